//! A manufactured solution: linear tets converge with order 2 in L2 and 1 in H1, on irregular meshes and at finite strain.
//!
//! On the unit block `x(X) = X + u(X)`, `u = A sin πX sin πY sin πZ · (1, −½, ¾)`, zero on the boundary. The body force that makes
//! it an equilibrium is `−Div P`, `(Div P)_i = Σ_k ∂P_ik/∂X_k = Σ_k [δP(F; ∂F/∂X_k) e_k]_i`, integrated against the shape functions.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
mod common;
use common::{LAWS, block, equilibrium, jittered, material, spec};
use glam::{DMat3, DVec3};
use palpate_physics::{LoadSpec, Model, PrescribedSpec, Surface, material::Material};
use std::f64::consts::PI;

const AMPLITUDE_M: f64 = 0.04;
const DIRECTION: DVec3 = DVec3::new(1.0, -0.5, 0.75);
const YOUNG_PA: f64 = 10e3;

/// `s = sin πX sin πY sin πZ`, its gradient and its Hessian.
fn bump(p: DVec3) -> (f64, DVec3, DMat3) {
    let s = p.to_array().map(|v| (PI * v).sin());
    let c = p.to_array().map(|v| PI * (PI * v).cos());
    let product = |factors: [f64; 3]| factors.iter().product::<f64>();
    let first = |i: usize| product(std::array::from_fn(|k| if k == i { c[k] } else { s[k] }));
    let second = |i: usize, j: usize| {
        if i == j {
            return -PI * PI * product(s);
        }
        product(std::array::from_fn(|k| if k == i || k == j { c[k] } else { s[k] }))
    };
    let column = |j: usize| DVec3::new(second(0, j), second(1, j), second(2, j));
    (product(s), DVec3::new(first(0), first(1), first(2)), DMat3::from_cols(column(0), column(1), column(2)))
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

fn gradient(p: DVec3) -> DMat3 {
    DMat3::IDENTITY + outer(DIRECTION * AMPLITUDE_M, bump(p).1)
}

/// `−Div P` (N/m³).
fn body_force(material: &Material, p: DVec3) -> DVec3 {
    let (f, hessian) = (gradient(p), bump(p).2);
    let term = |k: usize| {
        let df = outer(DIRECTION * AMPLITUDE_M, hessian.col(k));
        material.piola_differential(&f, &df).col(k)
    };
    -(term(0) + term(1) + term(2))
}

/// Keast's rule of degree 4 with 11 points (Keast 1986, Comput. Methods Appl. Mech. Eng. 55:339): barycentric points and
/// weights that sum to 1.
fn quadrature() -> Vec<([f64; 4], f64)> {
    let mut rule = vec![([0.25; 4], 6.0 * -0.013_155_555_555_555_555)];
    let (a, b) = (0.785_714_285_714_285_7, 0.071_428_571_428_571_42);
    for corner in 0..4 {
        rule.push((std::array::from_fn(|k| if k == corner { a } else { b }), 6.0 * 0.007_622_222_222_222_222));
    }
    let (a, b) = (0.399_403_576_166_799_2, 0.100_596_423_833_200_8);
    for [i, j] in palpate_physics::mesh::tet::EDGES {
        rule.push((std::array::from_fn(|k| if k == i || k == j { a } else { b }), 6.0 * 0.024_888_888_888_888_89));
    }
    rule
}

/// L2 and H1-seminorm errors, relative to those of `u`.
fn errors(material: Material, cells: usize) -> [f64; 2] {
    let mesh = jittered(&block(DVec3::ONE, [cells; 3]), 0.15 / cells as f64, 11);
    let rule = quadrature();
    let mut forces = vec![DVec3::ZERO; mesh.positions_m().len()];
    for (tet, nodes) in mesh.tets().iter().enumerate() {
        let (corners, volume) = (mesh.corners_m(tet), mesh.volume_m3(tet));
        for (weights, share) in &rule {
            let force = body_force(&material, at(&corners, weights)) * (share * volume);
            for (node, weight) in nodes.iter().zip(weights) {
                forces[*node as usize] += force * *weight;
            }
        }
    }
    let loads = vec![LoadSpec::NodalForces((0u32..).zip(forces).collect())];
    let boundary = Surface::of(&mesh).unwrap().nodes;
    let prescribed = vec![PrescribedSpec { name: "boundary".into(), nodes: boundary, axes: [true; 3] }];
    let model = Model::build(spec(mesh, material, prescribed, loads)).unwrap();
    let found = equilibrium(&model, 1.0, &[]);
    let mut sums = [0.0; 4];
    for (tet, nodes) in model.mesh().tets().iter().enumerate() {
        let (corners, rest) = (model.mesh().corners_m(tet), &model.rest_tets()[tet]);
        let x = nodes.map(|n| found.x[n as usize]);
        let f = rest.gradient_of(&x);
        for (weights, share) in &rule {
            let p = at(&corners, weights);
            let measure = share * rest.volume_m3;
            let u = DIRECTION * (AMPLITUDE_M * bump(p).0);
            let square = |m: DMat3| m.to_cols_array().iter().map(|v| v * v).sum::<f64>();
            sums[0] += measure * (at(&x, weights) - p - u).length_squared();
            sums[1] += measure * square(f - gradient(p));
            sums[2] += measure * u.length_squared();
            sums[3] += measure * square(gradient(p) - DMat3::IDENTITY);
        }
    }
    [(sums[0] / sums[2]).sqrt(), (sums[1] / sums[3]).sqrt()]
}

fn at(corners: &[DVec3; 4], weights: &[f64; 4]) -> DVec3 {
    corners.iter().zip(weights).map(|(c, w)| *c * *w).sum()
}

#[test]
fn the_rule_integrates_quartics() {
    // ∫ ζ0² ζ1² / V = 2! 2! 3! / 7!, ∫ ζ0⁴ / V = 4! 3! / 7!.
    let mean = |f: fn(&[f64; 4]) -> f64| quadrature().iter().map(|(w, share)| f(w) * share).sum::<f64>();
    assert!((mean(|w| w[0] * w[0] * w[1] * w[1]) - 24.0 / 5040.0).abs() < 1e-15);
    assert!((mean(|w| w[0].powi(4)) - 144.0 / 5040.0).abs() < 1e-15);
}

#[test]
fn linear_tets_converge_to_a_manufactured_solution() {
    for (name, law) in LAWS {
        let material = material(law, YOUNG_PA, 0.3);
        let found = [4, 8, 16].map(|cells| errors(material, cells));
        let order = |norm: usize, k: usize| (found[k][norm] / found[k + 1][norm]).log2();
        println!(
            "manufactured, {name}: L2 {:.2e} {:.2e} {:.2e}, order {:.2} {:.2}; H1 {:.2e} {:.2e} {:.2e}, order {:.2} {:.2}",
            found[0][0],
            found[1][0],
            found[2][0],
            order(0, 0),
            order(0, 1),
            found[0][1],
            found[1][1],
            found[2][1],
            order(1, 0),
            order(1, 1),
        );
        assert!(order(0, 1) >= 1.9 && order(1, 1) >= 0.95, "{name}");
    }
}
