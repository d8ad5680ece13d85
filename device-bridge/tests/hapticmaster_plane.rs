//! A HapticMASTER that renders the contact's plane by itself: driver, servo and emulator together, and the commands alone.
#![allow(clippy::unwrap_used)]
mod common;

use common::{
    Mock,
    press::{self, PRESSED_N, bridged, pressed_by, pressed_n, simulated, wall},
    start, until,
};
use glam::{DMat3, DVec3};
use palpate_bridge::{
    BridgeError, Config,
    config::{DeviceConfig, HapticMasterConfig, HapticMasterContact},
    device::{
        Arm as _, Effort, Fault,
        hapticmaster::{
            self as driver, EFFECT,
            plane::{DampFactor, PLANE, Plane, PlaneSettings},
        },
    },
    emulate::{
        Faults,
        hapticmaster::{HapticMaster, Settings},
    },
};
use palpate_control::{ContactPlane, HandPath, LocalModel, RenderSettings};
use std::{
    sync::atomic::Ordering,
    time::{Duration, Instant},
};
use tokio_util::sync::CancellationToken;

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
    let (expected_n, _) = pressed_n(FLICKER_N, simulated()).await;
    for (headers, quoted, apart) in [(true, false, false), (false, true, false), (true, true, true)] {
        let arm = emulator(|settings| (settings.headers, settings.quoted, settings.apart) = (headers, quoted, apart));
        let keys = HapticMasterConfig { apart, ..keys(&arm, HapticMasterContact::Plane) };
        let (found_n, summary) = pressed_n(FLICKER_N, DeviceConfig::Hapticmaster(keys)).await;
        assert!((found_n / expected_n - 1.0).abs() < 0.05, "{found_n} N, {expected_n} N: {headers} {quoted} {apart}");
        assert!(summary.peak_force_n < 1.2 * expected_n, "{summary}");
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
                behaviour.local_model = Some(palpate_proto::v1::LocalContactModel { force_n: Some(along), ..wall() })
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
    let arm = emulator(|settings| settings.keeps_effects = true);
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
    let arm = emulator(|settings| settings.keeps_effects = keeps_effects);
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

/// Numbers that come to no end and repeat themselves.
struct Numbers(u64);

impl Numbers {
    /// From −1 to 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// An arm that rests, and is told commands without a connection.
fn resting() -> (HapticMaster, DVec3) {
    let at_m = DVec3::new(0.05, -0.1, 0.2);
    let arm = emulator(|settings| settings.path = HandPath::resting_at(at_m));
    for text in
        ["create biasforce palpate", "set palpate enable", "create flatplane contact", "set contact no_pull true"]
    {
        assert!(!arm.obey(text).contains("ERROR"), "{text}");
    }
    (arm, at_m)
}

fn tell(arm: &HapticMaster, plane: &mut Plane, effort: &Effort, at_m: DVec3, most: usize) -> DVec3 {
    let mut text = Vec::new();
    let (count, bias_n) = plane.compose(effort.plane.as_ref(), effort.force_n, (at_m, DVec3::ZERO), &mut text, most);
    assert!(text.len() <= most, "{} bytes of {most}", text.len());
    let text = String::from_utf8(text).unwrap();
    assert_eq!(text.split(';').filter(|command| !command.is_empty()).count(), count, "{text}");
    for command in text.split(';').filter(|command| !command.is_empty()) {
        assert!(!arm.obey(command).contains("ERROR"), "{command}");
    }
    let bias = format!("set palpate force [{:.5},{:.5},{:.5}]", bias_n.x, bias_n.y, bias_n.z);
    assert!(!arm.obey(&bias).contains("ERROR"), "{bias}");
    bias_n
}

/// The emulator's plane is the oracle of the commands: its force is the local model's along the normal, at many places.
#[test]
fn the_arms_plane_gives_the_models_normal_force() {
    let (arm, at_m) = resting();
    let damp_factor = DampFactor::Ratio { inertia_kg: 2.0 };
    let mut plane = Plane::new(PlaneSettings { damp_factor });
    let settings =
        RenderSettings { hold_s: 0.02, forget_s: 0.1, damping_n_s_per_m: 2.0, max_stiffness_n_per_m: 2000.0 };
    let (mut numbers, mut pushed) = (Numbers(7), 0);
    for _ in 0..300 {
        let normal = numbers.vector().normalize();
        let skew = DMat3::from_cols(numbers.vector(), numbers.vector(), numbers.vector()) * 50.0;
        let outer = DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
        let model = LocalModel {
            point_m: at_m + 2e-3 * numbers.vector(),
            normal,
            force_n: numbers.vector(),
            stiffness_n_per_m: outer * (-600.0 + 400.0 * numbers.next()) + skew + skew.transpose(),
            validity_radius_m: 5e-3,
            max_force_n: 3.0,
        };
        let model = model.accept().unwrap();
        let rendered_n = model.render(at_m, DVec3::ZERO, 0.03, &settings).force_n;
        let effort = Effort { plane: ContactPlane::of(&model, at_m, 0.03, &settings), ..Effort::force(rendered_n) };
        for _ in 0..3 {
            tell(&arm, &mut plane, &effort, at_m, 136);
        }
        let (given_n, expected_n) = (arm.effect_of_n(PLANE), rendered_n.dot(normal) * normal);
        // A micrometre, times some hundred newtons a metre.
        let saturates = rendered_n.length() > 2.5;
        assert!(saturates || (given_n - expected_n).length() < 3e-3, "{given_n} N, {expected_n} N");
        assert!((given_n + arm.effect_of_n(EFFECT) - rendered_n).length() < 2e-3, "plane and bias are all of it");
        pushed += u32::from(given_n.length() > 0.05);
    }
    assert!(pushed > 100, "{pushed}");
}

/// Planes and forces that jump with every request, in as little room as there is: what is on the arm is the commanded force, and within the limit wherever the arm goes meanwhile.
#[test]
fn jumps_leave_no_wrong_force_and_none_beyond_the_limit() {
    for damp_factor in [DampFactor::Ratio { inertia_kg: 2.0 }, DampFactor::Coefficient] {
        let (arm, at_m) = resting();
        let mut plane = Plane::new(PlaneSettings { damp_factor });
        let mut numbers = Numbers(1);
        let mut enabled = 0;
        let mut wanted = None;
        for request in 0..4000 {
            let limit_n = 1.6 + 1.4 * numbers.next();
            if request % 5 == 0 {
                wanted = (request % 7 != 0).then_some(ContactPlane {
                    point_m: at_m + 5e-3 * numbers.vector(),
                    normal: numbers.vector().normalize(),
                    stiffness_n_per_m: 2001.0 + 2000.0 * numbers.next(),
                    damping_n_s_per_m: 1.0 + numbers.next(),
                    max_force_n: limit_n,
                });
            }
            let plane_wanted = wanted.map(|wanted| ContactPlane { max_force_n: limit_n, ..wanted });
            let force_n = (10.0 * numbers.vector()).clamp_length_max(limit_n);
            let effort = Effort { plane: plane_wanted, ..Effort::force(force_n) };
            let bias_n = tell(&arm, &mut plane, &effort, at_m, [99 + 37, 125 + 37][request % 2]);
            let total_n = arm.effect_of_n(PLANE) + arm.effect_of_n(EFFECT);
            assert!(
                (total_n - effort.force_n).length() < 2e-3 * 3.0 || bias_n.length() > 0.999 * limit_n,
                "{total_n} N"
            );
            assert!(total_n.length() < limit_n + 2e-3, "{total_n} N of {limit_n} N");
            if arm.is_enabled(PLANE) {
                enabled += 1;
                // Wherever it goes: from no force of the plane to its largest.
                let largest_n = plane.largest_n();
                assert!(
                    (bias_n + largest_n * plane.normal()).length() < limit_n + 2e-3,
                    "{bias_n} N and {largest_n} N"
                );
            }
            assert!(wanted.is_some() || !arm.is_enabled(PLANE));
        }
        assert!(enabled > 500, "{enabled}");
    }
}

/// The driver alone, in real time, with planes that jump.
#[test]
fn no_force_beyond_the_limit_reaches_the_arm() {
    let arm = emulator(|settings| settings.path = HandPath::resting_at(DVec3::ZERO));
    let settings = driver::start::StartSettings {
        address: arm.address().to_string(),
        dialect: driver::Dialect::Mixed,
        inertia_kg: 2.0,
        max_force_n: 3.0,
        plane: Some(PlaneSettings { damp_factor: DampFactor::Ratio { inertia_kg: 2.0 } }),
        homing: Duration::from_secs(2),
        silence: Duration::from_secs(2),
    };
    let started = driver::start::start(&settings, &CancellationToken::new()).unwrap();
    let mut driven = driver::HapticMaster::new(started, &settings, 1e-3).unwrap();
    let mut numbers = Numbers(3);
    let mut effort = Effort::NONE;
    for tick in 0..800 {
        let reading = driven.read(1).unwrap();
        if tick % 20 == 0 {
            let normal = numbers.vector().normalize();
            let plane = ContactPlane {
                point_m: reading.motion.position_m + normal * 2e-3,
                normal,
                stiffness_n_per_m: 3000.0,
                damping_n_s_per_m: 2.0,
                max_force_n: 100.0,
            };
            effort = Effort { plane: Some(plane), ..Effort::force(normal * 20.0 + numbers.vector() * 5.0) };
        }
        if tick % 130 == 129 {
            effort.plane = Some(ContactPlane { point_m: DVec3::NAN, ..effort.plane.unwrap() });
        }
        driven.apply(&effort);
        std::thread::sleep(Duration::from_millis(1));
    }
    let peak_n = arm.peak_n();
    assert!((2.5..3.001).contains(&peak_n), "{peak_n} N");
    let words = driven.last_words().unwrap().bytes;
    let words = String::from_utf8_lossy(&words);
    assert!(words.contains("set palpate force [0,0,0]") && words.contains("set contact disable"), "{words}");
    drop(driven);
    assert!(!arm.is_enabled(PLANE) && arm.effect_n() == DVec3::ZERO);
}

/// A bridge's press with the damping told in either way.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn damping_is_told_as_a_share_or_as_it_is() {
    for ratio in [true, false] {
        let arm = emulator(|settings| settings.damping_is_ratio = ratio);
        let keys = HapticMasterConfig { damping_is_ratio: ratio, ..keys(&arm, HapticMasterContact::Plane) };
        let damped = |config: &mut Config| config.render.damping_n_s_per_m = 5.0;
        let (found_n, _) = pressed_by(FLICKER_N, DeviceConfig::Hapticmaster(keys), damped).await;
        assert!((found_n / PRESSED_N - 1.0).abs() < 0.05, "{found_n} N");
    }
}
