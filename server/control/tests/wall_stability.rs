//! A virtual wall rendered by a sampled loop on a real mass, against the analytic limits, and with the passivity controller.
#![allow(clippy::unwrap_used)] // helpers of tests
use glam::DVec3;
use palpate_control::{ArmSpec, HandPath, PassivityController, PassivitySettings, SimulatedArm, coupling::SampledWall};
use std::f64::consts::PI;

const T_S: f64 = 1e-3;

/// A wall held on both sides, `F = −K x − B (x_k − x_{k−1})/T`, `delay` samples late; ratio of the motion's amplitude at the
/// end to that at the start.
fn growth(spec: ArmSpec, stiffness: f64, damping: f64, delay: usize, ticks: usize) -> f64 {
    let mut arm = SimulatedArm::new(spec, HandPath::resting_at(DVec3::ZERO), T_S).unwrap();
    for _ in 0..3 {
        arm.step(DVec3::X);
    }
    let mut positions_m = vec![arm.motion().position_m.x; delay + 2];
    let mut envelope: Vec<f64> = Vec::with_capacity(ticks);
    for _ in 0..ticks {
        let n = positions_m.len();
        let (x, before) = (positions_m[n - 1 - delay], positions_m[n - 2 - delay]);
        let force_n = -stiffness * x - damping * (x - before) / T_S;
        positions_m.push(arm.step(DVec3::X * force_n).position_m.x);
        envelope.push(arm.motion().position_m.x.abs());
        if envelope.last().is_some_and(|x| *x > 1e6) {
            return f64::INFINITY;
        }
    }
    let amplitude = |range: &[f64]| range.iter().copied().fold(0.0, f64::max);
    amplitude(&envelope[ticks * 9 / 10..]) / amplitude(&envelope[..ticks / 10])
}

fn arm(mass_kg: f64, damping: f64) -> ArmSpec {
    ArmSpec { mass_kg, damping_n_s_per_m: damping, hand_stiffness_n_per_m: 0.0, hand_damping_n_s_per_m: 0.0 }
}

fn wall(b: f64, damping: f64, delay_s: f64) -> SampledWall {
    SampledWall { arm_damping_n_s_per_m: b, wall_damping_n_s_per_m: damping, sample_time_s: T_S, delay_s }
}

#[test]
fn an_undamped_wall_is_stable_below_the_limit_and_unstable_above() {
    // 1 kg: b T/m = 4e-4, so the limit's own approximation is far below the 3 % tried here.
    let limit = wall(0.4, 0.0, 0.0).passive_stiffness_limit_n_per_m().unwrap();
    assert!(growth(arm(1.0, 0.4), 0.97 * limit, 0.0, 0, 400_000) < 0.5);
    assert!(growth(arm(1.0, 0.4), 1.03 * limit, 0.0, 0, 400_000) > 2.0);
}

#[test]
fn a_damped_and_delayed_wall_follows_the_stability_limit() {
    for (damping, delay) in [(0.0, 1), (0.3, 0), (0.3, 1), (0.2, 3)] {
        let limit = wall(0.4, damping, delay as f64 * T_S).stable_stiffness_limit_n_per_m().unwrap();
        let spec = arm(1.0, 0.4);
        assert!(growth(spec, 0.95 * limit, damping, delay, 600_000) < 0.5, "B = {damping}, {delay} samples late");
        assert!(growth(spec, 1.05 * limit, damping, delay, 600_000) > 2.0, "B = {damping}, {delay} samples late");
    }
}

#[test]
fn a_passive_hand_finds_the_damped_walls_passivity_limit() {
    // b > K T/2 + B is worst at the Nyquist frequency. A hand that is a spring (passive) and makes the arm swing there drives
    // a wall unstable that is stable on the arm alone (K < 2 (b + B)/T). Per sample the wall gives 2 (K + 2B/T) A², and a
    // sinusoidal motion of amplitude A loses b π² A²/(2T): unstable from K T/2 + B = (π²/8) b on. The bound itself, without
    // π²/8, is reached by a triangular motion.
    let (b, damping) = (4.0, 2.0);
    let limit = wall(b, damping, 0.0).passive_stiffness_limit_n_per_m().unwrap();
    let alone = wall(b, damping, 0.0).stable_stiffness_limit_n_per_m().unwrap();
    assert_eq!((limit, alone), (4000.0, 12000.0));
    let held = |stiffness: f64, nyquist_fraction: f64| {
        let mass_kg = 0.5;
        let omega = nyquist_fraction * PI / T_S;
        let spec = ArmSpec { hand_stiffness_n_per_m: mass_kg * omega * omega, ..arm(mass_kg, b) };
        growth(spec, stiffness, damping, 0, 20_000)
    };
    let worst = |stiffness: f64| (0..=60).map(|i| held(stiffness, 0.97 + 1e-3 * f64::from(i))).fold(0.0, f64::max);
    assert!(worst(0.97 * limit) < 0.5, "{}", worst(0.97 * limit));
    let sinusoidal = (PI * PI / 8.0 * b - damping) * 2.0 / T_S;
    assert!(worst(0.97 * sinusoidal) < 0.9, "{}", worst(0.97 * sinusoidal));
    assert!(worst(1.05 * sinusoidal) > 2.0, "{}", worst(1.05 * sinusoidal));
    assert!(growth(arm(0.5, b), 1.05 * sinusoidal, damping, 0, 20_000) < 0.5);
}

#[test]
fn the_passivity_controller_tames_a_wall_beyond_the_limit() {
    // Thrown at a one-sided wall three times stiffer than the limit: alone it bounces off with more speed than it came with.
    let spec = arm(0.1, 0.4);
    let stiffness = 3.0 * wall(0.4, 0.0, 0.0).passive_stiffness_limit_n_per_m().unwrap();
    let bounce = |controlled: bool| {
        let mut arm = SimulatedArm::new(spec, HandPath::resting_at(DVec3::X * 1e-3), T_S).unwrap();
        let settings =
            PassivitySettings { max_damping_n_s_per_m: 50.0, max_stored_j: 1.0, ..PassivitySettings::default() };
        let mut controller = PassivityController::new(settings);
        let mut fastest: f64 = 0.0;
        for tick in 0..20_000 {
            let motion = arm.motion();
            let x = motion.position_m.x;
            // A hand pushes towards the wall with 0.2 N for ever: the arm settles, or rattles.
            let wall_n = DVec3::X * (-stiffness * x.min(0.0));
            let step = controller.step(wall_n, motion.position_m, motion.velocity_m_per_s, T_S);
            let rendered_n = if controlled { step.force_n } else { wall_n };
            arm.step(rendered_n - DVec3::X * 0.2);
            if tick > 10_000 {
                fastest = fastest.max(arm.motion().velocity_m_per_s.length());
            }
        }
        fastest
    };
    let (alone, controlled) = (bounce(false), bounce(true));
    assert!(alone > 5.0 * controlled, "without {alone} m/s, with {controlled} m/s");
}
