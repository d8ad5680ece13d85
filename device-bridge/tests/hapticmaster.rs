//! The HapticMASTER's driver against its emulator, over real sockets: beneath a bridge, and alone.

use crate::common;
use crate::common::press::{self, PRESSED_N, bridged, pressed, simulated, to_arm};
use glam::DVec3;
use palpate_bridge::{
    config::{DeviceConfig, HapticMasterConfig},
    device::{
        Arm as _, Fault,
        hapticmaster::{
            self as driver,
            plane::{DampFactor, PlaneSettings},
        },
    },
    emulate::{
        Faults,
        hapticmaster::{HapticMaster, Settings},
    },
    probe::probe,
};
use palpate_control::{HandPath, Keyframe};
use std::{sync::atomic::Ordering, time::Duration};
use tokio_util::sync::CancellationToken;

fn emulator(change: impl FnOnce(&mut Settings)) -> HapticMaster {
    let mut settings = Settings::default();
    change(&mut settings);
    HapticMaster::listen("127.0.0.1:0", settings).unwrap()
}

fn arm_config(emulator: &HapticMaster, apart: bool) -> HapticMasterConfig {
    HapticMasterConfig {
        address: emulator.address().to_string(),
        apart,
        // Patient with a busy test machine.
        silence_s: 0.5,
        ..HapticMasterConfig::default()
    }
}

fn held(settings: &mut Settings) {
    settings.path = press::path();
    // The hand holds the heavier arm as firmly; it is damped like it.
    settings.arm.hand_damping_n_s_per_m = 40.0;
}

const FLICKER_N: f64 = 2e-4;

/// An admittance arm takes the same press to the same force: within 5 %, in every dialect.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_ends_at_the_force_of_the_simulated_arm() {
    let expected_n = pressed(FLICKER_N, simulated()).await.force_n;
    assert!((expected_n - PRESSED_N).abs() < 0.01, "{expected_n}");
    for (headers, quoted, apart) in
        [(true, false, false), (false, true, false), (true, true, true), (false, true, true)]
    {
        let arm = emulator(|settings| {
            held(settings);
            (settings.headers, settings.quoted, settings.apart) = (headers, quoted, apart);
        });
        let pressed = pressed(FLICKER_N, DeviceConfig::Hapticmaster(arm_config(&arm, apart))).await;
        let found_n = pressed.force_n;
        assert!((found_n / expected_n - 1.0).abs() < 0.05, "{found_n} N, {expected_n} N: {headers} {quoted} {apart}");
        pressed.assert_peak_below(1.2, expected_n);
        assert_eq!(arm.effect_n(), DVec3::ZERO, "the bridge took its force away when it ended");
    }
}

async fn lost_by(fault: impl FnOnce(&Faults)) -> (Fault, f64) {
    let arm = emulator(|_| ());
    let device = DeviceConfig::Hapticmaster(arm_config(&arm, false));
    press::lost_by(device, || arm.effect_n(), || fault(&arm.faults)).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_of_the_arm_takes_the_force_away_and_is_named() {
    assert_eq!(lost_by(|faults| Faults::set(&faults.silence, true)).await, (Fault::Silent, 0.0));
    assert_eq!(lost_by(|faults| Faults::set(&faults.garbage, true)).await, (Fault::Garbled, 0.0));
    assert_eq!(lost_by(|faults| Faults::set(&faults.emergency_stop, true)).await, (Fault::EmergencyStop, 0.0));
    assert_eq!(lost_by(|faults| Faults::set(&faults.refusal, true)).await, (Fault::Refused, 0.0));
    assert_eq!(lost_by(|faults| Faults::set(&faults.cut, true)).await, (Fault::Disconnected, 0.0));
    assert_eq!(lost_by(|faults| faults.slow_us.store(900_000, Ordering::Relaxed)).await, (Fault::Silent, 0.0));
}

#[test]
fn a_probe_says_where_the_arm_is_and_how_old_its_poses_are() {
    let arm = emulator(|settings| settings.path = HandPath::resting_at(to_arm(DVec3::new(0.01, 0.02, 0.03))));
    let mut config = bridged("http://127.0.0.1:1", DeviceConfig::Hapticmaster(arm_config(&arm, false)));
    config.servo.rate_hz = 500.0;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let _context = runtime.enter();
    let report = probe(&config, Duration::from_millis(400)).unwrap();
    assert!(report.position_m.distance(DVec3::new(0.01, 0.02, 0.03)) < 2e-6, "{report}");
    assert!(report.measured_force_n.is_some_and(|force_n| force_n.length() < 1e-6), "{report}");
    assert!(report.age.count > 20 && report.age.max_ns < 500_000_000, "{report}");
    // A request goes out in one tick and its answer is read in the next at the soonest.
    assert!(report.age.p50_ns > 1_900_000 && report.poses_per_s > 50.0, "{report}");
    assert!(report.to_string().contains("position  10.00, 20.00, 30.00 mm"), "{report}");
    Faults::set(&arm.faults.emergency_stop, true);
    let refused = common::told(&probe(&config, Duration::from_millis(100)).unwrap_err());
    assert!(refused.starts_with("the arm cannot be started: ") && refused.contains("emergency stop"), "{refused}");
}

/// An arm driven without a bridge, tick by tick in real time.
fn opened(arm: &HapticMaster, apart: bool) -> driver::HapticMaster {
    let settings = driver::start::StartSettings {
        address: arm.address().to_string(),
        dialect: if apart { driver::Dialect::Apart } else { driver::Dialect::Mixed },
        inertia_kg: 2.0,
        max_force_n: 3.0,
        plane: None,
        homing: Duration::from_secs(2),
        silence: Duration::from_millis(500),
    };
    let started = driver::start::start(&settings, &CancellationToken::new()).unwrap();
    assert_eq!(started.version, "palpate emulator");
    driver::HapticMaster::new(started, &settings, 1e-3).unwrap()
}

/// Answers split into bytes are put together, and poses follow the arm.
#[test]
fn poses_follow_the_arm_though_answers_come_in_pieces() {
    for (split, apart) in [(false, false), (true, false), (true, true)] {
        let emulated = emulator(|settings| {
            let keys = [(0.0, 0.0), (0.3, 0.03)].map(|(time_s, x)| Keyframe { time_s, position_m: DVec3::X * x });
            settings.path = HandPath::new(keys.to_vec(), None).unwrap();
            settings.apart = apart;
        });
        Faults::set(&emulated.faults.split, split);
        let mut arm = opened(&emulated, apart);
        let followed = press::followed(&mut arm, || emulated.position_m(), |_| ());
        let end = arm.read(0).unwrap();
        assert!(end.motion.position_m.distance(emulated.position_m()) < 1e-3, "{:?}", end.motion);
        assert!(emulated.position_m().x > 0.02 && emulated.requests() > 100);
        // It moves at up to 0.2 m/s: some milliseconds.
        followed.assert_near(5e-3);
        assert!(end.measured_force_n.is_some());
    }
}

#[test]
fn no_force_beyond_the_limit_reaches_the_arm_and_none_that_is_not_finite() {
    let emulated = emulator(|_| ());
    let mut arm = opened(&emulated, false);
    let mut apply = |force_n: DVec3| {
        press::hold(&mut arm, force_n);
        emulated.effect_n()
    };
    assert!((apply(DVec3::new(0.0, -1.0, 2.0)) - DVec3::new(0.0, -1.0, 2.0)).length() < 1e-4);
    assert!((apply(DVec3::splat(1e6)).length() - 3.0).abs() < 1e-4);
    assert_eq!(apply(DVec3::new(f64::NAN, 0.0, 0.0)), DVec3::ZERO);
}

#[test]
fn an_arm_that_cannot_be_started_says_why() {
    let settings = |address: String, homing| driver::start::StartSettings {
        address,
        dialect: driver::Dialect::Mixed,
        inertia_kg: 2.0,
        max_force_n: 3.0,
        plane: None,
        homing,
        silence: Duration::from_millis(500),
    };
    let said = |settings| driver::start::start(&settings, &CancellationToken::new()).unwrap_err().to_string();
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    assert!(said(settings(port.to_string(), Duration::ZERO)).starts_with("no HapticMASTER answers at 127.0.0.1"));
    let emulated = emulator(|settings| settings.homing = Some(Duration::from_mins(1)));
    let address = emulated.address().to_string();
    let never = said(settings(address.clone(), Duration::from_millis(150)));
    assert!(never.contains("did not find its home within 0.15 s") && never.contains("\"init\""), "{never}");
    let stop = CancellationToken::new();
    let stopping = std::thread::spawn({
        let stop = stop.clone();
        move || {
            std::thread::sleep(Duration::from_millis(200));
            stop.cancel();
        }
    });
    let stopped = driver::start::start(&settings(address.clone(), Duration::from_mins(1)), &stop).unwrap_err();
    assert_eq!(stopped.to_string(), "its start was stopped");
    stopping.join().unwrap();
    Faults::set(&emulated.faults.emergency_stop, true);
    assert_eq!(said(settings(address.clone(), Duration::ZERO)), "its emergency stop is pressed");
    Faults::set(&emulated.faults.emergency_stop, false);
    Faults::set(&emulated.faults.garbage, true);
    assert!(said(settings(address.clone(), Duration::ZERO)).contains("\"remove all\" is none of a HapticMASTER"));
    Faults::set(&emulated.faults.garbage, false);
    Faults::set(&emulated.faults.silence, true);
    assert_eq!(said(settings(address, Duration::ZERO)), "no answer to \"remove all\" within 2 s");
    let light = emulator(|settings| settings.homing = None);
    let light =
        driver::start::StartSettings { inertia_kg: 1.0, ..settings(light.address().to_string(), Duration::ZERO) };
    assert!(said(light).contains("refused \"set inertia 1\""));
}

/// On an arm that keeps its effects when a connection ends.
#[test]
fn a_start_that_fails_leaves_no_effects() {
    let emulated = emulator(|settings| (settings.effects.kept, settings.effects.planes) = (true, false));
    let settings = driver::start::StartSettings {
        address: emulated.address().to_string(),
        dialect: driver::Dialect::Mixed,
        inertia_kg: 2.0,
        max_force_n: 3.0,
        plane: Some(PlaneSettings { damp_factor: DampFactor::Coefficient }),
        homing: Duration::from_secs(2),
        silence: Duration::from_millis(500),
    };
    let error = driver::start::start(&settings, &CancellationToken::new()).unwrap_err().to_string();
    assert!(error.contains("refused \"create flatplane contact\""), "{error}");
    assert!(!emulated.is_enabled(driver::EFFECT));
    let started =
        driver::start::start(&driver::start::StartSettings { plane: None, ..settings }, &CancellationToken::new());
    assert!(started.is_ok() && emulated.is_enabled(driver::EFFECT));
}
