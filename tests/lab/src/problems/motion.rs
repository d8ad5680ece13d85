//! How an action comes and goes in time.
use std::f64::consts::TAU;

/// Ticks per second.
pub const RATE_HZ: f64 = 1000.0;
/// Mass damping (1/s) of dynamic problems: free motion falls to a third in a fifth of a second, so that the body rings.
pub const RINGING_DAMPING_PER_S: f64 = 10.0;

/// How much of an action is there at a time. Between the ends of two ticks it goes straight, as [`palpate_physics::TickInput`] has it, for
/// references too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// It comes smoothly and stays until the body rests: how fast, each body has its own pace.
    ToRest,
    /// It comes within some ticks, along `6s⁵ − 15s⁴ + 10s³`, and stays; the body rings.
    Step {
        /// Ticks in which it comes.
        rise_ticks: usize,
        /// Ticks in all.
        ticks: usize,
    },
    /// `sin φ` with a frequency `φ'/2π` that goes up evenly.
    Sweep {
        /// Frequency (Hz) at the beginning and at the end.
        hz: [f64; 2],
        /// Ticks in all.
        ticks: usize,
    },
}

impl Motion {
    /// Ticks of a dynamic problem; `None` where the body comes to rest.
    pub fn ticks(self) -> Option<usize> {
        match self {
            Self::ToRest => None,
            Self::Step { ticks, .. } | Self::Sweep { ticks, .. } => Some(ticks),
        }
    }

    /// Share of the action at the end of a dynamic problem's tick, counted from 1 (0: before the first); all of it where the body comes to rest.
    pub fn fraction(self, tick: usize) -> f64 {
        match self {
            Self::ToRest => 1.0,
            Self::Step { rise_ticks, .. } => smooth(tick as f64 / rise_ticks as f64),
            Self::Sweep { hz: [from, to], ticks } => {
                // φ = 2π (f₀ t + ½ (f₁ − f₀) t²/T)
                let (t, whole) = (tick as f64 / RATE_HZ, ticks as f64 / RATE_HZ);
                (TAU * t * (from + 0.5 * (to - from) * t / whole)).sin()
            }
        }
    }
}

/// `6s⁵ − 15s⁴ + 10s³`, at rest at both ends.
pub fn smooth(s: f64) -> f64 {
    let s = s.min(1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_crosses_zero_as_often_as_its_mean_frequency_says() {
        let sweep = Motion::Sweep { hz: [5.0, 45.0], ticks: 1000 };
        let values: Vec<f64> = (1..=1000).map(|t| sweep.fraction(t)).collect();
        let crossings = values.windows(2).filter(|w| w[0] * w[1] < 0.0).count();
        // 25 periods.
        assert!((49..=50).contains(&crossings), "{crossings}");
        let step = Motion::Step { rise_ticks: 5, ticks: 10 };
        assert!(step.fraction(1) < 0.06 && step.fraction(5) == 1.0 && step.fraction(10) == 1.0);
    }
}
