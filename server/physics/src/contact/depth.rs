//! How pressure grows with depth.
//!
//! Up to `s₀ R` the foundation is linear. Beyond, a tool is nearer to passing through the surface than to what the
//! foundation is made for (a coarse triangle that cannot follow it, an edge that bears little), and the samples on its
//! flanks push each other: the axial force would fall while it sinks in. There pressure grows faster. With `s = g/R` and
//! `u = max(0, s − s₀)`, per `k_f a` of a sample,
//! ```text
//! Φ = ½ g² + c R² u³        |f_n| = g + 3 c R u²        d|f_n|/dg = 1 + 6 c u
//! ```

/// `s₀`, the depth over the radius up to which the foundation is linear: the coupling of a tool saturates at less.
const LINEAR: f64 = 0.4;
/// `c`. At 10 the edges of coarse blocks let small tools through (`docs/adr/contact-foundation.md`).
const GROWTH: f64 = 25.0;

/// The foundation's answer to a depth, per `k_f a` of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DepthResponse {
    /// Energy (m²).
    pub(super) energy_m2: f64,
    /// Force (m).
    pub(super) force_m: f64,
    /// Stiffness, 1 where the foundation is linear.
    pub(super) stiffness: f64,
}

impl DepthResponse {
    /// Returns the answer to a depth (m) in a tool of this radius (m).
    pub(super) fn of(depth_m: f64, radius_m: f64) -> Self {
        let beyond = (depth_m / radius_m - LINEAR).max(0.0);
        Self {
            energy_m2: 0.5 * depth_m * depth_m + GROWTH * radius_m * radius_m * beyond.powi(3),
            force_m: depth_m + 3.0 * GROWTH * radius_m * beyond * beyond,
            stiffness: 1.0 + 6.0 * GROWTH * beyond,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_and_stiffness_are_the_energys_derivatives_and_small_depths_are_linear() {
        let radius_m = 0.01;
        for depth_m in [0.0, 1e-3, 3.9e-3, 4.1e-3, 7e-3, 9.9e-3] {
            let (step, at) = (1e-7, |d: f64| DepthResponse::of(d, radius_m));
            let (low, here, high) = (at(depth_m - step), at(depth_m), at(depth_m + step));
            let slope = (high.energy_m2 - low.energy_m2) / (2.0 * step);
            assert!((slope - here.force_m).abs() < 1e-9, "{depth_m}");
            let slope = (high.force_m - low.force_m) / (2.0 * step);
            assert!((slope - here.stiffness).abs() < 1e-4, "{depth_m}");
            assert!(depth_m > LINEAR * radius_m || here.force_m == depth_m);
        }
    }

    /// `F/(k_f R³) = 2π (1 − s) ∫₀ˢ F(σ R)/R dσ`, of a sphere whose deepest point is `s R` in a plane.
    #[test]
    fn a_flat_foundation_resists_more_and_more_until_the_centre_is_near_to_it() {
        let force = |s: f64| {
            let parts = 2000;
            let mean = (0..parts).map(|i| DepthResponse::of(s * (f64::from(i) + 0.5) / f64::from(parts), 1.0).force_m);
            2.0 * std::f64::consts::PI * (1.0 - s) * s * mean.sum::<f64>() / f64::from(parts)
        };
        let forces: Vec<f64> = (1..=16).map(|i| force(0.05 * f64::from(i))).collect();
        assert!(forces.windows(2).all(|pair| pair[1] > pair[0]), "{forces:?}");
        // Couplings saturate at 0.3 R of a typical triangle; with c = 10, at which edges let tools through, it is 6 times.
        assert!(forces[15] > 8.0 * forces[5], "{forces:?}");
    }
}
