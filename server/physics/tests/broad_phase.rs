//! Skipping what a tool cannot touch changes no bit.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{ModelSpec, State, contact::Coupling, material::Law, snapshot};
use rig::{Drive, Rig, at, body, bricks, even, material, sphere};

/// A block that falls freely past two tools, is hit by one and swept by the other.
fn falling_block() -> ModelSpec {
    let side = even(-0.02, 0.02, 5);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 3));
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.gravity_m_per_s2 = DVec3::new(0.0, 0.5, -9.81);
    let coupled = Coupling::Spring { stiffness_n_per_m: 300.0, damping_n_s_per_m: 2.0, mass_kg: 0.01 };
    spec.tools = vec![
        sphere(0.004, DVec3::new(0.0, 0.0, -0.05), Coupling::Rigid),
        sphere(0.006, DVec3::new(0.05, 0.0, -0.01), coupled),
    ];
    for tool in &mut spec.tools {
        tool.friction_coefficient = 0.3;
    }
    spec
}

fn devices(tick: u32) -> Vec<palpate_physics::contact::ToolTarget> {
    let t = f64::from(tick) * 1e-3;
    vec![
        at(DVec3::new(0.01 * (40.0 * t).sin(), 0.0, -0.05)),
        at(DVec3::new(0.05 - 0.6 * t, 0.004, -0.01 - 4.0 * t * t)),
    ]
}

fn run(exhaustive: bool, forget_at: Option<u32>) -> (State, u32) {
    let mut spec = falling_block();
    spec.settings.skips.distant_contact = !exhaustive;
    let mut rig = Rig::new(spec);
    let mut touched = 0;
    for tick in 0..250 {
        if forget_at.is_some_and(|every| tick % every == 0) {
            rig.state = rig.state.clone();
            let bytes = snapshot::save(&rig.model, &rig.state);
            rig.state = snapshot::restore(&rig.model, &bytes).unwrap();
        }
        let drive = Drive { tools: devices(tick), ..rig.still() };
        rig.tick(&drive);
        touched += u32::from(rig.state.mechanical.tools.iter().any(|tool| tool.contacts > 0));
    }
    (rig.state, touched)
}

#[test]
fn with_and_without_the_broad_phase_the_bits_are_the_same() {
    let (skipping, touched) = run(false, None);
    let (exhaustive, _) = run(true, None);
    assert!(touched > 20 && touched < 230, "the run must touch and let go: {touched}");
    assert_eq!(snapshot::state_hash(&skipping), snapshot::state_hash(&exhaustive));
    assert_eq!(skipping, exhaustive);
}

/// A tool on a spring that flies straight at a body at rest: no motion of the body makes the bound on distances generous.
#[test]
fn a_straight_approach_is_noticed_in_the_same_substep() {
    let run = |exhaustive: bool, height_m: f64| {
        let mut spec = falling_block();
        spec.gravity_m_per_s2 = DVec3::ZERO;
        spec.tools.truncate(1);
        spec.tools[0].coupling = Coupling::Spring { stiffness_n_per_m: 300.0, damping_n_s_per_m: 2.0, mass_kg: 0.01 };
        let place = |t: f64| DVec3::new(0.001, 0.002, height_m - t);
        spec.tools[0].start_position_m = place(0.0);
        spec.settings.skips.distant_contact = !exhaustive;
        let mut rig = Rig::new(spec);
        let mut touched = 0;
        for tick in 0..60 {
            let device = palpate_physics::contact::ToolTarget {
                velocity_m_per_s: DVec3::NEG_Z,
                ..at(place(f64::from(tick + 1) * 1e-3))
            };
            rig.tick(&Drive { tools: vec![device], ..rig.still() });
            touched += u32::from(rig.state.mechanical.tools[0].contacts > 0);
        }
        assert!(touched > 3, "{touched}");
        rig.state
    };
    for step in 0..8 {
        let height_m = 0.03 + 1.7e-4 * f64::from(step);
        assert_eq!(run(false, height_m), run(true, height_m), "{height_m}");
    }
}

#[test]
fn two_runs_give_the_same_bits() {
    assert_eq!(run(false, None).0, run(false, None).0);
}

#[test]
fn a_restored_state_continues_bit_for_bit() {
    assert_eq!(run(false, None).0, run(false, Some(7)).0);
}

#[test]
fn a_used_scratch_carries_nothing_over() {
    let mut rig = Rig::new(falling_block());
    let early = rig.state.clone();
    let mut once = early.clone();
    for round in 0..2 {
        rig.state = early.clone();
        for tick in 0..120 {
            let drive = Drive { tools: devices(tick), ..rig.still() };
            rig.tick(&drive);
        }
        if round == 0 {
            once = rig.state.clone();
        }
    }
    assert_eq!(once, rig.state);
}
