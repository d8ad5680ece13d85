//! The WoodenHaptics' driver against its emulator, over real pseudo terminals: beneath a bridge, and alone.

use crate::common;
use crate::common::press::{self, PRESSED_N, lost_by, pressed, simulated, to_arm};
use glam::DVec3;
use palpate_bridge::{
    config::{DeviceConfig, WoodenHapticsConfig},
    device::{Arm as _, Effort, Fault, woodenhaptics as driver},
    emulate::{
        Faults,
        woodenhaptics::{Settings, WoodenHaptics},
    },
    settings::arm,
};
use palpate_control::{ArmSpec, HandPath, Keyframe};
use std::{
    sync::atomic::Ordering,
    time::{Duration, Instant},
};

/// Switched on elsewhere than at home, with a motor that turns the other way, and finer encoders than usual.
fn keys(port: &str) -> WoodenHapticsConfig {
    WoodenHapticsConfig {
        port: port.to_owned(),
        home_counts: [100, -2000, 30],
        reversed: [false, true, false],
        counts_per_turn: 8000.0,
        // Patient with a busy test machine.
        silence_s: 0.4,
        ..WoodenHapticsConfig::default()
    }
}

fn constants(config: &WoodenHapticsConfig) -> driver::Settings {
    arm::woodenhaptics::checked(config).unwrap()
}

fn emulator(answers: bool, path: HandPath) -> WoodenHaptics {
    let arm = ArmSpec::default();
    WoodenHaptics::start(Settings { constants: constants(&keys("")), answers, arm, path }).unwrap()
}

fn resting() -> HandPath {
    HandPath::resting_at(DVec3::new(0.01, 0.02, 0.03))
}

fn device(arm: &WoodenHaptics) -> DeviceConfig {
    DeviceConfig::Woodenhaptics(keys(arm.port()))
}

/// Of the length of a step of the encoders (0.03 mm at the tool) the wall makes 0.01 N.
const FLICKER_N: f64 = 0.03;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_ends_at_the_force_of_the_simulated_arm() {
    let expected_n = pressed(2e-4, simulated()).await.force_n;
    assert!((expected_n - PRESSED_N).abs() < 0.01, "{expected_n}");
    for answers in [false, true] {
        // The middle of the workspace is where the press is.
        let arm = WoodenHaptics::start(Settings {
            constants: constants(&shifted(keys(""))),
            answers,
            arm: ArmSpec::default(),
            path: press::path(),
        });
        let arm = arm.unwrap();
        let pressed = pressed(FLICKER_N, DeviceConfig::Woodenhaptics(shifted(keys(arm.port())))).await;
        let found_n = pressed.force_n;
        assert!((found_n / expected_n - 1.0).abs() < 0.02, "{found_n} N, {expected_n} N: {answers}");
        pressed.assert_peak_below(1.1, expected_n);
        common::until("the bridge took its force away when it ended", || arm.force_n() == DVec3::ZERO).await;
    }
}

/// Its workspace where the press of all arms is.
fn shifted(keys: WoodenHapticsConfig) -> WoodenHapticsConfig {
    let centre_m = DVec3::from_array(keys.centre_m) - to_arm(DVec3::ZERO);
    WoodenHapticsConfig { centre_m: centre_m.to_array(), ..keys }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_of_the_arm_takes_the_force_away_and_is_named() {
    type Cause = fn(&Faults);
    let causes: [(Cause, Fault); 4] = [
        (|faults| Faults::set(&faults.silence, true), Fault::Silent),
        (|faults| Faults::set(&faults.garbage, true), Fault::Garbled),
        (|faults| Faults::set(&faults.cut, true), Fault::Disconnected),
        (|faults| faults.slow_us.store(900_000, Ordering::Relaxed), Fault::Silent),
    ];
    for (cause, fault) in causes {
        let arm = emulator(false, resting());
        let found = lost_by(device(&arm), || arm.force_n(), || cause(&arm.faults)).await;
        assert_eq!(found, (fault, 0.0));
        common::until("the motors are off", || arm.force_n() == DVec3::ZERO).await;
    }
}

/// A bridge that is killed says nothing more: the board's own watchdog takes the force away.
#[test]
fn motors_are_off_half_a_second_after_the_last_line() {
    let emulated = emulator(false, resting());
    let mut arm = driver::WoodenHaptics::start(&constants(&keys(emulated.port())), 1e-3).unwrap();
    let began = Instant::now();
    let mut pushed = began;
    while emulated.force_n().z < 0.9 {
        assert!(began.elapsed() < Duration::from_secs(5), "{}", emulated.force_n());
        arm.read(1).unwrap();
        arm.apply(&Effort::force(DVec3::Z));
        pushed = Instant::now();
        std::thread::sleep(Duration::from_millis(1));
    }
    while emulated.force_n() != DVec3::ZERO {
        assert!(pushed.elapsed() < Duration::from_secs(5));
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(pushed.elapsed() > Duration::from_millis(490), "{:?}", pushed.elapsed());
}

#[test]
fn a_probe_says_where_the_arm_is() {
    let arm = emulator(true, resting());
    let report = common::probed(device(&arm), Duration::from_millis(400)).unwrap();
    // Half a step of each encoder.
    assert!(report.position_m.distance(DVec3::new(0.01, 0.02, 0.03)) < 2e-5, "{report}");
    assert!(report.measured_force_n.is_none() && report.poses_per_s > 50.0, "{report}");
    Faults::set(&arm.faults.cut, true);
    std::thread::sleep(Duration::from_millis(20));
    assert!(common::probed(device(&arm), Duration::from_millis(100)).is_err());
}

/// Lines split into bytes are put together; place and velocity follow the arm.
#[test]
fn poses_follow_the_arm_though_lines_come_in_pieces() {
    for (split, answers) in [(false, false), (true, false), (true, true)] {
        let keys_of = [(0.0, 0.0), (0.3, 0.03)].map(|(time_s, x)| Keyframe { time_s, position_m: DVec3::X * x });
        let emulated = emulator(answers, HandPath::new(keys_of.to_vec(), None).unwrap());
        Faults::set(&emulated.faults.split, split);
        let mut arm = driver::WoodenHaptics::start(&constants(&keys(emulated.port())), 1e-3).unwrap();
        let followed = press::followed(&mut arm, || emulated.position_m(), |_| ());
        let end = arm.read(0).unwrap();
        assert!(end.motion.position_m.distance(emulated.position_m()) < 1e-4, "{:?}", end.motion);
        assert!(emulated.position_m().x > 0.02 && emulated.lines() > 100);
        followed.assert_near(5e-3);
        followed.assert_way(end.motion.position_m, 3e-3);
        assert!(end.motion.velocity_m_per_s.length() < 5e-3, "{:?}", end.motion);
    }
}

#[test]
fn no_current_beyond_the_limit_is_asked_for_and_the_force_keeps_its_direction() {
    let emulated = emulator(false, resting());
    let mut arm = driver::WoodenHaptics::start(&constants(&keys(emulated.port())), 1e-3).unwrap();
    let weak = DVec3::new(0.3, -0.5, 1.0);
    press::bounded(&mut arm, || emulated.force_n(), weak, 20.0);
}

#[test]
fn an_arm_that_cannot_be_started_says_why() {
    let started = |port: &str| driver::WoodenHaptics::start(&constants(&keys(port)), 1e-3);
    let said = |port: &str| started(port).unwrap_err().to_string();
    assert!(said("/dev/nothing").starts_with("cannot open the serial port /dev/nothing"));
    let arm = emulator(false, resting());
    Faults::set(&arm.faults.silence, true);
    let silent = said(arm.port());
    assert!(silent.starts_with("no line came from /dev/pts/") && silent.contains("within 2 s"), "{silent}");
    Faults::set(&arm.faults.silence, false);
    Faults::set(&arm.faults.garbage, true);
    assert!(said(arm.port()).contains("is it this arm's port?"));
}
