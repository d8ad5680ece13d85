//! The proxy stays on its side of the body, whatever the device does.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    ModelSpec,
    contact::{Coupling, is_inside},
    material::Law,
    world,
};
use rig::{Rig, body, bricks, even, hold, material, nodes_where, sphere};

const RADIUS_M: f64 = 0.005;

/// A plate 60 × 60 × `thick_m` mm of 10 kPa, held at its rim, top at z = 0, with a coupled sphere 1 mm above its middle.
fn plate(thick_m: f64, stiffness_n_per_m: f64, mass_kg: f64) -> ModelSpec {
    let side = even(-0.03, 0.03, 12);
    let mesh = bricks(&side, &side, &even(-thick_m, 0.0, (thick_m / 0.005).round() as usize));
    let rim = nodes_where(&mesh, |p| p.x.abs().max(p.y.abs()) > 0.0299);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.prescribed = vec![hold("rim", rim, [true; 3])];
    spec.settings.mass_damping_per_s = 20.0;
    let coupling = Coupling::Spring {
        stiffness_n_per_m,
        damping_n_s_per_m: 2.0 * 0.7 * (stiffness_n_per_m * mass_kg).sqrt(),
        mass_kg,
    };
    spec.tools = vec![sphere(RADIUS_M, DVec3::Z * (RADIUS_M + 0.001), coupling)];
    spec
}

/// Drives the device along `path` (ticks → position), then back to the start, and returns the deepest penetration over R and the
/// largest device force (N). The proxy must then be back at the device, out of contact: it never changed sides.
fn drive(spec: ModelSpec, ticks: u32, path: impl Fn(u32) -> DVec3) -> (f64, f64) {
    let mut rig = Rig::new(spec);
    let start = rig.state.mechanical.tools[0].centre_m;
    let (mut deepest, mut strongest) = (0.0_f64, 0.0_f64);
    for tick in 0..ticks + 300 {
        rig.tick_at(if tick < ticks { path(tick) } else { start });
        assert!(rig.state.quarantine.is_none(), "tick {tick}");
        deepest = deepest.max(rig.state.mechanical.tools[0].penetration_m / RADIUS_M);
        strongest = strongest.max(rig.state.mechanical.tools[0].device_force_n.length());
    }
    let tool = &rig.state.mechanical.tools[0];
    let min_j = world::min_volume_ratio(&rig.model, &rig.state).unwrap().ratio;
    println!(
        "deepest {deepest:.3} R, strongest {strongest:.3} N, limit {:.3} N, min J at end {min_j:.3}, off by {:.2e} m, contacts {}",
        rig.model.contact().force_limit_n(0),
        tool.centre_m.distance(start),
        tool.contacts
    );
    assert!(tool.centre_m.distance(start) < 1e-4, "proxy at {} after the device went back", tool.centre_m);
    assert_eq!(tool.contacts, 0);
    (deepest, strongest)
}

#[test]
fn a_device_15_mm_inside_leaves_the_proxy_outside() {
    for (stiffness, mass) in [(200.0, 0.02), (1000.0, 0.05), (3000.0, 0.005)] {
        let ramp = |tick: u32| DVec3::Z * (0.006 - 0.021 * (f64::from(tick) / 200.0).min(1.0));
        let (deepest, _) = drive(plate(0.02, stiffness, mass), 500, ramp);
        assert!(deepest < 0.35, "{deepest}");
    }
}

#[test]
fn a_device_that_jumps_through_the_wall_in_one_tick_leaves_the_proxy_behind() {
    for (stiffness, mass) in [(200.0, 0.02), (1000.0, 0.05), (3000.0, 0.005)] {
        let (deepest, _) = drive(plate(0.01, stiffness, mass), 400, |_| DVec3::Z * -0.04);
        assert!(deepest < 0.35, "{deepest}");
    }
}

#[test]
fn a_fast_sweep_across_leaves_the_proxy_on_its_side() {
    // 40 mm in 20 ms, 15 mm deep half-way.
    let sweep = |tick: u32| {
        let s = (f64::from(tick) / 20.0).min(1.0);
        DVec3::new(-0.02 + 0.04 * s, 0.004, 0.006 - 0.02 * (std::f64::consts::PI * s).sin())
    };
    for (stiffness, mass) in [(500.0, 0.02), (2000.0, 0.01)] {
        let (deepest, _) = drive(plate(0.02, stiffness, mass), 20, sweep);
        assert!(deepest < 0.35, "{deepest}");
    }
}

#[test]
fn a_hard_edge_hit_at_speed_is_not_crossed() {
    // From beside the plate, against the clamped rim's sharp edge, which carries half of what a flat surface does.
    let sweep = |tick: u32| {
        let s = (f64::from(tick) / 40.0).min(1.0);
        DVec3::new(-0.05 + 0.1 * s, 0.004, 0.006 - 0.02 * (std::f64::consts::PI * s).sin())
    };
    for (stiffness, mass) in [(500.0, 0.02), (2000.0, 0.01)] {
        let mut rig = Rig::new(plate(0.02, stiffness, mass));
        let mut deepest = 0.0_f64;
        // A spring that is saturated pulls it through its damper at 0.1 m/s.
        for tick in 0..600 {
            rig.tick_at(sweep(tick));
            deepest = deepest.max(rig.state.mechanical.tools[0].penetration_m / RADIUS_M);
        }
        println!("edge: deepest {deepest:.3} R");
        assert!(deepest < 0.6, "{deepest}");
        assert!(rig.state.mechanical.tools[0].centre_m.distance(sweep(600)) < 1e-4);
    }
}

/// Beside the plate, up along its side, over its edge and down: the samples of the upper face were inside the sphere from
/// the start, reached from behind, and carried nothing when it came down on them.
#[test]
fn a_tool_that_comes_round_an_edge_does_not_sink_in_behind_it() {
    for beside_m in [-0.034, -0.032, -0.028] {
        for over_m in [-0.027, -0.024] {
            let mut spec = plate(0.02, 1000.0, 0.02);
            let start_m = DVec3::new(-0.038, 0.004, -0.003);
            spec.tools[0].start_position_m = start_m;
            let mut rig = Rig::new(spec);
            let way = [start_m, DVec3::new(beside_m, 0.004, -0.003), DVec3::new(over_m, 0.004, 0.002)];
            let way = [way[0], way[1], way[2], DVec3::new(over_m, 0.004, -0.012), way[2], way[1], way[0]];
            let surface = rig.model.surface().triangles.clone();
            let mut x_m = Vec::new();
            for tick in 0..1800_u32 {
                let (leg, along) = ((tick / 300) as usize, f64::from(tick % 300) / 300.0);
                rig.tick_at(way[leg].lerp(way[leg + 1], along));
                rig.model.surface_positions_m(&rig.state, &mut x_m);
                let tool = &rig.state.mechanical.tools[0];
                assert!(
                    !is_inside(tool.centre_m, &surface, &x_m),
                    "{beside_m} {over_m}: tick {tick}: the tool is inside, at {}",
                    tool.centre_m
                );
            }
            (0..300).for_each(|_| _ = rig.tick_at(start_m));
            assert!(rig.state.mechanical.tools[0].centre_m.distance(start_m) < 1e-4, "{beside_m} {over_m}");
        }
    }
}

/// An arm that counts steps of an encoder moves by leaps: in the free air the coupling's damper made 0.1 N of each.
#[test]
fn a_device_that_moves_by_leaps_is_hardly_felt_in_the_free_air() {
    // 30 mm/s past the plate, told in steps of 0.05 mm; its mean force (N), root mean square and largest.
    let felt = |step_m: f64| {
        let mut spec = plate(0.02, 400.0, 0.02);
        let coupling = Coupling::Spring { stiffness_n_per_m: 400.0, damping_n_s_per_m: 2.0, mass_kg: 0.02 };
        spec.tools = vec![sphere(RADIUS_M, DVec3::Z * 0.05, coupling)];
        let mut rig = Rig::new(spec);
        let mut forces_n = Vec::new();
        for tick in 0..900 {
            let x = 30e-6 * f64::from(tick);
            let told = if step_m > 0.0 { (x / step_m).floor() * step_m } else { x };
            rig.tick_at(DVec3::new(told, 0.0, 0.05));
            if tick >= 300 {
                forces_n.push(rig.state.mechanical.tools[0].device_force_n.x);
            }
        }
        let n = forces_n.len() as f64;
        let mean_n = forces_n.iter().sum::<f64>() / n;
        let rms_n = (forces_n.iter().map(|f| (f - mean_n).powi(2)).sum::<f64>() / n).sqrt();
        (mean_n, rms_n, forces_n.iter().fold(0.0_f64, |most, f| most.max(f.abs())))
    };
    let (smooth, leaps) = (felt(0.0), felt(5e-5));
    println!("smooth {smooth:?}, leaps {leaps:?}");
    assert!(smooth.2 < 1e-6, "a tool in the free air follows without force: {smooth:?}");
    // A step of the spring alone is 0.02 N.
    assert!(leaps.0.abs() < 1e-3 && leaps.1 < 0.012 && leaps.2 < 0.03, "{leaps:?}");
}
