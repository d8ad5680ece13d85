//! Natural frequencies of a reference body at rest, with the masses of [`super::dynamics`].
//!
//! Subspace iteration: `K Y = M X`, Rayleigh and Ritz on Y (`YᵀKY a = ω² YᵀMY a`), and X from the Ritz vectors.
use super::{bodies::Body, dynamics::masses_kg, matrix::System, ordering::nested_dissection, solid::Solid};
use faer::{Mat, Side};
use glam::DVec3;
use miette::{Result, bail, ensure, miette};
use std::f64::consts::TAU;

/// Vectors beyond those that are asked for, which the last of these converge by.
const MORE: usize = 8;
const MOST_ITERATIONS: usize = 60;
/// Relative change of `ω²` in an iteration at which it has converged.
const TOLERANCE: f64 = 1e-9;

/// Returns the `count` lowest natural frequencies (Hz), ascending.
///
/// # Errors
/// A body that is not held, or frequencies that do not settle.
pub fn frequencies_hz(solid: &Solid, body: &Body, density_kg_per_m3: f64, count: usize) -> Result<Vec<f64>> {
    let free = body.free_axes();
    let grid = &solid.grid;
    let groups = grid.elements.iter().map(|nodes| nodes.to_vec()).collect();
    let mut system = System::new(&free, &nested_dissection(grid), groups)?;
    let (masses, _) = masses_kg(grid, density_kg_per_m3)?;
    let blocks = solid.stiffness(&grid.positions_m);
    system.factorise(&blocks).ok_or_else(|| miette!("the reference body is not held"))?;
    let wave = |vector: usize, node: usize| {
        let s = (node * (vector + 2)) as f64;
        let shaken = DVec3::new((0.7 * s).sin(), (1.3 * s + 0.4).sin(), (2.1 * s + 0.9).sin());
        DVec3::select(free[node], shaken, DVec3::ZERO)
    };
    let width = count + MORE;
    let mut basis: Vec<Vec<DVec3>> =
        (0..width).map(|vector| (0..free.len()).map(|node| wave(vector, node)).collect()).collect();
    let mut before = vec![f64::INFINITY; count];
    for _ in 0..MOST_ITERATIONS {
        let forces: Vec<Vec<DVec3>> = basis.iter().map(|x| weighted(&masses, x)).collect();
        let found: Vec<Vec<DVec3>> = forces.iter().map(|f| system.solve_factorised(f)).collect();
        let momenta: Vec<Vec<DVec3>> = found.iter().map(|y| weighted(&masses, y)).collect();
        // YᵀKY = YᵀMX
        let (stiffness, mass) = (gram(&found, &forces), gram(&found, &momenta));
        let (squares, vectors) = ritz(&stiffness, &mass)?;
        basis = vectors.iter().map(|weights| combined(&found, weights)).collect();
        let settled = squares.iter().zip(&before).all(|(now, before)| (now - before).abs() <= TOLERANCE * now);
        if settled {
            return Ok(squares[..count].iter().map(|square| square.sqrt() / TAU).collect());
        }
        before = squares[..count].to_vec();
    }
    bail!("the reference's frequencies did not settle in {MOST_ITERATIONS} iterations")
}

fn weighted(masses_kg: &[f64], x: &[DVec3]) -> Vec<DVec3> {
    x.iter().zip(masses_kg).map(|(x, m)| *x * *m).collect()
}

fn combined(vectors: &[Vec<DVec3>], weights: &[f64]) -> Vec<DVec3> {
    let mut sum = vec![DVec3::ZERO; vectors[0].len()];
    for (vector, weight) in vectors.iter().zip(weights) {
        sum.iter_mut().zip(vector).for_each(|(sum, v)| *sum += *v * *weight);
    }
    sum
}

/// Returns the symmetric part of `AᵀB`.
fn gram(a: &[Vec<DVec3>], b: &[Vec<DVec3>]) -> Mat<f64> {
    let dot = |i: usize, j: usize| a[i].iter().zip(&b[j]).map(|(a, b)| a.dot(*b)).sum::<f64>();
    Mat::from_fn(a.len(), a.len(), |i, j| 0.5 * (dot(i, j) + dot(j, i)))
}

/// Solves `A a = ω² B a` of small matrices, with B positive definite: `ω²`, ascending, and the vectors, of `aᵀBa = 1`.
fn ritz(a: &Mat<f64>, b: &Mat<f64>) -> Result<(Vec<f64>, Vec<Vec<f64>>)> {
    let failed = |what: &str| miette!("the small eigenvalue problem of the reference's modes failed: {what}");
    let of_b = b.self_adjoint_eigen(Side::Lower).map_err(|e| failed(&format!("{e:?}")))?;
    let size = b.nrows();
    let lengths: Vec<f64> = (0..size).map(|i| of_b.S()[i]).collect();
    ensure!(lengths.iter().all(|length| *length > 0.0), failed("its vectors are not independent"));
    // W = U S^{−½}, WᵀBW = I
    let w = Mat::from_fn(size, size, |i, j| of_b.U()[(i, j)] / lengths[j].sqrt());
    let of_a = (w.transpose() * a * &w).self_adjoint_eigen(Side::Lower).map_err(|e| failed(&format!("{e:?}")))?;
    let vectors = &w * of_a.U();
    let squares = (0..size).map(|i| of_a.S()[i]).collect();
    Ok((squares, (0..size).map(|j| (0..size).map(|i| vectors[(i, j)]).collect()).collect()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a test that cannot build its subject has failed
    use super::*;
    use crate::{
        bodies::material,
        reference::grid::{HexGrid, Side as Face},
    };
    use palpate_physics::material::Law;

    /// A column clamped at one end, ν = 0, along which only x may move: `f = (2k − 1) √(E/ρ)/4L`.
    #[test]
    fn a_column_swings_along_its_axis_as_the_wave_equation_says() {
        let even = |to: f64, n: usize| (0..=n).map(|i| to * i as f64 / n as f64).collect::<Vec<_>>();
        let grid = HexGrid::new([even(0.1, 8), even(0.01, 1), even(0.01, 1)], |p| p);
        let across = [1, 2].into_iter().flat_map(|parameter| {
            let axes = [false, parameter == 1, parameter == 2];
            [false, true].map(|upper| (Face { parameter, upper }, axes))
        });
        let clamp = Face { parameter: 0, upper: false };
        let body = Body {
            grid: grid.clone(),
            held: across.chain([(clamp, [true; 3])]).collect(),
            touched: Face { parameter: 0, upper: true },
            multiplicity: 1.0,
            touch_m: DVec3::X * 0.1,
            normal: DVec3::X,
        };
        let solid = Solid::new(grid, material(Law::StableNeoHookean, 100e3, 0.0).unwrap()).unwrap();
        let found = frequencies_hz(&solid, &body, 1000.0, 3).unwrap();
        for (mode, found) in found.into_iter().enumerate() {
            let expected = (2.0 * mode as f64 + 1.0) * (100e3_f64 / 1000.0).sqrt() / 0.4;
            assert!((found / expected - 1.0).abs() < 2e-3, "{mode}: {found} {expected} Hz");
        }
    }
}
