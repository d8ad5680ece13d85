//! How stiff a contact may be rendered: from the arm's damping, the loop's period and the delay that is measured.
use crate::{coupling::SampledWall, parameter::ParameterError};

/// Time (s) over which the delay is averaged: a pose that is late once makes no other gain.
const AVERAGED_OVER_S: f64 = 0.25;

/// The largest stiffness, kept up to date with the delay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffnessBound {
    wall: SampledWall,
    /// Without delay (N/m): what is passive, asked for, and within the arm's own limit.
    most_n_per_m: f64,
    delay_s: f64,
}

impl StiffnessBound {
    /// Of a wall on an arm; its delay is the first one. `most_n_per_m` bounds it besides.
    ///
    /// # Errors
    /// [`ParameterError`] for values out of range.
    pub fn new(wall: SampledWall, most_n_per_m: f64) -> Result<Self, ParameterError> {
        let passive_n_per_m = SampledWall { delay_s: 0.0, ..wall }.passive_stiffness_limit_n_per_m()?;
        wall.stable_stiffness_limit_n_per_m()?;
        Ok(Self { wall, most_n_per_m: passive_n_per_m.min(most_n_per_m), delay_s: wall.delay_s })
    }

    /// The same wall, no stiffer than this (N/m).
    #[must_use]
    pub fn within(self, most_n_per_m: f64) -> Self {
        Self { most_n_per_m: self.most_n_per_m.min(most_n_per_m), ..self }
    }

    /// The pose that the next force answers is `age_s` old; `dt_s` have passed since the last one.
    pub fn pose_is(&mut self, age_s: f64, dt_s: f64) {
        if age_s.is_finite() && age_s >= 0.0 && dt_s > 0.0 {
            // t_d ← t_d + (1 − e^(−dt/τ)) (age − t_d)
            self.delay_s += (1.0 - (-dt_s / AVERAGED_OVER_S).exp()) * (age_s - self.delay_s);
        }
    }

    /// The same wall with another delay (s), as measured.
    #[must_use]
    pub fn at_delay(self, delay_s: f64) -> Self {
        Self { delay_s: delay_s.max(0.0), ..self }
    }

    /// The delay (s) now.
    pub fn delay_s(&self) -> f64 {
        self.delay_s
    }

    /// The largest stiffness (N/m) where the loop that renders has no delay: what is passive at this sample time, and asked for.
    pub fn without_delay_n_per_m(&self) -> f64 {
        self.most_n_per_m
    }

    /// The largest stiffness (N/m) at this delay.
    ///
    /// `K < (b + B)/(T/2 + t_d)` ([`SampledWall::stable_stiffness_limit_n_per_m`]), and never more than what is passive without delay.
    pub fn largest_n_per_m(&self) -> f64 {
        let SampledWall { arm_damping_n_s_per_m: b, wall_damping_n_s_per_m, sample_time_s, .. } = self.wall;
        ((b + wall_damping_n_s_per_m) / (0.5 * sample_time_s + self.delay_s)).min(self.most_n_per_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bound(most_n_per_m: f64) -> StiffnessBound {
        let wall =
            SampledWall { arm_damping_n_s_per_m: 0.4, wall_damping_n_s_per_m: 0.0, sample_time_s: 1e-3, delay_s: 0.0 };
        StiffnessBound::new(wall, most_n_per_m).unwrap()
    }

    #[test]
    fn published_limits_follow_the_measured_delay() {
        let mut bound = bound(f64::INFINITY);
        assert!((bound.largest_n_per_m() - 800.0).abs() < 1e-9);
        for _ in 0..10_000 {
            bound.pose_is(1e-3, 1e-3);
        }
        assert!((bound.largest_n_per_m() - 266.667).abs() < 1e-2, "{}", bound.largest_n_per_m());
        // One late pose in between is no other arm.
        bound.pose_is(20e-3, 1e-3);
        assert!(bound.largest_n_per_m() > 250.0);
        for age_s in [f64::NAN, f64::INFINITY, -1.0] {
            let before = bound;
            bound.pose_is(age_s, 1e-3);
            assert_eq!(bound, before);
        }
    }

    #[test]
    fn what_is_asked_for_and_what_is_passive_bound_it_too() {
        assert_eq!(bound(500.0).largest_n_per_m(), 500.0);
        assert_eq!([300.0, 700.0].map(|most| bound(500.0).within(most).largest_n_per_m()), [300.0, 500.0]);
        // 2 (b − B)/T = 400, where (b + B)/(T/2) = 1200.
        let damped = SampledWall { wall_damping_n_s_per_m: 0.2, ..bound(1.0).wall };
        assert!((StiffnessBound::new(damped, 1e9).unwrap().largest_n_per_m() - 400.0).abs() < 1e-9);
        assert!(StiffnessBound::new(SampledWall { sample_time_s: 0.0, ..damped }, 1e9).is_err());
    }
}
