//! Resistance to stretch that no tissue takes, for laws whose stress grows no faster than stretch.
//!
//! Such a law lets a surface that wraps around a tool, and is stretched by it, give way: like a balloon's, its tension
//! grows more slowly than its area, and past some depth one cell grows at the cost of its neighbours until the tool is
//! through. Tissue stiffens long before. So these laws have, with `I₁ = tr FᵀF` and [`LIMIT`] `L`, beside what they are,
//! ```text
//! Ψ_L = µ k/(2L) w²        w = max(0, I₁ − L)
//! P_L = 2 µ k/L w F
//! δP_L = 2 µ k/L (w δF + 2 (F : δF) F)        for w > 0
//! ```
//! Up to `L` nothing changes, not by a bit. It is reached by a stretch of 3.06 along one axis, of 2.23 along two, and
//! by a shear of 2.6. The stress has no jump.
use super::{
    Lame,
    lane_matrix::{M3, contract as lane_contract, trace},
};
use crate::{lanes::real::Real, linalg::tensor::contract};
use glam::DMat3;

/// `L`, the sum of squared principal stretches from which a law stiffens; 3 at rest.
pub const LIMIT: f64 = 10.0;
/// `k`.
const STIFFNESS: f64 = 1.0;

/// Returns `Ψ_L` (J/m³).
pub(super) fn energy_density(lame: Lame, f: &DMat3) -> f64 {
    let beyond = (contract(f, f) - LIMIT).max(0.0);
    0.5 * STIFFNESS / LIMIT * lame.mu_pa * beyond * beyond
}

/// Returns `P_L` (Pa).
pub(super) fn piola(lame: Lame, f: &DMat3) -> DMat3 {
    *f * (2.0 * STIFFNESS / LIMIT * lame.mu_pa * (contract(f, f) - LIMIT).max(0.0))
}

/// Returns `δP_L` (Pa).
pub(super) fn piola_differential(lame: Lame, f: &DMat3, df: &DMat3) -> DMat3 {
    let beyond = contract(f, f) - LIMIT;
    if beyond <= 0.0 {
        return DMat3::ZERO;
    }
    (*df * beyond + *f * (2.0 * contract(f, df))) * (2.0 * STIFFNESS / LIMIT * lame.mu_pa)
}

/// Adds `P_L` (Pa).
#[inline(always)]
pub(super) fn add_lane_piola<T: Real>(mu: T, h: &M3<T>, p: &mut M3<T>) {
    // I₁ − L = H : H + 2 tr H + 3 − L
    let beyond = lane_contract(h, h) + T::of(2.0) * trace(h) + T::of(3.0 - LIMIT);
    let factor = mu * T::of(2.0 * STIFFNESS / LIMIT) * beyond.max(T::of(0.0));
    for i in 0..3 {
        for j in 0..3 {
            p[i][j] = p[i][j] + factor * h[i][j];
        }
        p[i][i] = p[i][i] + factor;
    }
}
