//! Resistance to stretch that no tissue takes, for laws whose stress grows no faster than stretch.
//!
//! Such a law lets a surface that wraps around a tool, and is stretched by it, give way: like a balloon's, its tension
//! grows more slowly than its area, and past some depth one cell grows at the cost of its neighbours until the tool is
//! through. Tissue stiffens long before. So these laws have, with `I₁ = tr FᵀF` and `L` = 8, beside what they are,
//! ```text
//! Ψ_L = µ k/(2L) w²        w = max(0, I₁ − L)
//! P_L = 2 µ k/L w F
//! δP_L = 2 µ k/L (w δF + 2 (F : δF) F)        for w > 0
//! ```
//! Up to `L` nothing changes, not by a bit. It is reached by a stretch of 2.69 along one axis, of 1.98 along two, and
//! by a shear of 2.2. The stress has no jump.
use super::{
    Lame,
    lane_matrix::{M3, contract as lane_contract, trace},
};
use crate::{lanes::real::Real, linalg::tensor::contract};
use glam::DMat3;

/// `L`, the sum of squared principal stretches from which a law stiffens; 3 at rest.
const LIMIT: f64 = 8.0;
/// `k`.
const STIFFNESS: f64 = 4.0;

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

/// Returns the most that `n·(δP_L N)` (Pa) is, `δF = n Nᵀ` with unit `n` and `N`, where no principal stretch exceeds a
/// value of which the square is given: `2 µ k/L ((3s² − L) + 2s²)` where `3s² > L`.
pub(super) fn stretched_modulus_pa(lame: Lame, stretch_sq: f64) -> f64 {
    let beyond = 3.0 * stretch_sq - LIMIT;
    if beyond <= 0.0 { 0.0 } else { 2.0 * STIFFNESS / LIMIT * lame.mu_pa * (beyond + 2.0 * stretch_sq) }
}

/// Adds `δP_L` (Pa).
#[inline(always)]
pub(super) fn add_lane_piola_differential<T: Real>(mu: T, h: &M3<T>, df: &M3<T>, p: &mut M3<T>) {
    let beyond = beyond(h);
    if !beyond.any_positive() {
        return;
    }
    let beyond = beyond.max(T::of(0.0));
    // 1 where w > 0: no lane branches.
    let is_beyond = beyond / beyond.max(T::of(f64::from(f32::MIN_POSITIVE)));
    let factor = mu * T::of(2.0 * STIFFNESS / LIMIT);
    // F : δF = H : δF + tr δF
    let along = factor * is_beyond * T::of(2.0) * (lane_contract(h, df) + trace(df));
    let factor = factor * beyond;
    for i in 0..3 {
        for j in 0..3 {
            p[i][j] = p[i][j] + (factor * df[i][j] + along * h[i][j]);
        }
        p[i][i] = p[i][i] + along;
    }
}

/// Returns `I₁ − L = H : H + 2 tr H + 3 − L`.
#[inline(always)]
fn beyond<T: Real>(h: &M3<T>) -> T {
    lane_contract(h, h) + T::of(2.0) * trace(h) + T::of(3.0 - LIMIT)
}

/// Adds `P_L` (Pa).
#[inline(always)]
pub(super) fn add_lane_piola<T: Real>(mu: T, h: &M3<T>, p: &mut M3<T>) {
    let beyond = beyond(h);
    // Hardly any tet is stretched so far.
    if !beyond.any_positive() {
        return;
    }
    let factor = mu * T::of(2.0 * STIFFNESS / LIMIT) * beyond.max(T::of(0.0));
    for i in 0..3 {
        for j in 0..3 {
            p[i][j] = p[i][j] + factor * h[i][j];
        }
        p[i][i] = p[i][i] + factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::lane_matrix::{columns, rows};
    use glam::DVec3;

    /// Stretched along one axis, along two, and sheared; within the limit and beyond it.
    fn strains() -> Vec<DMat3> {
        let sheared = |s: f64| DMat3::from_cols(DVec3::X, DVec3::new(s, 1.0, 0.0), DVec3::Z);
        let along = |s: f64| DMat3::from_diagonal(DVec3::new(s, 1.0 / s.sqrt(), 1.0 / s.sqrt()));
        let across = |s: f64| DMat3::from_diagonal(DVec3::new(s, s, 1.0 / (s * s)));
        let turned = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 0.7);
        [sheared(2.2), along(2.6), across(1.9), sheared(2.3), along(2.8), across(2.1), along(5.0)]
            .map(|f| turned * f)
            .to_vec()
    }

    #[test]
    fn nothing_changes_within_the_limit_and_beyond_it_stress_is_the_energys_derivative() {
        let lame = Lame { lambda_pa: 3.0, mu_pa: 2.0 };
        for (number, f) in strains().into_iter().enumerate() {
            let change = DMat3::from_cols_array(&[0.3, -0.1, 0.7, 0.2, 0.5, -0.4, 0.1, 0.6, -0.2]);
            let step = 1e-5;
            let at = |s: f64| f + change * s;
            let slope = (energy_density(lame, &at(step)) - energy_density(lame, &at(-step))) / (2.0 * step);
            assert!((slope - contract(&piola(lame, &f), &change)).abs() < 1e-7 * (1.0 + slope.abs()));
            let slope = (piola(lame, &at(step)) - piola(lame, &at(-step))) * (0.5 / step);
            let differential = piola_differential(lame, &f, &change);
            assert!(slope.abs_diff_eq(differential, 1e-6), "{slope} {differential}");
            assert_eq!(piola(lame, &f) == DMat3::ZERO, number < 3, "{f}");
        }
    }

    #[test]
    fn lanes_and_numbers_agree_and_lanes_change_no_bit_within_the_limit() {
        let lame = Lame { lambda_pa: 3.0, mu_pa: 2.0 };
        let before = [[0.1, -0.2, 0.3], [1e-9, -7.0, 2.0], [0.4, 0.5, -0.6]];
        for (number, f) in strains().into_iter().enumerate() {
            let (h, df) = (rows(&(f - DMat3::IDENTITY)), [[0.3, 0.2, 0.1], [-0.1, 0.5, 0.6], [0.7, -0.4, -0.2]]);
            let (mut p, mut dp) = (before, before);
            add_lane_piola(lame.mu_pa, &h, &mut p);
            add_lane_piola_differential(lame.mu_pa, &h, &df, &mut dp);
            assert_eq!(p == before && dp == before, number < 3);
            let (p, dp) = (columns(&p) - columns(&before), columns(&dp) - columns(&before));
            assert!(p.abs_diff_eq(piola(lame, &f), 1e-12));
            assert!(dp.abs_diff_eq(piola_differential(lame, &f, &columns(&df)), 1e-12));
        }
    }

    /// A thin sheet that is stretched alike along both of its axes, as over a tool, never gives way: the force on its
    /// edge grows with its stretch.
    #[test]
    fn a_sheet_stretched_along_two_axes_resists_ever_more() {
        let lame = Lame { lambda_pa: 10.0, mu_pa: 1.0 };
        for law in [crate::material::Law::StableNeoHookean, crate::material::Law::FixedCorotated] {
            let material = crate::material::Material {
                law,
                lame,
                viscosity: crate::material::Viscosity::default(),
                crushing_pa: 0.0,
            };
            let pressure = |s: f64| {
                // Laplace: pressure over a cap is in proportion to the tension s P, over the radius, per current area.
                let f = DMat3::from_diagonal(DVec3::new(s, s, 1.0 / (s * s)));
                material.piola(&f).x_axis.x
            };
            let forces: Vec<f64> = (0..60).map(|i| pressure(1.0 + 0.1 * f64::from(i))).collect();
            assert!(forces.windows(2).all(|pair| pair[1] > pair[0]), "{law:?} {forces:?}");
        }
    }
}
