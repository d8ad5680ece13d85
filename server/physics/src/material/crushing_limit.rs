//! Resistance to being crushed, for an element whose own part of the energy knows no volume.
//!
//! Smoothed tets (`elements/smoothing.rs`) keep volume around nodes alone. The mean around a node may be sound while one of
//! its tets is turned inside out, which its own part, shear alone, hardly resists. So tets have, with `J = det F` and
//! `J₀` = ½, beside what they are,
//! ```text
//! Ψ_C = ½ κ w²        w = max(0, J₀ − J)
//! P_C = −κ w cof F
//! δP_C = κ (cof F : δF) cof F − κ w δ(cof F)        for w > 0
//! ```
//! Above `J₀` nothing changes, not by a bit. The stress has no jump.
use super::{
    lane_matrix::M3,
    lane_strain::{cofactor_and_volume_change, volumetric_differential},
};
use crate::{
    lanes::real::Real,
    linalg::tensor::{cofactor, cofactor_differential, contract},
};
use glam::DMat3;

/// `J₀`, the volume ratio below which an element resists.
const LIMIT: f64 = 0.5;

/// Returns `w`.
fn below(f: &DMat3) -> f64 {
    (LIMIT - f.determinant()).max(0.0)
}

/// Returns `Ψ_C` (J/m³) of a modulus κ (Pa).
pub(super) fn energy_density(kappa_pa: f64, f: &DMat3) -> f64 {
    0.5 * kappa_pa * below(f).powi(2)
}

/// Returns `P_C` (Pa).
pub(crate) fn piola(kappa_pa: f64, f: &DMat3) -> DMat3 {
    cofactor(f) * (-kappa_pa * below(f))
}

/// Returns `δP_C` (Pa).
pub(crate) fn piola_differential(kappa_pa: f64, f: &DMat3, df: &DMat3) -> DMat3 {
    let below = below(f);
    if below == 0.0 {
        return DMat3::ZERO;
    }
    let cof = cofactor(f);
    cof * (kappa_pa * contract(&cof, df)) - cofactor_differential(f, df) * (kappa_pa * below)
}

/// Adds `P_C` (Pa).
#[inline(always)]
pub(crate) fn add_lane_piola<T: Real>(kappa: T, h: &M3<T>, p: &mut M3<T>) {
    let (cof_f, volume_change) = cofactor_and_volume_change(h);
    let below = T::of(LIMIT - 1.0) - volume_change;
    // Hardly any tet is crushed so far.
    if !below.any_positive() {
        return;
    }
    let pressure = kappa * below.max(T::of(0.0));
    for i in 0..3 {
        for j in 0..3 {
            p[i][j] = p[i][j] - pressure * cof_f[i][j];
        }
    }
}

/// Adds `δP_C` (Pa).
#[inline(always)]
pub(crate) fn add_lane_piola_differential<T: Real>(kappa: T, h: &M3<T>, df: &M3<T>, p: &mut M3<T>) {
    let (cof_f, volume_change) = cofactor_and_volume_change(h);
    let below = T::of(LIMIT - 1.0) - volume_change;
    if !below.any_positive() {
        return;
    }
    let below = below.max(T::of(0.0));
    // 1 where w > 0: no lane branches.
    let is_below = below / below.max(T::of(f64::from(f32::MIN_POSITIVE)));
    let pressure = T::of(0.0) - kappa * below;
    let volumetric = volumetric_differential(kappa * is_below, pressure, h, &cof_f, df);
    for i in 0..3 {
        for j in 0..3 {
            p[i][j] = p[i][j] + volumetric[i][j];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::lane_matrix::{columns, rows};
    use glam::DVec3;

    const KAPPA_PA: f64 = 3.0;

    /// Pressed along one axis, along all, and sheared; short of the limit, beyond it, and inside out.
    fn strains() -> Vec<DMat3> {
        let diagonal = |x: f64, y: f64, z: f64| DMat3::from_diagonal(DVec3::new(x, y, z));
        let sheared = DMat3::from_cols(DVec3::X, DVec3::new(0.8, 1.0, 0.0), DVec3::Z);
        let turned = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 0.7);
        [
            diagonal(0.51, 1.0, 1.0),
            diagonal(0.8, 0.8, 0.8),
            diagonal(0.49, 1.0, 1.0),
            diagonal(0.7, 0.7, 0.7),
            diagonal(0.1, 1.5, 1.0),
            diagonal(0.0, 1.0, 1.0),
            diagonal(-0.6, 1.2, 1.1),
            diagonal(-0.5, -0.4, -0.3),
        ]
        .map(|f| turned * f * sheared)
        .to_vec()
    }

    #[test]
    fn nothing_changes_above_the_limit_and_below_it_stress_is_the_energys_derivative() {
        for (number, f) in strains().into_iter().enumerate() {
            let change = DMat3::from_cols_array(&[0.3, -0.1, 0.7, 0.2, 0.5, -0.4, 0.1, 0.6, -0.2]);
            let step = 1e-5;
            let at = |s: f64| f + change * s;
            let slope = (energy_density(KAPPA_PA, &at(step)) - energy_density(KAPPA_PA, &at(-step))) / (2.0 * step);
            let stated = contract(&piola(KAPPA_PA, &f), &change);
            assert!((slope - stated).abs() < 1e-8 * (1.0 + slope.abs()), "{number}: {slope} {stated}");
            let slope = (piola(KAPPA_PA, &at(step)) - piola(KAPPA_PA, &at(-step))) * (0.5 / step);
            let differential = piola_differential(KAPPA_PA, &f, &change);
            assert!(slope.abs_diff_eq(differential, 1e-7), "{number}: {slope} {differential}");
            assert_eq!(piola(KAPPA_PA, &f) == DMat3::ZERO, number < 2, "{number}: {f}");
        }
    }

    #[test]
    fn lanes_and_numbers_agree_and_lanes_change_no_bit_above_the_limit() {
        let before = [[0.1, -0.2, 0.3], [1e-9, -7.0, 2.0], [0.4, 0.5, -0.6]];
        for (number, f) in strains().into_iter().enumerate() {
            let (h, df) = (rows(&(f - DMat3::IDENTITY)), [[0.3, 0.2, 0.1], [-0.1, 0.5, 0.6], [0.7, -0.4, -0.2]]);
            let (mut p, mut dp) = (before, before);
            add_lane_piola(KAPPA_PA, &h, &mut p);
            add_lane_piola_differential(KAPPA_PA, &h, &df, &mut dp);
            assert_eq!(p == before && dp == before, number < 2);
            let (p, dp) = (columns(&p) - columns(&before), columns(&dp) - columns(&before));
            assert!(p.abs_diff_eq(piola(KAPPA_PA, &f), 1e-12));
            assert!(dp.abs_diff_eq(piola_differential(KAPPA_PA, &f, &columns(&df)), 1e-12));
        }
    }

    /// The more an element is pressed along an axis, the more it resists, until it is flat.
    #[test]
    fn what_is_pressed_flat_resists_ever_more() {
        let pressure = |s: f64| -piola(KAPPA_PA, &DMat3::from_diagonal(DVec3::new(s, 1.0, 1.0))).x_axis.x;
        assert_eq!(pressure(LIMIT), 0.0);
        let pressures: Vec<f64> = (0..=10).map(|i| pressure(LIMIT - 0.05 * f64::from(i))).collect();
        assert!(pressures.windows(2).all(|pair| pair[1] > pair[0]), "{pressures:?}");
    }
}
