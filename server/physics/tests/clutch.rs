//! A rigid tool slips from its device before it goes through a surface. A device that went on drove it through: a force
//! of some newtons, then none, the tool buried or beneath the floor.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    ModelSpec,
    bodies::hybrid::Waking,
    contact::{Coupling, ToolShape, ToolState},
    material::Law,
    snapshot,
};
use rig::{Rig, body, bricks, even, hold, hybrid_block, material, nodes_where, sphere};

const RADIUS_M: f64 = 0.006;

/// 40 × 40 × 20 mm, its upper face at z = 0, held at its lower one.
fn block() -> ModelSpec {
    let side = even(-0.02, 0.02, 8);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 4));
    let bottom = nodes_where(&mesh, |p| p.z < -0.0199);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    with_tool(spec)
}

/// 80 × 80 × 40 mm with particles 2.5 mm apart, and a skin of triangles half as large, as scenes make them.
fn with_particles() -> ModelSpec {
    let mut spec = rig::held_below(hybrid_block((0.04, 2, 32), 0.45, 600, Waking::ByTools { reach_m: 0.012 }));
    rig::particles_mut(&mut spec).spacing_m = 2.5e-3;
    rig::solid_mut(&mut spec).regions[0].material.viscosity.psi_pa_s = 0.3;
    with_tool(spec)
}

fn with_tool(mut spec: ModelSpec) -> ModelSpec {
    spec.settings.mass_damping_per_s = 20.0;
    spec.tools = vec![sphere(RADIUS_M, DVec3::Z * (RADIUS_M + 1e-3), Coupling::Rigid)];
    spec
}

fn tool(rig: &Rig) -> &ToolState {
    &rig.state.mechanical.tools[0]
}

/// Moves the device to a height (m) in so many ticks; `look` sees the tool after each.
fn go(rig: &mut Rig, to_m: DVec3, ticks: u32, mut look: impl FnMut(&Rig)) {
    let from_m = tool(rig).target.position_m;
    for tick in 1..=ticks {
        let report = rig.tick_at(from_m.lerp(to_m, f64::from(tick) / f64::from(ticks)));
        assert!(report.quarantined.is_none());
        look(rig);
    }
}

/// The device goes through body and floor, and comes back. The tool stays above, with the force that the body gives there.
#[test]
fn a_device_that_goes_through_the_floor_leaves_its_tool_above() {
    for (spec, floor_m) in [(block(), -0.02), (with_particles(), -0.04)] {
        let mut rig = Rig::new(spec);
        let start_m = tool(&rig).centre_m;
        let (mut peak_n, mut deepest_m, mut lowest_m) = (0.0_f64, 0.0_f64, f64::INFINITY);
        let mut forces_n = Vec::new();
        go(&mut rig, DVec3::Z * -0.06, 700, |rig| {
            let force_n = tool(rig).contact_force_n.z;
            forces_n.push(force_n);
            let recent_n = forces_n.iter().rev().take(20).fold(0.0_f64, |most, n| most.max(*n));
            assert!(force_n >= 0.95 * recent_n || recent_n < 0.05, "{force_n} N after {recent_n} N within 20 ms");
            assert!(force_n >= 0.9 * peak_n || peak_n < 0.05, "{force_n} N after {peak_n} N");
            (peak_n, deepest_m) = (peak_n.max(force_n), deepest_m.max(tool(rig).penetration_m));
            lowest_m = lowest_m.min(tool(rig).centre_m.z);
        });
        assert!(tool(&rig).slip_m.z > 0.03, "{:?}", tool(&rig).slip_m);
        go(&mut rig, DVec3::Z * -0.06, 200, |rig| lowest_m = lowest_m.min(tool(rig).centre_m.z));
        let held_n = tool(&rig).device_force_n.z;
        println!("peak {peak_n} N, held {held_n} N, lowest {lowest_m} m, deepest {} R", deepest_m / RADIUS_M);
        assert!(lowest_m > floor_m + 0.2 * RADIUS_M && deepest_m < 0.8 * RADIUS_M, "{lowest_m} m, {deepest_m} m");
        assert!(held_n > 0.9 * peak_n && peak_n > 0.5, "{held_n} N of {peak_n} N");
        go(&mut rig, start_m, 300, |_| ());
        go(&mut rig, start_m, 300, |_| ());
        assert_eq!((tool(&rig).slip_m, tool(&rig).centre_m), (DVec3::ZERO, start_m));
        assert_eq!(tool(&rig).contact_force_n, DVec3::ZERO);
        let mut surface_m = Vec::new();
        rig.model.surface_positions_m(&rig.state, &mut surface_m);
        assert!(surface_m.iter().all(|p| p.is_finite() && p.z < 1e-3));
    }
}

/// Across the block and back, each in one tick.
#[test]
fn a_device_that_leaps_across_leaves_its_tool_on_the_side_it_came_from() {
    for aside_m in [0.0, 0.003] {
        let mut rig = Rig::new(block());
        let start_m = tool(&rig).centre_m;
        let beneath_m = DVec3::new(aside_m, 0.0, -0.06);
        go(&mut rig, beneath_m, 1, |_| ());
        go(&mut rig, beneath_m, 300, |rig| assert!(tool(rig).centre_m.z > -0.019, "{}", tool(rig).centre_m));
        assert!(tool(&rig).device_force_n.z > 0.5, "{}", tool(&rig).device_force_n);
        go(&mut rig, start_m, 1, |_| ());
        go(&mut rig, start_m, 500, |_| ());
        assert_eq!((tool(&rig).slip_m, tool(&rig).contact_force_n), (DVec3::ZERO, DVec3::ZERO));
        assert_eq!(tool(&rig).centre_m, start_m);
    }
}

/// To the bit: what bears its force is where its device is.
#[test]
fn below_its_limit_a_rigid_tool_is_where_its_device_is() {
    for shape in [ToolShape::Sphere, ToolShape::capsule(Coupling::Rigid, RADIUS_M, 4e-3, DVec3::X)] {
        let mut spec = block();
        spec.tools[0].shape = shape;
        let mut rig = Rig::new(spec);
        let mut peak_n = 0.0_f64;
        go(&mut rig, DVec3::new(2e-3, 0.0, RADIUS_M - 3e-3), 200, |rig| {
            assert_eq!((tool(rig).slip_m, tool(rig).centre_m), (DVec3::ZERO, tool(rig).target.position_m));
            peak_n = peak_n.max(tool(rig).contact_force_n.length());
        });
        assert!(peak_n > 0.1, "{peak_n} N");
    }
}

/// The clutch takes energy and gives none: in a round through the floor and back the device does work, and what the
/// body has got of it, it has lost again.
#[test]
fn the_ledger_closes_while_a_tool_slips() {
    let mut rig = Rig::new(block());
    let start_m = tool(&rig).centre_m;
    let mut moved_j = 0.0_f64;
    let mut by_device_j = 0.0;
    let mut last_m = start_m;
    for (to_m, ticks) in [(DVec3::Z * -0.04, 300), (start_m, 300), (start_m, 200)] {
        go(&mut rig, to_m, ticks, |rig| {
            by_device_j -= tool(rig).device_force_n.dot(tool(rig).target.position_m - last_m);
            last_m = tool(rig).target.position_m;
            moved_j = moved_j.max(rig.state.mechanical.ledger.external_work_j);
        });
    }
    let energies = palpate_physics::Energies::of(&rig.model, &rig.state);
    assert!(moved_j > 1e-3 && energies.balance_j().abs() < 0.02 * moved_j, "{} J of {moved_j} J", energies.balance_j());
    assert!(by_device_j > rig.state.mechanical.ledger.external_work_j, "{by_device_j} J");
}

/// A snapshot of a tool that slips goes on as the run did.
#[test]
fn what_has_slipped_is_saved() {
    let mut rig = Rig::new(block());
    go(&mut rig, DVec3::Z * -0.03, 200, |_| ());
    assert!(tool(&rig).slip_m.length() > 1e-3);
    let saved = snapshot::save(&rig.model, &rig.state);
    let mut other = Rig::new(block());
    other.state = snapshot::restore(&other.model, &saved).unwrap();
    for rig in [&mut rig, &mut other] {
        go(rig, DVec3::Z * -0.02, 50, |_| ());
    }
    assert_eq!(rig.state, other.state);
}
