//! Where the arm is now, from where it was a few milliseconds ago.
use glam::{DQuat, DVec3};

/// Pose and twist of an arm at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Position (m, world).
    pub position_m: DVec3,
    /// Orientation, tool frame to world.
    pub orientation: DQuat,
    /// Linear velocity (m/s, world).
    pub velocity_m_per_s: DVec3,
    /// Angular velocity (rad/s, world).
    pub angular_velocity_rad_per_s: DVec3,
}

impl Motion {
    /// At rest at a position, unrotated.
    pub fn at(position_m: DVec3) -> Self {
        Self {
            position_m,
            orientation: DQuat::IDENTITY,
            velocity_m_per_s: DVec3::ZERO,
            angular_velocity_rad_per_s: DVec3::ZERO,
        }
    }

    /// Whether every component is finite.
    pub fn is_finite(&self) -> bool {
        self.position_m.is_finite()
            && self.orientation.is_finite()
            && self.velocity_m_per_s.is_finite()
            && self.angular_velocity_rad_per_s.is_finite()
    }
}

/// The motion `after_s` later at constant twist: `x + v t`, `q ← exp(ω t) q`. Time outside 0 to `longest_s`, or NaN, is taken
/// to the nearer end (NaN to 0): a constant velocity is believed for a few milliseconds only.
pub fn extrapolate(motion: &Motion, after_s: f64, longest_s: f64) -> Motion {
    let t = if after_s > 0.0 { after_s.min(longest_s) } else { 0.0 };
    let turn = DQuat::from_scaled_axis(motion.angular_velocity_rad_per_s * t);
    Motion {
        position_m: motion.position_m + motion.velocity_m_per_s * t,
        orientation: (turn * motion.orientation).normalize(),
        ..*motion
    }
}

/// The rotation vector (rad) that turns one orientation into another, the shorter way round: `exp(θ) from = ± to`.
pub fn turn_rad(from: DQuat, to: DQuat) -> DVec3 {
    let by = to * from.conjugate();
    (if by.w < 0.0 { -by } else { by }).to_scaled_axis()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn moving() -> Motion {
        Motion {
            position_m: DVec3::new(0.1, 0.2, 0.3),
            orientation: DQuat::from_rotation_x(FRAC_PI_2),
            velocity_m_per_s: DVec3::new(1.0, 0.0, -2.0),
            angular_velocity_rad_per_s: DVec3::new(0.0, 0.0, 100.0 * FRAC_PI_2),
        }
    }

    #[test]
    fn constant_twist() {
        let later = extrapolate(&moving(), 0.01, 0.02);
        assert!((later.position_m - DVec3::new(0.11, 0.2, 0.28)).length() < 1e-15);
        // A quarter turn about the world's z, after the quarter turn about x.
        let expected = DQuat::from_rotation_z(FRAC_PI_2) * DQuat::from_rotation_x(FRAC_PI_2);
        assert!(later.orientation.angle_between(expected) < 1e-7);
    }

    #[test]
    fn two_halves_make_a_whole() {
        let half = extrapolate(&extrapolate(&moving(), 0.002, 1.0), 0.002, 1.0);
        let whole = extrapolate(&moving(), 0.004, 1.0);
        assert!((half.position_m - whole.position_m).length() < 1e-15);
        assert!(half.orientation.angle_between(whole.orientation) < 1e-7);
    }

    #[test]
    fn time_is_bounded() {
        assert_eq!(extrapolate(&moving(), 10.0, 0.005), extrapolate(&moving(), 0.005, 0.005));
        assert_eq!(extrapolate(&moving(), -1.0, 0.005).position_m, moving().position_m);
        assert_eq!(extrapolate(&moving(), f64::NAN, 0.005).position_m, moving().position_m);
    }
}
