//! What the bridge and its drivers do, tested: in one program, which is linked once and runs as many tests at a time as there are processors.
#![allow(clippy::unwrap_used, clippy::expect_used)] // helpers outside #[test] functions
#[path = "common/law.rs"]
mod bench;
mod common;
#[path = "common/libhd.rs"]
mod libhd;

mod bridge;
mod falcon;
mod fuzz_corpus;
mod haply_2diy;
mod hapticmaster;
mod hapticmaster_commands;
mod hapticmaster_plane;
mod inverse3;
mod network_passivity;
mod phantom;
mod playback;
mod servo_law;
mod servo_plane;
mod servo_torque;
mod transports;
mod vrpn;
mod vrpn_server;
mod woodenhaptics;
