//! A HapticMASTER that renders the contact's plane by itself: driver, servo and emulator together.

use crate::common;
use crate::common::{
    Mock,
    press::{self, PRESSED_N, bridged, pressed, pressed_by, simulated, wall},
    start, until,
};
use glam::DVec3;
use palpate_bridge::{
    BridgeError, Config,
    config::{DeviceConfig, HapticMasterConfig, HapticMasterContact},
    device::{
        Fault,
        hapticmaster::{EFFECT, plane::PLANE},
    },
    emulate::{
        Faults,
        hapticmaster::{HapticMaster, Settings},
    },
};
use std::{
    sync::atomic::Ordering,
    time::{Duration, Instant},
};

const FLICKER_N: f64 = 2e-4;

fn emulator(change: impl FnOnce(&mut Settings)) -> HapticMaster {
    let mut settings = Settings { path: press::path(), ..Settings::default() };
    settings.arm.hand_damping_n_s_per_m = 40.0;
    change(&mut settings);
    HapticMaster::listen("127.0.0.1:0", settings).unwrap()
}

fn keys(emulator: &HapticMaster, contact: HapticMasterContact) -> HapticMasterConfig {
    // Patient with a busy test machine.
    let (address, silence_s) = (emulator.address().to_string(), 0.5);
    HapticMasterConfig { address, contact, silence_s, ..HapticMasterConfig::default() }
}

fn by_plane(emulator: &HapticMaster) -> DeviceConfig {
    DeviceConfig::Hapticmaster(keys(emulator, HapticMasterContact::Plane))
}

/// The same press to the same force as the bridge's own rendering, in every dialect.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_ends_at_the_force_of_the_simulated_arm() {
    let expected_n = pressed(FLICKER_N, simulated()).await.force_n;
    for (headers, quoted, apart) in [(true, false, false), (false, true, false), (true, true, true)] {
        let arm = emulator(|settings| (settings.headers, settings.quoted, settings.apart) = (headers, quoted, apart));
        let keys = HapticMasterConfig { apart, ..keys(&arm, HapticMasterContact::Plane) };
        let pressed = pressed(FLICKER_N, DeviceConfig::Hapticmaster(keys)).await;
        let found_n = pressed.force_n;
        assert!((found_n / expected_n - 1.0).abs() < 0.05, "{found_n} N, {expected_n} N: {headers} {quoted} {apart}");
        pressed.assert_peak_below(1.2, expected_n);
        assert!(arm.peak_n() > 0.9 * expected_n && arm.effect_n() == DVec3::ZERO, "both are gone when the bridge ends");
    }
}

/// A bridge at rest on the wall, whose plane the arm has: what is done then, and how it ends.
async fn pressing(
    arm: &HapticMaster,
    change: impl FnOnce(&mut Config),
    look: impl AsyncFnOnce(&common::Running, &Mock),
) -> common::Running {
    let mock = Mock::default();
    mock.set(|behaviour| behaviour.local_model = Some(wall()));
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let mut config = bridged(&format!("http://{address}"), by_plane(arm));
    change(&mut config);
    let bridge = start(config);
    let stats = bridge.handle.stats();
    until("it presses", || {
        arm.is_enabled(PLANE) && (arm.effect_n().length() / PRESSED_N - 1.0).abs() < 0.03 && stats.force_n() > 0.5
    })
    .await;
    look(&bridge, &mock).await;
    bridge
}

/// In steady contact the plane gives the force, the bias nothing, and both are what the servo limits.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn plane_and_bias_are_the_servos_force() {
    let arm = emulator(|_| ());
    let bridge = pressing(
        &arm,
        |_| (),
        async |bridge, mock| {
            let stats = bridge.handle.stats();
            let (mut plane_n, mut bias_n) = (DVec3::ZERO, DVec3::ZERO);
            until("it rests", || {
                (plane_n, bias_n) = (arm.effect_of_n(PLANE), arm.effect_of_n(EFFECT));
                (plane_n.length() - stats.force_n()).abs() < 2e-3 && (plane_n.length() / PRESSED_N - 1.0).abs() < 0.01
            })
            .await;
            assert!(bias_n.length() < 0.02, "{plane_n} N and {bias_n} N");
            // Along the surface the plane is nothing: that is the bias force's.
            let along = palpate_proto::v1::Vec3 { x: 0.3, y: 0.0, z: 0.0 };
            mock.set(|behaviour| {
                behaviour.local_model = Some(palpate_proto::v1::LocalContactModel { force_n: Some(along), ..wall() });
            });
            // The arm's y is the world's x.
            until("the bias force has it", || (arm.effect_of_n(EFFECT) - DVec3::Y * 0.3).length() < 0.02).await;
            assert!((arm.effect_of_n(PLANE).length() / PRESSED_N - 1.0).abs() < 0.03);
        },
    )
    .await;
    bridge.stop().await;
    assert!(!arm.is_enabled(PLANE));
}

/// No contact, no answer of the daemon, a stop: in each the plane is disabled, and not only told of no force.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_a_contact_there_is_no_plane() {
    let arm = emulator(|settings| settings.effects.kept = true);
    let bridge = pressing(
        &arm,
        |config| config.servo.auto_recover = true,
        async |_, mock| {
            mock.set(|behaviour| behaviour.local_model = None);
            // The daemon's own force then.
            until("the plane is off", || !arm.is_enabled(PLANE) && (arm.effect_n() - DVec3::Z).length() < 0.02).await;
            mock.set(|behaviour| behaviour.local_model = Some(wall()));
            until("the plane is on", || arm.is_enabled(PLANE) && arm.effect_of_n(PLANE).length() > 0.5).await;
            mock.set(|behaviour| behaviour.silent = true);
            until("the force is off", || !arm.is_enabled(PLANE) && arm.effect_of_n(EFFECT) == DVec3::ZERO).await;
            mock.set(|behaviour| behaviour.silent = false);
            until("the plane is on again", || arm.is_enabled(PLANE) && arm.effect_of_n(PLANE).length() > 0.5).await;
        },
    )
    .await;
    bridge.stop().await;
    assert!(!arm.is_enabled(PLANE) && arm.effect_of_n(EFFECT) == DVec3::ZERO, "also where the arm keeps effects");
}

/// The fault it ended by. Where the arm still hears it keeps its effects, so that only being told takes their force away.
async fn lost_by(keeps_effects: bool, fault: impl FnOnce(&Faults)) -> Fault {
    let arm = emulator(|settings| settings.effects.kept = keeps_effects);
    let bridge = pressing(&arm, |_| (), async |_, _| fault(&arm.faults)).await;
    let error = tokio::time::timeout(Duration::from_secs(20), bridge.task).await.unwrap().unwrap().unwrap_err();
    until("the arm was told", || !arm.is_enabled(PLANE) && arm.effect_of_n(EFFECT) == DVec3::ZERO).await;
    assert_eq!(bridge.handle.stats().force_n(), 0.0);
    match error {
        BridgeError::DeviceLost { fault } => fault,
        other => panic!("{other}"),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_takes_plane_and_bias_away_and_is_named() {
    assert_eq!(lost_by(true, |faults| Faults::set(&faults.silence, true)).await, Fault::Silent);
    assert_eq!(lost_by(true, |faults| Faults::set(&faults.garbage, true)).await, Fault::Garbled);
    assert_eq!(lost_by(true, |faults| Faults::set(&faults.emergency_stop, true)).await, Fault::EmergencyStop);
    // It hears nothing while it is slow, and the connection is over when it answers.
    assert_eq!(lost_by(false, |faults| faults.slow_us.store(900_000, Ordering::Relaxed)).await, Fault::Silent);
    assert_eq!(lost_by(false, |faults| Faults::set(&faults.refusal, true)).await, Fault::Refused);
    assert_eq!(lost_by(false, |faults| Faults::set(&faults.cut, true)).await, Fault::Disconnected);
}

/// Answers that take 20 ms make the bridge's own rendering soft; the arm's own is as stiff as before.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn late_answers_soften_no_wall_that_the_arm_renders() {
    const WALL_N_PER_M: f64 = 3000.0;
    let mut ends_n = [0.0; 2];
    for (end_n, contact) in ends_n.iter_mut().zip([HapticMasterContact::Bias, HapticMasterContact::Plane]) {
        let arm = emulator(|_| ());
        arm.faults.slow_us.store(20_000, Ordering::Relaxed);
        let mock_wall = palpate_proto::v1::LocalContactModel {
            stiffness_n_per_m: Some(palpate_proto::v1::Mat3 {
                column_major: vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -WALL_N_PER_M],
            }),
            ..wall()
        };
        let mock = Mock::default();
        mock.set(|behaviour| behaviour.local_model = Some(mock_wall));
        let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
        let mut config = bridged(&format!("http://{address}"), DeviceConfig::Hapticmaster(keys(&arm, contact)));
        config.passivity.strict = true;
        // The arm's own friction.
        config.render.arm_damping_n_s_per_m = 8.0;
        let bridge = start(config);
        until("it presses", || arm.effect_n().length() > 0.5).await;
        let (mut last, began) = (Vec::new(), Instant::now());
        until("it rests", || {
            last.push(arm.effect_n().length());
            let newest = &last[last.len().saturating_sub(250)..];
            let (least, most) = newest.iter().fold((f64::MAX, 0.0_f64), |(a, b), &n| (a.min(n), b.max(n)));
            began.elapsed() > Duration::from_secs(2) && most - least < 0.02
        })
        .await;
        *end_n = arm.effect_n().length();
        bridge.stop().await;
    }
    let [bias_n, plane_n] = ends_n;
    println!("{WALL_N_PER_M} N/m, answers after 20 ms: {bias_n} N by bias, {plane_n} N by plane");
    // Hand and wall as springs in series.
    let expected_n = WALL_N_PER_M * 300.0 * 5e-3 / (WALL_N_PER_M + 300.0);
    assert!((plane_n / expected_n - 1.0).abs() < 0.03, "{plane_n} N of {expected_n} N");
    assert!(bias_n < 0.8 * expected_n, "{bias_n} N of {expected_n} N");
}

/// A bridge's press with the damping told in either way.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn damping_is_told_as_a_share_or_as_it_is() {
    for ratio in [true, false] {
        let arm = emulator(|settings| settings.effects.damping_is_ratio = ratio);
        let keys = HapticMasterConfig { damping_is_ratio: ratio, ..keys(&arm, HapticMasterContact::Plane) };
        let damped = |config: &mut Config| config.render.damping_n_s_per_m = 5.0;
        let found_n = pressed_by(FLICKER_N, Duration::ZERO, DeviceConfig::Hapticmaster(keys), damped).await.force_n;
        assert!((found_n / PRESSED_N - 1.0).abs() < 0.05, "{found_n} N");
    }
}
