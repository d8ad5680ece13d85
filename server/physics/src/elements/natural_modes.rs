//! Natural modes about the rest state: `K φ = ω² M φ` with the lumped mass, on the free degrees of freedom.
//!
//! Subspace iteration with the symmetric operator `A = M^½ K⁻¹ M^½`, whose largest eigenvalues are `1/ω²`: orthonormal `X`,
//! `Y = A X`, the Rayleigh-Ritz values are the eigenvalues of `XᵀY` (Bathe & Wilson's method, with mass lumped).
use super::{
    free_axes::{FreeAxes, NONE},
    rigid_motion::{self, FreePart},
};
use crate::linalg::{
    cholesky::{CholeskyError, Factor, LowerTriangle},
    eigen,
};
use glam::DVec3;
use thiserror::Error;

/// Why a body has no natural modes to show.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModesError {
    /// Rigid motions are left free.
    #[error(
        "the body (the part with node {}) is free to {}; prescribe displacements that hold it",
        .0.node, rigid_motion::list(&.0.motions)
    )]
    UnderConstrained(FreePart),
    /// The stiffness at rest cannot be factorised.
    #[error(transparent)]
    Factorisation(#[from] CholeskyError),
    /// The subspace iteration did not settle.
    #[error(
        "the natural modes did not settle: relative residual {relative_residual:.2e} after {iterations} iterations; ask for one mode \
         more or fewer, a pair may be cut in two"
    )]
    NoConvergence {
        /// Relative residual it ended with.
        relative_residual: f64,
        /// Iterations in all.
        iterations: u32,
    },
}

/// A natural mode.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Frequency `ω/2π` (Hz).
    pub frequency_hz: f64,
    /// Shape per node, mass-normalised: `Σ m φ² = 1` (1/√kg); zero on prescribed axes.
    pub shape_per_sqrt_kg: Vec<DVec3>,
    /// `‖Kφ − ω²Mφ‖ / ‖ω²Mφ‖` in the norm of the iteration: how well it is an eigenvector.
    pub relative_residual: f64,
}

const MAX_ITERATIONS: u32 = 200;
const TOLERANCE: f64 = 1e-8;

/// Returns the `count` lowest modes, ascending, of a body that is held, with its stiffness at rest (N/m) and lumped masses (kg).
///
/// # Errors
/// [`ModesError`].
pub(crate) fn lowest_modes(
    stiffness: &LowerTriangle,
    axes: &FreeAxes,
    mass_kg: &[f64],
    count: usize,
) -> Result<Vec<Mode>, ModesError> {
    let mut factor = Factor::analyse(stiffness)?;
    let unknowns = axes.count;
    if !factor.factorise(stiffness) {
        let reason = "the stiffness at rest is not positive definite: parts hinge on an edge or a node".into();
        return Err(CholeskyError { unknowns, reason }.into());
    }
    let count = count.min(unknowns);
    let width = (count + 8).min(2 * count.max(1)).min(unknowns);
    let root_mass = root_mass(mass_kg, axes);
    let mut basis: Vec<Vec<f64>> = (0..width).map(|k| start_vector(unknowns, k as u64)).collect();
    orthonormalise(&mut basis);
    let mut worst = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        let images: Vec<Vec<f64>> = basis.iter().map(|x| apply(&mut factor, &root_mass, x)).collect();
        let ritz = ritz(&basis, &images, width);
        worst = ritz[..count].iter().map(|r| r.relative_residual).fold(0.0, f64::max);
        if worst <= TOLERANCE {
            return Ok(ritz[..count].iter().map(|r| r.mode(axes, &root_mass)).collect());
        }
        basis = ritz.into_iter().map(|r| r.image).collect();
        orthonormalise(&mut basis);
    }
    Err(ModesError::NoConvergence { relative_residual: worst, iterations: MAX_ITERATIONS })
}

/// A Ritz pair: `θ = 1/ω²`, vector and its image under `A`.
struct Ritz {
    theta: f64,
    vector: Vec<f64>,
    image: Vec<f64>,
    relative_residual: f64,
}

impl Ritz {
    fn mode(&self, axes: &FreeAxes, root_mass: &[f64]) -> Mode {
        let shape: Vec<f64> = self.vector.iter().zip(root_mass).map(|(x, m)| x / m).collect();
        Mode {
            frequency_hz: 1.0 / (std::f64::consts::TAU * self.theta.sqrt()),
            shape_per_sqrt_kg: axes.scatter(&shape),
            relative_residual: self.relative_residual,
        }
    }
}

fn ritz(basis: &[Vec<f64>], images: &[Vec<f64>], width: usize) -> Vec<Ritz> {
    let mut h = vec![0.0; width * width];
    for i in 0..width {
        for j in 0..width {
            h[i * width + j] = 0.5 * (dot(&basis[i], &images[j]) + dot(&basis[j], &images[i]));
        }
    }
    let (values, vectors) = eigen::symmetric(&mut h, width);
    let mut order: Vec<usize> = (0..width).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    let combine = |of: &[Vec<f64>], k: usize| {
        let mut sum = vec![0.0; of[0].len()];
        for (vector, weight) in of.iter().zip(&vectors[k * width..(k + 1) * width]) {
            for (s, v) in sum.iter_mut().zip(vector) {
                *s += weight * v;
            }
        }
        sum
    };
    order
        .into_iter()
        .map(|k| {
            let (theta, vector, image) = (values[k], combine(basis, k), combine(images, k));
            let rest = image.iter().zip(&vector).map(|(y, x)| (y - theta * x).powi(2)).sum::<f64>().sqrt();
            Ritz { theta, vector, image, relative_residual: rest / theta }
        })
        .collect()
}

/// `M^½ K⁻¹ M^½ x`.
fn apply(factor: &mut Factor, root_mass: &[f64], x: &[f64]) -> Vec<f64> {
    let mut y: Vec<f64> = x.iter().zip(root_mass).map(|(x, m)| x * m).collect();
    factor.solve(&mut y);
    for (y, m) in y.iter_mut().zip(root_mass) {
        *y *= m;
    }
    y
}

fn root_mass(mass_kg: &[f64], axes: &FreeAxes) -> Vec<f64> {
    let mut root = vec![0.0; axes.count];
    for (numbers, mass) in axes.number.iter().zip(mass_kg) {
        for &number in numbers.iter().filter(|&&n| n != NONE) {
            root[number as usize] = mass.sqrt();
        }
    }
    root
}

/// Twice modified Gram-Schmidt.
fn orthonormalise(basis: &mut [Vec<f64>]) {
    for k in 0..basis.len() {
        let (done, rest) = basis.split_at_mut(k);
        let vector = &mut rest[0];
        for _ in 0..2 {
            for earlier in done.iter() {
                let along = dot(earlier, vector);
                for (v, e) in vector.iter_mut().zip(earlier) {
                    *v -= along * e;
                }
            }
            let length = dot(vector, vector).sqrt();
            for v in vector.iter_mut() {
                *v /= length;
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Pseudo-random in (−½, ½), the same every time (splitmix64).
fn start_vector(length: usize, stream: u64) -> Vec<f64> {
    let mut state = stream.wrapping_mul(0xd1b5_4a32_d192_ed03) ^ 0x9e37_79b9_7f4a_7c15;
    let mut next = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    (0..length).map(|_| next()).collect()
}
