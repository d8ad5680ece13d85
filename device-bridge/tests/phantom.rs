//! The driver of a PHANToM against a library in libHD's place and its emulated arm: beneath a bridge, and alone.

use crate::common;
use crate::common::press::{self, PRESSED_N, lost_by, pressed, simulated};
use crate::libhd::Emulated;
use glam::{DQuat, DVec3};
use palpate_bridge::{
    Config, Handle,
    config::{DeviceConfig, PhantomConfig},
    device::{
        Arm as _, Effort, Fault,
        phantom::{self as driver, Phantom, ffi::Hd, start::StartError},
    },
    emulate::{
        Faults,
        phantom::{Calibration, Settings},
    },
    measure::measure,
    settings::arm,
};
use palpate_control::{HandPath, Keyframe};
use std::{
    sync::atomic::Ordering,
    time::{Duration, Instant},
};
use tokio_util::sync::CancellationToken;

const PLACE_M: DVec3 = DVec3::new(0.01, 0.02, -0.03);

fn resting() -> Settings {
    Settings { path: HandPath::resting_at(PLACE_M), ..Settings::default() }
}

fn settings(keys: &PhantomConfig, max_force_n: f64) -> driver::Settings {
    let mut config = Config::default();
    config.limits.max_force_n = max_force_n;
    arm::phantom::checked(keys, &config).unwrap()
}

fn started(keys: &PhantomConfig) -> Result<Phantom, StartError> {
    Phantom::start(&settings(keys, 3.0), 1e-3, &CancellationToken::new())
}

fn refused(keys: &PhantomConfig) -> String {
    started(keys).unwrap_err().to_string()
}

/// Applies `effort` tick by tick until `condition`; fails after 10 s.
fn apply_until(what: &str, arm: &mut Phantom, effort: &Effort, mut condition: impl FnMut() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(began.elapsed() < Duration::from_secs(10), "waited in vain until {what}");
        arm.read(0).unwrap();
        arm.apply(effort);
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(began.elapsed() < Duration::from_secs(10), "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_ends_at_the_force_of_the_simulated_arm() {
    let expected_n = pressed(2e-4, simulated()).await.force_n;
    assert!((expected_n - PRESSED_N).abs() < 0.01, "{expected_n}");
    let emulated = Emulated::new(Settings { path: press::path(), ..Settings::default() });
    let pressed = pressed(2e-3, DeviceConfig::Phantom(emulated.keys())).await;
    let found_n = pressed.force_n;
    assert!((found_n / expected_n - 1.0).abs() < 0.02, "{found_n} N, {expected_n} N");
    pressed.assert_peak_below(1.1, expected_n);
    assert_eq!(emulated.arm.force_n(), DVec3::ZERO, "the bridge took its force away when it ended");
}

/// The emulated arm is made for 500 N/m.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn walls_are_no_stiffer_than_the_arm_is_made_for() {
    let emulated = Emulated::new(Settings { path: press::path(), ..Settings::default() });
    // Twice as far in the world, half as stiff there.
    for (scale, most_n_per_m) in [(1.0, 500.0), (2.0, 250.0)] {
        let (_mock, bridge) = common::pushing(|config| {
            config.device = DeviceConfig::Phantom(emulated.keys());
            config.workspace.scale = scale;
        })
        .await;
        assert_eq!(bridge.handle.stats().largest_stiffness_n_per_m(), most_n_per_m);
        bridge.stop().await;
    }
    let mut config = common::config("http://127.0.0.1:1");
    config.device = DeviceConfig::Phantom(emulated.keys());
    config.render.max_stiffness_n_per_m = Some(501.0);
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("arm.csv");
    config.record.path = Some(recording.clone());
    let refused = palpate_bridge::run(config, CancellationToken::new()).await.unwrap_err().to_string();
    assert!(refused.starts_with("render.max_stiffness_n_per_m: 501 N/m is more than the 500 N/m"), "{refused}");
    assert!(!recording.exists(), "a run that was refused has no recording, over which the next would stumble");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_measured_promises_no_stiffer_walls_either() {
    let emulated = Emulated::new(Settings { path: press::path(), ..Settings::default() });
    let (address, _stop, _serving) = common::Mock::default().serve("127.0.0.1:0").await;
    let mut config = common::config(&format!("http://{address}"));
    config.device = DeviceConfig::Phantom(emulated.keys());
    config.render.arm_damping_n_s_per_m = 40.0;
    let report = measure(&config, Duration::from_millis(300), Handle::new()).await.unwrap();
    let (beside, across) = report.stiffness_n_per_m;
    assert!(beside <= 500.0 && across <= beside && across > 0.0, "{beside} {across}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_of_the_arm_takes_the_force_away_and_is_named() {
    type Cause = fn(&Faults);
    let causes: [(Cause, Fault); 10] = [
        (|faults| faults.error_code.store(0x0200, Ordering::Relaxed), Fault::Overheated),
        (|faults| faults.error_code.store(0x0201, Ordering::Relaxed), Fault::TooMuchForce),
        (|faults| faults.error_code.store(0x0202, Ordering::Relaxed), Fault::TooMuchForce),
        (|faults| faults.error_code.store(0x0203, Ordering::Relaxed), Fault::TooFast),
        (|faults| faults.error_code.store(0x0304, Ordering::Relaxed), Fault::Scheduler),
        (|faults| faults.error_code.store(0x0300, Ordering::Relaxed), Fault::Broken),
        (|faults| Faults::set(&faults.silence, true), Fault::Silent),
        (|faults| Faults::set(&faults.garbage, true), Fault::Garbled),
        (|faults| Faults::set(&faults.cut, true), Fault::Disconnected),
        (|faults| faults.slow_us.store(900_000, Ordering::Relaxed), Fault::Silent),
    ];
    for (cause, fault) in causes {
        let emulated = Emulated::new(resting());
        let device = DeviceConfig::Phantom(emulated.keys());
        let found = lost_by(device, || emulated.arm.force_n(), || cause(&emulated.arm.faults)).await;
        assert_eq!(found, (fault, 0.0));
        common::until("the motors are off", || emulated.arm.force_n() == DVec3::ZERO).await;
    }
}

/// The frame that sees an error is the last with a force, whatever the servo still wants.
#[test]
fn an_error_takes_the_force_away_before_the_servo_knows() {
    let emulated = Emulated::new(resting());
    let mut arm = started(&emulated.keys()).unwrap();
    let push = Effort::force(DVec3::Y * 2.0);
    apply_until("it pushes", &mut arm, &push, || emulated.arm.force_n() == push.force_n);
    emulated.arm.faults.error_code.store(0x0203, Ordering::Relaxed);
    wait_until("it lets go", || {
        arm.apply(&push);
        emulated.arm.force_n() == DVec3::ZERO
    });
    emulated.arm.faults.error_code.store(0, Ordering::Relaxed);
    press_without_effect(&mut arm, &emulated, &push);
    assert_eq!((arm.read(1), arm.read(1)), (Err(Fault::TooFast), Err(Fault::TooFast)));
}

/// An arm that failed has to be opened anew.
fn press_without_effect(arm: &mut Phantom, emulated: &Emulated, push: &Effort) {
    let frames = emulated.arm.frames();
    wait_until("frames go on", || {
        arm.apply(push);
        assert_eq!(emulated.arm.force_n(), DVec3::ZERO);
        emulated.arm.frames() > frames + 100
    });
}

/// The frames go on without the servo: they let go by themselves, and give the force back slowly.
#[test]
fn a_servo_that_hangs_loses_its_force_and_gets_it_back() {
    let emulated = Emulated::new(resting());
    let mut arm = started(&emulated.keys()).unwrap();
    let push = Effort::force(DVec3::Y * 2.0);
    apply_until("it pushes", &mut arm, &push, || emulated.arm.force_n() == push.force_n);
    let frames = emulated.arm.frames();
    wait_until("it lets go", || emulated.arm.force_n() == DVec3::ZERO);
    assert!(emulated.arm.frames() - frames >= u64::from(driver::frame::PATIENCE_FRAMES) - 2);
    assert!(arm.read(1).is_ok(), "the arm is there");
    apply_until("it pushes again", &mut arm, &push, || emulated.arm.force_n() == push.force_n);
    drop(arm);
    wait_until("it is told to let go", || emulated.arm.force_n() == DVec3::ZERO);
}

#[test]
fn an_arm_is_left_without_force_and_can_be_used_again() {
    let emulated = Emulated::new(resting());
    for _ in 0..3 {
        let mut arm = started(&emulated.keys()).unwrap();
        let push = Effort::force(DVec3::X);
        apply_until("it pushes", &mut arm, &push, || emulated.arm.force_n() == push.force_n);
        assert!(refused(&emulated.keys()).contains("(HD error 0x0301)"), "it is in use");
        drop(arm);
        // What was said last has still to be heard.
        wait_until("it lets go", || emulated.arm.force_n() == DVec3::ZERO);
        wait_until("the library has gone", || emulated.arm.left_with_n().is_some());
        assert_eq!(emulated.arm.left_with_n(), Some(0.0), "the last frame had no force");
    }
}

#[test]
fn a_probe_says_where_the_arm_is() {
    let emulated = Emulated::new(Settings { buttons: 0b10, ..resting() });
    let report = common::probed(DeviceConfig::Phantom(emulated.keys()), Duration::from_millis(400)).unwrap();
    assert!(report.position_m.distance(PLACE_M) < 1e-12 && report.buttons == 0b10, "{report}");
    assert!(report.measured_force_n.is_none() && report.poses_per_s > 50.0, "{report}");
    Faults::set(&emulated.arm.faults.cut, true);
    assert!(common::probed(DeviceConfig::Phantom(emulated.keys()), Duration::from_millis(100)).is_err());
}

/// Every number that goes through C comes out as it went in.
#[test]
fn what_is_read_is_what_the_arm_says() {
    let orientation = DQuat::from_scaled_axis(DVec3::new(0.3, -0.7, 1.1));
    let emulated = Emulated::new(Settings { orientation, buttons: 0b101, turns: true, ..resting() });
    let keys = emulated.keys();
    let mut started = driver::start::start(&settings(&keys, 3.0), &CancellationToken::new()).unwrap();
    let limits = started.limits;
    assert_eq!((limits.max_force_n, limits.continuous_force_n), (Some(3.3), Some(0.88)));
    assert_eq!((limits.stiffness_n_per_m, limits.velocity_m_per_s), (Some(500.0), Some(1.2)));
    assert_eq!((limits.impulse_n, limits.max_torque_nm), (Some(4.0), Some(0.188)));
    wait_until("a pose comes", || started.poses.take().is_some());
    let pose = started.poses.newest().unwrap();
    assert!(pose.motion.position_m.distance(PLACE_M) < 1e-15 && pose.buttons == 0b101, "{pose:?}");
    assert!(pose.motion.orientation.angle_between(orientation) < 1e-7, "{pose:?}");
}

#[test]
fn poses_follow_the_arm() {
    let keys_of = [(0.0, 0.0), (0.3, 0.03)].map(|(time_s, x)| Keyframe { time_s, position_m: DVec3::X * x });
    let path = HandPath::new(keys_of.to_vec(), None).unwrap();
    let emulated = Emulated::new(Settings { path, ..Settings::default() });
    let mut arm = started(&emulated.keys()).unwrap();
    let followed = press::followed(&mut arm, || emulated.arm.position_m(), |_| ());
    let end = arm.read(0).unwrap();
    assert!(end.motion.position_m.distance(emulated.arm.position_m()) < 1e-5, "{:?}", end.motion);
    assert!(emulated.arm.position_m().x > 0.029 && emulated.arm.frames() > 100);
    followed.assert_near(5e-3);
    followed.assert_way(DVec3::X * 0.03, 3e-3);
}

#[test]
fn no_force_beyond_the_limit_and_none_that_is_no_number_reaches_the_arm() {
    let emulated = Emulated::new(resting());
    let mut arm = started(&emulated.keys()).unwrap();
    let strong = DVec3::new(30.0, 0.0, -40.0);
    let limited = DVec3::new(1.8, 0.0, -2.4);
    apply_until("it is at its limit", &mut arm, &Effort::force(strong), || {
        emulated.arm.force_n().distance(limited) < 1e-12
    });
    apply_until("it lets go", &mut arm, &Effort::force(DVec3::NAN), || emulated.arm.force_n() == DVec3::ZERO);
    assert!(emulated.arm.peak_n() < 3.0 + 1e-12, "{}", emulated.arm.peak_n());
}

#[test]
fn torque_goes_to_arms_that_have_motors_for_it() {
    let twist = Effort { torque_nm: DVec3::new(0.0, 0.01, -0.02), ..Effort::force(DVec3::Z) };
    let strong = Effort { torque_nm: DVec3::X, ..twist };
    for (turns, torque, expected_nm) in
        [(true, true, twist.torque_nm), (true, false, DVec3::ZERO), (false, true, DVec3::ZERO)]
    {
        let emulated = Emulated::new(Settings { turns, ..resting() });
        let mut arm = started(&PhantomConfig { torque, ..emulated.keys() }).unwrap();
        apply_until("it pushes", &mut arm, &twist, || emulated.arm.force_n() == twist.force_n);
        assert!(emulated.arm.torque_nm().distance(expected_nm) < 1e-15, "{}", emulated.arm.torque_nm());
        if expected_nm != DVec3::ZERO {
            let most_nm = DVec3::X * 0.188;
            apply_until("it is at its limit", &mut arm, &strong, || emulated.arm.torque_nm().distance(most_nm) < 1e-12);
        }
    }
}

#[test]
fn an_arm_is_calibrated_before_it_is_used() {
    let (auto, inkwell, reset) = (2, 4, 1);
    for (calibration, style) in
        [(Calibration::Auto { frames: 50 }, auto), (Calibration::Inkwell { frames: 50 }, inkwell)]
    {
        let emulated = Emulated::new(Settings { calibration, ..resting() });
        let mut arm = started(&emulated.keys()).unwrap();
        assert!(emulated.arm.frames() > 50 && arm.read(0).is_ok());
        assert!(emulated.arm.calibrated().contains(&style), "{:?}", emulated.arm.calibrated());
        assert_eq!(emulated.arm.peak_n(), 0.0);
        // In vain.
        let calibration = Calibration::Inkwell { frames: u64::MAX };
        let emulated = Emulated::new(Settings { calibration, ..resting() });
        let keys = PhantomConfig { calibration_s: 0.1, ..emulated.keys() };
        assert_eq!(refused(&keys), "the arm is not calibrated: put its stylus into the inkwell and leave it there");
        let stop = CancellationToken::new();
        stop.cancel();
        let stopped = Phantom::start(&settings(&emulated.keys(), 3.0), 1e-3, &stop);
        assert!(matches!(stopped, Err(StartError::Stopped)), "{stopped:?}");
    }
    let emulated = Emulated::new(Settings { calibration: Calibration::EncoderReset, ..resting() });
    assert!(refused(&emulated.keys()).contains("device.reset_encoders = true"));
    assert!(emulated.arm.calibrated().is_empty(), "only when it is said that it is in its reset position");
    let _arm = started(&PhantomConfig { reset_encoders: true, ..emulated.keys() }).unwrap();
    assert_eq!(emulated.arm.calibrated(), [reset]);
}

#[test]
fn an_arm_that_cannot_be_started_says_why() {
    let emulated = Emulated::new(resting());
    let with = |change: fn(&mut PhantomConfig)| {
        let mut keys = emulated.keys();
        change(&mut keys);
        refused(&keys)
    };
    let missing = with(|keys| keys.library = "/nowhere/libHD.so".into());
    assert!(
        missing.starts_with("libHD cannot be loaded (/nowhere/libHD.so: ") && missing.contains("OpenHaptics"),
        "{missing}"
    );
    // What is looked for where nothing is named; a machine with OpenHaptics has no arm of this name.
    let usual = with(|keys| keys.library = String::new());
    assert!(["libHD.so: ", "libHD.so.3: ", "HD error"].iter().any(|part| usual.contains(part)), "{usual}");
    let other = with(|keys| keys.library = "libc.so.6".into());
    assert!(other.starts_with("libc.so.6 has no function hdInitDevice: it is not OpenHaptics' libHD"), "{other}");
    let nobody = with(|keys| keys.name = "/nowhere/arm".into());
    assert_eq!(nobody, "cannot use the arm \"/nowhere/arm\": device fault (HD error 0x0300)");
    assert!(with(|keys| keys.name = "a\0b".into()).starts_with("device.name: \"a\\0b\""));
    let strong = Phantom::start(&settings(&emulated.keys(), 3.5), 1e-3, &CancellationToken::new());
    let strong = strong.unwrap_err().to_string();
    assert!(
        strong.starts_with("limits.max_force_n: 3.5 N is more than this arm gives: 3.3 N at most (emulated PHANToM)"),
        "{strong}"
    );
    assert!(strong.contains("0.88 N for ever"), "{strong}");
    emulated.arm.faults.error_code.store(0x0200, Ordering::Relaxed);
    assert_eq!(refused(&emulated.keys()), "its motors are too warm (HD error 0x0200)");
    emulated.arm.faults.error_code.store(0, Ordering::Relaxed);
    drop(started(&emulated.keys()).unwrap());
}

/// Its scheduler takes no rate between those that it knows; the arm is used all the same.
#[test]
fn an_unknown_rate_is_no_reason_to_refuse() {
    let emulated = Emulated::new(resting());
    let mut settings = settings(&emulated.keys(), 3.0);
    settings.rate_hz = 1234;
    let mut arm = Phantom::start(&settings, 1e-3, &CancellationToken::new()).unwrap();
    press::hold(&mut arm, DVec3::X);
}

#[test]
fn what_hd_refuses_is_no_number_and_an_error() {
    let emulated = Emulated::new(resting());
    let hd = Hd::load(std::slice::from_ref(&emulated.library)).unwrap();
    assert_eq!(hd.error(), None);
    assert!(hd.doubles(driver::ffi::FORCE).iter().all(|value| value.is_nan()));
    let name = std::ffi::CString::new(emulated.arm.socket().to_str().unwrap()).unwrap();
    hd.begin_frame(hd.init_device(Some(&name)).unwrap());
    hd.set(driver::ffi::POSITION, [1.0, 2.0, 3.0]);
    assert_eq!([hd.error(), hd.error(), hd.error()], [Some(0x0100), Some(0x0100), None]);
}
