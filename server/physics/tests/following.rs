//! What is told of how a tool follows its device ([`ContactModel::following`]), against tools that do.
//!
//! [`ContactModel::following`]: palpate_physics::contact::ContactModel::following
#![allow(clippy::unwrap_used)]
use crate::rig;
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

/// Beyond what the coupling gives in contact, too: where nothing is near it is as quick as its steps allow.
#[test]
fn a_tool_moves_no_faster_than_is_told_and_as_fast() {
    for (stiffness, damping, mass) in [(400.0, 0.0, 0.02), (400.0, 2.0, 0.02), (200.0, 1.0, 0.005)] {
        let mut rig = plate(spring(stiffness, damping, mass), 0.1);
        let told = coupled(&rig);
        let mut fastest_m = 0.0_f64;
        for _ in 1..=50 {
            let before_m = rig.state.mechanical.tools[0].centre_m;
            rig.tick_at(DVec3::Z * 50.0);
            fastest_m = fastest_m.max(rig.state.mechanical.tools[0].centre_m.distance(before_m));
            assert!(rig.state.mechanical.tools[0].device_force_n.length() <= told.force_limit_n * (1.0 + 1e-12));
        }
        let part = fastest_m / rig.model.settings().tick_period_s / told.moves_m_per_s;
        assert!((0.99..=1.0 + 1e-9).contains(&part), "{told:?}: {part}");
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
    assert!(told.moves_m_per_s > 1.5 * told.meets_m_per_s, "it would have come faster");
    assert!(found <= told.meets_m_per_s * 1.05, "{found}");
}

#[test]
fn a_rigid_tool_is_as_fast_as_is_told_and_bears_what_is_told() {
    let mut rig = plate(Coupling::Rigid, 0.1);
    let Following::Rigid { slips_at_n, moves_m_per_s } = rig.model.contact().following(0, dt_s(&rig)) else {
        panic!("the tool is rigid")
    };
    let slipped_m = |rig: &Rig| rig.state.mechanical.tools[0].slip_m.length();
    for (part, slips) in [(0.99, false), (1.1, true)] {
        let mut rig = plate(Coupling::Rigid, 0.1);
        let step_m = part * moves_m_per_s * rig.model.settings().tick_period_s;
        for tick in 1..=20 {
            rig.tick_at(DVec3::Z * (0.1 + step_m * f64::from(tick)));
        }
        assert_eq!(slipped_m(&rig) > 0.0, slips, "{part}");
    }
    // Slowly pressed in until it slips, and on.
    let mut most_n = 0.0_f64;
    for tick in 1..=800 {
        rig.tick_at(DVec3::Z * (0.1 - 0.15e-3 * f64::from(tick)));
        most_n = most_n.max(rig.state.mechanical.tools[0].contact_force_n.length());
    }
    assert!(slipped_m(&rig) > 1e-3, "{}", slipped_m(&rig));
    // The body has mass: what it strikes with is beyond the limit for some substeps.
    assert!((0.3..1.2).contains(&(most_n / slips_at_n)), "{most_n} N of {slips_at_n} N");
}
