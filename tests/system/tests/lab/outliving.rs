//! An arm that outlives whoever drives it, and the configuration of a bridge for it.
use super::{arms, config};
use palpate_system_tests::{
    daemon::{Daemon, PATIENCE},
    programs::Program,
};
use std::{
    fs,
    path::PathBuf,
    time::{Duration, Instant},
};

/// The arm, and a file for `palpate-bridge --config`.
pub struct Lab {
    arm: arms::Emulated,
    config: PathBuf,
    _folder: tempfile::TempDir,
}

impl Lab {
    /// For a daemon at `url`.
    pub fn new(arm: arms::Emulated, url: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bridge.toml");
        let mut config = config(url, arm.device.clone());
        config.workspace = arms::workspace();
        fs::write(&path, toml::to_string(&config).unwrap()).unwrap();
        Self { arm, config: path, _folder: folder }
    }

    /// What the bridge is started with.
    pub fn arguments(&self) -> [&str; 2] {
        ["--config", self.config.to_str().unwrap()]
    }

    /// A bridge beside the arm.
    pub fn bridge(&self) -> Program {
        Program::start("palpate-bridge", &self.arguments())
    }

    /// The arm's force (N), whoever drives it.
    pub fn force_n(&self) -> f64 {
        self.arm.force_n().length()
    }

    /// Waits for a force (N).
    pub fn wait(&self, what: &str, condition: impl FnMut(f64) -> bool) {
        assert!(self.comes(condition), "never: {what}; {} N", self.force_n());
    }

    /// Likewise while `bridge` runs, whose words are told when it waited in vain.
    pub fn wait_beside(
        &self,
        (bridge, daemon): (&mut Program, &Daemon),
        what: &str,
        condition: impl FnMut(f64) -> bool,
    ) {
        if !self.comes(condition) {
            let (said, status) = (bridge.said(), daemon.status());
            panic!("never: {what}; {} N; the daemon:\n{status:#}\nthe bridge said:\n{said}", self.force_n());
        }
    }

    /// Waits until the force is zero for good, as far as a tenth of a second tells (a force that a controller shortens is zero for a tick, too); when it was not zero for the last time.
    pub fn wait_for_end(&self) -> Duration {
        const FOR_GOOD: Duration = Duration::from_millis(100);
        let (began, mut last) = (Instant::now(), Duration::ZERO);
        while began.elapsed() < last + FOR_GOOD {
            assert!(began.elapsed() < PATIENCE, "its force does not end: {} N", self.force_n());
            if self.force_n() != 0.0 {
                last = began.elapsed();
            }
            std::thread::sleep(Duration::from_micros(100));
        }
        last
    }

    /// Whether it comes to that within [`PATIENCE`].
    fn comes(&self, mut condition: impl FnMut(f64) -> bool) -> bool {
        let began = Instant::now();
        while !condition(self.force_n()) {
            if began.elapsed() > PATIENCE {
                return false;
            }
            std::thread::sleep(Duration::from_micros(100));
        }
        true
    }
}
