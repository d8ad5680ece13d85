//! The local contact model against finite differences of static presses, and its promises.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::{DQuat, DVec3};
use palpate_physics::{
    ModelSpec,
    contact::{Coupling, LocalContactModel, ToolShape, ToolTarget},
    material::Law,
};
use rig::{Drive, Rig, body, bricks, graded, hold, material, nodes_where, sphere};

const RADIUS_M: f64 = 0.008;

/// A bonded block 60 × 60 × `height_m`, finer in its middle, strongly damped, with a sphere just above.
fn block(height_m: f64, nu: f64, coupling: Coupling, friction: f64) -> ModelSpec {
    let half = graded(0.003, 0.006, 1.5, 0.03);
    let mirrored: Vec<f64> = half.iter().rev().map(|x| -x).chain(half.iter().skip(1).copied()).collect();
    let heights: Vec<f64> = graded(0.003, 0.006, 1.5, height_m).iter().rev().map(|z| -z).collect();
    let mesh = bricks(&mirrored, &mirrored, &heights);
    let bottom = nodes_where(&mesh, |p| p.z <= heights[0]);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, nu));
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    spec.settings.mass_damping_per_s = 120.0;
    spec.tools = vec![sphere(RADIUS_M, DVec3::Z * RADIUS_M, coupling)];
    spec.tools[0].friction_coefficient = friction;
    spec
}

fn soft_coupling() -> Coupling {
    Coupling::Spring { stiffness_n_per_m: 300.0, damping_n_s_per_m: 3.0, mass_kg: 0.01 }
}

/// Moves the device to a place in `ticks`, turned as it is, waits, and returns the force on the device.
fn settle(rig: &mut Rig, to_m: DVec3, ticks: u32) -> DVec3 {
    let from = rig.state.mechanical.tools[0].target;
    for tick in 1..=ticks + 80 {
        let s = (f64::from(tick) / f64::from(ticks)).min(1.0);
        let target = ToolTarget { position_m: from.position_m.lerp(to_m, s), ..from };
        let drive = Drive { tools: vec![target], ..rig.still() };
        rig.tick(&drive);
    }
    rig.state.mechanical.tools[0].device_force_n
}

/// `∂F/∂p` by central differences of static presses about where the device is.
fn static_stiffness(rig: &Rig, axis: DVec3, step_m: f64) -> DVec3 {
    let at = |sign: f64| {
        let mut copy = rig.clone();
        let here = rig.state.mechanical.tools[0].target.position_m;
        settle(&mut copy, here + axis * (sign * step_m), 40)
    };
    (at(1.0) - at(-1.0)) / (2.0 * step_m)
}

fn pressed(spec: ModelSpec, depth_m: f64) -> (Rig, LocalContactModel) {
    let mut rig = Rig::new(spec);
    settle(&mut rig, DVec3::Z * (RADIUS_M - depth_m), 200);
    let model = rig.state.mechanical.tools[0].local_model.unwrap();
    (rig, model)
}

/// Stated error: 10 %. Measured: −7 … +5 %, on finer meshes less.
#[test]
fn normal_stiffness_is_that_of_static_presses() {
    for (height, nu, coupling, depth) in [
        (0.03, 0.3, soft_coupling(), 0.001),
        (0.015, 0.45, soft_coupling(), 0.003),
        (0.03, 0.3, Coupling::Rigid, 0.001),
        (0.015, 0.45, Coupling::Rigid, 0.002),
    ] {
        let (rig, model) = pressed(block(height, nu, coupling, 0.0), depth);
        let measured = -static_stiffness(&rig, DVec3::Z, 1e-4).z;
        let told = -model.stiffness_n_per_m.z_axis.z;
        let error = told / measured - 1.0;
        println!("H {height}, nu {nu}: model {told:.1} N/m, presses {measured:.1} N/m, {:+.1} %", 100.0 * error);
        assert!(error.abs() < 0.1, "{error}");
        assert!(model.normal.distance(DVec3::Z) < 1e-6);
        // Frictionless: the tool follows the device along the surface.
        assert!(model.stiffness_n_per_m.x_axis.x.abs() < 1e-6);
    }
}

/// A capsule on its side, in the middle of the block and with one end beyond its edge, where it gives way by turning, too. Stated error: 10 %. Measured: −7 … −1 %.
#[test]
fn a_lying_capsule_is_as_stiff_as_static_presses_say() {
    for (coupling, beside_m, depth_m) in
        [(soft_coupling(), 0.0, 0.002), (Coupling::Rigid, 0.0, 0.001), (soft_coupling(), 0.035, 0.002)]
    {
        let mut spec = block(0.015, 0.45, coupling, 0.0);
        spec.tools[0].shape = ToolShape::capsule(coupling, RADIUS_M, 0.012, DVec3::X);
        spec.tools[0].start_position_m = DVec3::new(beside_m, 0.0, RADIUS_M);
        let mut rig = Rig::new(spec);
        settle(&mut rig, DVec3::new(beside_m, 0.0, RADIUS_M - depth_m), 200);
        let model = rig.state.mechanical.tools[0].local_model.unwrap();
        let measured = -static_stiffness(&rig, DVec3::Z, 1e-4).z;
        let told = -model.stiffness_n_per_m.z_axis.z;
        let error = told / measured - 1.0;
        println!(
            "capsule {beside_m} m beside: model {told:.1} N/m, presses {measured:.1} N/m, {:+.1} %",
            100.0 * error
        );
        assert!(error.abs() < 0.1, "{error}");
    }
}

/// `∂τ/∂θ` about an axis by central differences of static turns of the device where it is.
fn static_turning(rig: &Rig, axis: DVec3, step_rad: f64) -> DVec3 {
    let at = |sign: f64| {
        let mut copy = rig.clone();
        let here = rig.state.mechanical.tools[0].target;
        for tick in 1..=120 {
            let turn = DQuat::from_scaled_axis(axis * (sign * step_rad * (f64::from(tick) / 40.0).min(1.0)));
            let target = ToolTarget { orientation: turn * here.orientation, ..here };
            let drive = Drive { tools: vec![target], ..copy.still() };
            copy.tick(&drive);
        }
        copy.state.mechanical.tools[0].device_torque_nm
    };
    (at(1.0) - at(-1.0)) / (2.0 * step_rad)
}

/// Tilting: −9 to −34 %, by the body's share of the stiffness. Where friction holds the samples, spinning on the surface −26, −18 %, rolling +7, +13 %. Without friction the
/// model resists a spin by what the sides of the contact slope, 5 % of what it does tilting.
#[test]
fn a_lying_capsule_is_as_hard_to_turn_as_static_turns_say() {
    let stiff = Coupling::Spring { stiffness_n_per_m: 2000.0, damping_n_s_per_m: 8.0, mass_kg: 0.01 };
    for (coupling, beside_m, depth_m, friction) in [
        (soft_coupling(), 0.0, 0.002, 0.0),
        (stiff, 0.0, 0.001, 0.0),
        (Coupling::Rigid, 0.0, 0.001, 0.0),
        (soft_coupling(), 0.035, 0.002, 0.0),
        (stiff, 0.035, 0.001, 0.0),
        (Coupling::Rigid, 0.035, 0.001, 0.0),
        (stiff, 0.0, 0.001, 0.8),
        (Coupling::Rigid, 0.0, 0.001, 0.8),
    ] {
        let mut spec = block(0.015, 0.45, coupling, friction);
        spec.tools[0].shape = ToolShape::capsule(coupling, RADIUS_M, 0.012, DVec3::X);
        spec.tools[0].start_position_m = DVec3::new(beside_m, 0.0, RADIUS_M);
        let mut rig = Rig::new(spec);
        settle(&mut rig, DVec3::new(beside_m, 0.0, RADIUS_M - depth_m), 200);
        let model = rig.state.mechanical.tools[0].local_model.unwrap().torque.unwrap();
        let about = |axis: DVec3| {
            let measured = -static_turning(&rig, axis, 0.01).dot(axis);
            let told = -(model.stiffness_nm_per_rad * axis).dot(axis);
            println!(
                "{coupling:?} {beside_m} m beside, mu {friction}, about {axis}: model {:.3}, turns {:.3} mN m/rad, {:+.1} %",
                1e3 * told,
                1e3 * measured,
                100.0 * (told / measured - 1.0)
            );
            (told, measured)
        };
        let [rolling, tilting, spinning] = DVec3::AXES.map(about);
        let share = |(told, measured): (f64, f64)| told / measured;
        assert!((0.65..1.0).contains(&share(tilting)), "{tilting:?}");
        if friction > 0.0 {
            assert!((0.7..1.2).contains(&share(spinning)) && (0.8..1.2).contains(&share(rolling)));
        } else {
            assert!(spinning.0 < 0.06 * tilting.0 && rolling.0.abs() < 1e-3 * tilting.0);
        }
    }
}

/// Stated error: 10 %. Measured: +4 … +7 %, on finer meshes less.
#[test]
fn sticking_contact_has_tangential_stiffness() {
    for coupling in [soft_coupling(), Coupling::Rigid] {
        let (rig, model) = pressed(block(0.03, 0.45, coupling, 0.8), 0.002);
        let measured = -static_stiffness(&rig, DVec3::X, 1e-4).x;
        let told = -model.stiffness_n_per_m.x_axis.x;
        let error = told / measured - 1.0;
        println!("tangential: model {told:.1} N/m, presses {measured:.1} N/m, {:+.1} %", 100.0 * error);
        assert!(error.abs() < 0.1, "{error}");
    }
}

/// Within the validity radius the model's force is that of a static press, to 8 % of the force at its rim: 5 % that
/// any linear model of Hertz's law makes there, and the error of the stiffness.
#[test]
fn the_force_it_predicts_is_the_force_that_comes() {
    for coupling in [soft_coupling(), Coupling::Rigid] {
        let (rig, model) = pressed(block(0.015, 0.45, coupling, 0.0), 0.002);
        for sign in [-1.0, 1.0] {
            let to = model.point_m + DVec3::Z * (sign * model.validity_radius_m);
            let predicted = model.force_n + model.stiffness_n_per_m * (to - model.point_m);
            let mut copy = rig.clone();
            let came = settle(&mut copy, to, 60);
            let error = (predicted - came).length() / model.force_n.length();
            println!("radius {:.2e} m: predicted {:.4} N, came {:.4} N", model.validity_radius_m, predicted.z, came.z);
            assert!(error < 0.08, "{error}");
        }
    }
}

/// Tapping, sliding, leaving: symmetric, never pulling, never stiffer than the coupling, no jump from tick to tick.
#[test]
fn it_keeps_its_promises_in_motion() {
    let coupling_n_per_m = 300.0;
    let mut spec = block(0.015, 0.45, soft_coupling(), 0.5);
    spec.settings.mass_damping_per_s = 5.0;
    let mut rig = Rig::new(spec);
    let (mut before, mut contacts, mut steepest) = (0.0, 0, 0.0_f64);
    for tick in 0..800 {
        let t = f64::from(tick) * 1e-3;
        let place = DVec3::new(0.008 * (9.0 * t).sin(), 0.003 * (23.0 * t).sin(), -0.003 * (30.0 * t).sin());
        rig.tick_at(DVec3::Z * RADIUS_M + place);
        let Some(model) = rig.state.mechanical.tools[0].local_model else {
            before = 0.0;
            continue;
        };
        contacts += 1;
        let k = model.stiffness_n_per_m;
        assert!((k - k.transpose()).abs_diff_eq(glam::DMat3::ZERO, 1e-9));
        assert!((model.normal.length() - 1.0).abs() < 1e-12);
        for direction in [model.normal, model.normal.any_orthonormal_vector(), DVec3::new(0.6, 0.64, -0.48)] {
            let along = -direction.dot(k * direction);
            assert!((-1e-9..=coupling_n_per_m * (1.0 + 1e-9)).contains(&along), "tick {tick}: {along}");
        }
        assert!(model.validity_radius_m > 0.0 && model.validity_radius_m <= RADIUS_M);
        assert_eq!(model.point_m, rig.state.mechanical.tools[0].target.position_m);
        let now = -model.normal.dot(k * model.normal);
        steepest = steepest.max((now - before).abs());
        before = now;
    }
    println!("{contacts} ticks in contact, largest change of stiffness in a tick {steepest:.1} N/m");
    assert!(contacts > 200);
    assert!(steepest < 0.1 * coupling_n_per_m, "{steepest}");
}
