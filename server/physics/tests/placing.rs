//! Tools that are put somewhere, move with the body, or are too small for its surface.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    Model, ModelSpec, State,
    contact::{Coupling, ToolTarget},
    material::Law,
    snapshot,
    tick::EnvironmentError,
};
use rig::{Rig, body, bricks, even, hold, material, mesh_of, nodes_where, sphere};

const RADIUS_M: f64 = 0.005;
const SPRING: Coupling = Coupling::Spring { stiffness_n_per_m: 500.0, damping_n_s_per_m: 2.0, mass_kg: 0.02 };

/// A block 40 × 40 × 20 mm of 10 kPa, top at z = 0, with a tool 20 mm above it.
fn block(coupling: Coupling) -> ModelSpec {
    let side = even(-0.02, 0.02, 8);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 4));
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.tools = vec![sphere(RADIUS_M, DVec3::Z * 0.02, coupling)];
    spec
}

fn held_block(coupling: Coupling) -> ModelSpec {
    let mut spec = block(coupling);
    let floor = nodes_where(mesh_of(&spec), |p| p.z < -0.0199);
    spec.prescribed = vec![hold("floor", floor, [true; 3])];
    spec.settings.mass_damping_per_s = 60.0;
    spec.tools[0].friction_coefficient = 0.3;
    spec
}

fn deep(depth_m: f64) -> DVec3 {
    DVec3::new(0.0013, 0.0007, RADIUS_M - depth_m)
}

/// A device was attached with its arm leaning on the body: the tool appeared 1 mm deep with its full force at once, the body
/// rang, and so did the arm.
#[test]
fn a_tool_put_into_shallow_contact_does_not_kick() {
    for coupling in [Coupling::Rigid, SPRING] {
        let mut rig = Rig::new(held_block(coupling));
        rig.tick_at(DVec3::Z * 0.02);
        rig.state.place_tool(0, ToolTarget::at(deep(0.001)));
        // Saved before its first tick, it is still a tool that was just put there.
        let bytes = snapshot::save(&rig.model, &rig.state);
        rig.state = snapshot::restore(&rig.model, &bytes).unwrap();
        for _ in 0..50 {
            rig.tick_at(deep(0.001));
            let tool = &rig.state.mechanical.tools[0];
            assert_eq!((tool.contacts, tool.contact_force_n, tool.device_force_n), (0, DVec3::ZERO, DVec3::ZERO));
            assert!(tool.local_model.is_none());
            assert!(tool.penetration_m > 0.0009, "it is in the surface all the same: {}", tool.penetration_m);
        }
        assert_eq!(&rig.state.mechanical.x, rig.model.rest_positions_m(), "the body stays at rest");
    }
}

/// Force (N) of a rigid tool after it went down to a depth in 100 ticks and rested for 100.
fn press(rig: &mut Rig, from_m: f64, to_m: f64) -> f64 {
    for tick in 1..=200 {
        let way = (f64::from(tick) / 100.0).min(1.0);
        rig.tick_at(deep(from_m + (to_m - from_m) * way));
    }
    rig.state.mechanical.tools[0].contact_force_n.z
}

#[test]
fn a_tool_put_into_contact_resists_from_there_and_forgets_it_when_it_leaves() {
    let mut fresh = Rig::new(held_block(Coupling::Rigid));
    let whole = press(&mut fresh, -0.001, 0.002);
    let mut rig = Rig::new(held_block(Coupling::Rigid));
    rig.state.place_tool(0, ToolTarget::at(deep(0.001)));
    let first_um = {
        rig.tick_at(deep(0.001 + 1e-6));
        rig.state.mechanical.tools[0].contact_force_n.length()
    };
    let part = press(&mut rig, 0.001 + 1e-6, 0.002);
    press(&mut rig, 0.002, -0.001);
    assert_eq!(rig.state.mechanical.tools[0].contacts, 0);
    let again = press(&mut rig, -0.001, 0.002);
    println!(
        "pressed 2 mm: {whole:.4} N; put at 1 mm: first µm {first_um:.1e} N, at 2 mm {part:.4} N; again {again:.4} N"
    );
    assert!(first_um < 0.005 * whole);
    assert!(part > 0.3 * whole && part < whole);
    assert!((again / whole - 1.0).abs() < 1e-3);
}

/// What cannot be kept carries nothing, as deep as it is.
#[test]
fn a_tool_put_into_more_samples_than_can_be_kept_does_not_kick() {
    // A plate of 1.6 mm on a floor, with 20 000 triangles above and as many below, all inside the tool: its whole force would
    // be some hundred newtons.
    let (side, thickness_m) = (even(-0.01, 0.01, 100), 0.0016);
    let mut spec = body(bricks(&side, &side, &even(-thickness_m, 0.0, 1)), material(Law::StableNeoHookean, 10e3, 0.45));
    spec.tools = vec![sphere(0.02, DVec3::Z * 0.021, Coupling::Rigid)];
    spec.prescribed = vec![hold("floor", nodes_where(mesh_of(&spec), |p| p.z < -0.0015), [true; 3])];
    let mut rig = Rig::new(spec);
    for (from_m, way) in [(0.006, 1.0), (-0.006 - thickness_m, -1.0)] {
        rig.state = State::at_rest(&rig.model);
        rig.state.place_tool(0, ToolTarget::at(DVec3::Z * from_m));
        for tick in 1..=3 {
            rig.tick_at(DVec3::Z * (from_m - way * 1e-7 * f64::from(tick)));
            let tool = &rig.state.mechanical.tools[0];
            let force_n = tool.contact_force_n.length();
            println!("tick {tick} from {from_m} m: {force_n:.1e} N on {} samples", tool.contacts);
            assert!(force_n < 0.1 && tool.contacts <= 16_384 && rig.state.quarantine.is_none());
            assert!(tool.penetration_m > 0.005, "it is in the surface all the same: {}", tool.penetration_m);
        }
    }
}

/// A proxy near a body that moves was slowed down to what the foundation can stop at rest, as if the body stood still.
#[test]
fn a_tool_follows_a_body_that_moves_away() {
    let mut rig = Rig::new(block(SPRING));
    let velocity = DVec3::new(0.5, 0.0, -3.0);
    rig.state.mechanical.v.fill(velocity);
    let start = DVec3::new(0.0, 0.0, 1.1 * RADIUS_M);
    rig.state.place_tool(0, ToolTarget::at(start));
    rig.state.mechanical.tools[0].velocity_m_per_s = velocity;
    // It and its device have moved so for a while.
    rig.state.mechanical.tools[0].device_m_per_s = velocity;
    for tick in 1..=50 {
        rig.tick_at(start + velocity * (1e-3 * f64::from(tick)));
        let tool = &rig.state.mechanical.tools[0];
        assert!(tool.device_force_n.length() < 1e-9, "tick {tick}: {}", tool.device_force_n);
        assert!(tool.centre_m.distance(tool.target.position_m) < 1e-9);
    }
}

/// The limit takes speed from the tool and never gives it any: a body that comes at a resting tool does not push it from afar.
#[test]
fn a_body_that_comes_moves_no_tool_before_it_touches() {
    let mut rig = Rig::new(block(SPRING));
    rig.state.mechanical.v.fill(DVec3::Z);
    rig.state.place_tool(0, ToolTarget::at(DVec3::Z * (2.0 * RADIUS_M)));
    let mut near = 0;
    while rig.state.mechanical.tools[0].contacts == 0 {
        rig.tick_at(DVec3::Z * (2.0 * RADIUS_M));
        let tool = &rig.state.mechanical.tools[0];
        if tool.contacts == 0 {
            near += u32::from(rig.state.mechanical.x.iter().map(|x| x.z).fold(f64::MIN, f64::max) > 0.75 * RADIUS_M);
            assert_eq!(tool.velocity_m_per_s, DVec3::ZERO);
        }
    }
    assert!(near > 0, "it was near for a tick at least");
}

/// Samples are R/3 apart up to a size of 16 R; a larger triangle silently had fewer, and a small tool fell between them.
#[test]
fn a_tool_too_small_for_the_surface_is_refused() {
    let with_radius = |radius_m: f64| {
        let side = even(-0.05, 0.05, 2);
        let mut spec = body(bricks(&side, &side, &side), material(Law::StableNeoHookean, 10e3, 0.45));
        spec.tools = vec![sphere(radius_m, DVec3::Z, Coupling::Rigid)];
        Model::build(spec)
    };
    // Edges of 50 √2 mm.
    let limit_m = 0.05 * 2.0_f64.sqrt() / 16.0;
    assert!(with_radius(1.001 * limit_m).is_ok());
    let error = with_radius(0.999 * limit_m).unwrap_err();
    println!("{error}");
    let Some(EnvironmentError::SurfaceTooCoarse { tool, size_m, largest_m, .. }) = error.environment() else {
        panic!("{error}")
    };
    assert!(tool == "sphere" && (size_m / 0.070_710_678 - 1.0).abs() < 1e-6 && largest_m < size_m);
    assert!(error.to_string().contains("refine"));
}
