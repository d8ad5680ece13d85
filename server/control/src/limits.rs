//! What an arm may be asked for: a peak force, a rate of change, and a ramp that a watchdog holds.
use crate::parameter::{ParameterError, positive};
use glam::DVec3;

/// Limits of an arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceLimits {
    /// Largest magnitude of the force (N).
    pub max_force_n: f64,
    /// Largest change of the force per second (N/s).
    pub max_force_rate_n_per_s: f64,
}

impl ForceLimits {
    /// Checks both.
    ///
    /// # Errors
    /// [`ParameterError`] when one is not finite and positive.
    pub fn checked(self) -> Result<Self, ParameterError> {
        positive("max_force_n", self.max_force_n)?;
        positive("max_force_rate_n_per_s", self.max_force_rate_n_per_s)?;
        Ok(self)
    }
}

/// A limited force, and what was done to it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limited {
    /// Force to apply (N): finite, at most `ramp · max_force_n` long.
    pub force_n: DVec3,
    /// The wanted force was longer than the peak.
    pub saturated: bool,
    /// The wanted force changed faster than the rate.
    pub rate_limited: bool,
    /// The wanted force, the ramp or the time step was NaN or infinite, and zero was put out.
    pub non_finite: bool,
}

/// How often each limit acted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LimitCounts {
    /// Forces cut to the peak.
    pub saturated: u64,
    /// Forces held back by the rate.
    pub rate_limited: u64,
    /// Forces refused because they were not finite.
    pub non_finite: u64,
}

/// Saturation, then rate, then ramp.
///
/// The ramp multiplies what the rate limit let through, so a slow rate can never keep a force alive when the ramp is at zero:
/// `|F_k| ≤ ramp_k F_max` and `|F_k − F_{k−1}| ≤ rate·dt + |ramp_k − ramp_{k−1}| F_max`.
#[derive(Debug, Clone)]
pub struct ForceLimiter {
    limits: ForceLimits,
    /// Force after saturation and rate, before the ramp (N).
    unramped_n: DVec3,
    counts: LimitCounts,
}

impl ForceLimiter {
    /// At zero force.
    pub fn new(limits: ForceLimits) -> Self {
        Self { limits, unramped_n: DVec3::ZERO, counts: LimitCounts::default() }
    }

    /// The limits.
    pub fn limits(&self) -> ForceLimits {
        self.limits
    }

    /// Other limits from now on; the force goes on from where it is, at the new rate.
    pub fn set_limits(&mut self, limits: ForceLimits) {
        self.limits = limits;
    }

    /// How often each limit acted since construction.
    pub fn counts(&self) -> LimitCounts {
        self.counts
    }

    /// Zero at once, as for an arm that was just attached.
    pub fn reset(&mut self) {
        self.unramped_n = DVec3::ZERO;
    }

    /// Something after this limiter shortened the force: `force_n` (N) was put on the arm under `ramp`. The next one starts from there, or the force would jump when it is let go.
    pub fn was_shortened_to(&mut self, force_n: DVec3, ramp: f64) {
        let unramped_n = force_n / ramp;
        if unramped_n.is_finite() {
            self.unramped_n = clamp_length(unramped_n, self.limits.max_force_n).0;
        }
    }

    /// Limits `wanted_n` (N) for the next `dt_s` (s); `ramp` in 0 to 1 scales the result.
    pub fn limit(&mut self, wanted_n: DVec3, ramp: f64, dt_s: f64) -> Limited {
        if !(wanted_n.is_finite() && ramp.is_finite() && dt_s.is_finite() && dt_s >= 0.0) {
            self.counts.non_finite += 1;
            self.unramped_n = DVec3::ZERO;
            return Limited { non_finite: true, ..Limited::default() };
        }
        let (saturated_n, saturated) = clamp_length(wanted_n, self.limits.max_force_n);
        let (change_n, rate_limited) =
            clamp_length(saturated_n - self.unramped_n, self.limits.max_force_rate_n_per_s * dt_s);
        // The sum of two vectors inside the ball of radius F_max may leave it by rounding only.
        self.unramped_n = clamp_length(self.unramped_n + change_n, self.limits.max_force_n).0;
        self.counts.saturated += u64::from(saturated);
        self.counts.rate_limited += u64::from(rate_limited);
        Limited { force_n: self.unramped_n * ramp.clamp(0.0, 1.0), saturated, rate_limited, non_finite: false }
    }
}

/// `v` shortened to `max` if it is longer, and whether it was. Also for lengths whose square overflows.
pub(crate) fn clamp_length(v: DVec3, max: f64) -> (DVec3, bool) {
    let scale = v.abs().max_element();
    if scale <= max / 2.0 {
        return (v, false);
    }
    let length = (v / scale).length() * scale;
    if length <= max { (v, false) } else { ((v / scale) * (max / (v / scale).length()), true) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: ForceLimits = ForceLimits { max_force_n: 3.3, max_force_rate_n_per_s: 500.0 };

    fn any_component() -> impl Strategy<Value = f64> {
        prop_oneof![6 => -20.0..20.0_f64, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(-1e300), 1 => Just(1e-300)]
    }

    fn any_force() -> impl Strategy<Value = DVec3> {
        (any_component(), any_component(), any_component()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    #[test]
    fn a_small_slow_force_passes_unchanged() {
        let mut limiter = ForceLimiter::new(LIMITS);
        let out = limiter.limit(DVec3::new(0.1, -0.2, 0.3), 1.0, 1e-3);
        assert_eq!(out, Limited { force_n: DVec3::new(0.1, -0.2, 0.3), ..Limited::default() });
    }

    #[test]
    fn a_force_that_was_shortened_comes_back_at_the_rate() {
        let mut limiter = ForceLimiter::new(LIMITS);
        for _ in 0..10 {
            limiter.limit(DVec3::X * 3.0, 0.5, 1e-3);
        }
        limiter.was_shortened_to(DVec3::X * 0.2, 0.5);
        // 0.4 N without the ramp, and a step of 0.5 N.
        assert!((limiter.limit(DVec3::X * 3.0, 0.5, 1e-3).force_n.x - 0.45).abs() < 1e-12);
        limiter.was_shortened_to(DVec3::ZERO, 0.0);
        assert!(
            (limiter.limit(DVec3::X * 3.0, 0.5, 1e-3).force_n.x - 0.70).abs() < 1e-12,
            "nothing is known at ramp 0"
        );
    }

    #[test]
    fn a_step_rises_at_the_rate_and_stops_at_the_peak() {
        let mut limiter = ForceLimiter::new(LIMITS);
        let wanted_n = DVec3::new(0.0, 0.0, 10.0);
        for tick in 1..=6 {
            let out = limiter.limit(wanted_n, 1.0, 1e-3);
            assert!((out.force_n.z - 0.5 * f64::from(tick)).abs() < 1e-12);
            assert!(out.saturated && out.rate_limited);
        }
        let out = limiter.limit(wanted_n, 1.0, 1e-3);
        assert!((out.force_n.z - 3.3).abs() < 1e-12 && !out.rate_limited);
        assert_eq!(limiter.counts(), LimitCounts { saturated: 7, rate_limited: 6, non_finite: 0 });
    }

    #[test]
    fn nan_gives_zero_and_is_counted() {
        let mut limiter = ForceLimiter::new(LIMITS);
        limiter.limit(DVec3::X, 1.0, 1.0);
        for bad in [DVec3::new(f64::NAN, 0.0, 0.0), DVec3::new(0.0, f64::INFINITY, 0.0)] {
            let out = limiter.limit(bad, 1.0, 1e-3);
            assert!(out.non_finite);
            assert_eq!(out.force_n, DVec3::ZERO);
        }
        assert!(limiter.limit(DVec3::X, f64::NAN, 1e-3).non_finite);
        assert!(limiter.limit(DVec3::X, 1.0, f64::NAN).non_finite);
        assert_eq!(limiter.counts().non_finite, 4);
    }

    #[test]
    fn a_ramp_of_zero_is_zero_whatever_the_rate() {
        let mut limiter = ForceLimiter::new(ForceLimits { max_force_n: 3.0, max_force_rate_n_per_s: 1e-3 });
        limiter.limit(DVec3::X, 1.0, 1e6);
        assert_eq!(limiter.limit(DVec3::X, 0.0, 1e-3).force_n, DVec3::ZERO);
    }

    #[test]
    fn limits_must_be_positive() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(ForceLimits { max_force_n: bad, max_force_rate_n_per_s: 1.0 }.checked().is_err());
            assert!(ForceLimits { max_force_n: 1.0, max_force_rate_n_per_s: bad }.checked().is_err());
        }
    }

    proptest! {
        #[test]
        fn every_output_obeys_peak_rate_and_ramp(inputs in prop::collection::vec((any_force(), 0.0..=1.0_f64), 1..200)) {
            let dt_s = 1e-3;
            let mut limiter = ForceLimiter::new(LIMITS);
            let (mut previous_n, mut previous_ramp) = (DVec3::ZERO, 0.0);
            for (wanted_n, ramp) in inputs {
                let out = limiter.limit(wanted_n, ramp, dt_s);
                prop_assert!(out.force_n.is_finite());
                prop_assert!(out.force_n.length() <= ramp * LIMITS.max_force_n * (1.0 + 1e-12));
                prop_assert_eq!(out.non_finite, !wanted_n.is_finite());
                if out.non_finite {
                    prop_assert_eq!(out.force_n, DVec3::ZERO);
                } else {
                    let bound_n = LIMITS.max_force_rate_n_per_s * dt_s + (ramp - previous_ramp).abs() * LIMITS.max_force_n;
                    prop_assert!((out.force_n - previous_n).length() <= bound_n * (1.0 + 1e-9));
                }
                (previous_n, previous_ramp) = (out.force_n, ramp);
            }
        }

        #[test]
        fn limiting_keeps_the_direction(wanted in (-20.0..20.0_f64, -20.0..20.0_f64, -20.0..20.0_f64)) {
            let wanted_n = DVec3::from(wanted);
            let out = ForceLimiter::new(LIMITS).limit(wanted_n, 1.0, 1e-3);
            prop_assert!(out.force_n.cross(wanted_n).length() <= 1e-12 * wanted_n.length_squared().max(1.0));
            prop_assert!(out.force_n.dot(wanted_n) >= 0.0);
        }
    }
}
