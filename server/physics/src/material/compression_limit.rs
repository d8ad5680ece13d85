//! Resistance to being squeezed flat, for laws whose pressure at no volume is finite.
//!
//! Such a law turns inside out beneath a tool that is pressed towards a wall: the pressure stays near `λ` while the tool
//! goes on, and the force falls. Below a volume ratio of ½ these laws resist more. With `J = det F`, a modulus `m` of the
//! law's own volumetric part (`λ`, or `λ + µ`), and `w = max(0, J₀ − J)`,
//! ```text
//! Ψ_J = ½ c m w²        P_J = −c m w cof F        δP_J = c m ((cof F : δF) cof F − w δ(cof F))   for w > 0
//! ```
//! Above ½ nothing changes, not by a bit. The stress has no jump, and recovers from inversion as the law does.
use crate::{
    lanes::real::Real,
    linalg::tensor::{cofactor, cofactor_differential, contract},
};
use glam::DMat3;

/// `J₀`.
const LIMIT: f64 = 0.5;
/// `c`.
const STIFFNESS: f64 = 4.0;

/// Returns `Ψ_J` (J/m³) at a volume ratio.
pub(super) fn energy_density(modulus_pa: f64, volume_ratio: f64) -> f64 {
    0.5 * STIFFNESS * modulus_pa * (LIMIT - volume_ratio).max(0.0).powi(2)
}

/// Returns `−c m w` (Pa), the factor of `cof F` in the stress.
pub(super) fn pressure_pa(modulus_pa: f64, volume_ratio: f64) -> f64 {
    -STIFFNESS * modulus_pa * (LIMIT - volume_ratio).max(0.0)
}

/// Returns `δP_J` (Pa).
pub(super) fn piola_differential(modulus_pa: f64, f: &DMat3, df: &DMat3) -> DMat3 {
    let volume_ratio = f.determinant();
    if volume_ratio >= LIMIT {
        return DMat3::ZERO;
    }
    let cof = cofactor(f);
    cof * (STIFFNESS * modulus_pa * contract(&cof, df))
        + cofactor_differential(f, df) * pressure_pa(modulus_pa, volume_ratio)
}

/// Returns `−c m w` from `J − 1`.
#[inline(always)]
pub(super) fn lane_pressure<T: Real>(modulus: T, volume_change: T) -> T {
    T::of(0.0) - T::of(STIFFNESS) * modulus * squeezed(volume_change)
}

/// Returns its derivative along `J`, `c m` for `w > 0`.
#[inline(always)]
pub(super) fn lane_slope<T: Real>(modulus: T, volume_change: T) -> T {
    let squeezed = squeezed(volume_change);
    // 1 where w > 0: no lane branches.
    let is_squeezed = squeezed / squeezed.max(T::of(f64::from(f32::MIN_POSITIVE)));
    T::of(STIFFNESS) * modulus * is_squeezed
}

/// Returns `w` from `J − 1`.
#[inline(always)]
fn squeezed<T: Real>(volume_change: T) -> T {
    (T::of(LIMIT - 1.0) - volume_change).max(T::of(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Lame, Law, Material, Viscosity};
    use glam::DVec3;

    #[test]
    fn nothing_changes_above_the_limit_and_below_it_stress_is_the_energys_derivative() {
        let change = DMat3::from_cols_array(&[0.3, -0.1, 0.7, 0.2, 0.5, -0.4, 0.1, 0.6, -0.2]);
        let turned = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 0.7);
        for z in [1.2, 0.51, 0.45, 0.1, 0.0, -0.8] {
            let f = turned * DMat3::from_diagonal(DVec3::new(1.1, 1.0 / 1.1, z));
            let (step, at) = (1e-5, |s: f64| f + change * s);
            let energy = |s: f64| energy_density(3.0, at(s).determinant());
            let stress = |f: DMat3| cofactor(&f) * pressure_pa(3.0, f.determinant());
            let slope = (energy(step) - energy(-step)) / (2.0 * step);
            assert!((slope - contract(&stress(f), &change)).abs() < 1e-7, "{z}");
            let slope = (stress(at(step)) - stress(at(-step))) * (0.5 / step);
            assert!(slope.abs_diff_eq(piola_differential(3.0, &f, &change), 1e-6), "{z}");
            assert_eq!(pressure_pa(3.0, f.determinant()) == 0.0, z > 0.5, "{z}");
            let change = f.determinant() - 1.0;
            assert!((lane_pressure(3.0, change) - pressure_pa(3.0, change + 1.0)).abs() < 1e-12);
            assert_eq!(lane_slope(3.0, change), if z > 0.5 { 0.0 } else { 3.0 * STIFFNESS });
        }
    }

    /// The pressure that flattens a sheet between walls grows until it is flat, to more than twice what it was without.
    #[test]
    fn a_sheet_between_walls_resists_until_it_is_flat() {
        let lame = Lame { lambda_pa: 10.0, mu_pa: 1.0 };
        for law in [Law::StableNeoHookean, Law::FixedCorotated] {
            let material = Material { law, lame, viscosity: Viscosity::default() };
            let pressure = |z: f64| -material.piola(&DMat3::from_diagonal(DVec3::new(1.0, 1.0, z))).z_axis.z;
            let pressures: Vec<f64> = (0..=90).map(|i| pressure(1.0 - 0.01 * f64::from(i))).collect();
            assert!(pressures.windows(2).all(|pair| pair[1] > pair[0]), "{law:?}");
            assert!(pressure(0.05) > 2.5 * lame.lambda_pa, "{law:?} {}", pressure(0.05));
        }
    }
}
