//! How walls answer when they are pressed together.
//!
//! They should be stopped while there is a gap between them, as only outside of a wall is the distance from it a smooth
//! function of where a vertex is. So the answer is soft at first, for the step's sake, and grows: with the margin `m`
//! ```text
//! φ = ½ s² + ¼ c s⁴/m²        φ' = s + c s³/m²        φ'' = 1 + 3 c s²/m²        up to s = 2m; beyond, φ'' stays
//! ```
//! Where walls touch, at `s = m`, the force is `1 + c` times that of a linear answer.

/// `c`.
const GROWTH: f64 = 3.0;
/// Depth over the margin from which the stiffness grows no more: as far behind the other wall as the margin is before it.
const STIFFEST: f64 = 2.0;

/// The answer to a depth below the margin, per `κ` of a vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Response {
    /// `φ` (m²).
    pub(super) energy_m2: f64,
    /// `φ'` (m).
    pub(super) force_m: f64,
    /// `φ''`.
    pub(super) stiffness: f64,
}

impl Response {
    /// Returns the answer to a depth (m), 0 or more.
    pub(super) fn of(depth_m: f64, margin_m: f64) -> Self {
        let s = depth_m.min(STIFFEST * margin_m);
        let beyond_m = depth_m - s;
        let growth = GROWTH * (s / margin_m).powi(2);
        let (energy_m2, force_m, stiffness) = (s * s * (0.5 + 0.25 * growth), s * (1.0 + growth), 1.0 + 3.0 * growth);
        Self {
            energy_m2: energy_m2 + beyond_m * (force_m + 0.5 * stiffness * beyond_m),
            force_m: force_m + stiffness * beyond_m,
            stiffness,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_and_stiffness_are_the_energys_derivatives() {
        let margin_m = 1e-3;
        for depth_m in [1e-5, 3e-4, 1e-3, 1.9e-3, 2.1e-3, 6e-3] {
            let (step, at) = (1e-8, |d: f64| Response::of(d, margin_m));
            let (low, here, high) = (at(depth_m - step), at(depth_m), at(depth_m + step));
            let slope = (high.energy_m2 - low.energy_m2) / (2.0 * step);
            assert!((slope / here.force_m - 1.0).abs() < 1e-6, "{depth_m}");
            let slope = (high.force_m - low.force_m) / (2.0 * step);
            assert!((slope / here.stiffness - 1.0).abs() < 1e-6, "{depth_m}");
        }
        assert_eq!(Response::of(margin_m, margin_m).force_m, (1.0 + GROWTH) * margin_m);
    }
}
