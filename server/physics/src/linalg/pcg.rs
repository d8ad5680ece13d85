//! Preconditioned conjugate gradients in buffers that are there already, for a stiffness `K` or a step's
//! `M + dt² K + dt C`.
use glam::{DMat3, DVec3};

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub struct Stop {
    /// Most products with `A`.
    pub iterations: u32,
    /// `√(rᵀP⁻¹r)` over its value at the start.
    pub tolerance: f64,
}

/// The vectors of the iteration.
#[derive(Debug, Clone, Default)]
pub struct PcgScratch {
    /// `r`: the right side goes in here, what is left of it comes out.
    pub residual: Vec<DVec3>,
    /// `s`, as it comes out.
    pub solution: Vec<DVec3>,
    preconditioned: Vec<DVec3>,
    direction: Vec<DVec3>,
    product: Vec<DVec3>,
}

impl PcgScratch {
    /// For a system of so many nodes, of three unknowns each.
    pub fn new(nodes: usize) -> Self {
        let zero = vec![DVec3::ZERO; nodes];
        Self {
            residual: zero.clone(),
            solution: zero.clone(),
            preconditioned: zero.clone(),
            direction: zero.clone(),
            product: zero,
        }
    }
}

/// Solves `A s = r` from `s = 0`, with the blocks of `P⁻¹ ≈ A⁻¹`; returns the number of products.
///
/// Where `A` turns out to be indefinite along a direction (`pᵀAp ≤ 0`: the tangent of a law under compression), it
/// stops at what it has (Steihaug 1983), or at `P⁻¹r` if it has nothing: still a descent of the energy that the
/// positive directions make.
pub fn solve(
    mut apply: impl FnMut(&[DVec3], &mut [DVec3]),
    inverse_blocks: &[DMat3],
    stop: Stop,
    scratch: &mut PcgScratch,
) -> u32 {
    let PcgScratch { residual, solution, preconditioned, direction, product } = scratch;
    solution.fill(DVec3::ZERO);
    precondition(inverse_blocks, residual, preconditioned);
    direction.copy_from_slice(preconditioned);
    let mut size = dot(residual, preconditioned);
    if !size.is_finite() {
        // No step to be had: what is not finite, or leads there, must be seen and not be mistaken for rest.
        solution.copy_from_slice(preconditioned);
        return 0;
    }
    let enough = stop.tolerance * stop.tolerance * size;
    for iteration in 0..stop.iterations {
        if size <= enough || size == 0.0 {
            return iteration;
        }
        apply(direction, product);
        let curvature = dot(direction, product);
        if curvature <= 0.0 {
            if iteration == 0 {
                solution.copy_from_slice(preconditioned);
            }
            return iteration + 1;
        }
        // s ← s + α p,  r ← r − α A p,  α = rᵀP⁻¹r / pᵀAp
        let alpha = size / curvature;
        for (((s, p), r), ap) in solution.iter_mut().zip(&*direction).zip(residual.iter_mut()).zip(&*product) {
            *s += *p * alpha;
            *r -= *ap * alpha;
        }
        precondition(inverse_blocks, residual, preconditioned);
        let next = dot(residual, preconditioned);
        // p ← P⁻¹r + β p
        let beta = next / size;
        for (p, z) in direction.iter_mut().zip(&*preconditioned) {
            *p = *z + *p * beta;
        }
        size = next;
    }
    stop.iterations
}

fn precondition(inverse_blocks: &[DMat3], residual: &[DVec3], out: &mut [DVec3]) {
    for ((out, inverse), r) in out.iter_mut().zip(inverse_blocks).zip(residual) {
        *out = *inverse * *r;
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| *a * *b).sum::<DVec3>().element_sum()
}
