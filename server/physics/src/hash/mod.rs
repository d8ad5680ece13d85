//! FNV-1a, 64 bits: the same on every machine.
mod chain;

pub use chain::Chain;

use std::fmt::Write;

/// The hash of no bytes.
pub(crate) const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;

/// Returns the hash `start` continued by more bytes.
pub(crate) fn fnv(start: u64, bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(start, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// A hash of the text that is written into it.
pub(crate) struct Fnv(pub(crate) u64);

impl Write for Fnv {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.0 = fnv(self.0, text.bytes());
        Ok(())
    }
}

/// Writes what `Debug` prints into a hash, each renamed field under its first name, so that snapshots taken before stay
/// good. A field's name is a piece of text by itself.
pub(crate) struct FirstNames<'a>(pub(crate) &'a mut Fnv);

/// A field's name and the one that it had at first.
const FIRST_NAMES: [(&str, &str); 5] = [
    ("anchor_n_per_m", "home_n_per_m"),
    ("anchor_ratio", "home_ratio"),
    ("blend_s", "fade_s"),
    ("interface_force", "border_force"),
    ("interface_stiffness_ratio", "border_stiffness_ratio"),
];

impl Write for FirstNames<'_> {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        let renamed = FIRST_NAMES.iter().find(|(name, _)| *name == text);
        self.0.write_str(renamed.map_or(text, |(_, first)| first))
    }
}
