//! Velocity from positions alone, for arms whose encoders count and tell nothing else.
//!
//! First-order adaptive windowing (Janabi-Sharifi, Hayward and Chen, Discrete-time adaptive windowing for velocity estimation, IEEE Trans. Control Systems
//! Technology 8, 2000), with the line through the ends of the window: the longest window whose every sample is within the noise of that line. At
//! rest it averages over all of it; in a sudden move it is a single difference.

/// Samples that are remembered, the newest among them: the longest window spans one less. A hand's movement, counted in steps and told at ticks, is followed best
/// by eight: longer windows lag more than they smooth.
const REMEMBERED: usize = 9;

/// Rate of change of one number.
///
/// With samples `y_k` at times `t_k`, the window's line is `y_k − b_n (t_k − t)` with `b_n = (y_k − y_{k−n})/W`, `W = t_k − t_{k−n}`, and n is the largest for which
/// `|y_{k−i} − y_k + b_n (t_k − t_{k−i})| ≤ d` for all `0 < i < n`.
///
/// A steady rate v, in steps of q (`noise`) and told up to J (`jitter_s`) late, is off its line by `q + |v| J` at most, and `|v| (W − J) ≤ |b_n| W + q`. So
/// `d = q + J (|b_n| W + q)/(W − J)` keeps the whole window, where the rate is known to `(q + |v| J)/W`. Without jitter, under an acceleration a, the window is
/// `√(8 q/a)` long at most, and the rate lags by half of that.
#[derive(Debug, Clone)]
pub struct Velocity {
    /// Largest distance between two measurements of one place, such as a step of an encoder.
    noise: f64,
    /// How much later than another a sample may be told (s).
    jitter_s: f64,
    /// Newest last: value and time (s).
    samples: [(f64, f64); REMEMBERED],
    count: usize,
    rate_per_s: f64,
}

impl Velocity {
    /// At rest, with that much noise (in the number's unit, peak to peak), and that much difference in how late samples are told (s): a tick, where ticks tell the time.
    pub fn new(noise: f64, jitter_s: f64) -> Self {
        Self { noise, jitter_s, samples: [(0.0, 0.0); REMEMBERED], count: 0, rate_per_s: 0.0 }
    }

    /// A new sample, `passed_s` (s) after the one before; the rate per second now. One that is no number, or took no time, changes nothing.
    pub fn push(&mut self, value: f64, passed_s: f64) -> f64 {
        if !(value.is_finite() && passed_s.is_finite() && passed_s > 0.0) {
            return self.rate_per_s;
        }
        // Times count back from the newest sample, so they stay small for ever.
        for sample in &mut self.samples[..self.count] {
            sample.1 -= passed_s;
        }
        if self.count == REMEMBERED {
            self.samples.copy_within(1.., 0);
            self.count -= 1;
        }
        self.samples[self.count] = (value, 0.0);
        self.count += 1;
        self.rate_per_s = self.slope();
        self.rate_per_s
    }

    fn slope(&self) -> f64 {
        let Some((&(newest, _), before)) = self.samples[..self.count].split_last() else { return 0.0 };
        for (at, &(value, time_s)) in before.iter().enumerate() {
            let slope = (value - newest) / time_s;
            // d = q + J (|b| W + q)/(W − J)
            let late = self.jitter_s * ((value - newest).abs() + self.noise) / (-time_s - self.jitter_s);
            // Rounding of the line itself is no noise; a window within the jitter allows anything.
            let allowed = if late >= 0.0 { (self.noise + late) * (1.0 + 1e-9) } else { f64::INFINITY };
            let is_near = |&(y, t_s): &(f64, f64)| (y - newest - slope * t_s).abs() <= allowed;
            if before[at + 1..].iter().all(is_near) {
                return slope;
            }
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const T_S: f64 = 1e-3;
    const STEP: f64 = 5e-5;

    fn rounded(x: f64) -> f64 {
        (x / STEP).floor() * STEP
    }

    /// Feeds a motion in steps of an encoder; the largest error after `settled` samples.
    fn worst(motion: impl Fn(f64) -> (f64, f64), settled: usize, samples: usize) -> f64 {
        let mut velocity = Velocity::new(STEP, 0.0);
        let errors = (0..samples).map(|k| {
            let (x, v) = motion(k as f64 * T_S);
            let error = (velocity.push(rounded(x), T_S) - v).abs();
            if k < settled { 0.0 } else { error }
        });
        errors.fold(0.0, f64::max)
    }

    proptest! {
        /// The whole window, so the bound of the whole window, at any speed; a difference of two samples errs by up to STEP/T.
        #[test]
        fn a_steady_motion_in_steps_is_known_to_a_step_over_the_window(v in -0.5..0.5_f64, from in -0.1..0.1_f64) {
            let error = worst(|t_s| (from + v * t_s, v), REMEMBERED, 300);
            prop_assert!(error <= STEP / (T_S * (REMEMBERED - 1) as f64) * 1.001, "{error}");
        }

        /// Poses that beat against the ticks are told up to a tick late: without the jitter's share a tick that two of them share, or none has, doubles the rate.
        #[test]
        fn a_steady_motion_told_late_is_known_to_the_jitter_over_the_window(
            v in -0.5..0.5_f64, late in prop::collection::vec(0.0..T_S, 100),
        ) {
            let mut velocity = Velocity::new(STEP, T_S);
            // Told in order, each up to a tick after it was measured.
            for (k, pair) in late.windows(2).enumerate() {
                let measured_s = (k + 1) as f64 * T_S;
                let rate = velocity.push(rounded(v * measured_s), T_S + pair[1] - pair[0]);
                let window_s = (REMEMBERED - 1) as f64 * T_S - T_S;
                let bound = (STEP + v.abs() * T_S) / window_s * 1.001;
                prop_assert!(k < REMEMBERED || (rate - v).abs() <= bound, "{rate}, {v}");
            }
        }
    }

    /// Under an acceleration a the window is √(8 noise/a) long, and the rate lags by a/2 of it.
    #[test]
    fn an_acceleration_shortens_the_window_to_what_the_noise_allows() {
        let a = 6.0;
        let mut velocity = Velocity::new(STEP, 0.0);
        for k in 0..200 {
            let t_s = f64::from(k) * T_S;
            let rate = velocity.push(0.5 * a * t_s * t_s, T_S);
            let window_s = ((8.0 * STEP / a).sqrt() / T_S).floor() * T_S;
            if k > 40 {
                assert!((a * t_s - rate - 0.5 * a * window_s).abs() < 1e-9, "{rate} at {t_s}");
            }
        }
    }

    #[test]
    fn a_sudden_move_is_followed_in_a_few_samples_and_rest_is_rest() {
        let jerk = |t_s: f64| if t_s < 0.1 { (0.0, 0.0) } else { (0.4 * (t_s - 0.1), 0.4) };
        // A few samples; and then a step over what has passed since.
        let settled = 105;
        assert!(worst(jerk, settled, 300) <= STEP / (4.0 * T_S), "{}", worst(jerk, settled, 300));
        assert_eq!(worst(|_| (0.01, 0.0), 0, 100), 0.0);
    }

    #[test]
    fn a_skipped_tick_is_time_that_passed_and_what_is_no_number_is_left_out() {
        let mut velocity = Velocity::new(0.0, 0.0);
        let mut x = 0.0;
        for (k, periods) in [1.0, 1.0, 5.0, 1.0, 2.0].into_iter().cycle().take(60).enumerate() {
            x += 0.3 * periods * T_S;
            let rate = velocity.push(x, periods * T_S);
            assert!(k == 0 || (rate - 0.3).abs() < 1e-9, "{rate}");
        }
        for (value, passed_s) in [(f64::NAN, T_S), (1.0, f64::INFINITY), (1.0, 0.0), (1.0, -1.0)] {
            assert!((velocity.push(value, passed_s) - 0.3).abs() < 1e-9);
        }
        // One sample moves nowhere.
        assert_eq!(Velocity::new(0.0, 0.0).push(7.0, T_S), 0.0);
    }
}
