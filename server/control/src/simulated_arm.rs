//! An arm without hardware: a mass with friction, held by a hand that follows a path and yields to force.
use crate::{
    extrapolate::Motion,
    parameter::{ParameterError, not_negative, positive},
};
use glam::{DMat3, DVec3};
use thiserror::Error;

/// Where the hand wants to be at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Keyframe {
    /// Time since the start of the path (s).
    pub time_s: f64,
    /// Position (m, world).
    pub position_m: DVec3,
}

/// Why a path is refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PathError {
    /// No keyframe at all.
    #[error("a hand path needs at least one keyframe")]
    Empty,
    /// Times out of order, before zero, or not finite.
    #[error("keyframe {index}: time_s = {time_s} must be finite, not negative, and later than the one before")]
    Time {
        /// Which keyframe, from 0.
        index: usize,
        /// Its time (s).
        time_s: f64,
    },
    /// A position that is not finite.
    #[error("keyframe {index}: position_m must be finite")]
    Position {
        /// Which keyframe, from 0.
        index: usize,
    },
    /// A period that does not hold the keyframes.
    #[error("period_s = {period_s} must be finite, positive and not before the last keyframe, at {last_s} s")]
    Period {
        /// The period (s).
        period_s: f64,
        /// Time of the last keyframe (s).
        last_s: f64,
    },
}

/// A path through keyframes, each stretch a straight minimum-jerk movement (Flash and Hogan, The coordination of arm movements,
/// J. Neuroscience 5, 1985): `x = a + (b − a)(10 s³ − 15 s⁴ + 6 s⁵)`, at rest at every keyframe.
#[derive(Debug, Clone, PartialEq)]
pub struct HandPath {
    keyframes: Vec<Keyframe>,
    period_s: Option<f64>,
}

impl HandPath {
    /// A path through `keyframes`. With a period it repeats, moving from the last keyframe back to the first in what is left of
    /// the period; without, it rests at the last.
    ///
    /// # Errors
    /// [`PathError`], naming the keyframe.
    pub fn new(keyframes: Vec<Keyframe>, period_s: Option<f64>) -> Result<Self, PathError> {
        let mut earliest_s = 0.0;
        for (index, key) in keyframes.iter().enumerate() {
            let in_order = key.time_s > earliest_s || (index == 0 && key.time_s == 0.0);
            if !(key.time_s.is_finite() && in_order) {
                return Err(PathError::Time { index, time_s: key.time_s });
            }
            if !key.position_m.is_finite() {
                return Err(PathError::Position { index });
            }
            earliest_s = key.time_s;
        }
        let last_s = keyframes.last().ok_or(PathError::Empty)?.time_s;
        match period_s {
            Some(period_s) if !(period_s.is_finite() && period_s > 0.0 && period_s >= last_s) => {
                Err(PathError::Period { period_s, last_s })
            }
            _ => Ok(Self { keyframes, period_s }),
        }
    }

    /// A hand that stays at one place.
    pub fn resting_at(position_m: DVec3) -> Self {
        Self { keyframes: vec![Keyframe { time_s: 0.0, position_m }], period_s: None }
    }

    /// Position (m) and velocity (m/s) of the hand at a time (s) ≥ 0.
    pub fn at(&self, time_s: f64) -> (DVec3, DVec3) {
        let t = self.period_s.map_or(time_s, |period_s| time_s.rem_euclid(period_s));
        let after = self.keyframes.partition_point(|key| key.time_s <= t);
        let first = self.keyframes[0];
        let last = self.keyframes[self.keyframes.len() - 1];
        match (after, self.period_s) {
            (0, _) => (first.position_m, DVec3::ZERO),
            (n, None) if n == self.keyframes.len() => (last.position_m, DVec3::ZERO),
            (n, Some(period_s)) if n == self.keyframes.len() => {
                minimum_jerk(last, Keyframe { time_s: period_s, ..first }, t)
            }
            (n, _) => minimum_jerk(self.keyframes[n - 1], self.keyframes[n], t),
        }
    }
}

fn minimum_jerk(from: Keyframe, to: Keyframe, t: f64) -> (DVec3, DVec3) {
    let duration_s = to.time_s - from.time_s;
    let s = (t - from.time_s) / duration_s;
    let way_m = to.position_m - from.position_m;
    // x = a + (b − a)(10 s³ − 15 s⁴ + 6 s⁵),  ẋ = (b − a)(30 s² − 60 s³ + 30 s⁴)/duration
    let blend = s * s * s * (10.0 + s * (-15.0 + 6.0 * s));
    let rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / duration_s;
    (from.position_m + way_m * blend, way_m * rate)
}

/// Constants of arm and hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmSpec {
    /// Mass at the tool (kg).
    pub mass_kg: f64,
    /// Friction of the arm's joints, seen at the tool (N s/m).
    pub damping_n_s_per_m: f64,
    /// Stiffness of the hand (N/m); 0: nobody holds the arm.
    pub hand_stiffness_n_per_m: f64,
    /// Damping of the hand (N s/m).
    pub hand_damping_n_s_per_m: f64,
}

impl Default for ArmSpec {
    /// A desktop arm (0.1 kg, 0.4 N s/m) in a relaxed hand.
    fn default() -> Self {
        Self { mass_kg: 0.1, damping_n_s_per_m: 0.4, hand_stiffness_n_per_m: 300.0, hand_damping_n_s_per_m: 6.0 }
    }
}

impl ArmSpec {
    /// Checks them.
    ///
    /// # Errors
    /// [`ParameterError`] when the mass is not positive or another constant negative.
    pub fn checked(self) -> Result<Self, ParameterError> {
        positive("mass_kg", self.mass_kg)?;
        not_negative("damping_n_s_per_m", self.damping_n_s_per_m)?;
        not_negative("hand_stiffness_n_per_m", self.hand_stiffness_n_per_m)?;
        not_negative("hand_damping_n_s_per_m", self.hand_damping_n_s_per_m)?;
        Ok(self)
    }
}

/// The arm. `m ẍ = F + k_h (x_h − x) + b_h (v_h − v) − b v`, with the force F and the hand held constant over a step (the hand as
/// it is in the middle), which makes the step exact and so stable at any length: `(x, v, u)' = e^{A dt} (x, v, u)`.
#[derive(Debug, Clone)]
pub struct SimulatedArm {
    spec: ArmSpec,
    path: HandPath,
    dt_s: f64,
    steps: u64,
    position_m: DVec3,
    velocity_m_per_s: DVec3,
    /// Rows of e^{A dt}: coefficients of (x, v, u) in the new x and the new v.
    position_row: DVec3,
    velocity_row: DVec3,
}

impl SimulatedArm {
    /// At rest where the hand's path begins, to be stepped by `dt_s`.
    ///
    /// # Errors
    /// [`ParameterError`] when the constants or the step are out of range.
    pub fn new(spec: ArmSpec, path: HandPath, dt_s: f64) -> Result<Self, ParameterError> {
        let spec = spec.checked()?;
        positive("dt_s", dt_s)?;
        // A = [0 1 0; −k/m −(b + b_h)/m 1/m; 0 0 0], columns below.
        let m = spec.mass_kg;
        let damping = spec.damping_n_s_per_m + spec.hand_damping_n_s_per_m;
        let a = DMat3::from_cols(
            DVec3::new(0.0, -spec.hand_stiffness_n_per_m / m, 0.0),
            DVec3::new(1.0, -damping / m, 0.0),
            DVec3::new(0.0, 1.0 / m, 0.0),
        );
        let e = exponential(a * dt_s);
        let position_m = path.at(0.0).0;
        Ok(Self {
            spec,
            path,
            dt_s,
            steps: 0,
            position_m,
            velocity_m_per_s: DVec3::ZERO,
            position_row: e.row(0),
            velocity_row: e.row(1),
        })
    }

    /// Constants.
    pub fn spec(&self) -> ArmSpec {
        self.spec
    }

    /// Time (s) since the start of the path.
    pub fn time_s(&self) -> f64 {
        self.steps as f64 * self.dt_s
    }

    /// Pose and twist now; the arm does not turn.
    pub fn motion(&self) -> Motion {
        Motion { velocity_m_per_s: self.velocity_m_per_s, ..Motion::at(self.position_m) }
    }

    /// Force of the hand on the arm now (N): what a sensor in the handle would measure.
    pub fn hand_force_n(&self) -> DVec3 {
        let (hand_m, hand_m_per_s) = self.path.at(self.time_s());
        self.spec.hand_stiffness_n_per_m * (hand_m - self.position_m)
            + self.spec.hand_damping_n_s_per_m * (hand_m_per_s - self.velocity_m_per_s)
    }

    /// One step of `dt_s` under a force on the arm (N); one that is not finite acts as zero.
    pub fn step(&mut self, force_on_arm_n: DVec3) -> Motion {
        let (hand_m, hand_m_per_s) = self.path.at(self.time_s() + 0.5 * self.dt_s);
        self.step_towards(hand_m, hand_m_per_s, force_on_arm_n)
    }

    /// The same with the hand at another place (m) and velocity (m/s) than its path says, held over the step.
    pub fn step_towards(&mut self, hand_m: DVec3, hand_m_per_s: DVec3, force_on_arm_n: DVec3) -> Motion {
        let force_n = if force_on_arm_n.is_finite() { force_on_arm_n } else { DVec3::ZERO };
        // u = F + k_h x_h + b_h v_h
        let u = force_n + self.spec.hand_stiffness_n_per_m * hand_m + self.spec.hand_damping_n_s_per_m * hand_m_per_s;
        let (x, v, p, q) = (self.position_m, self.velocity_m_per_s, self.position_row, self.velocity_row);
        self.position_m = p.x * x + p.y * v + p.z * u;
        self.velocity_m_per_s = q.x * x + q.y * v + q.z * u;
        self.steps += 1;
        self.motion()
    }

    /// Puts the arm somewhere (m) with a velocity (m/s), as when time jumps; the path goes on.
    pub fn place(&mut self, position_m: DVec3, velocity_m_per_s: DVec3) {
        self.position_m = position_m;
        self.velocity_m_per_s = velocity_m_per_s;
    }
}

/// e^M by scaling and squaring: Taylor to order 12 of M/2ⁿ with ‖M/2ⁿ‖ ≤ ¼, so the rest is below 1e-17.
fn exponential(m: DMat3) -> DMat3 {
    let norm = [m.x_axis, m.y_axis, m.z_axis].iter().map(|c| c.abs().element_sum()).fold(0.0, f64::max);
    let squarings = (norm * 4.0).log2().ceil().max(0.0) as i32;
    let scaled = m * 0.5_f64.powi(squarings);
    let (mut sum, mut term) = (DMat3::IDENTITY, DMat3::IDENTITY);
    for order in 1..=12 {
        term = term * scaled * (1.0 / f64::from(order));
        sum += term;
    }
    for _ in 0..squarings {
        sum *= sum;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn key(time_s: f64, z: f64) -> Keyframe {
        Keyframe { time_s, position_m: DVec3::new(0.0, 0.0, z) }
    }

    fn free(mass_kg: f64, damping_n_s_per_m: f64) -> ArmSpec {
        ArmSpec { mass_kg, damping_n_s_per_m, hand_stiffness_n_per_m: 0.0, hand_damping_n_s_per_m: 0.0 }
    }

    #[test]
    fn a_free_mass_falls_with_friction_as_the_formula_says() {
        // v(t) = F/b (1 − e^{−bt/m}),  x(t) = F/b (t − m/b (1 − e^{−bt/m}))
        let (m, b, f) = (0.2, 0.5, 1.5);
        let mut arm = SimulatedArm::new(free(m, b), HandPath::resting_at(DVec3::ZERO), 1e-3).unwrap();
        for _ in 0..700 {
            arm.step(DVec3::X * f);
        }
        let decay = 1.0 - (-b * 0.7 / m).exp();
        assert!((arm.motion().velocity_m_per_s.x - f / b * decay).abs() < 1e-12);
        assert!((arm.motion().position_m.x - f / b * (0.7 - m / b * decay)).abs() < 1e-12);
    }

    #[test]
    fn a_held_arm_answers_a_step_as_the_formula_says() {
        // Underdamped: x(t) = F/k [1 − e^{−ζωt}(cos ω_d t + ζω/ω_d sin ω_d t)]
        let spec = ArmSpec { hand_damping_n_s_per_m: 2.0, ..ArmSpec::default() };
        let mut arm = SimulatedArm::new(spec, HandPath::resting_at(DVec3::ZERO), 1e-3).unwrap();
        let (m, k, c): (f64, f64, f64) = (0.1, 300.0, 2.4);
        let decay = c / (2.0 * m);
        let omega_d = (k / m - decay * decay).sqrt();
        for step in 1..=300 {
            let x = arm.step(DVec3::Z).position_m.z;
            let t = f64::from(step) * 1e-3;
            let expected =
                1.0 / k * (1.0 - (-decay * t).exp() * ((omega_d * t).cos() + decay / omega_d * (omega_d * t).sin()));
            assert!((x - expected).abs() < 1e-14, "at {t} s: {x} against {expected}");
        }
    }

    #[test]
    fn the_hand_yields_by_force_over_stiffness() {
        let mut arm =
            SimulatedArm::new(ArmSpec::default(), HandPath::resting_at(DVec3::new(0.1, 0.0, 0.0)), 1e-3).unwrap();
        for _ in 0..5000 {
            arm.step(DVec3::new(0.0, 0.0, 3.0));
        }
        let expected_m = DVec3::new(0.1, 0.0, 3.0 / 300.0);
        assert!((arm.motion().position_m - expected_m).length() < 1e-12);
        assert!((arm.hand_force_n() - DVec3::new(0.0, 0.0, -3.0)).length() < 1e-9);
    }

    #[test]
    fn the_arm_follows_the_hand() {
        let path = HandPath::new(vec![key(0.0, 0.0), key(1.0, 0.05)], None).unwrap();
        let mut arm = SimulatedArm::new(ArmSpec::default(), path.clone(), 1e-3).unwrap();
        let mut worst_m: f64 = 0.0;
        for _ in 0..1500 {
            let motion = arm.step(DVec3::ZERO);
            worst_m = worst_m.max((motion.position_m - path.at(arm.time_s()).0).length());
        }
        // The lag is (b v + m a)/k_h: 0.4 · 0.094/300 + 0.1 · 0.29/300 = 0.22 mm at most.
        assert!(worst_m < 0.25e-3, "{worst_m}");
        assert!((arm.motion().position_m.z - 0.05).abs() < 1e-9);
    }

    #[test]
    fn any_step_is_stable() {
        let stiff = ArmSpec { mass_kg: 1e-3, hand_stiffness_n_per_m: 1e5, ..ArmSpec::default() };
        let mut arm = SimulatedArm::new(stiff, HandPath::resting_at(DVec3::ZERO), 0.1).unwrap();
        for _ in 0..100 {
            assert!(arm.step(DVec3::X).position_m.length() <= 2.0 / 1e5);
        }
    }

    #[test]
    fn a_path_repeats_and_comes_back() {
        let path = HandPath::new(vec![key(0.5, 0.0), key(1.0, 0.1)], Some(2.0)).unwrap();
        assert_eq!(path.at(0.2), (DVec3::ZERO, DVec3::ZERO));
        assert_eq!(path.at(1.0).0.z, 0.1);
        assert!((path.at(1.5).0.z - 0.05).abs() < 1e-15);
        assert!((path.at(2.75).0.z - path.at(0.75).0.z).abs() < 1e-15);
        assert!((path.at(0.75).0.z - 0.05).abs() < 1e-15);
    }

    #[test]
    fn the_velocity_is_the_derivative_of_the_position() {
        let path = HandPath::new(vec![key(0.0, 0.0), key(0.7, 0.1), key(1.0, -0.1)], Some(1.5)).unwrap();
        for step in 1..60 {
            let (t, h) = (f64::from(step) * 0.05 + 0.003, 1e-6);
            let difference = (path.at(t + h).0 - path.at(t - h).0) / (2.0 * h);
            assert!((difference - path.at(t).1).length() < 1e-6, "at {t}");
        }
    }

    #[test]
    fn bad_paths_and_constants_are_named() {
        assert_eq!(HandPath::new(vec![], None), Err(PathError::Empty));
        let twice = HandPath::new(vec![key(0.0, 0.0), key(0.0, 1.0)], None);
        assert_eq!(twice, Err(PathError::Time { index: 1, time_s: 0.0 }));
        assert!(matches!(HandPath::new(vec![key(-1.0, 0.0)], None), Err(PathError::Time { index: 0, .. })));
        assert!(matches!(HandPath::new(vec![key(f64::NAN, 0.0)], None), Err(PathError::Time { index: 0, .. })));
        assert_eq!(HandPath::new(vec![key(0.0, f64::NAN)], None), Err(PathError::Position { index: 0 }));
        let short = HandPath::new(vec![key(0.0, 0.0), key(2.0, 1.0)], Some(1.0));
        assert_eq!(short, Err(PathError::Period { period_s: 1.0, last_s: 2.0 }));
        let error = ArmSpec { mass_kg: 0.0, ..ArmSpec::default() }.checked().unwrap_err();
        assert_eq!(error.to_string(), "mass_kg = 0: must be finite and larger than 0");
    }

    #[test]
    fn two_runs_give_the_same_bits() {
        let run = || {
            let path = HandPath::new(vec![key(0.0, 0.0), key(0.3, 0.02)], Some(0.8)).unwrap();
            let mut arm = SimulatedArm::new(ArmSpec::default(), path, 1e-3).unwrap();
            (0..2000)
                .map(|i| arm.step(DVec3::splat(f64::from(i % 7) * 0.1)).position_m)
                .fold(0_u64, |hash, p| hash.rotate_left(5) ^ p.x.to_bits() ^ p.z.to_bits().rotate_left(17))
        };
        assert_eq!(run(), run());
    }

    proptest! {
        /// Energy of mass and hand spring never grows by more than the work of the force: the arm is passive. The hand rests.
        #[test]
        fn the_arm_is_passive(
            forces in prop::collection::vec((-5.0..5.0_f64, -5.0..5.0_f64, -5.0..5.0_f64), 1..200),
            mass_kg in 0.01..2.0_f64, damping in 0.0..5.0_f64, stiffness in 0.0..2000.0_f64,
        ) {
            let spec = ArmSpec {
                mass_kg, damping_n_s_per_m: damping, hand_stiffness_n_per_m: stiffness, hand_damping_n_s_per_m: 1.0,
            };
            let mut arm = SimulatedArm::new(spec, HandPath::resting_at(DVec3::ZERO), 1e-3).unwrap();
            let energy_j = |m: &Motion| {
                0.5 * mass_kg * m.velocity_m_per_s.length_squared() + 0.5 * stiffness * m.position_m.length_squared()
            };
            let mut work_j = 0.0;
            for force in forces {
                let before = arm.motion();
                let after = arm.step(DVec3::from(force));
                // A held force does exactly F·Δx.
                work_j += DVec3::from(force).dot(after.position_m - before.position_m);
                prop_assert!(energy_j(&after) <= work_j + 1e-12, "{} J stored of {work_j} J", energy_j(&after));
            }
        }
    }
}
