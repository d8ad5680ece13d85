//! Coulomb friction of a tool on a body.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{ModelSpec, contact::Coupling, material::Law};
use rig::{Rig, body, bricks, even, hold, material, nodes_where, solid_mut, sphere};

const RADIUS_M: f64 = 0.02;
const DEPTH_M: f64 = 0.0005;

/// A stiff slab (1 MPa), held below, so that the contact is small and flat: a/R = 0.16.
fn slab(friction: f64, coupling: Coupling) -> ModelSpec {
    let side = even(-0.02, 0.02, 16);
    let mesh = bricks(&side, &side, &even(-0.01, 0.0, 4));
    let bottom = nodes_where(&mesh, |p| p.z < -0.0099);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 1e6, 0.3));
    solid_mut(&mut spec).regions[0].density_kg_per_m3 = 1e5;
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    spec.settings.mass_damping_per_s = 300.0;
    spec.tools = vec![sphere(RADIUS_M, DVec3::new(-0.004, 0.0, RADIUS_M), coupling)];
    spec.tools[0].friction_coefficient = friction;
    spec
}

/// Presses, then drags along x by `distance_m`; returns the forces on the tool while dragging.
fn drag(rig: &mut Rig, distance_m: f64, ticks: u32) -> Vec<DVec3> {
    let start = DVec3::new(-0.004, 0.0, RADIUS_M);
    for tick in 1..=60 {
        rig.tick_at(start - DVec3::Z * DEPTH_M * (f64::from(tick) / 30.0).min(1.0));
    }
    drag_from_rest(rig, distance_m, ticks)
}

fn drag_from_rest(rig: &mut Rig, distance_m: f64, ticks: u32) -> Vec<DVec3> {
    let start = DVec3::new(-0.004, 0.0, RADIUS_M);
    (1..=ticks)
        .map(|tick| {
            rig.tick_at(start + DVec3::new(distance_m * f64::from(tick) / f64::from(ticks), 0.0, -DEPTH_M));
            rig.state.mechanical.tools[0].contact_force_n
        })
        .collect()
}

#[test]
fn it_sticks_below_the_cone() {
    let mu = 0.5;
    let mut rig = Rig::new(slab(mu, Coupling::Rigid));
    // Pressing alone leaves a little of it: neither mesh nor place is symmetric.
    let still = drag(&mut rig, 0.0, 100)[99];
    let last = drag_from_rest(&mut rig, 5e-5, 40)[39];
    let heat = rig.state.mechanical.tools[0].friction_heat_j;
    println!("stick: {last} from {still}, heat {heat:.1e} J");
    // Only the rim of the contact slips, where the pressure fades (Cattaneo, Mindlin).
    assert!(heat < 0.1 * 0.5 * last.x.abs() * 5e-5, "{heat}");
    assert!(last.x < 0.0, "friction opposes the motion: {last}");
    assert!(last.x.abs() < 0.7 * mu * last.z && last.x.abs() > 0.1 * mu * last.z);
    // Going back gives it back: an elastic spring, but for the rim.
    for tick in 1..=100 {
        let back = 5e-5 * (1.0 - f64::from(tick.min(40)) / 40.0);
        rig.tick_at(DVec3::new(-0.004 + back, 0.0, RADIUS_M - DEPTH_M));
    }
    let rest = rig.state.mechanical.tools[0].contact_force_n;
    println!("back: {rest}");
    assert!((rest.x - still.x).abs() < 0.1 * (last.x - still.x).abs(), "{rest} after {last}, {still} before");
}

#[test]
fn it_slides_at_the_cone() {
    for mu in [0.1, 0.3] {
        let mut rig = Rig::new(slab(mu, Coupling::Rigid));
        let mut smooth = Rig::new(slab(0.0, Coupling::Rigid));
        let (forces, without) = (drag(&mut rig, 0.006, 300), drag(&mut smooth, 0.006, 300));
        // Mean over the second half, where it slides; without friction what is left is the body's own asymmetry.
        let mean = |forces: &[DVec3]| forces[150..].iter().sum::<DVec3>() / 150.0;
        let (force, plain) = (mean(&forces), mean(&without));
        let ratio = -(force.x - plain.x) / force.z;
        println!("mu {mu}: F_t/F_n = {ratio:.4}, frictionless {:.5}", -plain.x / plain.z);
        assert!((ratio / mu - 1.0).abs() < 0.03, "{ratio} for {mu}");
        assert!(force.y.abs() < 0.01 * force.z);
        // The work of dragging is the heat: µ N times the way slid.
        let heat = rig.state.mechanical.tools[0].friction_heat_j;
        let way = mu * force.z * 0.006;
        println!("  heat {heat:.3e} J, mu N s {way:.3e} J");
        assert!(heat > 0.8 * way && heat < way * 1.05);
        assert_eq!(smooth.state.mechanical.tools[0].friction_heat_j, 0.0);
    }
}

#[test]
fn a_coupled_tool_sticks_until_the_spring_pulls_harder_than_the_cone() {
    let coupling = Coupling::Spring { stiffness_n_per_m: 2000.0, damping_n_s_per_m: 30.0, mass_kg: 0.05 };
    let moved = |pull_m: f64| {
        let mut rig = Rig::new(slab(0.5, coupling));
        let start = DVec3::new(-0.004, 0.0, RADIUS_M);
        // 2 N down.
        for _ in 0..150 {
            rig.tick_at(start - DVec3::Z * 1e-3);
        }
        let before = rig.state.mechanical.tools[0].centre_m.x;
        let heat_of_pressing = rig.state.mechanical.tools[0].friction_heat_j;
        let mut after = [0.0; 2];
        for tick in 1..=400 {
            rig.tick_at(start + DVec3::new(pull_m * (f64::from(tick) / 100.0).min(1.0), 0.0, -1e-3));
            after[usize::from(tick > 250)] = rig.state.mechanical.tools[0].centre_m.x - before;
        }
        let heat = rig.state.mechanical.tools[0].friction_heat_j - heat_of_pressing;
        println!("pull {pull_m}: moved {after:?}, heat {heat:.1e} J");
        (after, heat)
    };
    // 1.5 N press; the cone carries 0.75 N, the spring pulls with 2 N/mm: 0.4 N hold, 8 N do not.
    let (stuck, heat) = moved(2e-4);
    assert!(stuck[1] < 0.4 * 2e-4 && (stuck[1] - stuck[0]).abs() < 1e-3 * stuck[1] && heat < 3e-6, "{stuck:?} {heat}");
    let (slid, heat) = moved(4e-3);
    assert!(slid[1] > 2e-3 && heat > 1e-3, "{slid:?} {heat}");
}
