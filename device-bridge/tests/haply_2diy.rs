//! The 2diy's driver against its emulator, over real pseudo terminals: beneath a bridge, and alone.

use crate::common;
use crate::common::press::{self, PRESS, lost_in, pressed, pressed_in, simulated};
use glam::{DVec2, DVec3, Vec3Swizzles as _};
use palpate_bridge::{
    config::{DeviceConfig, Haply2diyConfig, WorkspaceConfig},
    device::{
        Arm as _, Effort, Fault,
        haply_2diy::{self as driver, wire},
    },
    emulate::{
        Faults,
        haply_2diy::{Haply2diy, Settings},
    },
    settings::arm,
};
use palpate_control::{ArmSpec, HandPath, Keyframe};
use std::{
    io::Write as _,
    sync::atomic::Ordering,
    time::{Duration, Instant},
};

const AT_M: DVec3 = DVec3::new(0.01, 0.02, 0.0);

/// Finer encoders and stronger motors than usual, one of which turns the other way.
fn keys(port: &str) -> Haply2diyConfig {
    Haply2diyConfig {
        port: port.to_owned(),
        counts_per_turn: [40_000.0, 50_000.0],
        reversed: [false, true],
        max_torque_nm: 0.4,
        // Patient with a busy test machine.
        silence_s: 0.4,
        ..Haply2diyConfig::default()
    }
}

/// The second generation: motors on one axis, one of which turns with the clock, on the other ports.
fn second(keys: Haply2diyConfig) -> Haply2diyConfig {
    Haply2diyConfig {
        base_m: 0.0,
        centre_m: [0.0, 0.095],
        ports: [1, 2],
        counter_clockwise: [true, false],
        home_deg: [241.0, -61.0],
        ..keys
    }
}

fn constants(config: &Haply2diyConfig) -> driver::Settings {
    arm::haply_2diy::checked(config).unwrap()
}

fn emulated(keys: &Haply2diyConfig, path: HandPath) -> Haply2diy {
    let constants = constants(keys);
    Haply2diy::start(Settings { constants, knows_home: true, watchdog: None, arm: ArmSpec::default(), path }).unwrap()
}

fn emulator(path: HandPath) -> Haply2diy {
    emulated(&keys(""), path)
}

fn resting() -> HandPath {
    HandPath::resting_at(AT_M)
}

fn started(arm: &Haply2diy) -> driver::Haply2diy {
    driver::Haply2diy::start(&constants(&keys(arm.port())), 1e-3).unwrap()
}

fn device(arm: &Haply2diy) -> DeviceConfig {
    DeviceConfig::Haply2diy(keys(arm.port()))
}

/// The arm's y is the world's z: its plane stands upright.
fn upright() -> WorkspaceConfig {
    let axes = ["+x", "+z", "-y"].map(str::to_owned);
    WorkspaceConfig { axes, ..WorkspaceConfig::default() }
}

/// Of the length of a step of the encoders (0.02 mm at the tool) the wall makes 0.01 N.
const FLICKER_N: f64 = 0.03;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_ends_at_the_force_of_the_simulated_arm() {
    let expected_n = pressed(2e-4, simulated()).await.force_n;
    let key = |(time_s, y)| Keyframe { time_s, position_m: DVec3::Y * y };
    let path = HandPath::new(PRESS.map(key).to_vec(), None).unwrap();
    for generation in [|keys| keys, second] {
        let arm = emulated(&generation(keys("")), path.clone());
        let device = DeviceConfig::Haply2diy(generation(keys(arm.port())));
        let pressed = pressed_in(FLICKER_N, upright(), device).await;
        let found_n = pressed.force_n;
        assert!((found_n / expected_n - 1.0).abs() < 0.02, "{found_n} N, {expected_n} N");
        pressed.assert_peak_below(1.1, expected_n);
        common::until("the bridge took its force away when it ended", || arm.force_n() == DVec3::ZERO).await;
    }
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
        let arm = emulator(resting());
        let world_n = || DVec3::new(arm.force_n().x, 0.0, arm.force_n().y);
        let found = lost_in(upright(), device(&arm), world_n, || cause(&arm.faults)).await;
        assert_eq!(found, (fault, 0.0));
        common::until("the motors are off", || arm.force_n() == DVec3::ZERO).await;
    }
}

/// Its firmware has no watchdog: a bridge that is killed leaves its last torques, and the next start takes them away.
#[test]
fn a_start_takes_away_what_a_killed_bridge_left() {
    let emulated = emulator(resting());
    let constants = constants(&keys(""));
    let mut killed = serialport::new(emulated.port(), 115_200).open_native().unwrap();
    let setup = wire::setup(constants.device_id, constants.swapped(constants.axes));
    let request = wire::request(constants.device_id, [0.05, -0.05]);
    killed.write_all(&[&setup[..], &request].concat()).unwrap();
    drop(killed);
    common::wait("it pushes", || emulated.force_n() != DVec3::ZERO);
    std::thread::sleep(Duration::from_millis(600));
    assert!(emulated.force_n().length() > 0.3, "nothing takes it away by itself");
    let _arm = started(&emulated);
    assert_eq!(emulated.force_n(), DVec3::ZERO);
}

#[test]
fn a_board_with_a_watchdog_lets_go_by_itself() {
    let watchdog = Some(Duration::from_millis(100));
    let settings = Settings {
        constants: constants(&keys("")),
        knows_home: true,
        watchdog,
        arm: ArmSpec::default(),
        path: resting(),
    };
    let emulated = Haply2diy::start(settings).unwrap();
    let mut arm = started(&emulated);
    press::hold(&mut arm, DVec3::Y);
    common::wait("it lets go", || emulated.force_n() == DVec3::ZERO);
}

#[test]
fn a_probe_says_where_the_arm_is() {
    let arm = emulator(resting());
    let report = common::probed(device(&arm), Duration::from_millis(400)).unwrap();
    // Half a step of each encoder.
    assert!(report.position_m.distance(AT_M) < 2e-5, "{report}");
    assert!(report.measured_force_n.is_none() && report.poses_per_s > 50.0, "{report}");
    Faults::set(&arm.faults.cut, true);
    std::thread::sleep(Duration::from_millis(20));
    assert!(common::probed(device(&arm), Duration::from_millis(100)).is_err());
}

/// Answers split into bytes are put together; place and velocity follow the arm.
#[test]
fn poses_follow_the_arm_though_answers_come_in_pieces() {
    for split in [false, true] {
        let keys_of = [(0.0, 0.0), (0.6, 0.03)].map(|(time_s, x)| Keyframe { time_s, position_m: DVec3::X * x });
        let emulated = emulator(HandPath::new(keys_of.to_vec(), None).unwrap());
        Faults::set(&emulated.faults.split, split);
        let mut arm = started(&emulated);
        let followed = press::followed(&mut arm, || emulated.position_m(), |_| ());
        let end = arm.read(0).unwrap();
        assert!(end.motion.position_m.distance(emulated.position_m()) < 1e-4, "{:?}", end.motion);
        assert!(emulated.position_m().x > 0.02 && emulated.requests() > 100);
        followed.assert_near(1e-2);
        followed.assert_way(end.motion.position_m, 6e-3);
        assert!(end.motion.velocity_m_per_s.length() < 5e-3, "{:?}", end.motion);
        assert!(end.motion.position_m.z == 0.0 && end.age_s < 0.1);
    }
}

/// Encoders begin at their offsets wherever the arm is: it has to be held where these are right.
#[test]
fn angles_count_from_where_the_arm_is_when_the_bridge_starts() {
    let right = constants(&keys("")).kinematics.angles_rad(AT_M.xy()).unwrap().map(f64::to_degrees).to_array();
    for (home_deg, is_there) in [(right, true), ([right[0] + 5.0, right[1] - 5.0], false)] {
        let keys = |port: &str| Haply2diyConfig { home_deg, ..keys(port) };
        let constants = |port: &str| constants(&keys(port));
        let arm = ArmSpec::default();
        let settings = Settings { constants: constants(""), knows_home: false, watchdog: None, arm, path: resting() };
        let emulated = Haply2diy::start(settings).unwrap();
        let mut arm = driver::Haply2diy::start(&constants(emulated.port()), 1e-3).unwrap();
        let off_m = arm.read(0).unwrap().motion.position_m.distance(AT_M);
        assert_eq!(off_m < 2e-5, is_there, "{off_m}");
    }
}

#[test]
fn no_torque_beyond_the_limit_is_asked_for_and_the_force_keeps_its_direction() {
    let emulated = emulator(resting());
    let mut arm = started(&emulated);
    let weak = DVec3::new(0.3, -0.5, 0.0);
    // What is along z is not felt.
    press::hold(&mut arm, weak + 2.0 * DVec3::Z);
    assert!((emulated.force_n() - weak).length() < 0.01, "{}", emulated.force_n());
    press::bounded(&mut arm, || emulated.force_n(), weak, 20.0);
}

/// The published board's motors give so much; docs/arms/haply-2diy.md says so.
#[test]
fn the_published_motors_push_with_two_newtons_in_the_middle() {
    let settings = constants(&Haply2diyConfig::default());
    let place = settings.kinematics.place(settings.kinematics.angles_rad(DVec2::ZERO).unwrap()).unwrap();
    for (axis, expected_n) in [(DVec2::X, 3.0), (DVec2::Y, 2.1)] {
        let torques_nm = place.jacobian_m_per_rad.transpose() * axis;
        let most_n = settings.max_torque_nm / torques_nm.abs().max_element();
        assert!((most_n - expected_n).abs() < 0.05, "{axis} {most_n}");
    }
}

#[test]
fn an_arm_that_cannot_be_started_says_why() {
    let started = |port: &str| driver::Haply2diy::start(&constants(&keys(port)), 1e-3);
    let said = |port: &str| started(port).unwrap_err().to_string();
    assert!(said("/dev/nothing").starts_with("cannot open the serial port /dev/nothing"));
    let arm = emulator(resting());
    Faults::set(&arm.faults.silence, true);
    let silent = said(arm.port());
    assert!(silent.starts_with("no answer came from /dev/pts/") && silent.contains("within 3 s"), "{silent}");
    Faults::set(&arm.faults.silence, false);
    Faults::set(&arm.faults.garbage, true);
    assert!(said(arm.port()).contains("is it this arm's port?"));
    Faults::set(&arm.faults.garbage, false);
    // Elbows that do not reach each other.
    let settings = Settings {
        constants: constants(&keys("")),
        knows_home: false,
        watchdog: None,
        arm: ArmSpec::default(),
        path: resting(),
    };
    let arm = Haply2diy::start(settings).unwrap();
    let keys = Haply2diyConfig { home_deg: [180.0, 0.0], base_m: 0.06, ..keys(arm.port()) };
    let error = driver::Haply2diy::start(&constants(&keys), 1e-3).unwrap_err().to_string();
    assert!(error.contains("its angles are 180 and 0 degrees, which no arm"), "{error}");
}

/// A driver's requests are effort alone: what a lost arm is told is nothing.
#[test]
fn a_lost_arm_stays_lost_and_is_told_to_let_go() {
    let emulated = emulator(resting());
    let mut arm = started(&emulated);
    press::hold(&mut arm, DVec3::Y);
    Faults::set(&emulated.faults.garbage, true);
    let began = Instant::now();
    while arm.read(1).is_ok() {
        assert!(began.elapsed() < Duration::from_secs(5));
        arm.apply(&Effort::force(DVec3::Y));
        std::thread::sleep(Duration::from_millis(1));
    }
    Faults::set(&emulated.faults.garbage, false);
    arm.apply(&Effort::force(DVec3::Y));
    assert_eq!(arm.read(1), Err(Fault::Garbled));
    common::wait("it lets go", || emulated.force_n() == DVec3::ZERO);
}
