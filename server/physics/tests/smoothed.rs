//! Smoothed tets: what they keep of linear ones (balance, rigid motion, forces that are derivatives of an energy), and what they
//! are better at: bending, and volume that hardly changes.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::common;
use crate::rig;
use common::{
    Random, block, equilibrium, held, jittered, material, mean_displacement_m, nodes_where, spec, triangles_where,
};
use glam::{DMat3, DQuat, DVec3};
use palpate_physics::{
    BodySpec, LoadSpec, Model, ModelSpec, Precision, Settings, TetMesh,
    bodies::tet::{TetElements, TetSpec},
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
    elements::linear_tet::RestTet,
    material::Law,
    statics::{Goal, StaticSettings, solve_static},
    world::min_volume_ratio,
};
use std::ops::ControlFlow;

const SIZE_M: f64 = 0.1;
const YOUNG_PA: f64 = 10e3;

/// The same body of smoothed tets.
fn smoothed(mut spec: ModelSpec) -> ModelSpec {
    let solid = spec.body.solid().unwrap().clone();
    spec.body = BodySpec::Tet(TetSpec { solid, elements: TetElements::Smoothed });
    spec
}

fn irregular() -> TetMesh {
    jittered(&block(DVec3::splat(SIZE_M), [4, 4, 4]), 0.2 * SIZE_M / 4.0, 7)
}

fn body(law: Law, poisson: f64, precision: Precision) -> Model {
    let mut body = smoothed(spec(irregular(), material(law, YOUNG_PA, poisson), vec![], vec![]));
    body.settings.precision = precision;
    Model::build(body).unwrap()
}

fn forces_n(model: &Model, x: &[DVec3]) -> Vec<DVec3> {
    let (mut forces, v) = (vec![DVec3::ZERO; x.len()], vec![DVec3::ZERO; x.len()]);
    let kernel = model.body().as_tet().unwrap().kernel();
    kernel.forces_n(model.rest_positions_m(), x, &v, &mut forces, &mut kernel.scratch());
    forces
}

/// Every node whose neighbours' tets are all inside is in balance where all of the body is strained alike.
#[test]
fn uniform_deformation_leaves_interior_nodes_in_balance() {
    let mut random = Random(1);
    for law in Law::ALL {
        for (precision, bound) in [(Precision::Double, 1e-12), (Precision::Single, 1e-5)] {
            let model = body(law, 0.45, precision);
            for _ in 0..10 {
                let f = DMat3::IDENTITY + DMat3::from_cols(random.vector(), random.vector(), random.vector()) * 0.15;
                let x: Vec<DVec3> = model.rest_positions_m().iter().map(|p| f * *p + DVec3::X * 0.01).collect();
                let forces = forces_n(&model, &x);
                let on_surface = |node: usize| model.surface().vertex_of_node[node] != u32::MAX;
                let largest = |surface: bool| {
                    let of_kind = (0..x.len()).filter(|&node| on_surface(node) == surface);
                    of_kind.map(|node| forces[node].length()).fold(0.0, f64::max)
                };
                let relative = largest(false) / largest(true);
                assert!(relative < bound, "{law:?} {precision:?}: {relative:e}");
            }
        }
    }
}

#[test]
fn rigid_motion_makes_no_force() {
    let mut random = Random(3);
    for law in Law::ALL {
        let model = body(law, 0.45, Precision::Double);
        for _ in 0..10 {
            let turn = DQuat::from_scaled_axis(random.vector() * 3.0);
            let shift = random.vector() * SIZE_M;
            let x: Vec<DVec3> = model.rest_positions_m().iter().map(|p| turn * *p + shift).collect();
            let worst = forces_n(&model, &x).iter().map(|f| f.length()).fold(0.0, f64::max);
            assert!(worst < 1e-12 * YOUNG_PA * SIZE_M * SIZE_M, "{law:?}: {worst:e}");
        }
    }
}

/// `f = −∂U/∂x` and `−K a = ∂f/∂a` along random directions, and no net force or torque, whatever the sign of λ, and with tets
/// that are crushed and inside out.
#[test]
fn forces_are_derivatives_of_the_energy_and_balance() {
    let mut random = Random(11);
    for law in Law::ALL {
        for (poisson, moved_m) in [(-0.2, 2e-3), (0.3, 2e-3), (0.49, 2e-3), (0.3, 15e-3), (0.49, 15e-3)] {
            let model = body(law, poisson, Precision::Double);
            let tets = model.body().as_tet().unwrap();
            let x: Vec<DVec3> = model.rest_positions_m().iter().map(|p| *p + random.vector() * moved_m).collect();
            let ratios =
                || tets.mesh().tets().iter().zip(tets.rest_tets()).map(|(tet, rest)| volume_ratio(*tet, rest, &x));
            let (crushed, inside_out) = (ratios().filter(|j| *j < 0.5).count(), ratios().filter(|j| *j < 0.0).count());
            assert_eq!(crushed > 20 && inside_out > 5, moved_m > 1e-2, "{crushed} {inside_out}");
            let forces = forces_n(&model, &x);
            let scale: f64 = forces.iter().map(|f| f.length()).sum();
            let torque: DVec3 = x.iter().zip(&forces).map(|(x, f)| x.cross(*f)).sum();
            assert!(forces.iter().sum::<DVec3>().length() < 1e-13 * scale, "{law:?} {poisson}");
            assert!(torque.length() < 1e-13 * scale * SIZE_M, "{law:?} {poisson}: {torque}");
            for _ in 0..5 {
                let direction: Vec<DVec3> = x.iter().map(|_| random.vector()).collect();
                let moved = |by: f64| -> Vec<DVec3> { x.iter().zip(&direction).map(|(x, d)| *x + *d * by).collect() };
                let h = 1e-7;
                let energy = |by: f64| tets.points().energy_j(&moved(by));
                let measured = -(energy(h) - energy(-h)) / (2.0 * h);
                let stated: f64 = forces.iter().zip(&direction).map(|(f, d)| f.dot(*d)).sum();
                assert!((measured - stated).abs() < 1e-6 * scale, "{law:?} {poisson}: {measured} {stated}");

                let (mut products, mut scratch) = (vec![DVec3::ZERO; x.len()], tets.kernel().scratch_for_products());
                tets.kernel().linearise_at(model.rest_positions_m(), &x, &mut scratch);
                tets.kernel().products_n([1.0, 0.0], &direction, &mut products, &mut scratch);
                let (after, before) = (forces_n(&model, &moved(h)), forces_n(&model, &moved(-h)));
                let differ = |node: usize| (after[node] - before[node]) / (2.0 * h) - products[node];
                let worst = (0..x.len()).map(|node| differ(node).length()).fold(0.0, f64::max);
                let largest = products.iter().map(|p| p.length()).fold(0.0, f64::max);
                assert!(worst < 1e-5 * largest, "{law:?} {poisson} {moved_m}: {worst:e} of {largest:e}");
            }
        }
    }
}

fn volume_ratio(nodes: [u32; 4], rest: &RestTet, x: &[DVec3]) -> f64 {
    let [a, b, c, d] = nodes.map(|node| x[node as usize]);
    DMat3::from_cols(b - a, c - a, d - a).determinant() / (6.0 * rest.volume_m3)
}

/// A tool that jumps deep into a block crushes tets whose mean around nodes is sound; without a resistance of their own they were
/// turned inside out (least ratios of volume −0.4 to −4).
#[test]
fn a_brutal_press_turns_no_tet_inside_out() {
    for law in Law::ALL {
        for poisson in [0.0, 0.3, 0.45, 0.49] {
            let size_m = DVec3::new(0.08, 0.08, 0.04);
            let mesh = block(size_m, [10, 10, 5]);
            let floor = held(&mesh, "floor", [true; 3], |p| p.z == 0.0);
            let mut body = smoothed(spec(mesh, material(law, YOUNG_PA, poisson), vec![floor], vec![]));
            body.settings = Settings { mass_damping_per_s: 20.0, ..Settings::default() };
            let above_m = DVec3::new(0.04, 0.04, 0.07);
            body.tools = vec![ToolSpec {
                name: "sphere".into(),
                shape: ToolShape::Sphere,
                radius_m: 0.01,
                coupling: Coupling::Spring { stiffness_n_per_m: 400.0, damping_n_s_per_m: 2.0, mass_kg: 0.02 },
                friction_coefficient: 0.0,
                start_position_m: above_m,
            }];
            let mut rig = rig::Rig::new(body);
            let mut least = f64::INFINITY;
            for tick in 0..120 {
                rig.tick_at(if tick < 5 { above_m } else { above_m - DVec3::Z * 0.09 });
                assert_eq!(rig.state.quarantine, None, "{law:?} {poisson}, tick {tick}");
                least = least.min(min_volume_ratio(&rig.model, &rig.state).unwrap().ratio);
            }
            println!("{law:?}, nu {poisson}: least volume ratio {least:.3}");
            assert!(least > 0.0 && least < 0.5, "{law:?} {poisson}: {least}");
        }
    }
}

/// Deflection of a cantilever of 100 × 10 × 10 mm under a small load on its end, whose root is held along the beam alone, over
/// Timoshenko's `PL³/(3EI) + PL/(kGA)`, `k = 10(1 + ν)/(12 + 11ν)`.
fn deflection_ratio(poisson: f64, cells: usize, of: fn(ModelSpec) -> ModelSpec) -> f64 {
    let (length, side, force_n) = (0.1_f64, 0.01_f64, 1e-5);
    let mesh = block(DVec3::new(length, side, side), [10 * cells, cells, cells]);
    let traction = |x: f64, sign: f64| LoadSpec::Traction {
        triangles: triangles_where(&mesh, |p| p.x == x),
        traction_pa: DVec3::Z * sign * force_n / (side * side),
    };
    let middle = |v: f64| (v - 0.5 * side).abs() < 1e-9;
    let prescribed = vec![
        held(&mesh, "root", [true, false, false], |p| p.x == 0.0),
        held(&mesh, "centre", [false, false, true], |p| p.x == 0.0 && middle(p.y) && middle(p.z)),
        held(&mesh, "plane", [false, true, false], |p| p.x == 0.0 && middle(p.y)),
    ];
    let loads = vec![traction(length, 1.0), traction(0.0, -1.0)];
    let law = material(Law::StableNeoHookean, YOUNG_PA, poisson);
    let model = Model::build(of(spec(mesh, law, prescribed, loads))).unwrap();
    let found = equilibrium(&model, 1.0, &[]);
    let mean =
        |x: f64| mean_displacement_m(&model, &found.x, &nodes_where(model.body().tets().unwrap(), |p| p.x == x)).z;
    let (area, inertia, shear) = (side * side, side.powi(4) / 12.0, YOUNG_PA / (2.0 * (1.0 + poisson)));
    let k = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson);
    let exact = force_n * length.powi(3) / (3.0 * YOUNG_PA * inertia) + force_n * length / (k * shear * area);
    (mean(length) - mean(0.0)) / exact
}

/// Linear tets two cells high bend six tenths as far. Measured: 0.950, 0.999, 0.979, 0.963, 0.958.
#[test]
fn a_beam_two_cells_high_bends_as_it_should() {
    for (poisson, bound) in [(0.0, 0.06), (0.3, 0.05), (0.45, 0.05), (0.49, 0.05), (0.499, 0.05)] {
        let [linear, smoothed] = [|spec| spec, smoothed].map(|of| deflection_ratio(poisson, 2, of));
        println!(
            "beam two cells high, nu {poisson}: linear {linear:.3}, smoothed {smoothed:.3} of Timoshenko's deflection"
        );
        assert!((smoothed - 1.0).abs() < bound, "{poisson}: {smoothed}");
        assert!(linear < 0.65, "{poisson}: {linear}");
    }
}

/// Force (N) of a rigid sphere pressed into the middle of a block of 80 × 80 × 40 mm, held at its lower face, of cells of a size,
/// its centre `aside_m` from the middle node.
fn pressed_force_n(poisson: f64, cell_m: f64, radius_m: f64, depth_m: f64, aside_m: DVec3) -> f64 {
    let size_m = DVec3::new(0.08, 0.08, 0.04);
    let mesh = block(size_m, (size_m / cell_m).to_array().map(|n| n.round() as usize));
    let mesh = jittered(&mesh, 0.1 * cell_m, 5);
    let floor = held(&mesh, "floor", [true; 3], |p| p.z == 0.0);
    let law = material(Law::StableNeoHookean, YOUNG_PA, poisson);
    let mut body = smoothed(spec(mesh, law, vec![floor], vec![]));
    let touching_m = DVec3::new(0.04, 0.04, 0.04 + radius_m) + aside_m;
    body.tools = vec![ToolSpec {
        name: "sphere".into(),
        shape: ToolShape::Sphere,
        radius_m,
        coupling: Coupling::Rigid,
        friction_coefficient: 0.0,
        start_position_m: touching_m,
    }];
    let model = Model::build(body).unwrap();
    let tools = [ToolTarget::at(touching_m - DVec3::Z * depth_m)];
    let goal = Goal { prescribed_displacements_m: &[DVec3::ZERO], tools: &tools, ..Goal::default() };
    let solved = solve_static(&model, &goal, &StaticSettings::default(), &mut |_| ControlFlow::Continue(())).unwrap();
    solved.tools[0].contact_force_n.z
}

/// Hertz's problem where a half space is not enough: against triquadratic hexahedra with linear pressure, which do not lock
/// (`palpate-lab locking`). At nodes, where the lab's block is pressed, forces are within some 5 %; this block's nodes join 8 or 24 tets by
/// turns, and a contact of a cell's size feels whether one is beneath it.
#[test]
fn a_sphere_meets_the_force_of_a_solid_wherever_it_presses() {
    for (poisson, cell_m, depth_m, solid_n, bound) in [
        (0.3, 0.01, 5e-3, 0.57706, 0.15),
        (0.45, 0.01, 5e-3, 0.63833, 0.2),
        (0.49, 0.01, 5e-3, 0.66044, 0.27),
        (0.3, 0.005, 5e-3, 0.57706, 0.12),
        (0.45, 0.005, 5e-3, 0.63833, 0.07),
        (0.45, 0.01, 1e-3, 0.05559, 0.8),
        (0.45, 0.005, 1e-3, 0.05559, 0.27),
    ] {
        for aside in [DVec3::ZERO, DVec3::new(0.5, 0.0, 0.0), DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.3, -0.2, 0.0)] {
            let force_n = pressed_force_n(poisson, cell_m, 0.01, depth_m, aside * cell_m);
            let error = force_n / solid_n - 1.0;
            println!("nu {poisson}, cells of {cell_m}, {depth_m} deep, {aside} cells aside: {:+.1} %", 100.0 * error);
            assert!(
                error.abs() < bound,
                "nu {poisson}, cells of {cell_m}, {depth_m} deep, {aside} cells aside: {error:+.3}"
            );
        }
    }
}
