//! Contact where it is hard: through the body, thin walls, huge tools, inverted elements, stick and slip.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    ModelSpec, Substeps,
    contact::{Coupling, ToolTarget},
    material::Law,
    world,
};
use rig::{Rig, body, bricks, even, hold, material, nodes_where, solid_mut, sphere};

fn largest_displacement_m(rig: &Rig) -> f64 {
    let rest = rig.model.rest_positions_m();
    rig.state.mechanical.x.iter().zip(rest).map(|(x, rest)| x.distance(*rest)).fold(0.0, f64::max)
}

/// A block 40 × 40 × 20 mm of 10 kPa, held below, top at z = 0.
fn held_block(radius_m: f64, start_m: DVec3, coupling: Coupling) -> ModelSpec {
    let side = even(-0.02, 0.02, 8);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 4));
    let floor = nodes_where(&mesh, |p| p.z < -0.0199);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.prescribed = vec![hold("floor", floor, [true; 3])];
    spec.settings.mass_damping_per_s = 60.0;
    spec.tools = vec![sphere(radius_m, start_m, coupling)];
    spec
}

/// Drives the device along straight lines between points, `ticks` each, and returns the deepest penetration (m).
fn drive(rig: &mut Rig, ticks: u32, points: &[DVec3]) -> f64 {
    let (mut from, mut deepest) = (rig.state.mechanical.tools[0].target.position_m, 0.0_f64);
    for &to in points {
        for tick in 1..=ticks {
            rig.tick_at(from.lerp(to, f64::from(tick) / f64::from(ticks)));
            assert_eq!(rig.state.quarantine, None, "on the way to {to}, tick {tick}");
            deepest = deepest.max(rig.state.mechanical.tools[0].penetration_m);
        }
        from = to;
    }
    deepest
}

#[test]
fn a_rigid_tool_driven_through_the_body_leaves_it_whole() {
    let radius_m = 0.005;
    let mut spec = held_block(radius_m, DVec3::new(0.001, 0.002, 0.006), Coupling::Rigid);
    spec.tools[0].friction_coefficient = 0.4;
    let mut rig = Rig::new(spec);
    // Down through the held floor, along below it, and away.
    drive(&mut rig, 200, &[DVec3::new(0.001, 0.002, -0.04), DVec3::new(0.06, 0.0, -0.04), DVec3::new(0.06, 0.0, 0.02)]);
    drive(&mut rig, 600, &[DVec3::new(0.06, 0.0, 0.02)]);
    let tool = &rig.state.mechanical.tools[0];
    let min_j = world::min_volume_ratio(&rig.model, &rig.state).unwrap().ratio;
    println!("through: left {:.1e} m, min J {min_j:.6}", largest_displacement_m(&rig));
    assert_eq!((tool.contacts, tool.contact_force_n), (0, DVec3::ZERO));
    assert!(largest_displacement_m(&rig) < 1e-6 && (min_j - 1.0).abs() < 1e-3);
}

#[test]
fn a_proxy_does_not_cross_a_wall_thinner_than_itself() {
    for (thick_m, stiffness) in [(0.00125, 3000.0), (0.0025, 1000.0)] {
        let radius_m = 0.005;
        let side = even(-0.02, 0.02, 10);
        let mesh = bricks(&side, &side, &even(-thick_m, 0.0, 1));
        let rim = nodes_where(&mesh, |p| p.x.abs().max(p.y.abs()) > 0.0199);
        let mut spec = body(mesh, material(Law::StableNeoHookean, 30e3, 0.45));
        spec.prescribed = vec![hold("rim", rim, [true; 3])];
        spec.settings.mass_damping_per_s = 20.0;
        // It bulges far beyond what the step is made for by default.
        spec.settings.stretch_allowance = 2.5;
        let mass_kg = 0.02;
        let damping_n_s_per_m = 1.4 * f64::sqrt(stiffness * mass_kg);
        let coupling = Coupling::Spring { stiffness_n_per_m: stiffness, damping_n_s_per_m, mass_kg };
        spec.tools = vec![sphere(radius_m, DVec3::Z * 0.006, coupling)];
        let mut rig = Rig::new(spec);
        let start = rig.state.mechanical.tools[0].centre_m;
        // Slowly, at once, and sweeping, each time 25 mm to the other side and back.
        let below = DVec3::Z * -0.02;
        let mut deepest = drive(&mut rig, 200, &[below, start]);
        deepest = deepest.max(drive(&mut rig, 1, &[below]));
        deepest = deepest.max(drive(&mut rig, 300, &[below, start]));
        deepest =
            deepest.max(drive(&mut rig, 20, &[DVec3::new(-0.015, 0.0, 0.008), DVec3::new(0.015, 0.0, -0.02), start]));
        drive(&mut rig, 800, &[start]);
        let tool = &rig.state.mechanical.tools[0];
        println!(
            "wall {thick_m} m, {stiffness} N/m: deepest {:.3} R, tool off by {:.1e} m",
            deepest / radius_m,
            tool.centre_m.distance(start)
        );
        assert!(tool.centre_m.distance(start) < 1e-4 && tool.contacts == 0, "{tool:?}");
        assert!(deepest < 0.6 * radius_m, "{deepest}");
    }
}

#[test]
fn a_tool_larger_than_the_body_presses_all_of_it() {
    for coupling in
        [Coupling::Rigid, Coupling::Spring { stiffness_n_per_m: 500.0, damping_n_s_per_m: 6.0, mass_kg: 0.05 }]
    {
        let radius_m = 0.2;
        let mut rig = Rig::new(held_block(radius_m, DVec3::Z * (radius_m + 0.002), coupling));
        let down = DVec3::Z * (radius_m - 0.004);
        drive(&mut rig, 300, &[down, down]);
        let tool = &rig.state.mechanical.tools[0];
        let reaction: DVec3 = rig.scratch.reactions_n().iter().sum();
        println!("{coupling:?}: {} N on {} contacts, floor {reaction}", tool.contact_force_n, tool.contacts);
        // Pressed flat between sphere and floor: the whole top face, 4 mm of 20 mm.
        assert!(tool.contact_force_n.z > 1.0);
        assert!((reaction.z / tool.contact_force_n.z - 1.0).abs() < 1e-3);
        // The top under the sphere's lowest point follows it but for what the foundation gives.
        let top = rig.state.mechanical.x.iter().zip(rig.model.rest_positions_m()).filter(|(_, rest)| rest.z > -1e-9);
        let lowest_m = top.map(|(x, _)| x.z).fold(f64::MAX, f64::min);
        let share = lowest_m / (tool.centre_m.z - radius_m);
        println!("  the top follows {share:.3} of the way");
        assert!(share > 0.7 && share < 1.01, "{share}");
        let up = DVec3::Z * (radius_m + 0.002);
        drive(&mut rig, 300, &[up, up, up]);
        assert_eq!(rig.state.mechanical.tools[0].contacts, 0);
        assert!(largest_displacement_m(&rig) < 1e-6, "{}", largest_displacement_m(&rig));
    }
}

#[test]
fn a_body_turned_inside_out_still_meets_a_tool_in_finite_numbers() {
    for law in [Law::StableNeoHookean, Law::FixedCorotated, Law::StVenantKirchhoff] {
        let mut spec = held_block(0.006, DVec3::new(0.001, 0.002, 0.001), Coupling::Rigid);
        solid_mut(&mut spec).regions[0].material = material(law, 10e3, 0.45);
        spec.tools[0].friction_coefficient = 0.5;
        spec.settings.stretch_allowance = 2.0;
        let mut rig = Rig::new(spec);
        // The free nodes mirrored at the floor, where the tool then is, and flattened in y.
        let free = rig.model.body().as_tet().unwrap().inverse_mass_per_kg().to_vec();
        for (x, inverse_mass) in rig.state.mechanical.x.iter_mut().zip(&free).filter(|(_, m)| **m != DVec3::ZERO) {
            assert!(inverse_mass.x > 0.0);
            *x = DVec3::new(x.x, 0.0, -0.04 - x.z);
        }
        assert!(world::min_volume_ratio(&rig.model, &rig.state).unwrap().ratio <= 0.0);
        let place = DVec3::new(0.001, 0.002, -0.038);
        rig.state.place_tool(0, ToolTarget::at(place));
        let mut touched = 0;
        for tick in 0..400 {
            let t = f64::from(tick) * 1e-3;
            rig.tick_at(place + DVec3::new(0.004 * (40.0 * t).sin(), 0.0, 0.05 * t));
            assert_eq!(rig.state.quarantine, None, "{law:?}, tick {tick}");
            let tool = &rig.state.mechanical.tools[0];
            assert!(tool.contact_force_n.is_finite() && tool.friction_heat_j.is_finite());
            touched += u32::from(tool.contacts > 0);
        }
        assert!(touched > 10, "{law:?}: {touched}");
    }
}

/// What the tool gave beyond what the body got and friction took, over the heat, on a way that begins and ends out of contact:
/// press, stick, slip forth and back, lift.
fn unexplained(substeps: u32) -> f64 {
    let mut spec = held_block(0.006, DVec3::new(-0.004, 0.001, 0.007), Coupling::Rigid);
    spec.tools[0].friction_coefficient = 0.3;
    spec.settings.substeps = Substeps::Fixed(substeps);
    let mut rig = Rig::new(spec);
    let start = rig.state.mechanical.tools[0].centre_m;
    let low = DVec3::NEG_Z * 0.0025;
    let way = [start + low, start + low + DVec3::X * 0.008, start + low + DVec3::Y * 0.003, start];
    let (mut from, mut given_j) = (start, 0.0);
    for to in way {
        for tick in 1..=100 {
            let before = rig.state.mechanical.tools[0].centre_m;
            rig.tick_at(from.lerp(to, f64::from(tick) / 100.0));
            let tool = &rig.state.mechanical.tools[0];
            given_j -= tool.contact_force_n.dot(tool.centre_m - before);
        }
        from = to;
    }
    let tool = &rig.state.mechanical.tools[0];
    assert_eq!(tool.contacts, 0);
    let (got_j, heat_j) = (rig.state.mechanical.ledger.external_work_j, tool.friction_heat_j);
    println!("{substeps} substeps: given {given_j:.6e} J, body {got_j:.6e} J, heat {heat_j:.6e} J");
    assert!(heat_j > 0.2 * given_j);
    (given_j - got_j - heat_j) / heat_j
}

#[test]
fn what_the_tool_gives_is_what_the_body_gets_and_friction_takes() {
    let errors = [8, 16, 32].map(unexplained);
    println!("unexplained over heat: {errors:?}");
    assert!(errors[0].abs() < 0.02 && errors[2].abs() < 0.6 * errors[0].abs(), "{errors:?}");
}
