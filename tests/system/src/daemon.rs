//! A daemon as a real process on a real socket, and the viewer's commands on it.
#![allow(clippy::unwrap_used, clippy::missing_panics_doc)] // a test that cannot start its subject has failed
use crate::programs::{self, Program};
use serde_json::Value;
use std::{
    process::{Command, Output},
    thread,
    time::{Duration, Instant},
};

/// Far longer than anything needs on an idle machine.
pub const PATIENCE: Duration = Duration::from_mins(1);

/// A running daemon.
pub struct Daemon {
    /// Its process.
    pub program: Program,
    /// Its address.
    pub url: String,
}

impl Daemon {
    /// On a free port.
    pub fn start(arguments: &[&str]) -> Self {
        Self::of("palpated", &[&["serve"], arguments].concat())
    }

    /// Another program of this workspace that is a daemon.
    pub fn of(program: &str, arguments: &[&str]) -> Self {
        Self::at("127.0.0.1:0", program, arguments)
    }

    /// On this address.
    pub fn at(address: &str, program: &str, arguments: &[&str]) -> Self {
        let mut program = Program::start(program, &[arguments, &["--listen", address]].concat());
        let line = program.wait_for("://127.0.0.1:", PATIENCE);
        let from = line.find("http").unwrap();
        let url = line[from..].split_whitespace().next().unwrap().trim_end_matches(['/', ',', ')']).to_owned();
        Self { program, url }
    }

    /// A viewer's command on it.
    pub fn view(&self, arguments: &[&str]) -> Output {
        view(&self.url, arguments)
    }

    /// Its status now.
    pub fn status(&self) -> Value {
        let output = self.view(&["status", "--json"]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// Asks for the status until it satisfies a condition.
    pub fn wait_until(&self, what: &str, condition: impl Fn(&Value) -> bool) -> Value {
        let end = Instant::now() + PATIENCE;
        loop {
            let status = self.status();
            if condition(&status) {
                return status;
            }
            assert!(Instant::now() < end, "never: {what}; last status:\n{status:#}");
            thread::sleep(Duration::from_millis(100));
        }
    }
}

/// A viewer's command on the daemon at an address.
pub fn view(url: &str, arguments: &[&str]) -> Output {
    Command::new(programs::path_of("palpate-view")).args(["--server", url]).args(arguments).output().unwrap()
}

/// Bytes as text.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
