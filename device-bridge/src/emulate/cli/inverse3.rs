//! `palpate-bridge emulate inverse3`.
use super::{obey_lines, presses};
use crate::{
    BridgeError,
    device::inverse3::Dialect,
    emulate::inverse3::{Grip, Inverse3, Settings},
};
use clap::{Args, ValueEnum};

/// What goes wrong when it is told to.
pub(super) const FAULTS: &[&str] = &["silence", "garbage", "split", "slow", "cut"];

/// What it is like.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Where to listen; give it to the bridge as `url` of `[device]`, with `ws://` before it
    #[arg(long, default_value = "127.0.0.1:10001", value_name = "HOST:PORT")]
    listen: String,
    /// Obey forces told in this dialect only
    #[arg(long, value_name = "DIALECT")]
    dialect: Option<Told>,
    /// The grip that turns the tool
    #[arg(long, value_name = "GRIP", default_value = "wireless")]
    grip: Held,
    /// States come by themselves, not one for each command
    #[arg(long)]
    streams: bool,
    /// Other Inverse3 of the service, named before this one
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    others: usize,
    /// Say that it is not calibrated
    #[arg(long)]
    uncalibrated: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Told {
    Values,
    Vector,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Held {
    None,
    Wireless,
    Wired,
}

impl Arguments {
    pub(super) fn run(self) -> Result<(), BridgeError> {
        let settings = Settings {
            dialect: self.dialect.map(|told| match told {
                Told::Values => Dialect::Values,
                Told::Vector => Dialect::Vector,
            }),
            grip: match self.grip {
                Held::None => Grip::None,
                Held::Wireless => Grip::Wireless,
                Held::Wired => Grip::Wired,
            },
            streams: self.streams,
            others: self.others,
            uncalibrated: self.uncalibrated,
            path: presses()?,
            ..Settings::default()
        };
        let emulated = Inverse3::listen(&self.listen, settings)
            .map_err(|source| BridgeError::System { what: "listen there", source })?;
        let place = format!("an Inverse service listens at {}", emulated.url());
        obey_lines(&place, &emulated.faults, FAULTS);
        Ok(())
    }
}
