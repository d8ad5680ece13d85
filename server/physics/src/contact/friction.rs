//! Coulomb friction of one sample in contact.
//!
//! Every sample in contact has a tangential spring `e` (m) of stiffness `k_t = τ k_f a`, stretched by
//! the sample's motion relative to the tool and cut at the cone:
//! ```text
//! e ← (I − n̂n̂ᵀ)(p − q)        p = y − c₀ from the tool's centre, q where the spring is at rest, n̂ = r/|r|, r = y − c
//! e ← e · min(1, µ_f f_n / (k_t |e|))      slip; its heat k_t|e|·(cut length) ≥ 0
//! f_t = −k_t e,  q ← p − e
//! ```
//! `q` is a point of the tool: where the tool turns (`R`), what is kept is `Rᵀq`, so that the spring is stretched by
//! the motion of sample and tool relative to each other, `v + ω × p`.
use glam::DVec3;

/// `τ`, the tangential over the normal stiffness of the foundation; Mindlin's ratio 2(1 − ν)/(2 − ν) is 0.71 at ν =
/// 0.45 and 0.82 at 0.3. It may be at most 1, or the bound of the frequency fails.
pub(super) const TANGENTIAL_RATIO: f64 = 0.75;

/// The tangential spring of a sample after a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrictionSpring {
    /// `e` (m), within the cone.
    pub(super) stretch_m: DVec3,
    /// `k_t` (N/m).
    pub(super) stiffness_n_per_m: f64,
    /// Heat of slipping (J); `None` where the sample sticks.
    pub(super) heat_j: Option<f64>,
}

impl FrictionSpring {
    /// Stretches the spring of a sample with the stiffness `k_f a` (N/m) and the normal force `f_n` (N) by `trial_m` (m), and cuts it at the
    /// cone of the friction coefficient `µ_f`.
    pub(super) fn stretched(trial_m: DVec3, normal_n_per_m: f64, f_n: f64, coefficient: f64) -> Self {
        let k_t = TANGENTIAL_RATIO * normal_n_per_m;
        let (length_m, limit_m) = (trial_m.length(), coefficient * f_n / k_t);
        if length_m > limit_m {
            let heat_j = k_t * limit_m * (length_m - limit_m);
            Self { stretch_m: trial_m * (limit_m / length_m), stiffness_n_per_m: k_t, heat_j: Some(heat_j) }
        } else {
            Self { stretch_m: trial_m, stiffness_n_per_m: k_t, heat_j: None }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stretched further and further, the force grows with `k_t` up to `µ_f f_n`; from there on every length more is heat.
    #[test]
    fn the_force_ends_at_the_cone_and_what_is_cut_is_heat() {
        let (k, f_n, coefficient) = (200.0, 0.5, 0.3);
        let k_t = TANGENTIAL_RATIO * k;
        let limit_m = coefficient * f_n / k_t;
        let along = DVec3::new(0.6, 0.0, 0.8);
        let sticking = FrictionSpring::stretched(along * (0.9 * limit_m), k, f_n, coefficient);
        assert_eq!(
            sticking,
            FrictionSpring { stretch_m: along * (0.9 * limit_m), stiffness_n_per_m: k_t, heat_j: None }
        );
        let slipping = FrictionSpring::stretched(along * (3.0 * limit_m), k, f_n, coefficient);
        assert!(((slipping.stretch_m * k_t).length() - coefficient * f_n).abs() < 1e-15);
        assert!((slipping.heat_j.unwrap() - coefficient * f_n * 2.0 * limit_m).abs() < 1e-17);
    }

    #[test]
    fn nothing_holds_without_friction() {
        let spring = FrictionSpring::stretched(DVec3::X, 200.0, 0.5, 0.0);
        assert_eq!((spring.stretch_m, spring.heat_j), (DVec3::ZERO, Some(0.0)));
    }
}
