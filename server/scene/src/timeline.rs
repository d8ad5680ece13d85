//! Loads and prescribed motions as functions of time.
use crate::path::smooth_step;
use glam::DVec3;
use std::f64::consts::TAU;

/// A dimensionless factor over time.
#[derive(Debug, Clone, PartialEq)]
pub enum Amplitude {
    /// Always the same.
    Constant(f64),
    /// From one value to another along a straight line.
    Ramp(Transition),
    /// From one value to another along `s³(10 − 15s + 6s²)`.
    SmoothStep(Transition),
    /// `mean + amplitude · sin(2π f (t − start) + phase)`, and its value at `start` before.
    Sine {
        /// Mean value.
        mean: f64,
        /// Largest deviation from it.
        amplitude: f64,
        /// Frequency (Hz).
        frequency_hz: f64,
        /// Phase (rad).
        phase_rad: f64,
        /// Start (s).
        start_s: f64,
    },
    /// `value` while `start ≤ t < start + duration`, 0 otherwise; repeated every `period` if there is one.
    Pulse {
        /// Value inside the pulse.
        value: f64,
        /// Start (s).
        start_s: f64,
        /// Length (s).
        duration_s: f64,
        /// Repetition (s).
        period_s: Option<f64>,
    },
    /// Straight lines between points; the end values outside.
    Table {
        /// Times (s), increasing.
        times_s: Vec<f64>,
        /// Values, one per time.
        values: Vec<f64>,
    },
}

/// From one value to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transition {
    /// Value before.
    pub from: f64,
    /// Value after.
    pub to: f64,
    /// Start (s).
    pub start_s: f64,
    /// Length (s).
    pub duration_s: f64,
}

impl Transition {
    fn blend(&self, fraction: f64) -> f64 {
        self.from + (self.to - self.from) * fraction
    }

    fn fraction(&self, time_s: f64) -> f64 {
        ((time_s - self.start_s) / self.duration_s).clamp(0.0, 1.0)
    }
}

impl Amplitude {
    /// The factor at a time. Does not allocate.
    pub fn at(&self, time_s: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Ramp(transition) => transition.blend(transition.fraction(time_s)),
            Self::SmoothStep(transition) => transition.blend(smooth_step(transition.fraction(time_s))),
            Self::Sine { mean, amplitude, frequency_hz, phase_rad, start_s } => {
                let since = (time_s - start_s).max(0.0);
                mean + amplitude * (TAU * frequency_hz * since + phase_rad).sin()
            }
            Self::Pulse { value, start_s, duration_s, period_s } => {
                let since = time_s - start_s;
                let within = period_s.filter(|_| since >= 0.0).map_or(since, |period| since.rem_euclid(period));
                if (0.0..*duration_s).contains(&within) { *value } else { 0.0 }
            }
            Self::Table { times_s, values } => table_at(times_s, values, time_s),
        }
    }

    /// The factor once everything has settled, where there is one: what a static solve applies.
    pub fn final_value(&self) -> f64 {
        match self {
            Self::Sine { mean, .. } => *mean,
            Self::Pulse { .. } => 0.0,
            other => other.at(f64::MAX),
        }
    }
}

fn table_at(times_s: &[f64], values: &[f64], time_s: f64) -> f64 {
    let next = times_s.partition_point(|&t| t <= time_s);
    if next == 0 {
        return values.first().copied().unwrap_or(0.0);
    }
    if next == times_s.len() {
        return values[next - 1];
    }
    let s = (time_s - times_s[next - 1]) / (times_s[next] - times_s[next - 1]);
    values[next - 1] + (values[next] - values[next - 1]) * s
}

/// A prescribed displacement over time: `displacement · amplitude(t)`.
#[derive(Debug, Clone, PartialEq)]
pub struct PrescribedMotion {
    /// Displacement from rest at factor 1 (m).
    pub displacement_m: DVec3,
    /// Its factor.
    pub amplitude: Amplitude,
}

/// The factor of every load and the displacement of every prescribed set, in the order of the model's.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Timeline {
    /// One per load.
    pub loads: Vec<Amplitude>,
    /// One per prescribed set.
    pub prescribed: Vec<PrescribedMotion>,
}

impl Timeline {
    /// Writes the factors and displacements (m) at a time. Does not allocate; extra slots are left alone.
    pub fn fill(&self, time_s: f64, load_factors: &mut [f64], prescribed_displacements_m: &mut [DVec3]) {
        for (slot, amplitude) in load_factors.iter_mut().zip(&self.loads) {
            *slot = amplitude.at(time_s);
        }
        for (slot, motion) in prescribed_displacements_m.iter_mut().zip(&self.prescribed) {
            *slot = motion.displacement_m * motion.amplitude.at(time_s);
        }
    }

    /// Writes the factors and displacements (m) that a static solve applies: [`Amplitude::final_value`].
    pub fn fill_final(&self, load_factors: &mut [f64], prescribed_displacements_m: &mut [DVec3]) {
        for (slot, amplitude) in load_factors.iter_mut().zip(&self.loads) {
            *slot = amplitude.final_value();
        }
        for (slot, motion) in prescribed_displacements_m.iter_mut().zip(&self.prescribed) {
            *slot = motion.displacement_m * motion.amplitude.final_value();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Transition = Transition { from: 1.0, to: 3.0, start_s: 1.0, duration_s: 2.0 };

    #[test]
    fn transitions_start_end_and_pass_the_middle() {
        for amplitude in [Amplitude::Ramp(STEP), Amplitude::SmoothStep(STEP)] {
            for (t, value) in [(0.0, 1.0), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0), (9.0, 3.0)] {
                assert!((amplitude.at(t) - value).abs() < 1e-15, "{amplitude:?} at {t}");
            }
            assert_eq!(amplitude.final_value(), 3.0);
        }
        assert!(Amplitude::SmoothStep(STEP).at(1.2) < Amplitude::Ramp(STEP).at(1.2));
    }

    #[test]
    fn a_pulse_repeats_from_its_start_only() {
        let pulse = Amplitude::Pulse { value: 2.0, start_s: 1.0, duration_s: 0.25, period_s: Some(1.0) };
        for (t, value) in [(0.1, 0.0), (1.0, 2.0), (1.24, 2.0), (1.3, 0.0), (2.2, 2.0), (2.3, 0.0)] {
            assert_eq!(pulse.at(t), value, "at {t}");
        }
    }

    #[test]
    fn sine_and_table_have_their_values() {
        let sine = Amplitude::Sine { mean: 1.0, amplitude: 2.0, frequency_hz: 0.5, phase_rad: 0.0, start_s: 1.0 };
        assert_eq!(sine.at(0.0), 1.0);
        assert!((sine.at(1.5) - 3.0).abs() < 1e-12);
        let table = Amplitude::Table { times_s: vec![0.0, 1.0, 3.0], values: vec![0.0, 4.0, 0.0] };
        for (t, value) in [(-1.0, 0.0), (0.5, 2.0), (2.0, 2.0), (3.0, 0.0), (7.0, 0.0)] {
            assert_eq!(table.at(t), value, "at {t}");
        }
    }
}
