//! A path through space: what scripted tools, CSV trajectories and the hand on the simulated arm follow.
use glam::{DQuat, DVec3};
use palpate_physics::contact::ToolTarget;

/// How a [`MotionPath`] goes from one keyframe to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Straight at constant speed: the velocity jumps at keyframes.
    Linear,
    /// Straight along `s³(10 − 15s + 6s²)`: velocity and acceleration vanish at keyframes.
    #[default]
    Smooth,
}

/// Positions over time, in one orientation. Before the first keyframe it rests at the first, after the last one at the last, unless it repeats.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionPath {
    times_s: Vec<f64>,
    positions_m: Vec<DVec3>,
    orientation: DQuat,
    interpolation: Interpolation,
    repeat: bool,
}

/// Why keyframes make no path.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PathError {
    /// No keyframe at all.
    #[error("has no keyframe; give at least one")]
    Empty,
    /// A time or coordinate is NaN or infinite.
    #[error("keyframe {0} is not finite")]
    NonFinite(usize),
    /// Times must increase.
    #[error("keyframe {index} is at {time_s} s, not after the one before it ({previous_s} s)")]
    NotIncreasing {
        /// Index of the keyframe, from 0.
        index: usize,
        /// Its time (s).
        time_s: f64,
        /// Time of the one before (s).
        previous_s: f64,
    },
    /// A repeated path would jump.
    #[error(
        "repeats, but does not end where it starts ({start} m, then {end} m): the tool would jump; \
         make the last keyframe equal the first"
    )]
    Jumps {
        /// First position (m).
        start: DVec3,
        /// Last position (m).
        end: DVec3,
    },
}

impl PathError {
    /// The keyframe concerned, counting from 0.
    pub fn keyframe(&self) -> Option<usize> {
        match self {
            Self::NonFinite(index) | Self::NotIncreasing { index, .. } => Some(*index),
            Self::Empty | Self::Jumps { .. } => None,
        }
    }
}

impl MotionPath {
    /// Checks and takes keyframes `(time (s), position (m))`.
    ///
    /// # Errors
    /// [`PathError`].
    pub fn new(keyframes: &[(f64, DVec3)], interpolation: Interpolation, repeat: bool) -> Result<Self, PathError> {
        let (Some(first), Some(last)) = (keyframes.first(), keyframes.last()) else { return Err(PathError::Empty) };
        for (index, (time_s, position)) in keyframes.iter().enumerate() {
            if !time_s.is_finite() || !position.is_finite() {
                return Err(PathError::NonFinite(index));
            }
            let previous_s = if index == 0 { f64::NEG_INFINITY } else { keyframes[index - 1].0 };
            if *time_s <= previous_s {
                return Err(PathError::NotIncreasing { index, time_s: *time_s, previous_s });
            }
        }
        if repeat && first.1 != last.1 {
            return Err(PathError::Jumps { start: first.1, end: last.1 });
        }
        let (times_s, positions_m) = keyframes.iter().copied().unzip();
        Ok(Self { times_s, positions_m, orientation: DQuat::IDENTITY, interpolation, repeat })
    }

    /// The same path, in another orientation (tool frame to world).
    #[must_use]
    pub fn turned(self, orientation: DQuat) -> Self {
        Self { orientation, ..self }
    }

    /// Where it starts (m).
    pub fn start_m(&self) -> DVec3 {
        self.positions_m.first().copied().unwrap_or_default()
    }

    /// Time from the first to the last keyframe (s).
    pub fn duration_s(&self) -> f64 {
        self.last_s() - self.first_s()
    }

    fn first_s(&self) -> f64 {
        self.times_s.first().copied().unwrap_or(0.0)
    }

    fn last_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or(0.0)
    }

    /// Position (m) and velocity (m/s) at a time. Does not allocate.
    pub fn at(&self, time_s: f64) -> ToolTarget {
        let there = ToolTarget { orientation: self.orientation, ..ToolTarget::default() };
        let rest = |position_m| ToolTarget { position_m, ..there };
        let period_s = self.duration_s();
        let time_s = if self.repeat && period_s > 0.0 && time_s > self.first_s() {
            self.first_s() + (time_s - self.first_s()).rem_euclid(period_s)
        } else {
            time_s
        };
        let next = self.times_s.partition_point(|&t| t <= time_s);
        if next == 0 {
            return rest(self.start_m());
        }
        if next == self.times_s.len() {
            return rest(self.positions_m[next - 1]);
        }
        let (t0, t1) = (self.times_s[next - 1], self.times_s[next]);
        let (a, b) = (self.positions_m[next - 1], self.positions_m[next]);
        let s = (time_s - t0) / (t1 - t0);
        let (blend, rate) = match self.interpolation {
            Interpolation::Linear => (s, 1.0),
            Interpolation::Smooth => (smooth_step(s), smooth_step_rate(s)),
        };
        ToolTarget { position_m: a.lerp(b, blend), velocity_m_per_s: (b - a) * (rate / (t1 - t0)), ..there }
    }
}

/// `s³(10 − 15s + 6s²)`, from 0 at s = 0 to 1 at s = 1 with vanishing first and second derivatives at both; clamped outside.
pub fn smooth_step(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// Its derivative `30 s²(1 − s)²`.
fn smooth_step_rate(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    30.0 * (s * (1.0 - s)).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(interpolation: Interpolation, repeat: bool) -> MotionPath {
        let keys = [(0.0, DVec3::ZERO), (1.0, DVec3::X), (3.0, DVec3::ZERO)];
        MotionPath::new(&keys, interpolation, repeat).unwrap()
    }

    #[test]
    fn keyframes_are_met_and_ends_are_held() {
        for interpolation in [Interpolation::Linear, Interpolation::Smooth] {
            let path = path(interpolation, false);
            for (t, x) in [(-1.0, 0.0), (0.0, 0.0), (1.0, 1.0), (2.0, 0.5), (3.0, 0.0), (9.0, 0.0)] {
                assert!((path.at(t).position_m.x - x).abs() < 1e-15, "{interpolation:?} at {t}");
            }
        }
    }

    #[test]
    fn velocity_is_the_derivative_of_position() {
        for repeat in [false, true] {
            let (path, h) = (path(Interpolation::Smooth, repeat), 1e-6);
            for t in [0.3, 0.77, 1.4, 2.9, 3.5, 7.2] {
                let slope = (path.at(t + h).position_m - path.at(t - h).position_m) / (2.0 * h);
                assert!((slope - path.at(t).velocity_m_per_s).length() < 1e-8, "at {t}");
            }
        }
    }

    #[test]
    fn a_repeated_path_comes_round() {
        let path = path(Interpolation::Smooth, true);
        assert!((path.at(0.4).position_m - path.at(6.4).position_m).length() < 1e-12);
        assert!(path.at(3.5).position_m.x > 0.0);
    }

    #[test]
    fn bad_keyframes_are_named() {
        let make = |keys: &[(f64, DVec3)], repeat| MotionPath::new(keys, Interpolation::Linear, repeat).unwrap_err();
        assert_eq!(make(&[], false), PathError::Empty);
        assert_eq!(make(&[(0.0, DVec3::NAN)], false), PathError::NonFinite(0));
        assert_eq!(make(&[(0.0, DVec3::X), (0.0, DVec3::X)], false).keyframe(), Some(1));
        assert!(make(&[(0.0, DVec3::X), (1.0, DVec3::Y)], true).to_string().contains("would jump"));
    }
}
