//! `palpate-bridge emulate haply-2diy`.
use super::{obey_lines_at, presses};
use crate::{
    BridgeError,
    config::Haply2diyConfig,
    emulate::haply_2diy::{Haply2diy, Settings},
    settings::arm,
};
use clap::Args;
use palpate_control::ArmSpec;
use std::path::PathBuf;

/// What goes wrong when it is told to.
pub(super) const FAULTS: &[&str] = &["silence", "garbage", "split", "slow", "cut"];

/// What it is like.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A link to make to its port; give it to the bridge as `port` of `[device]`
    #[arg(long, default_value = "/tmp/palpate-haply-2diy", value_name = "PATH")]
    link: PathBuf,
}

impl Arguments {
    pub(super) fn run(self) -> Result<(), BridgeError> {
        let constants = arm::haply_2diy::checked(&Haply2diyConfig::default())?;
        let (arm, path) = (ArmSpec::default(), presses()?);
        let emulated = Haply2diy::start(Settings { constants, knows_home: true, watchdog: None, arm, path })
            .map_err(|source| BridgeError::System { what: "open a pseudo terminal", source })?;
        obey_lines_at("a Haply 2diy", emulated.port(), &self.link, &emulated.faults, FAULTS)
    }
}
