//! The virtual coupling between arm and tool, and how stiff a sampled wall may be.
use crate::parameter::{ParameterError, not_negative, positive};
use glam::DVec3;

/// Spring and damper between arm and tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VirtualCoupling {
    /// K_vc (N/m).
    pub stiffness_n_per_m: f64,
    /// B_vc (N s/m).
    pub damping_n_s_per_m: f64,
}

impl VirtualCoupling {
    /// Checks both.
    ///
    /// # Errors
    /// [`ParameterError`] when the stiffness is not positive or the damping negative.
    pub fn checked(self) -> Result<Self, ParameterError> {
        positive("coupling_stiffness_n_per_m", self.stiffness_n_per_m)?;
        not_negative("coupling_damping_n_s_per_m", self.damping_n_s_per_m)?;
        Ok(self)
    }

    /// Force on the arm (N): `F = K (x_tool − x_arm) + B (v_tool − v_arm)`. The tool feels −F.
    pub fn force_on_arm_n(
        &self,
        arm_position_m: DVec3,
        arm_velocity_m_per_s: DVec3,
        tool_position_m: DVec3,
        tool_velocity_m_per_s: DVec3,
    ) -> DVec3 {
        self.stiffness_n_per_m * (tool_position_m - arm_position_m)
            + self.damping_n_s_per_m * (tool_velocity_m_per_s - arm_velocity_m_per_s)
    }
}

/// A wall or coupling rendered by a sampled loop on a real arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledWall {
    /// Physical damping b of the arm (N s/m).
    pub arm_damping_n_s_per_m: f64,
    /// Damping B of the wall (N s/m), from backward differences of position.
    pub wall_damping_n_s_per_m: f64,
    /// Sample time T (s).
    pub sample_time_s: f64,
    /// Further delay t_d of the loop (s), e.g. a network round trip.
    pub delay_s: f64,
}

impl SampledWall {
    /// Stiffness K (N/m) below which the wall is **passive**: no passive hand can make it unstable.
    ///
    /// `b > K T/2 + |B|` (Colgate and Schenkel, Passivity of a class of sampled-data systems, J. Robotic Systems 14, 1997),
    /// from `b > K T/2 − B cos ωT`, worst at the Nyquist frequency. For a loop without further delay; negative when no
    /// stiffness is passive.
    ///
    /// # Errors
    /// [`ParameterError`] for values out of range, and for a delay, which no positive stiffness survives at all frequencies.
    pub fn passive_stiffness_limit_n_per_m(&self) -> Result<f64, ParameterError> {
        self.check()?;
        if self.delay_s > 0.0 {
            let rule = "must be 0: with a delay only the stability bound holds";
            return Err(ParameterError { name: "delay_s", value: self.delay_s, rule });
        }
        // K < 2 (b − |B|) / T
        Ok(2.0 * (self.arm_damping_n_s_per_m - self.wall_damping_n_s_per_m) / self.sample_time_s)
    }

    /// Stiffness K (N/m) below which the wall is **stable** on the arm alone, with delay.
    ///
    /// `K < (b + B) / (T/2 + t_d)` (Gil, Sánchez, Hulin, Preusche and Hirzinger, Stability boundary for haptic rendering:
    /// influence of damping and delay, J. Comput. Inf. Sci. Eng. 9, 2009), for dampings small beside m/T.
    /// At b = 0.4 N s/m and T = 1 ms: 800 N/m without delay, 267 N/m with 1 ms.
    ///
    /// # Errors
    /// [`ParameterError`] for values out of range.
    pub fn stable_stiffness_limit_n_per_m(&self) -> Result<f64, ParameterError> {
        self.check()?;
        Ok((self.arm_damping_n_s_per_m + self.wall_damping_n_s_per_m) / (self.sample_time_s / 2.0 + self.delay_s))
    }

    fn check(&self) -> Result<(), ParameterError> {
        not_negative("arm_damping_n_s_per_m", self.arm_damping_n_s_per_m)?;
        not_negative("wall_damping_n_s_per_m", self.wall_damping_n_s_per_m)?;
        positive("sample_time_s", self.sample_time_s)?;
        not_negative("delay_s", self.delay_s)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spring_pulls_the_arm_towards_the_tool() {
        let coupling = VirtualCoupling { stiffness_n_per_m: 500.0, damping_n_s_per_m: 2.0 };
        let force_n = coupling.force_on_arm_n(DVec3::ZERO, DVec3::X, DVec3::new(0.0, 0.0, 1e-3), DVec3::ZERO);
        assert_eq!(force_n, DVec3::new(-2.0, 0.0, 0.5));
    }

    #[test]
    fn published_limits() {
        let wall =
            SampledWall { arm_damping_n_s_per_m: 0.4, wall_damping_n_s_per_m: 0.0, sample_time_s: 1e-3, delay_s: 0.0 };
        assert!((wall.stable_stiffness_limit_n_per_m().unwrap() - 800.0).abs() < 1e-9);
        assert!((wall.passive_stiffness_limit_n_per_m().unwrap() - 800.0).abs() < 1e-9);
        let delayed = SampledWall { delay_s: 1e-3, ..wall };
        assert!((delayed.stable_stiffness_limit_n_per_m().unwrap() - 266.667).abs() < 1e-3);
        assert_eq!(delayed.passive_stiffness_limit_n_per_m().unwrap_err().name, "delay_s");
        assert_eq!(SampledWall { sample_time_s: 0.0, ..wall }.check().unwrap_err().name, "sample_time_s");
    }
}
