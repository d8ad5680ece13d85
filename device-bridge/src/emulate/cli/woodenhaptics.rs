//! `palpate-bridge emulate woodenhaptics`.
use super::{obey_lines_at, presses};
use crate::{
    BridgeError,
    config::WoodenHapticsConfig,
    emulate::woodenhaptics::{Settings, WoodenHaptics},
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
    #[arg(long, default_value = "/tmp/palpate-woodenhaptics", value_name = "PATH")]
    link: PathBuf,
    /// Say a line for each that it hears, not one every millisecond
    #[arg(long)]
    answers: bool,
}

impl Arguments {
    pub(super) fn run(self) -> Result<(), BridgeError> {
        let constants = arm::woodenhaptics::checked(&WoodenHapticsConfig::default())?;
        let (arm, path) = (ArmSpec::default(), presses()?);
        let settings = Settings { constants, answers: self.answers, arm, path };
        let emulated = WoodenHaptics::start(settings)
            .map_err(|source| BridgeError::System { what: "open a pseudo terminal", source })?;
        obey_lines_at("a WoodenHaptics", emulated.port(), &self.link, &emulated.faults, FAULTS)
    }
}
