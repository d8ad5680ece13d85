//! `palpate-bridge emulate KIND`: an arm that is not there, for trying a configuration and for tests.
use super::{Faults, hapticmaster};
use crate::{BridgeError, config::SimulatedConfig};
use clap::{Args, Subcommand};
use glam::DVec3;
use palpate_control::{HandPath, Keyframe};
use std::{
    io::{BufRead as _, Write as _},
    process::ExitCode,
};

/// Kinds of arms.
#[derive(Debug, Subcommand)]
pub enum Emulate {
    /// A HapticMASTER over TCP; its hand presses the built-in ventricle every two seconds
    Hapticmaster(HapticMasterArguments),
}

/// What it is like.
#[derive(Debug, Args)]
pub struct HapticMasterArguments {
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

const FAULTS: &str = "silence, garbage, split, slow, refuse, stop, cut (each again: over), quit";

impl Emulate {
    /// Runs until its input ends or says `quit`.
    ///
    /// # Errors
    /// An address that is taken.
    pub fn run(self) -> Result<ExitCode, BridgeError> {
        let Self::Hapticmaster(arguments) = self;
        let arm = SimulatedConfig::default();
        let key = |key: &crate::config::KeyframeConfig| Keyframe {
            time_s: key.time_s,
            position_m: DVec3::from_array(key.position_m),
        };
        let path = HandPath::new(arm.keyframes.iter().map(key).collect(), arm.period_s)
            .map_err(|error| BridgeError::Value { key: "hand".into(), reason: error.to_string() })?;
        let mut settings = hapticmaster::Settings {
            apart: arguments.apart,
            headers: !arguments.old,
            quoted: arguments.old,
            path,
            ..Default::default()
        };
        settings.arm.hand_damping_n_s_per_m = 40.0;
        let emulated = hapticmaster::HapticMaster::listen(&arguments.listen, settings)
            .map_err(|source| BridgeError::System { what: "listen there", source })?;
        let mut out = std::io::stdout();
        // A reader that has gone misses what is said, no more.
        let _ = writeln!(out, "a HapticMASTER listens at {}; faults by line: {FAULTS}", emulated.address());
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            let faults = &emulated.faults;
            let flag = match line.trim() {
                "silence" => &faults.silence,
                "garbage" => &faults.garbage,
                "split" => &faults.split,
                "refuse" => &faults.refusal,
                "stop" => &faults.emergency_stop,
                "cut" => &faults.cut,
                "slow" => {
                    let slow = faults.slow_us.fetch_xor(SLOW_US, std::sync::atomic::Ordering::Relaxed) == 0;
                    let _ = writeln!(out, "slow: {}", if slow { "50 ms an answer" } else { "over" });
                    continue;
                }
                "quit" => break,
                "" => continue,
                other => {
                    let _ = writeln!(out, "\"{other}\" is none of {FAULTS}");
                    continue;
                }
            };
            let on = !Faults::is(flag);
            Faults::set(flag, on);
            let _ = writeln!(out, "{}: {}", line.trim(), if on { "on" } else { "over" });
        }
        Ok(ExitCode::SUCCESS)
    }
}

const SLOW_US: u32 = 50_000;
