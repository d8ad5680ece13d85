//! What an arm may be asked for in torque, and how the servo renders it.
use crate::{
    extrapolate::{Motion, turn_rad},
    limits::{ForceLimiter, ForceLimits},
    parameter::{ParameterError, not_negative, positive},
    passivity::{PassivityController, PassivitySettings},
};
use glam::{DQuat, DVec3};

/// Limits of an arm's torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TorqueLimits {
    /// Largest magnitude of the torque (N m); 0: it has no motors for torque.
    pub max_torque_nm: f64,
    /// Largest change of the torque per second (N m/s).
    pub max_torque_rate_nm_per_s: f64,
}

impl TorqueLimits {
    /// No torque at all.
    pub const NONE: Self = Self { max_torque_nm: 0.0, max_torque_rate_nm_per_s: 1.0 };

    /// Checks both.
    ///
    /// # Errors
    /// [`ParameterError`] when the peak is negative or the rate not positive.
    pub fn checked(self) -> Result<Self, ParameterError> {
        not_negative("max_torque_nm", self.max_torque_nm)?;
        positive("max_torque_rate_nm_per_s", self.max_torque_rate_nm_per_s)?;
        Ok(self)
    }

    /// The stricter of both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            max_torque_nm: self.max_torque_nm.min(other.max_torque_nm),
            max_torque_rate_nm_per_s: self.max_torque_rate_nm_per_s.min(other.max_torque_rate_nm_per_s),
        }
    }

    /// The same law in N m.
    fn of_limiter(self) -> ForceLimits {
        ForceLimits { max_force_n: self.max_torque_nm, max_force_rate_n_per_s: self.max_torque_rate_nm_per_s }
    }
}

/// A [`ForceLimiter`] of torque: saturation, then rate, then ramp.
#[derive(Debug, Clone)]
pub struct TorqueLimiter {
    limiter: ForceLimiter,
}

impl TorqueLimiter {
    /// At zero torque.
    pub fn new(limits: TorqueLimits) -> Self {
        Self { limiter: ForceLimiter::new(limits.of_limiter()) }
    }

    /// Other limits from now on.
    pub fn set_limits(&mut self, limits: TorqueLimits) {
        self.limiter.set_limits(limits.of_limiter());
    }

    /// Largest torque (N m).
    pub fn max_torque_nm(&self) -> f64 {
        self.limiter.limits().max_force_n
    }

    /// Zero at once.
    pub fn reset(&mut self) {
        self.limiter.reset();
    }

    /// Limits `wanted_nm` (N m) for the next `dt_s` (s); zero for what is not finite.
    pub fn limit(&mut self, wanted_nm: DVec3, ramp: f64, dt_s: f64) -> DVec3 {
        self.limiter.limit(wanted_nm, ramp, dt_s).force_n
    }
}

/// Lever (m) that makes the arm's inertia and damping in rotation, and so the stiffness that it bears, of those at its tool.
pub const LEVER_M: f64 = 0.02;

/// Torque of the servo loop: limited, and passive by itself.
///
/// A torque held over a sample time does `τ·Δθ` on the hand, `Δθ` the rotation vector from one reading to the next (to first order in its angle, which is
/// some 10⁻² rad within 1 ms at most). With the sum of those in the place of a position, the observer and controller of force do for torque what they do
/// there. Each of the two gives the hand no energy that it did not get itself, so their sum gives none either; energy that was put in by pressing
/// does not come back by turning, which is more than passivity asks for.
#[derive(Debug, Clone)]
pub struct TorqueLaw {
    own: TorqueLimits,
    limiter: TorqueLimiter,
    passivity: Option<PassivityController>,
    last: Option<DQuat>,
    turned_rad: DVec3,
}

impl TorqueLaw {
    /// At zero torque. The passivity settings are those of force: damping and mass count with the square of [`LEVER_M`].
    pub fn new(limits: TorqueLimits, passivity: Option<PassivitySettings>) -> Self {
        let square = LEVER_M * LEVER_M;
        let of_rotation = |settings: PassivitySettings| PassivitySettings {
            max_damping_n_s_per_m: settings.max_damping_n_s_per_m * square,
            arm_mass_kg: settings.arm_mass_kg * square,
            ..settings
        };
        Self {
            own: limits,
            limiter: TorqueLimiter::new(limits),
            passivity: passivity.map(|settings| PassivityController::new(of_rotation(settings))),
            last: None,
            turned_rad: DVec3::ZERO,
        }
    }

    /// The daemon's limits; its own hold too.
    pub fn limit_to(&mut self, theirs: TorqueLimits) {
        self.limiter.set_limits(self.own.and(theirs));
    }

    /// The torque (N m) for the arm, which now moves so, to be held for `dt_s`.
    pub fn tick(&mut self, wanted_nm: DVec3, motion: &Motion, ramp: f64, dt_s: f64) -> DVec3 {
        if self.own.max_torque_nm <= 0.0 {
            return DVec3::ZERO;
        }
        self.follow(motion);
        let Some(passivity) = &mut self.passivity else { return self.limiter.limit(wanted_nm, ramp, dt_s) };
        let turning = motion.angular_velocity_rad_per_s;
        let step = passivity.step(wanted_nm, self.turned_rad, turning, dt_s);
        let limited_nm = self.limiter.limit(step.force_n, ramp, dt_s);
        let capped_nm = passivity.cap(limited_nm, turning, dt_s);
        if ramp == 0.0 {
            passivity.reset();
        }
        if capped_nm != limited_nm {
            self.limiter.limiter.was_shortened_to(capped_nm, ramp);
        }
        capped_nm
    }

    fn follow(&mut self, motion: &Motion) {
        let Some(now) = Some(motion.orientation).filter(|now| now.is_finite()) else {
            self.last = None;
            return;
        };
        if let Some(last) = self.last {
            self.turned_rad += turn_rad(last, now);
        }
        self.last = Some(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: TorqueLimits = TorqueLimits { max_torque_nm: 0.1, max_torque_rate_nm_per_s: 10.0 };
    const DT_S: f64 = 1e-3;

    fn turning(angle: f64, rate: f64) -> Motion {
        Motion {
            orientation: DQuat::from_rotation_z(angle),
            angular_velocity_rad_per_s: DVec3::Z * rate,
            ..Motion::at(DVec3::ZERO)
        }
    }

    #[test]
    fn torque_is_saturated_slewed_and_ramped() {
        let mut law = TorqueLaw::new(LIMITS, None);
        let still = turning(0.0, 0.0);
        assert!((law.tick(DVec3::Z, &still, 1.0, DT_S).z - 0.01).abs() < 1e-12, "the rate");
        for _ in 0..20 {
            law.tick(DVec3::Z, &still, 1.0, DT_S);
        }
        assert!((law.tick(DVec3::Z, &still, 1.0, DT_S).z - 0.1).abs() < 1e-12, "the peak");
        assert!((law.tick(DVec3::Z, &still, 0.5, DT_S).z - 0.05).abs() < 1e-12, "the ramp");
        assert_eq!(law.tick(DVec3::NAN, &still, 1.0, DT_S), DVec3::ZERO);
        assert_eq!(law.tick(DVec3::Z, &still, 0.0, DT_S), DVec3::ZERO);
        law.limit_to(TorqueLimits { max_torque_nm: 0.0, ..LIMITS });
        assert_eq!(law.tick(DVec3::Z, &still, 1.0, DT_S), DVec3::ZERO, "the daemon allows none");
        let mut none = TorqueLaw::new(TorqueLimits::NONE, None);
        assert_eq!(none.tick(DVec3::Z, &still, 1.0, DT_S), DVec3::ZERO, "the arm has none");
    }

    /// A late spring of 0.5 N m/rad gives a hand that swings about it energy in every round, and with the controller none to speak of.
    #[test]
    fn a_late_spring_gives_no_energy() {
        let given_j = |passivity: Option<PassivitySettings>| {
            let limits = TorqueLimits { max_torque_nm: 1.0, max_torque_rate_nm_per_s: 1e4 };
            let mut law = TorqueLaw::new(limits, passivity);
            let (swing_rad, omega, late) = (0.2, 20.0, 30.0);
            let angle = |tick: f64| swing_rad * (omega * tick * DT_S).sin();
            let mut given_j = 0.0;
            for tick in 0..3000 {
                let tick = f64::from(tick);
                let motion = turning(angle(tick), swing_rad * omega * (omega * tick * DT_S).cos());
                let torque_nm = law.tick(DVec3::Z * (-0.5 * angle(tick - late)), &motion, 1.0, DT_S);
                given_j += torque_nm.z * (angle(tick + 1.0) - angle(tick));
            }
            given_j
        };
        let strict = PassivitySettings { strict: true, ..PassivitySettings::default() };
        let (without, with) = (given_j(None), given_j(Some(strict)));
        println!("{without} J without, {with} J with");
        assert!(without > 0.1 && with < 1e-4, "{without} {with}");
    }
}
