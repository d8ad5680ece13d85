//! Static equilibrium of a hybrid body with a given patch: Newton's method, its linear systems by conjugate gradients.
use super::{
    partition::Partition,
    patch::{Field, Materials, Patch},
};
use crate::linalg::pcg::{self, PcgScratch, Stop};
use glam::{BVec3, DMat3, DVec3};
use thiserror::Error;

/// Most steps of Newton's method.
const MOST_STEPS: u32 = 30;
/// Most products in one.
const MOST_PRODUCTS: u32 = 5_000;
/// Each linear system is solved to this.
const LINEAR_TOLERANCE: f64 = 1e-3;
/// Halvings of a step that makes the residual larger.
const MOST_HALVINGS: u32 = 10;

/// No equilibrium was found.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("no equilibrium: relative residual {relative_residual:.2e} after {steps} steps of Newton's method")]
pub struct NoEquilibrium {
    /// What is left of the load.
    pub relative_residual: f64,
    /// Steps taken.
    pub steps: u32,
}

/// From the body at rest to where its forces balance dead `loads_n` (N) to `tolerance` of them; `free` tells along which axes coarse nodes
/// may move.
///
/// # Errors
/// Where Newton's method does not get there.
pub fn equilibrium(
    partition: &Partition,
    patch: &Patch,
    materials: &Materials<'_>,
    free: &[BVec3],
    loads_n: &Field,
    tolerance: f64,
) -> Result<Field, NoEquilibrium> {
    let mut at = patch.at_rest(partition);
    let still = Field { nodes: vec![DVec3::ZERO; at.nodes.len()], particles: vec![DVec3::ZERO; at.particles.len()] };
    let count = at.nodes.len();
    let held = |list: &mut [DVec3]| {
        for (value, free) in list.iter_mut().zip(free) {
            *value = DVec3::select(*free, *value, DVec3::ZERO);
        }
    };
    let residual = |at: &Field| {
        let internal = patch.forces_n(materials, at, &still).0;
        let pairs = internal.nodes.iter().zip(&loads_n.nodes).chain(internal.particles.iter().zip(&loads_n.particles));
        let mut residual: Vec<DVec3> = pairs.map(|(f, load)| *f + *load).collect();
        held(&mut residual);
        residual
    };
    let size = |list: &[DVec3]| list.iter().map(|f| f.length_squared()).sum::<f64>().sqrt();
    let inverse_blocks: Vec<DMat3> = patch.diagonal_n_per_m(materials, count).iter().map(DMat3::inverse).collect();
    let mut scratch = PcgScratch::new(count + at.particles.len());
    let mut left = residual(&at);
    let load = size(&left);
    for _ in 0..MOST_STEPS {
        if size(&left) <= tolerance * load {
            return Ok(at);
        }
        scratch.residual.copy_from_slice(&left);
        let stop = Stop { iterations: MOST_PRODUCTS, tolerance: LINEAR_TOLERANCE };
        let apply = |a: &[DVec3], out: &mut [DVec3]| {
            let direction = Field { nodes: a[..count].to_vec(), particles: a[count..].to_vec() };
            let product = patch.products_n(materials, &at, &direction);
            for (out, product) in out.iter_mut().zip(product.nodes.iter().chain(&product.particles)) {
                *out = -*product;
            }
            held(out);
        };
        pcg::solve(apply, &inverse_blocks, stop, &mut scratch);
        let moved = |scale: f64| {
            let mut next = at.clone();
            for (x, step) in next.nodes.iter_mut().chain(&mut next.particles).zip(&scratch.solution) {
                *x += *step * scale;
            }
            next
        };
        let (mut scale, mut next) = (1.0, moved(1.0));
        let mut then = residual(&next);
        for _ in 0..MOST_HALVINGS {
            if size(&then) < size(&left) {
                break;
            }
            scale *= 0.5;
            next = moved(scale);
            then = residual(&next);
        }
        (at, left) = (next, then);
    }
    Err(NoEquilibrium { relative_residual: size(&left) / load, steps: MOST_STEPS })
}
