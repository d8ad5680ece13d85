//! `palpate-bridge emulate phantom`.
use super::{obey_lines, presses};
use crate::{
    BridgeError,
    emulate::phantom::{Calibration, Phantom, Settings},
};
use clap::Args;
use std::path::PathBuf;

/// What goes wrong when it is told to.
pub(super) const FAULTS: &[&str] =
    &["silence", "garbage", "slow", "cut", "warm", "strong", "impulse", "fast", "timer", "device"];
/// Those that are errors of libHD.
pub(super) const ERRORS: &[(&str, u32)] = &[
    ("warm", 0x0200),
    ("strong", 0x0201),
    ("impulse", 0x0202),
    ("fast", 0x0203),
    ("device", 0x0300),
    ("timer", 0x0304),
];

/// What it is like.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Where to listen; give it to the bridge as `name` of `[device]`, with the library of docs/arms/phantom.md as `library`
    #[arg(long, default_value = "/tmp/palpate-phantom", value_name = "PATH")]
    socket: PathBuf,
    /// Has motors for torque
    #[arg(long)]
    torque: bool,
    /// Wants to be put into its inkwell for a second first
    #[arg(long)]
    uncalibrated: bool,
}

impl Arguments {
    pub(super) fn run(self) -> Result<(), BridgeError> {
        let calibration = if self.uncalibrated { Calibration::Inkwell { frames: 1000 } } else { Calibration::Done };
        let settings = Settings { turns: self.torque, calibration, path: presses()?, ..Settings::default() };
        let emulated = Phantom::listen(&self.socket, settings).map_err(|error| BridgeError::Value {
            key: "--socket".into(),
            reason: format!("cannot listen at {}: {error}; give another place", self.socket.display()),
        })?;
        let place = format!("a PHANToM listens at {}", emulated.socket().display());
        obey_lines(&place, &emulated.faults, FAULTS);
        Ok(())
    }
}
