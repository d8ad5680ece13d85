//! Capsules: what they press with, how they turn, and what neither may break.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::{DQuat, DVec3};
use palpate_physics::{
    Energies, Integrator, ModelSpec,
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget, is_inside},
    material::Law,
    snapshot,
    tick::EnvironmentError,
};
use rig::{Drive, Rig, body, bricks, even, hold, material, mesh_of, nodes_where, sphere};
use std::f64::consts::FRAC_PI_2;

const RADIUS_M: f64 = 0.004;
const HALF_M: f64 = 0.012;

fn capsule(radius_m: f64, half_length_m: f64, start_m: DVec3, along: DVec3, coupling: Coupling) -> ToolSpec {
    ToolSpec {
        shape: ToolShape::capsule(coupling, radius_m, half_length_m, along),
        ..sphere(radius_m, start_m, coupling)
    }
}

fn on_spring(stiffness_n_per_m: f64, damping_n_s_per_m: f64) -> Coupling {
    Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg: 0.02 }
}

/// A block of 40 × 40 × 20 mm, top at z = 0.
fn free_block() -> ModelSpec {
    let side = even(-0.02, 0.02, 8);
    body(bricks(&side, &side, &even(-0.02, 0.0, 4)), material(Law::StableNeoHookean, 10e3, 0.45))
}

fn block() -> ModelSpec {
    let mut spec = free_block();
    spec.prescribed = vec![hold("bottom", nodes_where(mesh_of(&spec), |p| p.z < -0.0199), [true; 3])];
    spec.settings.mass_damping_per_s = 20.0;
    spec
}

fn lying(height_m: f64, coupling: Coupling) -> ToolSpec {
    capsule(RADIUS_M, HALF_M, DVec3::Z * height_m, DVec3::X, coupling)
}

fn start(rig: &Rig) -> ToolTarget {
    rig.state.mechanical.tools[0].target
}

fn run_at(rig: &mut Rig, target: ToolTarget, ticks: u32) {
    for _ in 0..ticks {
        let drive = Drive { tools: vec![target], ..rig.still() };
        rig.tick(&drive);
    }
}

/// A long cylinder on a thin layer that is bonded below, ν = 0: under a contact much wider than the layer is thick, the layer is a row of springs `E/t`,
/// in series with the foundation. `F/l = ∫ k (d − x²/2R) dx = (4/3) k d √(2Rd)`, `1/k = t/E + 1/k_f`.
#[test]
fn a_capsule_on_its_side_presses_a_thin_layer_with_the_known_force_per_length() {
    let (young_pa, thick_m, length_m, radius_m, depth_m) = (10e3, 2e-3, 4e-3, 1.0, 4e-5);
    let mesh = bricks(&even(-0.014, 0.014, 28), &even(-0.5 * length_m, 0.5 * length_m, 4), &even(-thick_m, 0.0, 2));
    let mut spec = body(mesh, material(Law::StableNeoHookean, young_pa, 0.0));
    let ends = nodes_where(mesh_of(&spec), |p| p.y.abs() > 0.499 * length_m && p.z > -0.999 * thick_m);
    spec.prescribed = vec![
        hold("bottom", nodes_where(mesh_of(&spec), |p| p.z < -0.999 * thick_m), [true; 3]),
        hold("ends", ends, [false, true, false]),
    ];
    spec.settings.mass_damping_per_s = 300.0;
    let along_m = 0.03;
    let press = |shift_m: f64| {
        let mut spec = spec.clone();
        let above_m = DVec3::new(0.0, shift_m, radius_m + 1e-6);
        spec.tools = vec![capsule(radius_m, 0.1, above_m, DVec3::Y, Coupling::Rigid)];
        let mut rig = Rig::new(spec);
        let target = ToolTarget { position_m: DVec3::new(0.0, shift_m, radius_m - depth_m), ..start(&rig) };
        run_at(&mut rig, target, 200);
        let tool = rig.state.mechanical.tools[0].clone();
        (rig, tool)
    };
    let (rig, tool) = press(0.0);
    let top = |nodes: [u32; 3]| nodes.iter().all(|&n| rig.model.rest_positions_m()[n as usize].z > -1e-9);
    let inner = rig.model.contact().foundation(0).filter(|part| top(part.nodes));
    // Half a square millimetre each.
    let k_f =
        inner.map(|part| part.stiffness_n_per_m * part.weights.len() as f64 / 0.5e-6).fold(f64::INFINITY, f64::min);
    let k = 1.0 / (thick_m / young_pa + 1.0 / k_f);
    let expected_n = length_m * 4.0 / 3.0 * k * depth_m * (2.0 * radius_m * depth_m).sqrt();
    let force_n = tool.contact_force_n;
    println!("{} N, expected {expected_n} N, k_f {k_f:e} Pa/m", force_n.z);
    assert!((force_n.z / expected_n - 1.0).abs() < 0.05, "{force_n} {expected_n}");
    // Pressed in the middle it is not turned; with its centre beside, by the force times the way there.
    let torque_nm = tool.contact_torque_nm.length();
    assert!(torque_nm < 1e-3 * force_n.z * length_m, "{torque_nm}");
    let (_, beside) = press(along_m);
    let torque_nm = DVec3::new(0.0, -along_m, 0.0).cross(beside.contact_force_n);
    assert!((beside.contact_force_n - force_n).length() < 1e-9 * force_n.z, "{force_n}");
    assert!((beside.device_torque_nm - torque_nm).length() < 1e-3 * torque_nm.length(), "{torque_nm}");
}

/// A free block and a tool that nothing holds: what they exchange, friction and all, keeps both momenta.
#[test]
fn a_free_block_and_a_free_capsule_keep_both_momenta() {
    let mut spec = free_block();
    spec.tools = vec![capsule(
        RADIUS_M,
        HALF_M,
        DVec3::new(0.012, 0.003, 0.0046),
        DVec3::new(1.0, 0.2, -0.05),
        on_spring(1e-15, 0.0),
    )];
    spec.tools[0].friction_coefficient = 0.5;
    let mut rig = Rig::new(spec);
    for (x, v) in rig.state.mechanical.x.iter().zip(&mut rig.state.mechanical.v) {
        *v = DVec3::new(0.01, 0.02, 0.05) + DVec3::new(0.3, -0.2, 1.0).cross(*x);
    }
    let ToolShape::Capsule(shape) = rig.model.tools()[0].shape else { panic!("a capsule") };
    let momenta = |rig: &Rig| {
        let tool = &rig.state.mechanical.tools[0];
        let p = tool.velocity_m_per_s * 0.02;
        let l = tool.centre_m.cross(p) + tool.angular_velocity_rad_per_s * shape.turning.inertia_kg_m2;
        let nodes = rig.state.mechanical.x.iter().zip(&rig.state.mechanical.v).zip(rig.model.body().mass_kg());
        nodes.fold((p, l), |(p, l), ((x, v), m)| (p + *v * *m, l + x.cross(*v) * *m))
    };
    let (p0, l0) = momenta(&rig);
    let mut touched = 0;
    for _ in 0..300 {
        let still = start(&rig);
        run_at(&mut rig, still, 1);
        touched += u32::from(rig.state.mechanical.tools[0].contacts > 0);
    }
    let (p, l) = momenta(&rig);
    let tool = &rig.state.mechanical.tools[0];
    println!(
        "{touched} ticks, p off {:e}, L off {:e}",
        (p - p0).length() / p0.length(),
        (l - l0).length() / l0.length()
    );
    assert!(touched > 5 && tool.angular_velocity_rad_per_s.length() > 0.5, "{}", tool.angular_velocity_rad_per_s);
    assert!((p - p0).length() < 1e-12 * p0.length() && (l - l0).length() < 1e-12 * l0.length(), "{p0} {p} {l0} {l}");
}

/// Nothing is damped: a step over the limit would grow without bound.
#[test]
fn the_step_is_stable_in_contact_at_the_bound_itself() {
    for (radius_m, half_m) in [(0.002, 0.016), (0.004, 0.006)] {
        let mut spec = block();
        spec.settings.mass_damping_per_s = 0.0;
        spec.settings.step_safety = 1.0;
        let at_m = DVec3::new(0.006, 0.0, radius_m * 1.001);
        spec.tools = vec![capsule(radius_m, half_m, at_m, DVec3::X, on_spring(500.0, 0.0))];
        let mut rig = Rig::new(spec);
        let depth_m = 0.25 * radius_m;
        let device = ToolTarget { position_m: at_m - DVec3::Z * (depth_m + 0.001 * radius_m), ..start(&rig) };
        let mut most = 0.0_f64;
        for tick in 0..1500 {
            run_at(&mut rig, device, 1);
            assert!(rig.state.quarantine.is_none(), "tick {tick}");
            most = most
                .max(Energies::of(&rig.model, &rig.state).held_j() + rig.state.mechanical.tools[0].contact_energy_j);
        }
        let given = 0.5 * 500.0 * (depth_m + 0.001 * radius_m).powi(2);
        println!("R {radius_m}: {} substeps, most {most:.3e} J of {given:.3e} J", rig.model.substeps());
        assert!(most > 0.05 * given && most < 1.05 * given, "{most:e} {given:e}");
    }
}

/// Undamped and without friction, tool and body exchange energy and keep its sum, to second order in the step.
#[test]
fn the_energy_of_body_contact_and_coupling_is_kept() {
    let drift = |substeps: u32| {
        let mut spec = block();
        spec.settings.mass_damping_per_s = 0.0;
        spec.settings.substeps = palpate_physics::Substeps::Fixed(substeps);
        spec.tools = vec![lying(RADIUS_M + 1e-5, on_spring(500.0, 0.0))];
        let mut rig = Rig::new(spec);
        let ToolShape::Capsule(shape) = rig.model.tools()[0].shape else { panic!("a capsule") };
        let turned = DQuat::from_rotation_y(0.05) * start(&rig).orientation;
        let device = ToolTarget { position_m: DVec3::Z * (RADIUS_M - 2e-4), orientation: turned, ..start(&rig) };
        // The device's way is work done on the coupling; it stands from then on.
        run_at(&mut rig, device, 1);
        let energy_j = |rig: &Rig| {
            let tool = &rig.state.mechanical.tools[0];
            let apart = (device.orientation * tool.orientation.conjugate()).to_scaled_axis();
            let turning = shape.turning;
            let of_tool_j = 0.5 * 0.02 * tool.velocity_m_per_s.length_squared()
                + 0.5 * turning.inertia_kg_m2 * tool.angular_velocity_rad_per_s.length_squared()
                + 0.5 * 500.0 * tool.centre_m.distance_squared(device.position_m)
                + 0.5 * turning.stiffness_nm_per_rad * apart.length_squared();
            Energies::of(&rig.model, &rig.state).held_j() + tool.contact_energy_j + of_tool_j
        };
        let before_j = energy_j(&rig);
        let (mut worst, mut contacts) = (0.0_f64, 0);
        for _ in 0..100 {
            run_at(&mut rig, device, 1);
            worst = worst.max((energy_j(&rig) / before_j - 1.0).abs());
            contacts += rig.state.mechanical.tools[0].contacts;
        }
        assert!(contacts > 100, "{contacts}");
        worst
    };
    let (coarse, fine) = (drift(20), drift(40));
    println!("{coarse:e} {fine:e}");
    assert!(coarse < 0.03 && fine < 0.5 * coarse, "{coarse:e} {fine:e}");
}

/// Pressed with one end on the block, it comes to rest where the coupling's torque is the contact's.
#[test]
fn at_rest_the_device_feels_the_contacts_force_and_torque() {
    let mut spec = block();
    let at_m = DVec3::new(0.024, 0.0, RADIUS_M + 1e-4);
    spec.tools = vec![capsule(RADIUS_M, HALF_M, at_m, DVec3::X, on_spring(300.0, 3.0))];
    spec.tools[0].friction_coefficient = 0.3;
    let mut rig = Rig::new(spec);
    let device = ToolTarget { position_m: at_m - DVec3::Z * 5e-4, ..start(&rig) };
    run_at(&mut rig, device, 1500);
    let tool = &rig.state.mechanical.tools[0];
    let ToolShape::Capsule(shape) = rig.model.tools()[0].shape else { panic!("a capsule") };
    let turned = (device.orientation * tool.orientation.conjugate()).to_scaled_axis();
    let (torque_nm, force_n) = (tool.contact_torque_nm, tool.contact_force_n);
    println!("force {force_n}, torque {torque_nm}, turned {turned}");
    assert!(force_n.z > 0.01 && torque_nm.y > 5e-3 * force_n.z, "one end is pushed up: {force_n} {torque_nm}");
    assert!((tool.device_force_n - force_n).length() < 1e-3 * force_n.length());
    assert!((tool.device_torque_nm - torque_nm).length() < 1e-3 * torque_nm.length());
    assert!((turned * shape.turning.stiffness_nm_per_rad + torque_nm).length() < 2e-3 * torque_nm.length());
}

/// Whatever its device does: pushed through the block, flat, on end and turning.
#[test]
fn a_device_in_the_block_leaves_the_capsule_outside() {
    for (along, spin) in [(DVec3::X, 0.0), (DVec3::Z, 0.0), (DVec3::new(1.0, 0.0, 0.2), 20.0), (DVec3::Z, 300.0)] {
        let mut spec = block();
        let height_m = RADIUS_M + HALF_M * along.normalize().z.abs() + 1e-3;
        spec.tools = vec![capsule(RADIUS_M, HALF_M, DVec3::Z * height_m, along, on_spring(800.0, 4.0))];
        spec.tools[0].friction_coefficient = 0.4;
        let mut rig = Rig::new(spec);
        let first = start(&rig);
        let mut deepest = 0.0_f64;
        for tick in 0..1000_u32 {
            let t = f64::from(tick.min(600)) * 1e-3;
            let target = ToolTarget {
                position_m: DVec3::Z * if tick < 600 { height_m - 0.02 * (t / 0.2).min(1.0) } else { height_m },
                orientation: DQuat::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), if tick < 600 { spin * t } else { 0.0 })
                    * first.orientation,
                ..first
            };
            run_at(&mut rig, target, 1);
            assert!(rig.state.quarantine.is_none(), "tick {tick}");
            deepest = deepest.max(rig.state.mechanical.tools[0].penetration_m / RADIUS_M);
        }
        println!("along {along}, {spin} rad/s: deepest {deepest:.3} R");
        assert!(deepest < 0.6, "{deepest}");
        let tool = &rig.state.mechanical.tools[0];
        let surface = rig.model.surface();
        let triangles: Vec<[u32; 3]> = (0..surface.triangles.len()).map(|t| surface.triangle_nodes(t)).collect();
        let half_m = tool.orientation * DVec3::Z * HALF_M;
        for at_m in [tool.centre_m, tool.centre_m + half_m, tool.centre_m - half_m] {
            assert!(!is_inside(at_m, &triangles, &rig.state.mechanical.x), "{at_m}");
        }
        // One that is turned about may roll over the edge, and then stays beside the block.
        assert!(spin > 0.0 || tool.centre_m.distance(first.position_m) < 1e-3, "{}", tool.centre_m);
    }
}

fn rubbing(tick: u32, first: ToolTarget) -> ToolTarget {
    let t = f64::from(tick) * 1e-3;
    let wave = |frequency: f64| (frequency * t).sin();
    ToolTarget {
        position_m: first.position_m + DVec3::new(0.006 * wave(21.0), 0.004 * wave(17.0), -0.003 - 0.003 * wave(30.0)),
        orientation: DQuat::from_rotation_z(0.6 * wave(13.0))
            * DQuat::from_rotation_y(0.4 * wave(19.0))
            * first.orientation,
        ..first
    }
}

fn rubbing_rig(coupling: Coupling, exhaustive: bool) -> Rig {
    let mut spec = block();
    spec.tools = vec![lying(RADIUS_M + 2e-3, coupling)];
    spec.tools[0].friction_coefficient = 0.4;
    spec.settings.skips.distant_contact = !exhaustive;
    Rig::new(spec)
}

#[test]
fn the_broad_phase_changes_no_bit_and_a_restored_run_goes_on_as_it_was() {
    for coupling in [Coupling::Rigid, on_spring(400.0, 3.0)] {
        let (mut quick, mut slow) = (rubbing_rig(coupling, false), rubbing_rig(coupling, true));
        let first = start(&quick);
        let mut saved = None;
        for tick in 0..400 {
            run_at(&mut quick, rubbing(tick, first), 1);
            run_at(&mut slow, rubbing(tick, first), 1);
            assert_eq!(quick.state, slow.state, "tick {tick}");
            if tick == 200 {
                assert!(quick.state.mechanical.tools[0].contacts > 0, "saved in contact");
                saved = Some(snapshot::save(&quick.model, &quick.state));
            }
        }
        let mut again = rubbing_rig(coupling, false);
        again.state = snapshot::restore(&again.model, &saved.unwrap()).unwrap();
        for tick in 201..400 {
            run_at(&mut again, rubbing(tick, first), 1);
        }
        assert_eq!(again.state, quick.state);
    }
}

#[test]
fn bad_orientations_are_refused_and_the_tool_stays() {
    let mut rig = rubbing_rig(Coupling::Rigid, false);
    let first = start(&rig);
    for orientation in [DQuat::from_xyzw(0.0, 0.0, 0.0, 0.5), DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0)] {
        let drive = Drive { tools: vec![ToolTarget { orientation, ..first }], ..rig.still() };
        assert_eq!(rig.tick(&drive).inputs_rejected, 1);
        assert_eq!(rig.state.mechanical.tools[0].orientation, first.orientation);
    }
    let pose = ToolTarget { orientation: DQuat::from_rotation_z(FRAC_PI_2) * first.orientation, ..first };
    rig.state.place_tool(0, pose);
    assert_eq!(rig.state.mechanical.tools[0].orientation, pose.orientation);
}

#[test]
fn what_only_spheres_can_press_is_refused_by_name() {
    let mut spec = block();
    spec.tools = vec![lying(0.02, Coupling::Rigid)];
    spec.settings.integrator = Integrator::BackwardEuler;
    let error = palpate_physics::Model::build(spec).unwrap_err();
    assert!(
        matches!(error.environment(), Some(EnvironmentError::SpheresOnly { .. }))
            && error.to_string().contains("backward Euler"),
        "{error}"
    );
    let mut spec = block();
    spec.tools = vec![lying(0.02, Coupling::Rigid)];
    let ToolShape::Capsule(shape) = &mut spec.tools[0].shape else { panic!("a capsule") };
    shape.half_length_m = 0.0;
    assert!(palpate_physics::Model::build(spec).unwrap_err().to_string().contains("half_length_m"));
}
