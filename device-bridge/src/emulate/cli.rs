//! `palpate-bridge emulate KIND`: an arm that is not there, for trying a configuration and for tests.
use super::{Faults, hapticmaster, woodenhaptics};
use crate::{
    BridgeError,
    config::{KeyframeConfig, SimulatedConfig, WoodenHapticsConfig},
    settings::arm,
};
use clap::{Args, Subcommand};
use glam::DVec3;
use palpate_control::{ArmSpec, HandPath, Keyframe};
use std::{
    io::{BufRead as _, Write as _},
    path::{Path, PathBuf},
    process::ExitCode,
    sync::atomic::{AtomicBool, Ordering},
};

/// Kinds of arms.
#[derive(Debug, Subcommand)]
pub enum Emulate {
    /// A HapticMASTER over TCP; its hand presses the built-in ventricle every two seconds
    Hapticmaster(HapticMasterArguments),
    /// A WoodenHaptics on a pseudo terminal; its hand presses the built-in ventricle every two seconds
    Woodenhaptics(WoodenHapticsArguments),
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

/// What it is like.
#[derive(Debug, Args)]
pub struct WoodenHapticsArguments {
    /// A link to make to its port; give it to the bridge as `port` of `[device]`
    #[arg(long, default_value = "/tmp/palpate-woodenhaptics", value_name = "PATH")]
    link: PathBuf,
    /// Say a line for each that it hears, not one every millisecond
    #[arg(long)]
    answers: bool,
}

const HAPTICMASTER_FAULTS: &[&str] = &["silence", "garbage", "split", "slow", "refuse", "stop", "cut"];
const WOODENHAPTICS_FAULTS: &[&str] = &["silence", "garbage", "split", "slow", "cut"];
const SLOW_US: u32 = 50_000;

impl Emulate {
    /// Runs until its input ends or says `quit`.
    ///
    /// # Errors
    /// An address that is taken, or a link that cannot be made.
    pub fn run(self) -> Result<ExitCode, BridgeError> {
        match self {
            Self::Hapticmaster(arguments) => arguments.run(),
            Self::Woodenhaptics(arguments) => arguments.run(),
        }
        .map(|()| ExitCode::SUCCESS)
    }
}

impl HapticMasterArguments {
    fn run(self) -> Result<(), BridgeError> {
        let mut settings = hapticmaster::Settings {
            apart: self.apart,
            headers: !self.old,
            quoted: self.old,
            path: presses()?,
            ..Default::default()
        };
        settings.arm.hand_damping_n_s_per_m = 40.0;
        let emulated = hapticmaster::HapticMaster::listen(&self.listen, settings)
            .map_err(|source| BridgeError::System { what: "listen there", source })?;
        let place = format!("a HapticMASTER listens at {}", emulated.address());
        obey_lines(&place, &emulated.faults, HAPTICMASTER_FAULTS);
        Ok(())
    }
}

impl WoodenHapticsArguments {
    fn run(self) -> Result<(), BridgeError> {
        let constants = arm::woodenhaptics(&WoodenHapticsConfig::default())?;
        let (arm, path) = (ArmSpec::default(), presses()?);
        let settings = woodenhaptics::Settings { constants, answers: self.answers, arm, path };
        let emulated = woodenhaptics::WoodenHaptics::start(settings)
            .map_err(|source| BridgeError::System { what: "open a pseudo terminal", source })?;
        let _link = Link::new(emulated.port(), &self.link).map_err(|error| BridgeError::Value {
            key: "--link".into(),
            reason: format!("cannot make a link at {}: {error}; give another place", self.link.display()),
        })?;
        let place = format!("a WoodenHaptics is at {} ({})", self.link.display(), emulated.port());
        obey_lines(&place, &emulated.faults, WOODENHAPTICS_FAULTS);
        Ok(())
    }
}

/// A symbolic link as long as this lives.
struct Link<'a>(&'a Path);

impl<'a> Link<'a> {
    /// In the place of another link only.
    fn new(port: &str, at: &'a Path) -> std::io::Result<Self> {
        if at.is_symlink() {
            std::fs::remove_file(at)?;
        }
        std::os::unix::fs::symlink(port, at).map(|()| Self(at))
    }
}

impl Drop for Link<'_> {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(self.0);
    }
}

/// The path of the simulated arm's hand.
fn presses() -> Result<HandPath, BridgeError> {
    let arm = SimulatedConfig::default();
    let key = |key: &KeyframeConfig| Keyframe { time_s: key.time_s, position_m: DVec3::from_array(key.position_m) };
    HandPath::new(arm.keyframes.iter().map(key).collect(), arm.period_s)
        .map_err(|error| BridgeError::Value { key: "hand".into(), reason: error.to_string() })
}

/// Faults by their names, until the input ends or says `quit`.
fn obey_lines(place: &str, faults: &Faults, known: &[&str]) {
    let names = known.join(", ");
    let mut out = std::io::stdout();
    // A reader that has gone misses what is said, no more.
    let _ = writeln!(out, "{place}; faults by line: {names} (each again: over), quit");
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let name = line.trim();
        let said = match name {
            "quit" => return,
            "" => continue,
            name if !known.contains(&name) => format!("\"{name}\" is none of {names}, quit"),
            "slow" if faults.slow_us.fetch_xor(SLOW_US, Ordering::Relaxed) == 0 => "slow: 50 ms an answer".into(),
            "slow" => "slow: over".into(),
            name => match flag(faults, name) {
                Some(flag) => {
                    let on = !flag.fetch_not(Ordering::Relaxed);
                    format!("{name}: {}", if on { "on" } else { "over" })
                }
                None => continue,
            },
        };
        let _ = writeln!(out, "{said}");
    }
}

fn flag<'a>(faults: &'a Faults, name: &str) -> Option<&'a AtomicBool> {
    match name {
        "silence" => Some(&faults.silence),
        "garbage" => Some(&faults.garbage),
        "split" => Some(&faults.split),
        "refuse" => Some(&faults.refusal),
        "stop" => Some(&faults.emergency_stop),
        "cut" => Some(&faults.cut),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_that_is_named_can_be_caused() {
        let faults = Faults::default();
        for name in HAPTICMASTER_FAULTS.iter().chain(WOODENHAPTICS_FAULTS) {
            assert!(*name == "slow" || flag(&faults, name).is_some(), "{name}");
        }
    }

    #[test]
    fn a_link_takes_the_place_of_a_link_only_and_goes_with_its_arm() {
        let folder = tempfile::tempdir().unwrap();
        let (link, file) = (folder.path().join("link"), folder.path().join("file"));
        drop(std::fs::write(&file, "kept"));
        assert!(Link::new("/dev/null", &file).is_err());
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "kept");
        std::os::unix::fs::symlink("/nowhere", &link).unwrap();
        let made = Link::new("/dev/null", &link).unwrap();
        assert_eq!(std::fs::read_link(&link).unwrap(), Path::new("/dev/null"));
        drop(made);
        assert!(!link.is_symlink());
    }
}
