//! SIGKILL for bridge and daemon, at random times while an arm is pressed. `PALPATE_KILLS` says how often; how long the force lasted is printed, and not asserted: machines
//! that run tests are busy (docs/realtime.md tells what was measured).
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
mod lab;

use lab::{
    Random,
    arms::{self, Hand},
    outliving::Lab,
};
use palpate_system_tests::{
    daemon::{Daemon, PATIENCE},
    programs::Program,
};
use std::{
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
    std::env::var("PALPATE_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(3)
}

/// A hand that presses the ventricle's wall for a second and goes out for a moment, so that an arm that comes back finds its tool outside. It is killed while it presses: the force
/// ends because it is taken away, and not because the hand goes.
fn hand() -> Hand {
    Hand { keys: vec![(0.0, 0.050), (0.1, 0.050), (0.4, 0.028), (1.4, 0.028), (1.7, 0.050)], period_s: 1.7 }
}

/// Until it is pressed, by far the longest part of which is still to come, and then a moment that nobody knows.
fn wait_pressed(lab: &Lab, (bridge, daemon): (&mut Program, &Daemon), random: &mut Random) {
    lab.wait_beside((bridge, daemon), "it presses", |force_n| force_n > PRESSED_N);
    std::thread::sleep(Duration::from_micros(random.below(900_000)));
    lab.wait_beside((bridge, daemon), "it presses", |force_n| force_n > PRESSED_N);
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

fn bridges_are_killed(what: &str, arm: arms::Emulated) {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let daemon = Daemon::start(&["--arm", "none", &lab::light_ventricle(folder.path())]);
    let lab = Lab::new(arm, &daemon.url);
    let session = daemon.status()["session_id"].clone();
    let (mut random, mut tick, mut times) = (Random(1), 0, Vec::new());
    for _ in 0..kills() {
        let mut bridge = lab.bridge();
        wait_pressed(&lab, (&mut bridge, &daemon), &mut random);
        let killed = Instant::now();
        bridge.kill();
        let took = killed.elapsed();
        times.push(took + lab.wait_for_end());
        // The body goes on from where it was, and the tool waits for another arm.
        let status = daemon.wait_until("the device is gone", |s| s["devices"].as_array().is_some_and(Vec::is_empty));
        assert_eq!(status["session_id"], session);
        let now = status["tick"].as_u64().unwrap();
        assert!(now > tick && status["quarantine"] == "", "{status:#}");
        tick = now;
        assert!(lab.force_n() == 0.0);
    }
    told(what, times);
}

#[test]
fn a_killed_bridge_leaves_no_force_on_a_serial_arm() {
    bridges_are_killed("bridge of a WoodenHaptics", arms::woodenhaptics(&hand()));
}

#[test]
fn a_killed_bridge_leaves_no_force_on_a_hapticmaster() {
    bridges_are_killed("bridge of a HapticMASTER", arms::hapticmaster(&hand(), true));
}

#[test]
fn a_killed_daemon_leaves_no_force_and_the_next_one_is_found() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let scene = lab::light_ventricle(folder.path());
    let mut daemon = Daemon::start(&["--arm", "none", &scene]);
    let address = daemon.url.trim_start_matches("http://").to_owned();
    let lab = Lab::new(arms::woodenhaptics(&hand()), &daemon.url);
    let mut bridge = lab.bridge();
    let (mut random, mut times) = (Random(2), Vec::new());
    for _ in 0..kills() {
        wait_pressed(&lab, (&mut bridge, &daemon), &mut random);
        let killed = Instant::now();
        daemon.program.kill();
        let took = killed.elapsed();
        times.push(took + lab.wait_for_end());
        daemon = Daemon::at(&address, "palpated", &["serve", "--arm", "none", &scene]);
    }
    told("daemon", times);
    wait_pressed(&lab, (&mut bridge, &daemon), &mut random);
    bridge.terminate();
    assert!(bridge.wait(PATIENCE).success(), "{}", bridge.output);
    assert_eq!(lab.force_n(), 0.0);
}
