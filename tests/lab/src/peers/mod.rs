//! Other people's simulators in the same run (`--peers`), on the same meshes and loads, one thread each.
//!
//! A peer is a Python script in `tests/lab/peers` (its README tells how to add one) and a line in [`ALL`]. Peers cannot take turns
//! tick by tick with methods of this process; they take turns in blocks ([`crate::measure`]).
//!
//! - `environment.rs`: the Python environment they are installed in
//! - `exchange.rs`: what the lab tells a script, and what it answers
//! - `session.rs`: a script at work on a problem
mod environment;
mod exchange;
mod session;

pub use environment::Environment;
pub use exchange::{FORMAT, Settled, SettledRow, Task, Times};
pub use session::{Session, Variant};

use crate::{
    methods::Pace,
    problems::{Action, Problem},
};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// What a peer's method names begin with.
pub const PREFIX: &str = "peer: ";

/// A simulator that is measured beside ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Peer {
    /// Its name.
    pub name: &'static str,
    /// Its file in `tests/lab/peers`.
    pub script: &'static str,
    /// The Python package it needs, and its version.
    pub package: (&'static str, &'static str),
}

/// Every peer.
pub const ALL: [Peer; 2] = [
    Peer { name: "MuJoCo flex", script: "mujoco_flex.py", package: ("mujoco-core", "4.0.0") },
    Peer { name: "PositionBasedDynamics", script: "pypbd_xpbd.py", package: ("pypbd", "2.2.2") },
];

/// The peers of a run, and what is known of them.
#[derive(Debug, Default)]
pub struct Peers {
    python: PathBuf,
    ready: Vec<Peer>,
    /// For the reader: of each peer its version or why it is skipped, of each variant its law and settings.
    pub notes: BTreeMap<String, String>,
}

impl Peers {
    /// Installs what is missing in `environment` (a cache folder of the user's, if `None`); a peer that cannot be had is skipped with a
    /// note.
    pub fn install(environment: Option<&Path>) -> Self {
        let mut peers = Self::default();
        let folder = environment.map_or_else(environment::default_folder, Path::to_path_buf);
        // Scripts are started elsewhere.
        let folder = std::path::absolute(&folder).unwrap_or(folder);
        let made = Environment::make("python3", &folder);
        for peer in ALL {
            let installed = made.as_ref().map_err(Clone::clone).and_then(|made| made.install(peer.package));
            let (name, version) = peer.package;
            let note = match installed {
                Ok(()) => {
                    peers.ready.push(peer);
                    format!("{name} {version}, one thread")
                }
                Err(why) => format!("skipped: {why}"),
            };
            peers.notes.insert(format!("{PREFIX}{}", peer.name), note);
        }
        if let Ok(made) = made {
            peers.python = made.python;
        }
        peers
    }

    /// Whether peers can be given this problem: dead forces on nodes are the same for all, contact is not; and they are judged at rest.
    pub fn take(problem: &Problem) -> bool {
        matches!(problem.action, Action::Patch { .. }) && problem.motion.ticks().is_none()
    }

    /// Starts every peer on a problem at every resolution of the quick run, one after the other, and lets it come to rest.
    pub fn start(
        &mut self,
        problem: &Problem,
        pace: &Pace,
        budget_s: f64,
        tell: &mut dyn FnMut(&str, u32),
    ) -> Vec<Session> {
        if !Self::take(problem) {
            return vec![];
        }
        let mut sessions = Vec::new();
        for peer in &self.ready {
            for &resolution in problem.body.resolutions(false) {
                tell(peer.name, resolution);
                let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers").join(peer.script);
                let started = Task::new(problem, resolution, pace, budget_s)
                    .and_then(|task| Session::start(&self.python, &script, &task, resolution));
                match started {
                    Ok(session) => {
                        self.notes.extend(session.settings());
                        sessions.push(session);
                    }
                    Err(error) => {
                        let at = format!("{PREFIX}{} on {} at {resolution}", peer.name, problem.name);
                        self.notes.insert(at, format!("skipped: {error}"));
                    }
                }
            }
        }
        sessions
    }
}
