//! The VRPN driver against its emulator, over real sockets: beneath a bridge, and alone.

use crate::common;
use crate::common::press::{self, PRESSED_N, bridged, lost_by, pressed, simulated, to_arm};
use glam::{DQuat, DVec3};
use palpate_bridge::{
    config::{DeviceConfig, LimitsConfig, VrpnConfig},
    device::{Arm as _, Effort, Fault, vrpn as driver},
    emulate::{
        Faults,
        vrpn::{Settings, Vrpn},
    },
    probe::probe,
    settings::arm,
};
use palpate_control::{HandPath, Keyframe};
use std::{
    sync::atomic::Ordering,
    time::{Duration, Instant},
};

/// Names of its parts that are not the same, and a sensor that is not the first.
fn names() -> [String; 3] {
    ["Stylus", "Grip", "Motors"].map(str::to_owned)
}

fn emulator(change: impl FnOnce(&mut Settings)) -> Vrpn {
    let mut settings = Settings { names: names(), sensor: 1, ..Settings::default() };
    change(&mut settings);
    Vrpn::listen("127.0.0.1:0", settings).unwrap()
}

fn keys(arm: &Vrpn) -> VrpnConfig {
    let [tracker, button, force_device] = names();
    VrpnConfig {
        address: arm.address().to_string(),
        tracker,
        sensor: 1,
        button,
        force_device,
        // Patient with a busy test machine.
        silence_s: 0.4,
        ..VrpnConfig::default()
    }
}

fn device(arm: &Vrpn) -> DeviceConfig {
    DeviceConfig::Vrpn(keys(arm))
}

fn started(keys: &VrpnConfig) -> Result<driver::Vrpn, driver::start::StartError> {
    let limits = LimitsConfig { max_force_n: 3.0, ..LimitsConfig::default() };
    driver::Vrpn::start(&arm::vrpn::checked(keys, &limits).unwrap(), 1e-3)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_ends_at_the_force_of_the_simulated_arm() {
    let expected_n = pressed(2e-4, simulated()).await.force_n;
    assert!((expected_n - PRESSED_N).abs() < 0.01, "{expected_n}");
    for (velocities, every) in [(true, 1), (false, 1), (true, 2)] {
        let arm = emulator(|settings| {
            settings.path = press::path();
            (settings.velocities, settings.every) = (velocities, every);
        });
        let pressed = pressed(0.01, device(&arm)).await;
        let found_n = pressed.force_n;
        assert!((found_n / expected_n - 1.0).abs() < 0.02, "{found_n} N, {expected_n} N: {velocities} {every}");
        pressed.assert_peak_below(1.1, expected_n);
        common::until("the bridge took its force away when it ended", || arm.force_n() == DVec3::ZERO).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_of_the_arm_takes_the_force_away_and_is_named() {
    type Cause = fn(&Faults);
    let causes: [(Cause, Fault); 5] = [
        (|faults| Faults::set(&faults.silence, true), Fault::Silent),
        (|faults| Faults::set(&faults.garbage, true), Fault::Garbled),
        (|faults| Faults::set(&faults.refusal, true), Fault::Refused),
        (|faults| Faults::set(&faults.cut, true), Fault::Disconnected),
        (|faults| faults.slow_us.store(900_000, Ordering::Relaxed), Fault::Silent),
    ];
    for (cause, fault) in causes {
        // It lets go because it was told to, wherever it can still hear.
        let arm = emulator(|settings| settings.keeps = fault != Fault::Disconnected);
        let found = lost_by(device(&arm), || arm.force_n(), || cause(&arm.faults)).await;
        assert_eq!(found, (fault, 0.0));
        common::until("the arm has no force", || arm.force_n() == DVec3::ZERO).await;
    }
}

/// A bridge that is killed says nothing more. The server lets go when its last client has gone; where another is left, only as far as the field reaches.
#[test]
fn a_field_that_nobody_renews_ends_with_its_radius() {
    let emulated = emulator(|settings| settings.keeps = true);
    let mut arm = started(&VrpnConfig { field_radius_m: 0.02, ..keys(&emulated) }).unwrap();
    press::hold(&mut arm, DVec3::Z);
    let field = emulated.field();
    assert!((field.force_at_n(emulated.position_m()) - DVec3::Z).length() < 1e-6);
    assert_eq!(field.force_at_n(emulated.position_m() + 0.03 * DVec3::X), DVec3::ZERO);
    drop(arm);
    let dropped = Instant::now();
    while emulated.force_n() != DVec3::ZERO {
        assert!(dropped.elapsed() < Duration::from_secs(5), "told so, it lets go");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_probe_says_where_the_arm_is_and_what_its_sensor_measures() {
    let held = |settings: &mut Settings| {
        settings.path = HandPath::resting_at(to_arm(DVec3::new(0.01, 0.02, 0.03)));
        settings.measures = true;
    };
    let arm = emulator(held);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let _context = runtime.enter();
    for force_is_measured in [false, true] {
        let keys = VrpnConfig { force_is_measured, ..keys(&arm) };
        let config = bridged("http://127.0.0.1:1", DeviceConfig::Vrpn(keys));
        let report = probe(&config, Duration::from_millis(400)).unwrap();
        assert!(report.position_m.distance(DVec3::new(0.01, 0.02, 0.03)) < 1e-9, "{report}");
        assert_eq!(report.measured_force_n.is_some(), force_is_measured, "{report}");
        assert!(report.poses_per_s > 50.0, "{report}");
    }
    Faults::set(&arm.faults.cut, true);
    std::thread::sleep(Duration::from_millis(20));
    assert!(probe(&bridged("http://127.0.0.1:1", device(&arm)), Duration::from_millis(100)).is_err());
}

/// Messages split into bytes are put together; place, turn and velocity follow the arm, whoever makes the velocity.
#[test]
fn poses_follow_the_arm_though_messages_come_in_pieces() {
    let orientation = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 0.9);
    for (split, velocities, from_poses) in [(false, true, false), (true, true, true), (true, false, false)] {
        let emulated = emulator(|settings| {
            // The arm waits until enough poses came to believe the server's clock.
            let keys = [(0.0, 0.0), (0.25, 0.0), (0.55, 0.03)];
            let keys = keys.map(|(time_s, x)| Keyframe { time_s, position_m: DVec3::X * x });
            settings.path = HandPath::new(keys.to_vec(), None).unwrap();
            (settings.velocities, settings.orientation) = (velocities, orientation);
        });
        Faults::set(&emulated.faults.split, split);
        let mut arm = started(&VrpnConfig { velocity_from_poses: from_poses, ..keys(&emulated) }).unwrap();
        let first_m = arm.read(0).unwrap().motion.position_m;
        let followed = press::followed(
            &mut arm,
            || emulated.position_m(),
            |reading| assert!(reading.motion.orientation.angle_between(orientation) < 1e-6),
        );
        let end = arm.read(0).unwrap();
        assert!(end.motion.position_m.distance(emulated.position_m()) < 1e-4, "{:?}", end.motion);
        assert!(emulated.position_m().x > 0.02 && emulated.fields() > 100 && emulated.pongs() > 2);
        followed.assert_near(5e-3);
        followed.assert_way(end.motion.position_m - first_m, 3e-3);
        assert!(end.motion.velocity_m_per_s.length() < 5e-3, "{:?}", end.motion);
    }
}

#[test]
fn buttons_are_told() {
    let emulated = emulator(|_| ());
    emulated.press(2);
    let mut arm = started(&keys(&emulated)).unwrap();
    for buttons in [2, 3, 1, 0] {
        emulated.press(buttons);
        let began = Instant::now();
        while arm.read(1).unwrap().buttons != buttons {
            assert!(began.elapsed() < Duration::from_secs(5));
            arm.apply(&Effort::NONE);
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    // Without a name there are none, and without a force device no force.
    let keys = VrpnConfig { button: String::new(), force_device: String::new(), ..keys(&emulated) };
    drop(arm);
    let mut arm = started(&keys).unwrap();
    emulated.press(3);
    let before = emulated.fields();
    press::hold(&mut arm, DVec3::Z);
    assert_eq!((arm.read(0).unwrap().buttons, emulated.force_n()), (0, DVec3::ZERO));
    drop(arm);
    assert_eq!(emulated.fields(), before);
}

#[test]
fn no_force_beyond_the_limit_reaches_the_arm_and_none_that_is_not_finite() {
    let emulated = emulator(|_| ());
    let mut arm = started(&keys(&emulated)).unwrap();
    let mut apply = |force_n: DVec3| {
        press::hold(&mut arm, force_n);
        emulated.force_n()
    };
    let weak = DVec3::new(0.0, -1.0, 2.0);
    assert!((apply(weak) - weak).length() < 1e-5);
    assert!((apply(DVec3::splat(1e6)).length() - 3.0).abs() < 1e-5);
    assert_eq!(apply(DVec3::new(f64::NAN, 0.0, 0.0)), DVec3::ZERO);
    assert!(apply(DVec3::splat(1e300)).length() < 3.1);
}

#[test]
fn an_arm_that_cannot_be_started_says_why() {
    let said = |keys: &VrpnConfig| started(keys).unwrap_err().to_string();
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let arm = emulator(|_| ());
    let nowhere = VrpnConfig { address: port.to_string(), ..keys(&arm) };
    assert!(said(&nowhere).starts_with("no VRPN server answers at 127.0.0.1"));
    let with = |change: fn(&mut VrpnConfig)| {
        let mut keys = keys(&arm);
        change(&mut keys);
        said(&keys)
    };
    assert!(with(|keys| keys.tracker = "Nobody".into()).ends_with("has no tracker named \"Nobody\""));
    assert!(with(|keys| keys.force_device = "Nobody".into()).ends_with("has no force device named \"Nobody\""));
    assert_eq!(with(|keys| keys.sensor = 5), "no pose came from \"Stylus\", sensor 5, within 2 s");
    let old = emulator(|settings| settings.cookie = *b"vrpn: ver. 06.12  0\0\0\0\0\0");
    assert!(said(&keys(&old)).contains("of version 07: it says \"vrpn: ver. 06.12  0\""), "{}", said(&keys(&old)));
    let newer = emulator(|settings| settings.cookie = *b"vrpn: ver. 07.99  0\0\0\0\0\0");
    assert!(started(&keys(&newer)).is_ok());
    Faults::set(&old.faults.silence, true);
    assert!(said(&keys(&old)).contains("does not say within 2 s that it is a VRPN server"));
    let failed = emulator(|_| ());
    Faults::set(&failed.faults.refusal, true);
    assert!(said(&keys(&failed)).ends_with("it refused a command"));
    Faults::set(&failed.faults.cut, true);
    assert!(said(&keys(&failed)).contains("broke"));
}
