//! The spring of the virtual coupling: linear, then saturated.
//!
//! With the stretch `e = d − c` from tool to device and `e₀ = F_max/K`:
//! ```text
//! Ψ(e) = ½ K |e|²  for |e| ≤ e₀,   F_max |e| − ½ F_max e₀  beyond;   force on the tool −∂Ψ/∂c = K e, or F_max e/|e|
//! ```
//! Both pieces meet with the same slope, so the spring is conservative whatever the device does.
use glam::{DMat3, DVec3};

/// A spring that saturates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SaturatingSpring {
    /// `K` (N/m).
    pub(crate) stiffness_n_per_m: f64,
    /// `F_max` (N).
    pub(crate) limit_n: f64,
}

impl SaturatingSpring {
    /// Returns the force (N) on the tool.
    pub(crate) fn force_n(self, stretch_m: DVec3) -> DVec3 {
        shortened(stretch_m, self.limit_n / self.stiffness_n_per_m) * self.stiffness_n_per_m
    }

    /// Returns the secant stiffness over `K`: 1 or, beyond `e₀`, `e₀/|e|`.
    pub(crate) fn secant(self, stretch_m: DVec3) -> f64 {
        let full_n = self.stiffness_n_per_m * stretch_m.length();
        if full_n <= self.limit_n { 1.0 } else { self.limit_n / full_n }
    }

    /// Returns `Ψ` (J).
    pub(crate) fn energy_j(self, stretch_m: DVec3) -> f64 {
        let (length_m, linear_m) = (stretch_m.length(), self.limit_n / self.stiffness_n_per_m);
        if length_m <= linear_m {
            0.5 * self.stiffness_n_per_m * length_m * length_m
        } else {
            self.limit_n * (length_m - 0.5 * linear_m)
        }
    }

    /// Returns `∂²Ψ/∂c²` (N/m): `K I`, or `F_max/|e| (I − êêᵀ)`. `definite` gives the secant `F_max/|e| I` instead of
    /// the latter, which is no less and leads straight to the device.
    pub(crate) fn hessian_n_per_m(self, stretch_m: DVec3, definite: bool) -> DMat3 {
        let length_m = stretch_m.length();
        if self.stiffness_n_per_m * length_m <= self.limit_n {
            return DMat3::from_diagonal(DVec3::splat(self.stiffness_n_per_m));
        }
        let e = stretch_m / length_m;
        let along = DMat3::from_cols(e * e.x, e * e.y, e * e.z);
        (DMat3::IDENTITY - along * f64::from(u8::from(!definite))) * (self.limit_n / length_m)
    }
}

/// Returns the vector, cut to a length; it is safe for any finite vector, however long.
pub(super) fn shortened(a: DVec3, limit: f64) -> DVec3 {
    let largest = a.abs().max_element();
    if largest <= limit { a.clamp_length_max(limit) } else { (a / largest).normalize() * limit }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn force_and_stiffness_are_the_derivatives_of_the_energy(
            e in prop::array::uniform3(-2.0..2.0_f64),
            axis in 0..3_usize,
        ) {
            let spring = SaturatingSpring { stiffness_n_per_m: 300.0, limit_n: 300.0 };
            let (e, step) = (DVec3::from(e), DVec3::AXES[axis] * 1e-6);
            // The stiffness has a kink there.
            prop_assume!((e.length() - 1.0).abs() > 1e-3);
            let slope = (spring.energy_j(e + step) - spring.energy_j(e - step)) / 2e-6;
            prop_assert!((slope - spring.force_n(e)[axis]).abs() < 1e-6 * 300.0);
            let column = (spring.force_n(e + step) - spring.force_n(e - step)) / 2e-6;
            prop_assert!((column - spring.hessian_n_per_m(e, false).col(axis)).length() < 1e-5 * 300.0);
        }
    }

    #[test]
    fn any_finite_stretch_is_cut() {
        let spring = SaturatingSpring { stiffness_n_per_m: 1000.0, limit_n: 2.0 };
        for stretch in [DVec3::X, DVec3::splat(f64::MAX), DVec3::new(-1e200, 1.0, 0.0)] {
            assert!((spring.force_n(stretch).length() - 2.0).abs() < 1e-12);
        }
    }
}
