//! Motors that grow warm: what an arm bears for a moment it does not bear for long.
use crate::parameter::{ParameterError, positive};
use glam::DVec3;

/// Warmth, in parts of what is borne for ever, up to which the peak is allowed; from here to 1 the force comes down to the continuous one.
const FREE_TO: f64 = 0.5;

/// What an arm bears for ever, and how fast it warms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalLimits {
    /// Force (N) that may be held for ever.
    pub continuous_force_n: f64,
    /// Largest force (N); not below the continuous one.
    pub max_force_n: f64,
    /// Time constant (s) of the windings.
    pub time_s: f64,
}

impl ThermalLimits {
    /// Checks all.
    ///
    /// # Errors
    /// [`ParameterError`] when one is not finite and positive, or the continuous force is above the largest.
    pub fn checked(self) -> Result<Self, ParameterError> {
        positive("max_force_n", self.max_force_n)?;
        positive("thermal_time_s", self.time_s)?;
        let value = positive("continuous_force_n", self.continuous_force_n)?;
        if value > self.max_force_n {
            return Err(ParameterError { name: "continuous_force_n", value, rule: "must not be above max_force_n" });
        }
        Ok(self)
    }
}

/// Windings in which a motor's current, and with it `F²`, turns to heat that flows off: `τ θ' = F² − θ`, `θ` in N².
///
/// Below `θ = F_c²/2` forces up to the peak pass. From there to `F_c²` the largest falls linearly to the continuous `F_c`, so that a hand feels a body grow softer and no
/// step, and `θ`, the mean of `F²` over the last `τ` or so, never exceeds `F_c²`: where they are equal no more than `F_c` passes. That holds as long as a
/// period at the peak warms little, `F_p² dt ≪ F_c² τ`; periods are milliseconds and windings take seconds.
#[derive(Debug, Clone)]
pub struct ThermalLimiter {
    limits: ThermalLimits,
    /// Warmth θ (N²).
    warmth_n2: f64,
}

impl ThermalLimiter {
    /// Cold.
    pub fn new(limits: ThermalLimits) -> Self {
        Self { limits, warmth_n2: 0.0 }
    }

    /// Warmth in parts of what is borne for ever, 0 to 1.
    pub fn warmth(&self) -> f64 {
        self.warmth_n2 / self.limits.continuous_force_n.powi(2)
    }

    /// The largest force (N) that passes now.
    pub fn largest_n(&self) -> f64 {
        let ThermalLimits { continuous_force_n, max_force_n, .. } = self.limits;
        // F ≤ F_p − (F_p − F_c) (θ/F_c² − ½)/½
        let part = ((self.warmth() - FREE_TO) / (1.0 - FREE_TO)).clamp(0.0, 1.0);
        max_force_n - (max_force_n - continuous_force_n) * part
    }

    /// As much of a force (N) as passes; nothing of one that is not finite.
    pub fn limit(&self, force_n: DVec3) -> DVec3 {
        if force_n.is_finite() { force_n.clamp_length_max(self.largest_n()) } else { DVec3::ZERO }
    }

    /// A force (N) was held for `dt_s`.
    pub fn held(&mut self, force_n: DVec3, dt_s: f64) {
        let force_n2 = force_n.length_squared();
        if force_n2.is_finite() && dt_s > 0.0 {
            // θ ← F² + (θ − F²) exp(−dt/τ), exact for a force that is held.
            self.warmth_n2 = force_n2 + (self.warmth_n2 - force_n2) * (-dt_s / self.limits.time_s).exp();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT_S: f64 = 1e-3;
    /// A Touch's forces; its time constant is not public.
    const LIMITS: ThermalLimits = ThermalLimits { continuous_force_n: 0.88, max_force_n: 3.3, time_s: 10.0 };

    fn press(limiter: &mut ThermalLimiter, wanted_n: f64, seconds: f64) -> f64 {
        let mut out_n = DVec3::ZERO;
        for _ in 0..(seconds / DT_S) as u64 {
            out_n = limiter.limit(DVec3::X * wanted_n);
            limiter.held(out_n, DT_S);
        }
        out_n.x
    }

    #[test]
    fn the_continuous_force_passes_for_ever_and_the_peak_for_as_long_as_the_windings_take() {
        let mut steady = ThermalLimiter::new(LIMITS);
        assert_eq!(press(&mut steady, 0.88, 200.0), 0.88);
        let mut peak = ThermalLimiter::new(LIMITS);
        // F_p² (1 − exp(−t/τ)) = F_c²/2
        let free_s = -10.0 * (1.0_f64 - 0.5 * 0.88_f64.powi(2) / 3.3_f64.powi(2)).ln();
        assert_eq!(press(&mut peak, 3.3, free_s - 2e-3), 3.3);
        assert!(press(&mut peak, 3.3, 0.01) < 3.3);
        let held_n = press(&mut peak, 3.3, 200.0);
        assert!((held_n / 0.88 - 1.0).abs() < 1e-3 && peak.warmth() <= 1.0, "{held_n} N");
        // Cooling: after τ ln 2 of rest half the warmth is left, and the peak passes.
        press(&mut peak, 0.0, 10.0 * 2.0_f64.ln() + 0.01);
        assert!((peak.warmth() - 0.5).abs() < 1e-3);
        assert_eq!(press(&mut peak, 3.3, DT_S), 3.3);
    }

    #[test]
    fn limits_without_sense_are_refused_by_name() {
        assert_eq!(LIMITS.checked(), Ok(LIMITS));
        let refused = |limits: ThermalLimits| limits.checked().unwrap_err().name;
        assert_eq!(refused(ThermalLimits { continuous_force_n: 4.0, ..LIMITS }), "continuous_force_n");
        assert_eq!(refused(ThermalLimits { continuous_force_n: f64::NAN, ..LIMITS }), "continuous_force_n");
        assert_eq!(refused(ThermalLimits { time_s: 0.0, ..LIMITS }), "thermal_time_s");
    }

    proptest! {
        /// Whatever is asked for: the mean square stays below, and what passes changes slowly.
        #[test]
        fn warmth_never_exceeds_what_is_borne(wanted in prop::collection::vec((any::<f64>(), 0.0..5.0), 1..40)) {
            let mut limiter = ThermalLimiter::new(ThermalLimits { time_s: 0.5, ..LIMITS });
            // d(largest)/dt = 2 (F_p − F_c) θ'/F_c², θ' ≤ F_p²/τ
            let steepest_n = 2.0 * (3.3 - 0.88) * (3.3_f64 / 0.88).powi(2) / 0.5 * DT_S;
            for (any_n, sane_n) in wanted {
                for wanted_n in [any_n, sane_n, sane_n].into_iter().cycle().take(100) {
                    let before_n = limiter.largest_n();
                    let out_n = limiter.limit(DVec3::new(wanted_n, 0.0, sane_n));
                    prop_assert!(out_n.is_finite() && out_n.length() <= before_n * (1.0 + 1e-12));
                    limiter.held(out_n, DT_S);
                    prop_assert!(limiter.warmth() <= 1.0 + 1e-12, "{}", limiter.warmth());
                    prop_assert!((limiter.largest_n() - before_n).abs() <= steepest_n * 1.01);
                }
            }
        }
    }
}
