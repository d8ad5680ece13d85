//! `palpate-bridge emulate KIND`: an arm that is not there, for trying a configuration and for tests.
mod falcon;
mod haply_2diy;
mod hapticmaster;
mod inverse3;
mod phantom;
mod vrpn;
mod woodenhaptics;

use super::Faults;
use crate::{
    BridgeError,
    config::{KeyframeConfig, SimulatedConfig},
};
use clap::Subcommand;
use glam::DVec3;
use palpate_control::{HandPath, Keyframe};
use std::{
    io::{BufRead as _, Write as _},
    path::Path,
    process::ExitCode,
    sync::atomic::{AtomicBool, Ordering},
};

/// Kinds of arms.
#[derive(Debug, Subcommand)]
pub enum Emulate {
    /// A HapticMASTER over TCP; its hand presses the built-in heart every two seconds
    Hapticmaster(hapticmaster::Arguments),
    /// A WoodenHaptics on a pseudo terminal; its hand presses the built-in heart every two seconds
    Woodenhaptics(woodenhaptics::Arguments),
    /// A PHANToM for the library in libHD's place (docs/arms/phantom.md); its hand presses the built-in heart every two seconds
    Phantom(phantom::Arguments),
    /// A Haply Inverse3 and its service, over a WebSocket; its hand presses the built-in heart every two seconds
    Inverse3(inverse3::Arguments),
    /// A Haply 2diy on a pseudo terminal; its hand presses the built-in heart every two seconds
    #[command(name = "haply-2diy")]
    Haply2diy(haply_2diy::Arguments),
    /// A Novint Falcon on a pseudo terminal; its hand presses the built-in heart every two seconds
    Falcon(falcon::Arguments),
    /// A VRPN server with an arm; its hand presses the built-in heart every two seconds
    Vrpn(vrpn::Arguments),
}

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
            Self::Phantom(arguments) => arguments.run(),
            Self::Inverse3(arguments) => arguments.run(),
            Self::Haply2diy(arguments) => arguments.run(),
            Self::Falcon(arguments) => arguments.run(),
            Self::Vrpn(arguments) => arguments.run(),
        }
        .map(|()| ExitCode::SUCCESS)
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

/// An arm on a serial line, with a link to its port: faults by their names, until the input ends or says `quit`.
fn obey_lines_at(what: &str, port: &str, link: &Path, faults: &Faults, known: &[&str]) -> Result<(), BridgeError> {
    let _link = Link::new(port, link).map_err(|error| BridgeError::Value {
        key: "--link".into(),
        reason: format!("cannot make a link at {}: {error}; give another place", link.display()),
    })?;
    obey_lines(&format!("{what} is at {} ({port})", link.display()), faults, known);
    Ok(())
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
                None => match error_code(name) {
                    Some(code) => {
                        let was = faults.error_code.swap(code, Ordering::Relaxed);
                        if was == code {
                            faults.error_code.store(0, Ordering::Relaxed);
                        }
                        format!("{name}: {}", if was == code { "over" } else { "on" })
                    }
                    None => continue,
                },
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

/// Errors of libHD.
fn error_code(name: &str) -> Option<u32> {
    phantom::ERRORS.iter().find(|(known, _)| *known == name).map(|(_, code)| *code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_that_is_named_can_be_caused() {
        let faults = Faults::default();
        let of_each = [
            hapticmaster::FAULTS,
            woodenhaptics::FAULTS,
            phantom::FAULTS,
            inverse3::FAULTS,
            haply_2diy::FAULTS,
            falcon::FAULTS,
            vrpn::FAULTS,
        ];
        for name in of_each.concat() {
            assert!(name == "slow" || flag(&faults, name).is_some() || error_code(name).is_some(), "{name}");
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
