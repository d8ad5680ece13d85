//! What has to hold whatever bytes come: a function for each parser of the bridge, which panics where it does not, and says whether it was understood.
//!
//! The fuzzer calls them with bytes of its own making, and `device-bridge/tests/fuzz_corpus.rs` with those in `corpus` and with seeded spoilt ones, so that they
//! hold on stable Rust, too.
mod arms;
mod files;
mod vrpn;

pub use arms::{falcon, haply_2diy, hapticmaster, inverse3, phantom, woodenhaptics};
pub use files::{config, daemon, recording};
pub use vrpn::{vrpn_payload, vrpn_peer, vrpn_wire};

/// A body, by the name of its target and of its folder in `corpus`.
pub type Target = (&'static str, fn(&[u8]) -> bool);

/// All of them.
pub const ALL: [Target; 12] = [
    ("config", config),
    ("daemon", daemon),
    ("falcon", falcon),
    ("haply_2diy", haply_2diy),
    ("hapticmaster", hapticmaster),
    ("inverse3", inverse3),
    ("phantom", phantom),
    ("recording", recording),
    ("vrpn_payload", vrpn_payload),
    ("vrpn_peer", vrpn_peer),
    ("vrpn_wire", vrpn_wire),
    ("woodenhaptics", woodenhaptics),
];
