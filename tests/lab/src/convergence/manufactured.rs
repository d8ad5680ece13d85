//! A manufactured solution on the unit block: `u = A sin πX sin πY sin πZ · (1, −½, ¾)`, zero on the boundary, at finite strain. The body force
//! that makes it an equilibrium is `−Div P`, `(Div P)_i = Σ_k [δP(F; ∂F/∂X_k) e_k]_i`, integrated against the shape functions.
use super::Convergence;
use crate::methods::tet_body;
use crate::random::Random;
use crate::{bodies, stress::meshes};
use glam::{DMat3, DVec3};
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    BodySpec, LoadSpec, Model, ModelSpec, Precision, PrescribedSpec, Region, Settings, Solid, Surface, TetMesh,
    linalg::tensor::outer,
    material::{Law, Material},
    mesh::tet::EDGES,
    statics::{Goal, StaticSettings, solve_static},
};
use std::{f64::consts::PI, ops::ControlFlow};

const CELLS: [u32; 3] = [4, 8, 16];
const AMPLITUDE_M: f64 = 0.04;
const DIRECTION: DVec3 = DVec3::new(1.0, -0.5, 0.75);
/// Largest shift of an interior node over the cells' size: meshes are irregular, lest errors cancel.
const JITTER: f64 = 0.15;

/// Relative errors in L2 and in the H1 seminorm.
pub(super) fn study(law: Law) -> Result<[Convergence; 2]> {
    let material = bodies::material(law, 10e3, 0.3)?;
    let errors = CELLS.iter().map(|&cells| errors(material, cells)).collect::<Result<Vec<_>>>()?;
    let convergence = |quantity, norm: usize, demand| Convergence {
        quantity,
        refined: "cells along a side",
        sizes: CELLS.to_vec(),
        errors: errors.iter().map(|e| e[norm]).collect(),
        demand,
    };
    Ok([
        convergence("linear tetrahedra: displacements (relative L2)", 0, 1.9),
        convergence("linear tetrahedra: their gradients (relative H1)", 1, 0.95),
    ])
}

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
    for [i, j] in EDGES {
        rule.push((std::array::from_fn(|k| if k == i || k == j { a } else { b }), 6.0 * 0.024_888_888_888_888_89));
    }
    rule
}

fn at(corners: &[DVec3; 4], weights: &[f64; 4]) -> DVec3 {
    corners.iter().zip(weights).map(|(c, w)| *c * *w).sum()
}

/// The unit block, neighbouring cells mirrored, with its interior nodes shifted, always in the same way.
fn jittered(cells: u32) -> Result<(TetMesh, Vec<u32>)> {
    let side = meshes::even(0.0, 1.0, cells as usize);
    let regular = meshes::bricks(&side, &side, &side)?;
    let boundary = Surface::of(&regular).into_diagnostic()?.nodes;
    let mut random = Random::new(11);
    let shift = JITTER / f64::from(cells);
    let mut positions: Vec<DVec3> = regular.positions_m().iter().map(|p| *p + random.vector() * shift).collect();
    for &node in &boundary {
        positions[node as usize] = regular.positions_m()[node as usize];
    }
    Ok((TetMesh::new(positions, regular.tets().to_vec()).into_diagnostic()?, boundary))
}

/// Relative to the norms of `u`.
fn errors(material: Material, cells: u32) -> Result<[f64; 2]> {
    let (mesh, boundary) = jittered(cells)?;
    let rule = quadrature();
    let model = loaded(mesh, boundary, material, &rule)?;
    let settings = StaticSettings { relative_residual: 1e-10, ..StaticSettings::default() };
    let found = solve_static(
        &model,
        &Goal { load_factors: &[1.0], prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() },
        &settings,
        &mut |_| ControlFlow::Continue(()),
    )
    .into_diagnostic()?;
    let mut sums = [0.0; 4];
    for (tet, nodes) in tet_body(&model).mesh().tets().iter().enumerate() {
        let (corners, rest) = (tet_body(&model).mesh().corners_m(tet), &tet_body(&model).rest_tets()[tet]);
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
    Ok([(sums[0] / sums[2]).sqrt(), (sums[1] / sums[3]).sqrt()])
}

fn loaded(mesh: TetMesh, boundary: Vec<u32>, material: Material, rule: &[([f64; 4], f64)]) -> Result<Model> {
    let mut forces = vec![DVec3::ZERO; mesh.positions_m().len()];
    for (tet, nodes) in mesh.tets().iter().enumerate() {
        let (corners, volume) = (mesh.corners_m(tet), mesh.volume_m3(tet));
        for (weights, share) in rule {
            let force = body_force(&material, at(&corners, weights)) * (share * volume);
            for (node, weight) in nodes.iter().zip(weights) {
                forces[*node as usize] += force * *weight;
            }
        }
    }
    Model::build(ModelSpec {
        body: BodySpec::Tet(
            Solid {
                regions: vec![Region { name: "body".into(), material, density_kg_per_m3: 1000.0 }],
                tet_region: vec![0; mesh.tets().len()],
                mesh,
            }
            .into(),
        ),
        prescribed: vec![PrescribedSpec { name: "boundary".into(), nodes: boundary, axes: [true; 3], is_fixed: false }],
        loads: vec![LoadSpec::NodalForces((0u32..).zip(forces).collect())],
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![],
        settings: Settings { precision: Precision::Double, ..Settings::default() },
    })
    .into_diagnostic()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_integrates_quartics() {
        // ∫ ζ0² ζ1² / V = 2! 2! 3! / 7!, ∫ ζ0⁴ / V = 4! 3! / 7!.
        let mean = |f: fn(&[f64; 4]) -> f64| quadrature().iter().map(|(w, share)| f(w) * share).sum::<f64>();
        assert!((mean(|w| w[0] * w[0] * w[1] * w[1]) - 24.0 / 5040.0).abs() < 1e-15);
        assert!((mean(|w| w[0].powi(4)) - 144.0 / 5040.0).abs() < 1e-15);
    }
}
