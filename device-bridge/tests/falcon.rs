//! The Falcon's driver against its emulator, over real pseudo terminals: beneath a bridge, and alone.

use crate::common;
use crate::common::press::{self, PRESS, elsewhere, lost_in, pressed, pressed_in, simulated};
use glam::DVec3;
use palpate_bridge::{
    config::{DeviceConfig, FalconConfig, WorkspaceConfig},
    device::{
        Arm as _, Effort, Fault,
        falcon::{self as driver, kinematics, wire},
    },
    emulate::{
        Faults,
        falcon::{Falcon, Settings},
    },
    settings::arm,
};
use palpate_control::{ArmSpec, HandPath, Keyframe};
use std::{
    sync::atomic::Ordering,
    time::{Duration, Instant},
};
use tokio_util::sync::CancellationToken;

const AT_M: DVec3 = DVec3::new(0.01, 0.02, 0.03);

/// Other constants than usual, where public sources do not agree.
fn keys(port: &str) -> FalconConfig {
    FalconConfig {
        port: port.to_owned(),
        zero_deg: 40.0,
        torque_units_per_nm: 6600.0,
        reversed: false,
        // Patient with a busy test machine.
        silence_s: 0.4,
        homing_s: 20.0,
        ..FalconConfig::default()
    }
}

fn constants(config: &FalconConfig) -> driver::Settings {
    arm::falcon::checked(config).unwrap()
}

fn settings(path: HandPath) -> Settings {
    Settings {
        constants: constants(&keys("")),
        firmware: None,
        homing: Duration::ZERO,
        watchdog: Some(Duration::from_millis(500)),
        arm: ArmSpec::default(),
        path,
    }
}

fn emulator(path: HandPath) -> Falcon {
    Falcon::start(settings(path)).unwrap()
}

fn resting() -> HandPath {
    HandPath::resting_at(AT_M)
}

fn open(config: &FalconConfig) -> Result<driver::Falcon, driver::start::StartError> {
    driver::Falcon::open(&constants(config), 1e-3, &CancellationToken::new())
}

fn started(arm: &Falcon) -> driver::Falcon {
    open(&keys(arm.port())).unwrap()
}

fn device(arm: &Falcon) -> DeviceConfig {
    DeviceConfig::Falcon(keys(arm.port()))
}

/// The world's origin is the middle of its workspace.
fn here() -> WorkspaceConfig {
    WorkspaceConfig { origin_m: [0.0; 3], ..elsewhere() }
}

/// Of the length of a step of the encoders (0.04 mm at the grip) the wall makes 0.015 N.
const FLICKER_N: f64 = 0.04;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_ends_at_the_force_of_the_simulated_arm() {
    let expected_n = pressed(2e-4, simulated()).await.force_n;
    let key = |(time_s, z)| Keyframe { time_s, position_m: DVec3::Z * z };
    let path = HandPath::new(PRESS.map(key).to_vec(), None).unwrap();
    for keys in [keys, |port: &str| FalconConfig { port: port.into(), silence_s: 0.4, ..FalconConfig::default() }] {
        let constants = constants(&keys(""));
        let arm = Falcon::start(Settings { constants, ..settings(path.clone()) }).unwrap();
        let pressed = pressed_in(FLICKER_N, here(), DeviceConfig::Falcon(keys(arm.port()))).await;
        let found_n = pressed.force_n;
        assert!((found_n / expected_n - 1.0).abs() < 0.02, "{found_n} N, {expected_n} N");
        pressed.assert_peak_below(1.1, expected_n);
        common::until("the bridge took its force away when it ended", || arm.force_n() == DVec3::ZERO).await;
        common::until("its light says so", || arm.lights() == wire::BLUE).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_of_the_arm_takes_the_force_away_and_is_named() {
    type Cause = fn(&Falcon);
    let causes: [(Cause, Fault); 5] = [
        (|arm| Faults::set(&arm.faults.silence, true), Fault::Silent),
        (|arm| Faults::set(&arm.faults.garbage, true), Fault::Garbled),
        (|arm| Faults::set(&arm.faults.cut, true), Fault::Disconnected),
        (|arm| arm.faults.slow_us.store(900_000, Ordering::Relaxed), Fault::Silent),
        (Falcon::lose_home, Fault::Unhomed),
    ];
    for (cause, fault) in causes {
        // Slow enough that a reply without a home is seen.
        let homing = Duration::from_millis(300);
        let arm = Falcon::start(Settings { homing, ..settings(resting()) }).unwrap();
        let found = lost_in(here(), device(&arm), || arm.force_n(), || cause(&arm)).await;
        assert_eq!(found, (fault, 0.0));
        common::until("the motors are off", || arm.force_n() == DVec3::ZERO).await;
    }
}

/// A bridge that is killed says nothing more. An arm with a watchdog lets go, and one without does not: which of them a real one is no public source says.
#[test]
fn motors_are_off_after_the_last_frame_if_the_firmware_sees_to_it() {
    for watchdog in [Some(Duration::from_millis(500)), None] {
        let emulated = Falcon::start(Settings { watchdog, ..settings(resting()) }).unwrap();
        let mut arm = started(&emulated);
        let began = Instant::now();
        while emulated.force_n().z < 0.9 {
            assert!(began.elapsed() < Duration::from_secs(5), "{}", emulated.force_n());
            press::hold(&mut arm, DVec3::Z);
        }
        std::thread::sleep(Duration::from_millis(1500));
        assert_eq!(emulated.force_n() == DVec3::ZERO, watchdog.is_some());
    }
}

#[test]
fn a_probe_says_where_the_arm_is_and_what_is_pressed() {
    let arm = emulator(resting());
    arm.press(0b0101);
    let report = common::probed(device(&arm), Duration::from_millis(400)).unwrap();
    // Half a step of each encoder.
    assert!(report.position_m.distance(AT_M) < 5e-5, "{report}");
    assert!(report.measured_force_n.is_none() && report.poses_per_s > 50.0, "{report}");
    assert_eq!(report.buttons, 0b0101);
    Faults::set(&arm.faults.cut, true);
    std::thread::sleep(Duration::from_millis(20));
    assert!(common::probed(device(&arm), Duration::from_millis(100)).is_err());
}

/// Frames split into bytes are put together; place and velocity follow the arm.
#[test]
fn poses_follow_the_arm_though_frames_come_in_pieces() {
    for split in [false, true] {
        let keys_of = [(0.0, 0.0), (0.6, 0.03)].map(|(time_s, x)| Keyframe { time_s, position_m: DVec3::X * x });
        let emulated = emulator(HandPath::new(keys_of.to_vec(), None).unwrap());
        Faults::set(&emulated.faults.split, split);
        let mut arm = started(&emulated);
        let began_m = arm.read(0).unwrap().motion.position_m;
        let followed = press::followed(&mut arm, || emulated.position_m(), |_| ());
        let end = arm.read(0).unwrap();
        assert!(end.motion.position_m.distance(emulated.position_m()) < 1e-4, "{:?}", end.motion);
        assert!(emulated.position_m().x > 0.02 && emulated.frames() > 100);
        followed.assert_near(1e-2);
        followed.assert_way(end.motion.position_m - began_m, 6e-3);
        assert!(end.motion.velocity_m_per_s.length() < 5e-3, "{:?}", end.motion);
        assert!(end.age_s < 0.1);
    }
}

#[test]
fn no_torque_beyond_the_limit_is_asked_for_and_the_force_keeps_its_direction() {
    let emulated = emulator(resting());
    // Not so much that the arm flies off while it is looked at.
    let mut arm = open(&FalconConfig { max_torque_units: 600, ..keys(emulated.port()) }).unwrap();
    let weak = DVec3::new(0.3, -0.5, 1.0);
    press::bounded(&mut arm, || emulated.force_n(), weak, 3.0);
}

/// With the usual constants and in the middle; docs/arms/falcon.md says so.
#[test]
fn the_largest_force_is_that_of_a_falcon() {
    let settings = constants(&FalconConfig::default());
    let slope_rad_per_m = kinematics::legs(kinematics::MIDDLE_M).unwrap().slope_rad_per_m;
    for (axis, expected_n) in [(DVec3::X, 8.24), (DVec3::Y, 8.08), (DVec3::Z, 20.11)] {
        // τ = Jᵀ F
        let torques_nm = slope_rad_per_m.inverse().transpose() * axis;
        let most_n =
            f64::from(settings.max_torque_units) / settings.torque_units_per_nm / torques_nm.abs().max_element();
        assert!((most_n - expected_n).abs() < 0.05, "{axis} {most_n}");
    }
}

/// A file of five pieces and a bit, taken whole; then the firmware runs, and the next start finds it so.
#[test]
fn firmware_is_loaded_where_none_runs_and_only_there() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("firmware.bin");
    let firmware: Vec<u8> = (0..333_u32).map(|i| (i * 7 + 3) as u8).collect();
    std::fs::write(&file, &firmware).unwrap();
    let emulated = Falcon::start(Settings { firmware: Some(firmware), ..settings(resting()) }).unwrap();
    let with_file = |file: &std::path::Path| FalconConfig { firmware: Some(file.into()), ..keys(emulated.port()) };
    let said = |keys: &FalconConfig| open(keys).unwrap_err().to_string();
    let without = said(&keys(emulated.port()));
    assert!(without.contains("no firmware answers") && without.contains("`firmware` of [device]"), "{without}");
    assert!(said(&with_file(&folder.path().join("none.bin"))).starts_with("cannot read the firmware "));
    Faults::set(&emulated.faults.refusal, true);
    let changed = said(&with_file(&file));
    assert!(changed.contains("from byte 0 on"), "{changed}");
    Faults::set(&emulated.faults.refusal, false);
    let other = folder.path().join("other.bin");
    std::fs::write(&other, [1, 2, 3]).unwrap();
    let dead = said(&with_file(&other));
    assert!(dead.contains("was loaded, and does not answer"), "{dead}");
    std::fs::write(&other, []).unwrap();
    assert!(said(&with_file(&other)).contains("is no firmware of a Falcon: it has 0 bytes"));
    let mut arm = open(&with_file(&file)).unwrap();
    assert!(arm.read(0).unwrap().motion.position_m.distance(AT_M) < 5e-5);
    drop(arm);
    // Its file is not needed any more.
    drop(started(&emulated));
}

#[test]
fn the_driver_waits_until_the_arm_knows_its_home() {
    let homing = Duration::from_millis(600);
    let emulated = Falcon::start(Settings { homing, ..settings(resting()) }).unwrap();
    let began = Instant::now();
    let error = open(&FalconConfig { homing_s: 0.1, ..keys(emulated.port()) }).unwrap_err().to_string();
    assert!(error.contains("not shown its home within 0.1 s") && error.contains("all the way out"), "{error}");
    common::wait("its light asks for its home", || emulated.lights() == wire::RED);
    let mut arm = started(&emulated);
    assert!(began.elapsed() > homing);
    assert!(arm.read(0).unwrap().motion.position_m.distance(AT_M) < 5e-5);
    press::hold(&mut arm, DVec3::ZERO);
    assert_eq!(emulated.lights(), wire::GREEN);
}

#[test]
fn a_start_that_waits_can_be_stopped() {
    let emulated = Falcon::start(Settings { homing: Duration::from_mins(1), ..settings(resting()) }).unwrap();
    let stop = CancellationToken::new();
    let token = stop.clone();
    let settings = constants(&keys(emulated.port()));
    let start = std::thread::spawn(move || driver::Falcon::open(&settings, 1e-3, &token).map(|_| ()));
    common::wait("it is asked for its home", || emulated.frames() > 10);
    stop.cancel();
    let began = Instant::now();
    assert_eq!(start.join().unwrap().unwrap_err().to_string(), "its start was stopped");
    assert!(began.elapsed() < Duration::from_secs(5));
}

#[test]
fn an_arm_that_cannot_be_started_says_why() {
    let said = |port: &str| open(&keys(port)).unwrap_err().to_string();
    assert!(said("/dev/nothing").starts_with("cannot open the serial port /dev/nothing"));
    let arm = emulator(resting());
    Faults::set(&arm.faults.silence, true);
    assert!(said(arm.port()).starts_with("no firmware answers at /dev/pts/"));
    Faults::set(&arm.faults.silence, false);
    Faults::set(&arm.faults.garbage, true);
    assert!(said(arm.port()).starts_with("no firmware answers at /dev/pts/"));
    Faults::set(&arm.faults.garbage, false);
    // Counts from another zero.
    let far = FalconConfig { zero_deg: 170.0, ..keys(arm.port()) };
    assert!(open(&far).unwrap_err().to_string().contains("which no Falcon has"));
}

/// Near a stop the encoders may say what no Falcon has: no force, and the last pose; for long it is a fault.
#[test]
fn where_no_falcon_can_be_there_is_no_force_and_after_a_while_no_arm() {
    // The hand pulls farther than the driver's constants allow.
    let keys_of = [(0.0, 0.0), (0.3, 0.048)].map(|(time_s, z)| Keyframe { time_s, position_m: DVec3::Z * z });
    let emulated = emulator(HandPath::new(keys_of.to_vec(), None).unwrap());
    let mut arm = open(&FalconConfig { zero_deg: 80.0, ..keys(emulated.port()) }).unwrap();
    let (began, mut last, mut unforced) = (Instant::now(), None, 0);
    let fault = loop {
        assert!(began.elapsed() < Duration::from_secs(20));
        match arm.read(1) {
            Ok(reading) if reading.age_s > 0.2 => {
                assert_eq!(reading.motion.velocity_m_per_s, DVec3::ZERO);
                assert_eq!(*last.get_or_insert(reading.motion.position_m), reading.motion.position_m);
                unforced += u32::from(emulated.force_n() == DVec3::ZERO);
            }
            Ok(_) => {}
            Err(fault) => break fault,
        }
        arm.apply(&Effort::force(0.2 * DVec3::Z));
        std::thread::sleep(Duration::from_millis(1));
    };
    assert_eq!(fault, Fault::Garbled);
    assert!(unforced > 10, "{unforced}");
}

#[test]
fn a_lost_arm_stays_lost_and_is_told_to_let_go() {
    let emulated = emulator(resting());
    let mut arm = started(&emulated);
    press::hold(&mut arm, DVec3::Z);
    Faults::set(&emulated.faults.garbage, true);
    common::wait("it pushes", || emulated.force_n().z > 0.9);
    let began = Instant::now();
    while arm.read(1).is_ok() {
        assert!(began.elapsed() < Duration::from_secs(5));
        arm.apply(&Effort::force(DVec3::Z));
        std::thread::sleep(Duration::from_millis(1));
    }
    Faults::set(&emulated.faults.garbage, false);
    arm.apply(&Effort::force(DVec3::Z));
    assert_eq!(arm.read(1), Err(Fault::Garbled));
    common::wait("it lets go", || emulated.force_n() == DVec3::ZERO);
}
