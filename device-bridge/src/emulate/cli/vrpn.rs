//! `palpate-bridge emulate vrpn`.
use super::{obey_lines, presses};
use crate::{
    BridgeError,
    emulate::vrpn::{Settings, Vrpn},
};
use clap::Args;

/// What goes wrong when it is told to.
pub(super) const FAULTS: &[&str] = &["silence", "garbage", "split", "slow", "refuse", "cut"];

/// What it is like.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Where to listen; give it to the bridge as `address` of `[device]`
    #[arg(long, default_value = "127.0.0.1:3883", value_name = "HOST:PORT")]
    listen: String,
    /// What its arm is called
    #[arg(long, default_value = "Phantom0", value_name = "NAME")]
    name: String,
    /// Tell no velocities
    #[arg(long)]
    poses_only: bool,
    /// Tell the force of the hand, not that of the motors
    #[arg(long)]
    measures: bool,
}

impl Arguments {
    pub(super) fn run(self) -> Result<(), BridgeError> {
        let settings = Settings {
            names: std::array::from_fn(|_| self.name.clone()),
            velocities: !self.poses_only,
            measures: self.measures,
            path: presses()?,
            ..Settings::default()
        };
        let emulated = Vrpn::listen(&self.listen, settings)
            .map_err(|source| BridgeError::System { what: "listen there", source })?;
        let place = format!("a VRPN server listens at {}, with an arm {}", emulated.address(), self.name);
        obey_lines(&place, &emulated.faults, FAULTS);
        Ok(())
    }
}
