//! The torque of a contact on a tool that turns, rendered beside the arm between two messages of the daemon.
use crate::{
    extrapolate::turn_rad,
    limits::clamp_length,
    local_model::{RenderSettings, age_weight, bounded, distance_weight},
    torque::LEVER_M,
};
use glam::{DMat3, DQuat, DVec3};

/// Torque on the arm near `orientation`: `τ(R) = torque_nm + stiffness θ`, with the rotation vector `θ` of `R orientation⁻¹`, shortened to `max_torque_nm` where it is longer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalTorque {
    /// Orientation of the arm about which it is expanded.
    pub orientation: DQuat,
    /// Torque on the arm there (N m).
    pub torque_nm: DVec3,
    /// `∂τ/∂θ` (N m/rad), symmetric.
    pub stiffness_nm_per_rad: DMat3,
    /// Angle inside which it holds (rad).
    pub validity_angle_rad: f64,
    /// Largest torque that may be rendered from it (N m).
    pub max_torque_nm: f64,
}

impl LocalTorque {
    /// Accepts a received model: finite, an orientation of length 1 (± 1e-3, then normalised), positive angle and largest torque; the stiffness is made symmetric, because a
    /// spring that is not gives energy on a closed path. `None` otherwise.
    pub fn accept(self) -> Option<Self> {
        let finite =
            self.orientation.is_finite() && self.torque_nm.is_finite() && self.stiffness_nm_per_rad.is_finite();
        let positive = |number: f64| number.is_finite() && number > 0.0;
        let is_one = (self.orientation.length() - 1.0).abs() <= 1e-3;
        if !(finite && is_one && positive(self.validity_angle_rad) && positive(self.max_torque_nm)) {
            return None;
        }
        let stiffness_nm_per_rad = (self.stiffness_nm_per_rad + self.stiffness_nm_per_rad.transpose()) * 0.5;
        let accepted = Self { orientation: self.orientation.normalize(), stiffness_nm_per_rad, ..self };
        accepted.stiffness_nm_per_rad.is_finite().then_some(accepted)
    }

    /// The torque (N m) on an arm of this orientation, from a model `age_s` old.
    ///
    /// As the force of [`crate::LocalModel::render`]: linear inside the angle; outside the turn counts as far as the angle, and the whole fades to zero at twice the angle, and with age.
    /// Never stiffer than the largest stiffness of `settings` on a lever of [`LEVER_M`].
    pub fn render(&self, orientation: DQuat, age_s: f64, settings: &RenderSettings) -> DVec3 {
        if !orientation.is_finite() {
            return DVec3::ZERO;
        }
        let turn = turn_rad(self.orientation, orientation);
        let angle_rad = turn.length();
        let share = (self.validity_angle_rad / angle_rad).min(1.0);
        let stiffness = bounded(&self.stiffness_nm_per_rad, settings.max_stiffness_n_per_m * LEVER_M * LEVER_M);
        // τ = τ₀ + (∂τ/∂θ) θ
        let torque_nm = self.torque_nm + stiffness * (turn * share);
        let weight = distance_weight(angle_rad / self.validity_angle_rad) * age_weight(age_s, settings);
        weight * clamp_length(torque_nm, self.max_torque_nm).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SETTINGS: RenderSettings =
        RenderSettings { hold_s: 5e-3, forget_s: 20e-3, damping_n_s_per_m: 0.5, max_stiffness_n_per_m: 800.0 };

    /// A quarter turned about x; 0.1 N m/rad about y.
    fn model() -> LocalTorque {
        LocalTorque {
            orientation: DQuat::from_rotation_x(1.5),
            torque_nm: DVec3::Y * 0.02,
            stiffness_nm_per_rad: DMat3::from_diagonal(DVec3::Y * -0.1),
            validity_angle_rad: 0.1,
            max_torque_nm: 0.025,
        }
    }

    fn turned(by: DVec3) -> DQuat {
        DQuat::from_scaled_axis(by) * model().orientation
    }

    #[test]
    fn linear_inside_the_angle_and_shortened_to_the_largest() {
        let at = |by: DVec3| model().render(turned(by), 0.0, &SETTINGS);
        assert!(at(DVec3::Y * 0.05).distance(DVec3::Y * 0.015) < 1e-12);
        assert!(at(DVec3::Y * -0.02).distance(DVec3::Y * 0.022) < 1e-12);
        assert!(at(DVec3::Y * -0.09).distance(DVec3::Y * 0.025) < 1e-12, "shortened");
        assert!(at(DVec3::X * 0.05).distance(DVec3::Y * 0.02) < 1e-12, "nothing resists that");
        assert_eq!(
            model().render(-turned(DVec3::ZERO), 0.0, &SETTINGS),
            model().render(turned(DVec3::ZERO), 0.0, &SETTINGS)
        );
    }

    #[test]
    fn it_fades_outside_the_angle_and_with_age() {
        let at = |rad: f64, age_s: f64| model().render(turned(DVec3::Y * rad), age_s, &SETTINGS).y;
        assert!((at(0.1, 0.0) - 0.01).abs() < 1e-12);
        assert!((at(0.15, 0.0) - 0.005).abs() < 1e-12);
        assert!(at(0.2, 0.0).abs() < 1e-12 && at(3.0, 0.0).abs() < 1e-12);
        assert!((at(0.0, 12.5e-3) - 0.01).abs() < 1e-12 && at(0.0, 0.02) == 0.0);
        assert_eq!(model().render(DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0), 0.0, &SETTINGS), DVec3::ZERO);
    }

    #[test]
    fn no_stiffer_than_a_loop_of_the_arm_bears() {
        let stiff = LocalTorque { stiffness_nm_per_rad: DMat3::from_diagonal(DVec3::splat(-100.0)), ..model() };
        let torque_nm = stiff.render(turned(DVec3::Y * 0.05), 0.0, &SETTINGS).y;
        // 800 N/m · (0.02 m)² = 0.32 N m/rad.
        assert!((torque_nm - (0.02 - 0.05 * 0.32)).abs() < 1e-12, "{torque_nm}");
    }

    #[test]
    fn received_models_are_checked() {
        assert_eq!(model().accept().unwrap().torque_nm, model().torque_nm);
        for bad in [
            LocalTorque { orientation: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), ..model() },
            LocalTorque { torque_nm: DVec3::NAN, ..model() },
            LocalTorque { validity_angle_rad: 0.0, ..model() },
            LocalTorque { max_torque_nm: -1.0, ..model() },
            LocalTorque { stiffness_nm_per_rad: DMat3::from_diagonal(DVec3::splat(f64::MAX)) * 10.0, ..model() },
        ] {
            assert_eq!(bad.accept(), None, "{bad:?}");
        }
    }

    proptest! {
        #[test]
        fn it_is_continuous_and_bounded(by in prop::array::uniform3(-3.0..3.0_f64), age_s in 0.0..0.03_f64) {
            let here = model().render(turned(DVec3::from(by)), age_s, &SETTINGS);
            let near = model().render(turned(DVec3::from(by)) * DQuat::from_rotation_z(1e-7), age_s, &SETTINGS);
            prop_assert!(here.length() <= 0.025 + 1e-12);
            // 0.1 N m/rad, and the fade's slope, 3/2 per 0.1 rad of 0.025 N m.
            prop_assert!((near - here).length() < 1e-7, "{here} {near}");
        }
    }
}
