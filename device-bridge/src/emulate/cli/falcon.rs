//! `palpate-bridge emulate falcon`.
use super::{obey_lines_at, presses};
use crate::{
    BridgeError,
    config::FalconConfig,
    emulate::falcon::{Falcon, Settings},
    settings::arm,
};
use clap::Args;
use palpate_control::ArmSpec;
use std::{path::PathBuf, time::Duration};

/// What goes wrong when it is told to.
pub(super) const FAULTS: &[&str] = &["silence", "garbage", "split", "slow", "refuse", "cut"];

/// What it is like.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A link to make to its port; give it to the bridge as `port` of `[device]`
    #[arg(long, default_value = "/tmp/palpate-falcon", value_name = "PATH")]
    link: PathBuf,
    /// A file that has to be loaded before it runs; any will do
    #[arg(long, value_name = "PATH")]
    firmware: Option<PathBuf>,
    /// How long its hand takes to show it its home (s)
    #[arg(long, default_value_t = 0, value_name = "SECONDS")]
    homing_s: u64,
}

impl Arguments {
    pub(super) fn run(self) -> Result<(), BridgeError> {
        let firmware = self.firmware.map(|path| {
            std::fs::read(&path).map_err(|source| BridgeError::Read { what: "the firmware", path, source })
        });
        let settings = Settings {
            constants: arm::falcon::checked(&FalconConfig::default())?,
            firmware: firmware.transpose()?,
            homing: Duration::from_secs(self.homing_s),
            watchdog: Some(Duration::from_millis(500)),
            arm: ArmSpec::default(),
            path: presses()?,
        };
        let emulated =
            Falcon::start(settings).map_err(|source| BridgeError::System { what: "open a pseudo terminal", source })?;
        obey_lines_at("a Falcon", emulated.port(), &self.link, &emulated.faults, FAULTS)
    }
}
