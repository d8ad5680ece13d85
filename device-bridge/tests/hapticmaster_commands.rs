//! The commands of a plane on a HapticMASTER, against the emulator's plane.
use glam::{DMat3, DVec3};
use palpate_bridge::{
    device::{
        Arm as _, Effort,
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
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

/// Held where it is.
fn emulator(at_m: DVec3) -> HapticMaster {
    let mut settings = Settings { path: HandPath::resting_at(at_m), ..Settings::default() };
    settings.arm.hand_damping_n_s_per_m = 40.0;
    HapticMaster::listen("127.0.0.1:0", settings).unwrap()
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
    let arm = emulator(at_m);
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

fn opened(arm: &HapticMaster) -> driver::HapticMaster {
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
    driver::HapticMaster::new(started, &settings, 1e-3).unwrap()
}

/// The driver alone, in real time, with planes that jump.
#[test]
fn no_force_beyond_the_limit_reaches_the_arm() {
    let arm = emulator(DVec3::ZERO);
    let mut driven = opened(&arm);
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

/// It hears, and answers what is none of its protocol: it is told before anybody takes its driver away.
#[test]
fn an_arm_that_is_lost_is_told_to_let_go_at_once() {
    let arm = emulator(DVec3::ZERO);
    let mut driven = opened(&arm);
    let plane = ContactPlane {
        point_m: DVec3::Z * 2e-3,
        normal: DVec3::Z,
        stiffness_n_per_m: 500.0,
        damping_n_s_per_m: 2.0,
        max_force_n: 3.0,
    };
    let effort = Effort { plane: Some(plane), ..Effort::force(DVec3::new(0.5, 0.0, 1.0)) };
    let until = |what: &str, driven: &mut driver::HapticMaster, done: &dyn Fn(bool) -> bool| {
        let began = Instant::now();
        loop {
            let lost = driven.read(1).is_err();
            driven.apply(&effort);
            if done(lost) {
                return;
            }
            assert!(began.elapsed() < Duration::from_secs(20), "waited in vain until {what}");
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    let has_force = || arm.is_enabled(PLANE) && arm.effect_of_n(EFFECT).length() > 0.4;
    until("it has plane and bias", &mut driven, &|lost| !lost && has_force());
    Faults::set(&arm.faults.garbage, true);
    until("it is lost", &mut driven, &|lost| lost);
    until("it is told", &mut driven, &|_| !arm.is_enabled(PLANE) && arm.effect_of_n(EFFECT) == DVec3::ZERO);
}
