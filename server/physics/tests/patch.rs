//! The patch test, in both precisions, and rigid motion.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::common;
use common::{Random, block, equilibrium, jittered, material, spec};
use glam::{DMat3, DQuat, DVec3};
use palpate_physics::{Model, ModelSpec, Precision, PrescribedSpec, TetMesh, material::Law};

const YOUNG_PA: f64 = 10e3;
const SIZE_M: f64 = 0.1;

/// A block of 4×4×4 cells, 1 cm wide, with interior nodes moved by up to a fifth of a cell.
fn irregular() -> TetMesh {
    jittered(&block(DVec3::splat(SIZE_M), [4, 4, 4]), 0.2 * SIZE_M / 4.0, 7)
}

fn body(law: Law, precision: Precision) -> ModelSpec {
    let mut body = spec(irregular(), material(law, YOUNG_PA, 0.45), vec![], vec![]);
    body.settings.precision = precision;
    body
}

/// `F = I + 0.3 R`, R with entries in (−1, 1), and J > 0.2.
fn random_gradient(random: &mut Random) -> DMat3 {
    loop {
        let r = DMat3::from_cols(random.vector(), random.vector(), random.vector());
        let f = DMat3::IDENTITY + r * 0.3;
        if f.determinant() > 0.2 {
            return f;
        }
    }
}

fn kernel_forces(model: &Model, x: &[DVec3]) -> Vec<DVec3> {
    let mut forces = vec![DVec3::ZERO; x.len()];
    let v = vec![DVec3::ZERO; x.len()];
    let kernel = model.body().as_tet().unwrap().kernel();
    kernel.forces_n(model.rest_positions_m(), x, &v, &mut forces, &mut kernel.scratch());
    forces
}

/// Largest interior force, over the sum of the magnitudes that balance at its node, and over the largest corner force of any tet.
fn interior_residual(model: &Model, f: DMat3) -> [f64; 2] {
    let x: Vec<DVec3> = model.rest_positions_m().iter().map(|p| f * *p + DVec3::new(0.01, -0.02, 0.03)).collect();
    let forces = kernel_forces(model, &x);
    let mut balanced = vec![0.0; x.len()];
    let mut largest = 0.0_f64;
    let tets = model.body().as_tet().unwrap();
    for (tet, nodes) in tets.mesh().tets().iter().enumerate() {
        let corners = tets.rest_tets()[tet].corner_forces_n(&tets.material_of(tet).piola(&f));
        for (node, corner) in nodes.iter().zip(corners) {
            balanced[*node as usize] += corner.length();
            largest = largest.max(corner.length());
        }
    }
    let interior = (0..x.len()).filter(|&node| model.surface().vertex_of_node[node] == u32::MAX);
    interior.fold([0.0; 2], |[sum, single], node| {
        let residual = forces[node].length();
        [f64::max(sum, residual / balanced[node]), f64::max(single, residual / largest)]
    })
}

#[test]
fn uniform_deformation_leaves_interior_nodes_in_balance() {
    for law in Law::ALL {
        let name = law.name();
        for (precision, bound) in [(Precision::Double, 1e-12), (Precision::Single, 1e-5)] {
            let model = Model::build(body(law, precision)).unwrap();
            let mut random = Random(1);
            let found: Vec<[f64; 2]> =
                (0..20).map(|_| interior_residual(&model, random_gradient(&mut random))).collect();
            let [sum, single] = [0, 1].map(|k: usize| found.iter().map(|f| f[k]).fold(0.0, f64::max));
            println!(
                "patch, {name}, {precision:?}: worst of 20 random F {sum:.1e} of what balances at the node, {single:.1e} of \
                 the largest corner force"
            );
            assert!(sum < 0.1 * bound && single < bound, "{name} {precision:?}: {sum:e} {single:e}");
        }
    }
}

#[test]
fn a_boundary_moved_uniformly_solves_to_a_uniform_interior() {
    for law in Law::ALL {
        let name = law.name();
        let mut body = body(law, Precision::Double);
        let f = random_gradient(&mut Random(5));
        let mesh = body.body.solid().unwrap().mesh.clone();
        let held: Vec<u32> = palpate_physics::Surface::of(&mesh).unwrap().nodes;
        body.prescribed = held
            .iter()
            .map(|&n| PrescribedSpec { name: format!("{n}"), nodes: vec![n], axes: [true; 3], is_fixed: false })
            .collect();
        let moved: Vec<DVec3> = held
            .iter()
            .map(|&n| {
                let rest = mesh.positions_m()[n as usize];
                f * rest - rest
            })
            .collect();
        let model = Model::build(body).unwrap();
        let found = equilibrium(&model, 1.0, &moved);
        let error = |(x, rest): (&DVec3, &DVec3)| x.distance(f * *rest);
        let worst = found.x.iter().zip(model.rest_positions_m()).map(error).fold(0.0, f64::max);
        println!("patch by static solve, {name}: positions within {:.1e} of the size", worst / SIZE_M);
        assert!(worst < 1e-12 * SIZE_M, "{name}: {worst:e}");
    }
}

#[test]
fn rigid_motion_makes_no_force() {
    let mut random = Random(3);
    for law in Law::ALL {
        let name = law.name();
        let model = Model::build(body(law, Precision::Double)).unwrap();
        let mut worst = 0.0_f64;
        for _ in 0..20 {
            let turn = DQuat::from_scaled_axis(random.vector() * 3.0);
            let shift = random.vector() * SIZE_M;
            let x: Vec<DVec3> = model.rest_positions_m().iter().map(|p| turn * *p + shift).collect();
            worst = kernel_forces(&model, &x).iter().map(|f| f.length()).fold(worst, f64::max);
        }
        let relative = worst / (YOUNG_PA * SIZE_M * SIZE_M);
        println!("rigid motion, {name}: worst force {relative:.1e} E A");
        assert!(relative < 1e-12, "{name}: {relative:e}");
    }
}
