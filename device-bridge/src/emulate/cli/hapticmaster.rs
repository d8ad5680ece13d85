//! `palpate-bridge emulate hapticmaster`.
use super::{obey_lines, presses};
use crate::{
    BridgeError,
    emulate::hapticmaster::{HapticMaster, Settings},
};
use clap::Args;

/// What goes wrong when it is told to.
pub(super) const FAULTS: &[&str] = &["silence", "garbage", "split", "slow", "refuse", "stop", "cut"];

/// What it is like.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Where to listen; give it to the bridge as `address` of `[device]`
    #[arg(long, default_value = "127.0.0.1:7654", value_name = "HOST:PORT")]
    listen: String,
    /// Answers without headers and with quotation marks, as older versions give them
    #[arg(long)]
    old: bool,
    /// Refuse `set` and `get` in one request
    #[arg(long)]
    apart: bool,
}

impl Arguments {
    pub(super) fn run(self) -> Result<(), BridgeError> {
        let mut settings = Settings {
            apart: self.apart,
            headers: !self.old,
            quoted: self.old,
            path: presses()?,
            ..Default::default()
        };
        settings.arm.hand_damping_n_s_per_m = 40.0;
        let emulated = HapticMaster::listen(&self.listen, settings)
            .map_err(|source| BridgeError::System { what: "listen there", source })?;
        let place = format!("a HapticMASTER listens at {}", emulated.address());
        obey_lines(&place, &emulated.faults, FAULTS);
        Ok(())
    }
}
