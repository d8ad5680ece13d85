//! SIGKILL for bridge and daemon, at random times while an arm is pressed. `PALPATE_KILLS` says how often; how long the force lasted is printed, and not asserted: machines
//! that run tests are busy (docs/realtime.md tells what was measured).
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
use glam::DVec3;
use palpate_bridge::{
    config::{HapticMasterConfig, WoodenHapticsConfig},
    emulate::{hapticmaster, woodenhaptics},
    settings::arm,
};
use palpate_control::{ArmSpec, HandPath, Keyframe};
use palpate_system_tests::{
    daemon::{Daemon, PATIENCE},
    programs::Program,
};
use std::{
    fs,
    path::PathBuf,
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

/// Felt: what it was killed with.
const PRESSED_N: f64 = 0.1;

/// One lab at a time: each has a daemon, a bridge and an arm of its own that want to keep time.
static ALONE: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn kills() -> usize {
    std::env::var("PALPATE_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(6)
}

/// A linear congruential generator (Knuth's MMIX constants); its high bits.
struct Random(u64);

impl Random {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }
}

/// A hand that goes in and out of the ventricle's wall, twice a second.
fn hand() -> HandPath {
    let key = |(time_s, x_m)| Keyframe { time_s, position_m: DVec3::X * x_m };
    HandPath::new([(0.0, 0.045), (0.2, 0.028), (0.3, 0.028)].map(key).to_vec(), Some(0.5)).unwrap()
}

/// An arm that outlives whoever drives it.
enum Arm {
    WoodenHaptics(woodenhaptics::WoodenHaptics),
    HapticMaster(hapticmaster::HapticMaster),
}

impl Arm {
    fn woodenhaptics() -> Self {
        let constants = arm::woodenhaptics::checked(&keys(String::new())).unwrap();
        let (arm, path) = (ArmSpec::default(), hand());
        Self::WoodenHaptics(
            woodenhaptics::WoodenHaptics::start(woodenhaptics::Settings { constants, answers: false, arm, path })
                .unwrap(),
        )
    }

    fn hapticmaster() -> Self {
        let mut settings = hapticmaster::Settings { path: hand(), ..Default::default() };
        settings.arm.hand_damping_n_s_per_m = 40.0;
        Self::HapticMaster(hapticmaster::HapticMaster::listen("127.0.0.1:0", settings).unwrap())
    }

    fn force_n(&self) -> f64 {
        match self {
            Self::WoodenHaptics(arm) => arm.force_n().length(),
            Self::HapticMaster(arm) => arm.effect_n().length(),
        }
    }

    /// `[device]`, and where it is in the world.
    fn device(&self) -> String {
        match self {
            Self::WoodenHaptics(arm) => {
                let keys = keys(arm.port().to_owned());
                format!(
                    "[device]\nkind = \"woodenhaptics\"\nport = \"{}\"\ncentre_m = {:?}\nsilence_s = 0.2\n",
                    keys.port, keys.centre_m
                )
            }
            Self::HapticMaster(arm) => {
                let inertia_kg = HapticMasterConfig::default().inertia_kg;
                let address = arm.address();
                format!(
                    "[device]\nkind = \"hapticmaster\"\naddress = \"{address}\"\ninertia_kg = {inertia_kg}\nsilence_s = 0.2\n"
                )
            }
        }
    }

    fn wait(&self, what: &str, mut condition: impl FnMut(f64) -> bool) -> Duration {
        let began = Instant::now();
        while !condition(self.force_n()) {
            assert!(began.elapsed() < PATIENCE, "never: {what}; {} N", self.force_n());
            std::thread::sleep(Duration::from_micros(100));
        }
        began.elapsed()
    }
}

/// Where the ventricle is, is the middle of its workspace.
fn keys(port: String) -> WoodenHapticsConfig {
    WoodenHapticsConfig { port, centre_m: [0.22, 0.0, 0.08], ..WoodenHapticsConfig::default() }
}

struct Lab {
    arm: Arm,
    config: PathBuf,
    _folder: tempfile::TempDir,
}

impl Lab {
    fn new(arm: Arm, url: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let config = folder.path().join("bridge.toml");
        let text = format!(
            "[server]\nurl = \"{url}\"\nfirst_pause_s = 0.02\nlongest_pause_s = 0.1\n[servo]\nauto_recover = true\nleast_success_rate = 0.0\n{}",
            arm.device()
        );
        fs::write(&config, text).unwrap();
        Self { arm, config, _folder: folder }
    }

    fn bridge(&self) -> Program {
        Program::start("palpate-bridge", &["--config", self.config.to_str().unwrap()])
    }

    fn wait_pressed(&self, random: &mut Random) {
        self.arm.wait("it presses", |n| n > PRESSED_N);
        std::thread::sleep(Duration::from_micros(random.below(60_000)));
        self.arm.wait("it presses", |n| n > PRESSED_N);
    }
}

fn told(what: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    let (median, longest) = (times[times.len() / 2], times[times.len() - 1]);
    let within = times.iter().filter(|time| **time <= Duration::from_millis(20)).count();
    println!(
        "{what}: {} kills, without force after {median:?} (median), {longest:?} (longest), {within} within 20 ms",
        times.len()
    );
}

fn bridges_are_killed(what: &str, arm: Arm) {
    let _alone = alone();
    let daemon = Daemon::start(&["--arm", "none"]);
    let lab = Lab::new(arm, &daemon.url);
    let session = daemon.status()["session_id"].clone();
    let (mut random, mut tick, mut times) = (Random(1), 0, Vec::new());
    for _ in 0..kills() {
        let mut bridge = lab.bridge();
        lab.wait_pressed(&mut random);
        let killed = Instant::now();
        bridge.kill();
        lab.arm.wait("its force ends", |n| n == 0.0);
        times.push(killed.elapsed());
        // The body goes on from where it was, and the tool waits for another arm.
        let status = daemon.wait_until("the device is gone", |s| s["devices"].as_array().is_some_and(Vec::is_empty));
        assert_eq!(status["session_id"], session);
        let now = status["tick"].as_u64().unwrap();
        assert!(now > tick && status["quarantine"] == "", "{status:#}");
        tick = now;
        assert!(lab.arm.force_n() == 0.0);
    }
    told(what, times);
}

#[test]
fn a_killed_bridge_leaves_no_force_on_a_serial_arm() {
    bridges_are_killed("bridge of a WoodenHaptics", Arm::woodenhaptics());
}

#[test]
fn a_killed_bridge_leaves_no_force_on_a_hapticmaster() {
    bridges_are_killed("bridge of a HapticMASTER", Arm::hapticmaster());
}

#[test]
fn a_killed_daemon_leaves_no_force_and_the_next_one_is_found() {
    let _alone = alone();
    let mut daemon = Daemon::start(&["--arm", "none"]);
    let address = daemon.url.trim_start_matches("http://").to_owned();
    let lab = Lab::new(Arm::woodenhaptics(), &daemon.url);
    let mut bridge = lab.bridge();
    let (mut random, mut times) = (Random(2), Vec::new());
    for _ in 0..kills() {
        lab.wait_pressed(&mut random);
        let killed = Instant::now();
        daemon.program.kill();
        lab.arm.wait("its force ends", |n| n == 0.0);
        times.push(killed.elapsed());
        daemon = Daemon::at(&address, "palpated", &["serve", "--arm", "none"]);
    }
    told("daemon", times);
    lab.wait_pressed(&mut random);
    bridge.terminate();
    assert!(bridge.wait(PATIENCE).success(), "{}", bridge.output);
    assert_eq!(lab.arm.force_n(), 0.0);
}
