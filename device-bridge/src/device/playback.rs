//! A recording as an arm: it moves as the arm did that was recorded, in that arm's own axes, whatever force is put on it.
//!
//! It lives in servo time. Between two rows position follows the cubic of Hermite, from their positions and velocities, orientation the shorter arc (slerp).
use super::{Arm, Effort, Fault, Reading};
use crate::recording::read::{self, Pose, RecordingError};
use glam::DQuat;
use palpate_control::{Motion, turn_rad};
use std::path::PathBuf;

/// After a pause longer than this (periods) the arm goes on from where it was.
const LONGEST_GAP: u64 = 100;

/// What to play, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The recording.
    pub file: PathBuf,
    /// How many times as fast as it was recorded.
    pub speed: f64,
    /// It goes back to its beginning and begins anew.
    pub repeat: bool,
    /// It rests so long (s) at its beginning before it moves, and takes so long to go back there.
    pub rest_s: f64,
}

/// The arm.
#[derive(Debug)]
pub struct Playback {
    track: Track,
    period_s: f64,
    periods: u64,
}

impl Playback {
    /// Reads the recording.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn open(settings: &Settings, period_s: f64) -> Result<Self, RecordingError> {
        let track = Track::new(read::file(&settings.file)?, settings);
        Ok(Self { track, period_s, periods: 0 })
    }
}

impl Arm for Playback {
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        self.periods += periods.min(LONGEST_GAP);
        let (motion, buttons) = self.track.at(self.periods as f64 * self.period_s);
        Ok(Reading { motion, buttons, measured_force_n: None, age_s: 0.0, force_share: 1.0 })
    }

    /// Nothing moves it.
    fn apply(&mut self, _: &Effort) {}
}

/// Where a recorded arm is at any time.
#[derive(Debug, Clone)]
struct Track {
    /// At least one.
    poses: Vec<Pose>,
    speed: f64,
    repeat: bool,
    rest_s: f64,
}

impl Track {
    fn new(poses: Vec<Pose>, settings: &Settings) -> Self {
        let Settings { speed, repeat, rest_s, .. } = *settings;
        Self { poses, speed, repeat, rest_s }
    }

    /// Motion and buttons at a time (s) since the arm was opened.
    ///
    /// First it rests at its beginning; then it plays; then it stays at its end, or goes back to the beginning and plays again.
    fn at(&self, time_s: f64) -> (Motion, u32) {
        let (first, last) = (&self.poses[0], &self.poses[self.poses.len() - 1]);
        let round_s = self.rest_s + last.time_s / self.speed;
        let is_again = self.repeat && time_s >= round_s;
        let in_round_s = if is_again { time_s.rem_euclid(round_s) } else { time_s };
        if in_round_s < self.rest_s && is_again {
            return (back(&last.motion, &first.motion, in_round_s, self.rest_s), 0);
        }
        if in_round_s < self.rest_s {
            return (at_rest(&first.motion), first.buttons);
        }
        let played_s = (in_round_s - self.rest_s) * self.speed;
        let after = self.poses.partition_point(|pose| pose.time_s <= played_s);
        match (self.poses.get(after.wrapping_sub(1)), self.poses.get(after)) {
            (Some(a), Some(b)) => (between(a, b, played_s, self.speed), a.buttons),
            _ => (at_rest(&last.motion), last.buttons),
        }
    }
}

fn at_rest(motion: &Motion) -> Motion {
    Motion { orientation: motion.orientation, ..Motion::at(motion.position_m) }
}

/// `x(s) = (2s³ − 3s² + 1) a + (s³ − 2s² + s) h ȧ + (3s² − 2s³) b + (s³ − s²) h ḃ`, with h from a to b and s from 0 to 1.
fn between(a: &Pose, b: &Pose, time_s: f64, speed: f64) -> Motion {
    let h = b.time_s - a.time_s;
    let s = (time_s - a.time_s) / h;
    let (from, to) = (&a.motion, &b.motion);
    let (x0, v0, x1, v1) = (from.position_m, from.velocity_m_per_s, to.position_m, to.velocity_m_per_s);
    // Seen from a, or a place far from the origin would lose digits.
    let way_m = x1 - x0;
    let position_m = x0 + s * ((s * s - 2.0 * s + 1.0) * h * v0 + s * (3.0 - 2.0 * s) * way_m + s * (s - 1.0) * h * v1);
    // ẋ = (3s² − 4s + 1) ȧ + 6 s (1 − s) (b − a)/h + (3s² − 2s) ḃ
    let velocity = (3.0 * s * s - 4.0 * s + 1.0) * v0 + 6.0 * s * (1.0 - s) / h * way_m + (3.0 * s * s - 2.0 * s) * v1;
    Motion {
        position_m,
        orientation: from.orientation.slerp(to.orientation, s).normalize(),
        velocity_m_per_s: speed * velocity,
        angular_velocity_rad_per_s: speed * from.angular_velocity_rad_per_s.lerp(to.angular_velocity_rad_per_s, s),
    }
}

/// From one place to another in `duration_s`, with the least jerk: `b(s) = 10 s³ − 15 s⁴ + 6 s⁵` of the way.
fn back(from: &Motion, to: &Motion, time_s: f64, duration_s: f64) -> Motion {
    let s = time_s / duration_s;
    let blend = s * s * s * (10.0 + s * (-15.0 + 6.0 * s));
    let rate_per_s = 30.0 * s * s * (1.0 - s) * (1.0 - s) / duration_s;
    let turn = turn_rad(from.orientation, to.orientation);
    let way_m = to.position_m - from.position_m;
    Motion {
        position_m: from.position_m + blend * way_m,
        orientation: (DQuat::from_scaled_axis(blend * turn) * from.orientation).normalize(),
        velocity_m_per_s: rate_per_s * way_m,
        angular_velocity_rad_per_s: rate_per_s * turn,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    fn settings(speed: f64, repeat: bool) -> Settings {
        Settings { file: PathBuf::new(), speed, repeat, rest_s: 0.5 }
    }

    /// A cubic in time, and a steady turn: 2 s of it, rows every 0.1 s.
    fn exact(t: f64) -> Motion {
        Motion {
            position_m: DVec3::new(t * t * t, 1.0 - t, 2.0 * t * t),
            orientation: DQuat::from_rotation_z(3.0 * t),
            velocity_m_per_s: DVec3::new(3.0 * t * t, -1.0, 4.0 * t),
            angular_velocity_rad_per_s: DVec3::Z * 3.0,
        }
    }

    fn track(speed: f64, repeat: bool) -> Track {
        let pose = |i: u32| {
            let time_s = f64::from(i) * 0.1;
            Pose { time_s, motion: exact(time_s), buttons: i }
        };
        Track::new((0..=20).map(pose).collect(), &settings(speed, repeat))
    }

    fn same(a: &Motion, b: &Motion) -> bool {
        a.position_m.distance(b.position_m) < 1e-12
            && a.orientation.angle_between(b.orientation) < 1e-7
            && a.velocity_m_per_s.distance(b.velocity_m_per_s) < 1e-12
            && a.angular_velocity_rad_per_s.distance(b.angular_velocity_rad_per_s) < 1e-12
    }

    #[test]
    fn rest_then_the_motion_then_its_end() {
        let track = track(1.0, false);
        assert_eq!(track.at(0.3), (at_rest(&exact(0.0)), 0));
        assert_eq!(track.at(60.0), (at_rest(&exact(2.0)), 20));
        assert_eq!(track.at(0.5 + 0.25).1, 2, "buttons are those of the row before");
        let one = Track::new(vec![Pose { time_s: 0.0, motion: exact(1.0), buttons: 3 }], &settings(1.0, true));
        for time_s in [0.0, 0.2, 0.5, 0.7, 99.3] {
            assert!(same(&one.at(time_s).0, &at_rest(&exact(1.0))), "{time_s}");
        }
    }

    #[test]
    fn it_repeats_without_a_jump() {
        let track = track(2.0, true);
        let (round_s, step_s) = (0.5 + 1.0, 1e-4);
        assert!(same(&track.at(round_s + 0.75).0, &track.at(0.75).0), "played again");
        let mut before = track.at(0.0).0;
        for tick in 1..45_000 {
            let now = track.at(f64::from(tick) * step_s).0;
            assert!(now.position_m.distance(before.position_m) < 50.0 * step_s, "at {tick}");
            assert!(now.orientation.angle_between(before.orientation) < 15.0 * step_s, "at {tick}");
            before = now;
        }
    }

    proptest! {
        /// A cubic between rows is played as it was, at any speed.
        #[test]
        fn a_cubic_and_a_steady_turn_are_played_exactly(t in 0.0..1.999_f64, speed in 0.1..10.0_f64) {
            let motion = track(speed, false).at(0.5 + t / speed).0;
            let e = exact(t);
            let faster = Motion {
                velocity_m_per_s: speed * e.velocity_m_per_s,
                angular_velocity_rad_per_s: speed * e.angular_velocity_rad_per_s,
                ..e
            };
            prop_assert!(motion.position_m.distance(faster.position_m) < 1e-12);
            prop_assert!(motion.orientation.angle_between(faster.orientation) < 1e-6);
            prop_assert!(motion.velocity_m_per_s.distance(faster.velocity_m_per_s) < 1e-10);
            prop_assert!(motion.angular_velocity_rad_per_s.distance(faster.angular_velocity_rad_per_s) < 1e-12);
        }

        /// Velocities are the slopes of places, on the way back, too.
        #[test]
        fn velocity_is_the_slope_of_position(t in 0.6..5.9_f64) {
            let (track, h) = (track(1.0, true), 1e-5);
            let (a, now, b) = (track.at(t - h).0, track.at(t).0, track.at(t + h).0);
            // Not across the ends of a round, where it starts and stops.
            let round = |t: f64| [(t % 2.5) < 0.5, t >= 2.5, t >= 5.0];
            prop_assume!(round(t - h) == round(t + h));
            let slope = (b.position_m - a.position_m) / (2.0 * h);
            prop_assert!(slope.distance(now.velocity_m_per_s) < 1e-5, "{slope} {now:?}");
            // 2 sin(θ/2) is θ here; the library's own takes a turn of less than 1e-8 rad for none.
            let turned = (b.orientation * a.orientation.inverse()).xyz() / h;
            prop_assert!(turned.distance(now.angular_velocity_rad_per_s) < 1e-4, "{turned} {now:?}");
        }

        #[test]
        fn any_time_is_a_finite_motion(time_s in 0.0..1e9_f64, speed in 0.01..10.0_f64, repeat in any::<bool>()) {
            prop_assert!(track(speed, repeat).at(time_s).0.is_finite());
        }
    }
}
