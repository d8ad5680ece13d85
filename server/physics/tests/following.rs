//! What is told of how a tool follows its device ([`ContactModel::following`]), against tools that do.
//!
//! [`ContactModel::following`]: palpate_physics::contact::ContactModel::following
#![allow(clippy::unwrap_used)]
mod rig;
use glam::DVec3;
use palpate_physics::{
    ModelSpec,
    contact::{CoupledFollowing, Coupling, Following},
    material::Law,
};
use rig::{Rig, body, bricks, even, hold, material, nodes_where, sphere};

const RADIUS_M: f64 = 0.005;

/// A plate of 60 × 60 × 20 mm held at its rim, its top at z = 0, and a sphere at a height (m).
fn plate(coupling: Coupling, height_m: f64) -> Rig {
    let side = even(-0.03, 0.03, 6);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 2));
    let rim = nodes_where(&mesh, |p| p.x.abs().max(p.y.abs()) > 0.0299);
    let mut spec: ModelSpec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.prescribed = vec![hold("rim", rim, [true; 3])];
    spec.tools = vec![sphere(RADIUS_M, DVec3::Z * height_m, coupling)];
    Rig::new(spec)
}

fn spring(stiffness_n_per_m: f64, damping_n_s_per_m: f64, mass_kg: f64) -> Coupling {
    Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg }
}

fn dt_s(rig: &Rig) -> f64 {
    rig.model.settings().tick_period_s / f64::from(rig.model.substeps())
}

fn coupled(rig: &Rig) -> CoupledFollowing {
    match rig.model.contact().following(0, dt_s(rig)) {
        Following::Coupled(following) => following,
        Following::Rigid { .. } => panic!("the tool is on a spring"),
    }
}

/// The largest force (N) on the device while it goes at a speed (m/s) from where the tool waits, away from the body.
fn most_n(coupling: Coupling, speed_of: impl Fn(&CoupledFollowing) -> f64) -> (f64, CoupledFollowing) {
    let mut rig = plate(coupling, 0.1);
    let told = coupled(&rig);
    let step_m = speed_of(&told) * rig.model.settings().tick_period_s;
    let mut most_n = 0.0_f64;
    for tick in 1..=200 {
        rig.tick_at(DVec3::Z * (0.1 + step_m * f64::from(tick)));
        most_n = most_n.max(rig.state.mechanical.tools[0].device_force_n.length());
    }
    (most_n, told)
}

#[test]
fn a_device_that_sets_off_as_fast_as_is_told_is_followed_within_the_limit() {
    for (stiffness, damping, mass) in [
        (400.0, 0.0, 0.02),
        (400.0, 2.0, 0.02),
        (400.0, 20.0, 0.02),
        (800.0, 3.0, 0.02),
        (200.0, 20.0, 0.05),
        (3000.0, 1.0, 0.005),
    ] {
        let (slower_n, told) = most_n(spring(stiffness, damping, mass), |told| 0.95 * told.sets_off_m_per_s);
        println!("{told:?}: {slower_n:.3} N");
        assert!(slower_n < 0.999 * told.force_limit_n, "{stiffness} {damping} {mass}: {slower_n} N");
        // It is a bound that is reached with little damping; the force is a mean over a tick, too long for quick couplings.
        let (faster_n, _) = most_n(spring(stiffness, damping, mass), |told| 1.6 * told.sets_off_m_per_s);
        if damping * damping < 0.5 * stiffness * mass && stiffness / mass < 5e4 {
            assert!(faster_n > 0.99 * told.force_limit_n, "{stiffness} {damping} {mass}: {faster_n} N");
        }
    }
}

#[test]
fn a_tool_gains_speed_and_moves_no_faster_than_is_told_and_as_fast() {
    // A damper would hold it against a device that stands.
    let mut rig = plate(spring(400.0, 0.0, 0.02), 0.1);
    let told = coupled(&rig);
    let mut fastest_m_per_s = 0.0_f64;
    for tick in 1..=800 {
        rig.tick_at(DVec3::Z * 50.0);
        let speed_m_per_s = rig.state.mechanical.tools[0].velocity_m_per_s.length();
        fastest_m_per_s = fastest_m_per_s.max(speed_m_per_s);
        let most_m_per_s = told.gains_m_per_s2 * 1e-3 * f64::from(tick);
        assert!(speed_m_per_s <= most_m_per_s * (1.0 + 1e-9), "tick {tick}: {speed_m_per_s} of {most_m_per_s}");
        // The device takes a tick to leave.
        let least_m_per_s = 0.99 * (most_m_per_s - told.gains_m_per_s2 * 1e-3);
        if most_m_per_s < 0.99 * told.moves_m_per_s {
            assert!(speed_m_per_s >= least_m_per_s, "tick {tick}: {speed_m_per_s} of {most_m_per_s}");
        }
    }
    println!("{told:?}, fastest {fastest_m_per_s}");
    // Half a kick comes after the limit.
    let kick_m_per_s = told.gains_m_per_s2 * dt_s(&rig);
    assert!((fastest_m_per_s - told.moves_m_per_s).abs() <= kick_m_per_s, "{fastest_m_per_s}");
}

/// A device that leaps and stands: the saturated spring pulls against the damper.
#[test]
fn a_tool_comes_back_to_a_device_that_stands_as_fast_as_is_told() {
    for (stiffness, damping, mass) in [(400.0, 2.0, 0.02), (800.0, 3.0, 0.02), (200.0, 1.0, 0.005)] {
        let mut rig = plate(spring(stiffness, damping, mass), 0.1);
        let told = coupled(&rig);
        for _ in 0..300 {
            rig.tick_at(DVec3::Z * 0.4);
        }
        let tool = &rig.state.mechanical.tools[0];
        assert!(tool.centre_m.z < 0.4 - 2.0 * told.stretch_limit_m, "{} is still far away", tool.centre_m);
        let speed_m_per_s = tool.velocity_m_per_s.length();
        println!("{told:?}: {speed_m_per_s}");
        // The damper is limited together with the spring, kick by kick: a little less is left of it.
        let part = speed_m_per_s / told.comes_back_m_per_s;
        assert!((0.97..=1.0 + 1e-9).contains(&part), "{stiffness} {damping}: {speed_m_per_s}");
    }
}

#[test]
fn a_tool_meets_the_surface_no_faster_than_is_told() {
    let mut rig = plate(spring(3000.0, 0.0, 0.05), 0.05);
    let told = coupled(&rig);
    let mut at_contact_m_per_s = None;
    for _ in 0..2000 {
        rig.tick_at(DVec3::NEG_Z * 1.0);
        let tool = &rig.state.mechanical.tools[0];
        if tool.contacts > 0 {
            at_contact_m_per_s = Some(tool.velocity_m_per_s.length());
            break;
        }
    }
    let found = at_contact_m_per_s.unwrap();
    println!("{told:?}, met at {found}");
    // It would have come at the speed of 45 mm of fall otherwise.
    assert!((2.0 * told.gains_m_per_s2 * 0.045).sqrt() > 1.5 * told.meets_m_per_s);
    assert!(found <= told.meets_m_per_s * 1.05, "{found}");
}

#[test]
fn a_rigid_tool_that_is_slower_than_is_told_is_felt_wherever_its_substeps_end() {
    let least_n = |part: f64| {
        let of_phase = |phase: u32| {
            let mut rig = plate(Coupling::Rigid, 0.1 + 1e-3 * f64::from(phase));
            let Following::Rigid { leaps_above_m_per_s } = rig.model.contact().following(0, dt_s(&rig)) else {
                panic!("the tool is rigid")
            };
            let step_m = part * leaps_above_m_per_s * rig.model.settings().tick_period_s;
            let mut most_n = 0.0_f64;
            for tick in 1..=(0.2 / step_m).ceil() as u32 {
                let height_m = 0.1 + 1e-3 * f64::from(phase) - step_m * f64::from(tick);
                rig.tick_at(DVec3::new(0.0, 0.0, height_m.max(-0.1)));
                most_n = most_n.max(rig.state.mechanical.tools[0].contact_force_n.length());
            }
            most_n
        };
        (0..10).map(of_phase).fold(f64::INFINITY, f64::min)
    };
    let (slow_n, quick_n) = (least_n(0.8), least_n(5.0));
    println!("least force at 0.8 of that speed {slow_n} N, at 5 times {quick_n} N");
    assert!(slow_n > 1e-3, "{slow_n}");
}
