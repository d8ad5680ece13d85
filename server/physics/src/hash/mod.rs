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
