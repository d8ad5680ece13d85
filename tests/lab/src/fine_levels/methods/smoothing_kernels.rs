//! Kernels of particle methods: functions of distance that integrate to one and vanish from a radius on.
//!
//! With a smoothing length s both end at `R = 2s`; `q = r/s`.
//! ```text
//! cone           W = 3/(πR³) (1 − r/R)                    dW/dr = −3/(πR⁴)
//! Wendland C2    W = 21/(16πs³) (1 − q/2)⁴ (2q + 1)       dW/dr = −105/(16πs⁴) q (1 − q/2)³
//! ```
//! The cone is the linear approximation of a Lennard-Jones potential (singular, negative and without an integral, hence no kernel itself) of Mero & Susín 2006:
//! its tangent where it crosses zero, cut there and normalised. Its gradient jumps at R, so how many neighbours lie within R matters
//! to it; that of Wendland's (1995) does not.
use std::f64::consts::PI;

/// Smoothing length over the lattice's spacing. Two spacings are then well within R, and no site of the lattice is at R.
pub const SMOOTHING: f64 = 1.05;

/// A kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// Linear.
    Cone,
    /// Twice differentiable.
    WendlandC2,
}

impl Kernel {
    /// R (m).
    pub fn support_m(smoothing_m: f64) -> f64 {
        2.0 * smoothing_m
    }

    /// `W` (1/m³) at a distance.
    pub fn value_per_m3(self, distance_m: f64, smoothing_m: f64) -> f64 {
        let left = (1.0 - distance_m / Self::support_m(smoothing_m)).max(0.0);
        match self {
            Self::Cone => 3.0 / (PI * Self::support_m(smoothing_m).powi(3)) * left,
            Self::WendlandC2 => {
                let q = distance_m / smoothing_m;
                21.0 / (16.0 * PI * smoothing_m.powi(3)) * left.powi(4) * (2.0 * q + 1.0)
            }
        }
    }

    /// `dW/dr` (1/m⁴) at a distance.
    pub fn slope_per_m4(self, distance_m: f64, smoothing_m: f64) -> f64 {
        let support_m = Self::support_m(smoothing_m);
        if distance_m >= support_m {
            return 0.0;
        }
        match self {
            Self::Cone => -3.0 / (PI * support_m.powi(4)),
            Self::WendlandC2 => {
                let (q, left) = (distance_m / smoothing_m, 1.0 - distance_m / support_m);
                -105.0 / (16.0 * PI * smoothing_m.powi(4)) * q * left.powi(3)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const BOTH: [Kernel; 2] = [Kernel::Cone, Kernel::WendlandC2];

    #[test]
    fn kernels_integrate_to_one() {
        let smoothing_m = 2.6e-3;
        for kernel in BOTH {
            // ∫W = 4π ∫ W r² dr, by the midpoint rule
            let steps = 10_000;
            let step_m = Kernel::support_m(smoothing_m) / f64::from(steps);
            let shell = |k: i32| {
                let r = (f64::from(k) + 0.5) * step_m;
                4.0 * PI * r * r * kernel.value_per_m3(r, smoothing_m) * step_m
            };
            let integral: f64 = (0..steps).map(shell).sum();
            assert!((integral - 1.0).abs() < 1e-7, "{kernel:?}: {integral}");
        }
    }

    /// `Σ V ∇W` gives the identity map on a lattice, along an axis, a gradient of one only by chance.
    #[test]
    fn the_cones_gradient_jumps_when_sites_at_two_spacings_come_into_its_support() {
        let of_identity = |kernel: Kernel, smoothing_m: f64| -> f64 {
            let sites =
                (0..343_i32).map(|n| DVec3::new(f64::from(n % 7), f64::from(n / 7 % 7), f64::from(n / 49)) - 3.0);
            let term = |at: DVec3| -at.x * at.x / at.length() * kernel.slope_per_m4(at.length(), smoothing_m);
            sites.filter(|at| *at != DVec3::ZERO).map(term).sum()
        };
        for (smoothing, cone, wendland) in [(0.999, 0.736, 0.982), (1.001, 0.968, 0.983), (SMOOTHING, 0.799, 0.998)] {
            let found = [Kernel::Cone, Kernel::WendlandC2].map(|kernel| of_identity(kernel, smoothing));
            assert!((found[0] - cone).abs() < 1e-3 && (found[1] - wendland).abs() < 1e-3, "{smoothing}: {found:?}");
        }
    }

    #[test]
    fn they_fall_to_nothing_at_the_support_and_slopes_are_theirs() {
        let smoothing_m = 2.6e-3;
        for kernel in BOTH {
            let mut before = f64::INFINITY;
            for k in 1..400 {
                let r = 0.005 * smoothing_m * f64::from(k);
                let value = kernel.value_per_m3(r, smoothing_m);
                assert!(value < before && value > 0.0);
                before = value;
                let step = 1e-6 * smoothing_m;
                let difference =
                    kernel.value_per_m3(r + step, smoothing_m) - kernel.value_per_m3(r - step, smoothing_m);
                let slope = kernel.slope_per_m4(r, smoothing_m);
                let scale = kernel.value_per_m3(0.0, smoothing_m) / smoothing_m;
                assert!((difference / (2.0 * step) - slope).abs() < 1e-8 * scale, "{kernel:?} at {r}");
            }
            for r in [2.0, 2.5, 9.0] {
                assert_eq!(kernel.value_per_m3(r * smoothing_m, smoothing_m), 0.0);
                assert_eq!(kernel.slope_per_m4(r * smoothing_m, smoothing_m), 0.0);
            }
        }
    }
}
