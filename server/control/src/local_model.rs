//! A linear model of a contact, rendered beside the arm between two messages of the daemon.
use crate::{
    limits::clamp_length,
    parameter::{ParameterError, not_negative, positive},
};
use glam::{DMat3, DVec3};

/// Force on the arm near `point_m`: `F(p) = force_n + stiffness (p − point_m)`, without its pulling part, and shortened to
/// `max_force_n` where it is longer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalModel {
    /// Arm position about which it is expanded (m).
    pub point_m: DVec3,
    /// Outward unit normal of the contact.
    pub normal: DVec3,
    /// Force on the arm at `point_m` (N).
    pub force_n: DVec3,
    /// `∂F/∂p` (N/m), symmetric.
    pub stiffness_n_per_m: DMat3,
    /// Radius inside which it holds (m).
    pub validity_radius_m: f64,
    /// Largest force that may be rendered from it (N).
    pub max_force_n: f64,
}

/// How a local model is rendered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderSettings {
    /// Age (s) up to which the model counts fully.
    pub hold_s: f64,
    /// Age (s) from which it counts nothing; linear in between.
    pub forget_s: f64,
    /// Damping (N s/m) along the normal while in contact.
    pub damping_n_s_per_m: f64,
    /// Largest stiffness (N/m) rendered: the bound of [`crate::coupling::SampledWall`] for this arm and loop.
    pub max_stiffness_n_per_m: f64,
}

impl RenderSettings {
    /// Checks them.
    ///
    /// # Errors
    /// [`ParameterError`] when one is out of range or order.
    pub fn checked(self) -> Result<Self, ParameterError> {
        not_negative("hold_s", self.hold_s)?;
        positive("forget_s", self.forget_s)?;
        not_negative("damping_n_s_per_m", self.damping_n_s_per_m)?;
        positive("max_stiffness_n_per_m", self.max_stiffness_n_per_m)?;
        if self.forget_s < self.hold_s {
            let rule = "must not be smaller than hold_s";
            return Err(ParameterError { name: "forget_s", value: self.forget_s, rule });
        }
        Ok(self)
    }
}

/// A rendered force.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rendered {
    /// Force on the arm (N); its normal part never pulls, and it is never longer than the model's largest.
    pub force_n: DVec3,
    /// How much the model counted, 0 to 1: by distance and by age.
    pub weight: f64,
    /// The arm is farther from `point_m` than the radius.
    pub outside: bool,
}

/// Beyond this many radii the model counts nothing.
const FADE_END: f64 = 2.0;

impl LocalModel {
    /// Accepts a received model: finite, normal of length 1 (± 1e-3, then normalised), positive radius and largest force; the
    /// stiffness is made symmetric (`(K + Kᵀ)/2`), because a spring that is not gives energy on a closed path. `None` otherwise.
    pub fn accept(self) -> Option<Self> {
        let finite = self.point_m.is_finite()
            && self.normal.is_finite()
            && self.force_n.is_finite()
            && self.stiffness_n_per_m.is_finite();
        let radius_ok = self.validity_radius_m.is_finite() && self.validity_radius_m > 0.0;
        let force_ok = self.max_force_n.is_finite() && self.max_force_n > 0.0;
        if !(finite && radius_ok && force_ok && (self.normal.length() - 1.0).abs() <= 1e-3) {
            return None;
        }
        let stiffness_n_per_m = (self.stiffness_n_per_m + self.stiffness_n_per_m.transpose()) * 0.5;
        let accepted = Self { normal: self.normal.normalize(), stiffness_n_per_m, ..self };
        accepted.stiffness_n_per_m.is_finite().then_some(accepted)
    }

    /// The force on an arm at `position_m` moving with `velocity_m_per_s`, from a model `age_s` old.
    ///
    /// Inside the radius `F = f₀ + K d`, `d = p − p₀`. Outside, d is cut to the radius, and the whole fades to zero at twice
    /// the radius: continuous, bounded, and never an extrapolation far from where the model was made.
    pub fn render(
        &self,
        position_m: DVec3,
        velocity_m_per_s: DVec3,
        age_s: f64,
        settings: &RenderSettings,
    ) -> Rendered {
        let d = position_m - self.point_m;
        let distance_m = d.length();
        if !(distance_m.is_finite() && velocity_m_per_s.is_finite()) {
            return Rendered::default();
        }
        let outside = distance_m > self.validity_radius_m;
        let inside_d = if outside { d * (self.validity_radius_m / distance_m) } else { d };
        let weight = distance_weight(distance_m / self.validity_radius_m) * age_weight(age_s, settings);
        let spring_n = self.force_n + self.bounded_stiffness(settings.max_stiffness_n_per_m) * inside_d;
        if spring_n.dot(self.normal) <= 0.0 {
            // Off the surface: nothing pulls, nothing damps; what is left acts along the surface.
            return Rendered { force_n: weight * self.bounded(spring_n), weight, outside };
        }
        let damping_n = -settings.damping_n_s_per_m * velocity_m_per_s.dot(self.normal) * self.normal;
        Rendered { force_n: weight * self.bounded(spring_n + damping_n), weight, outside }
    }

    fn bounded(&self, force_n: DVec3) -> DVec3 {
        clamp_length(without_pull(force_n, self.normal), self.max_force_n).0
    }

    /// K scaled so that no direction is stiffer than `max_n_per_m`.
    pub(crate) fn bounded_stiffness(&self, max_n_per_m: f64) -> DMat3 {
        bounded(&self.stiffness_n_per_m, max_n_per_m)
    }
}

/// K scaled so that no direction is stiffer than `max`: the largest column sum of |K| bounds its eigenvalues.
pub(crate) fn bounded(k: &DMat3, max: f64) -> DMat3 {
    let bound = [k.x_axis, k.y_axis, k.z_axis].iter().map(|c| c.abs().element_sum()).fold(0.0, f64::max);
    if bound > max { *k * (max / bound) } else { *k }
}

/// F without its part against the normal: a negative F·n is replaced by zero.
fn without_pull(force_n: DVec3, normal: DVec3) -> DVec3 {
    force_n - force_n.dot(normal).min(0.0) * normal
}

/// 1 up to the radius, then the cubic 1 − 3s² + 2s³ down to 0 at [`FADE_END`] radii.
pub(crate) fn distance_weight(radii: f64) -> f64 {
    let s = ((radii - 1.0) / (FADE_END - 1.0)).clamp(0.0, 1.0);
    1.0 - s * s * (3.0 - 2.0 * s)
}

/// 1 up to `hold_s`, then linear to 0 at `forget_s`. NaN counts as old.
pub(crate) fn age_weight(age_s: f64, settings: &RenderSettings) -> f64 {
    if age_s <= settings.hold_s {
        1.0
    } else if age_s < settings.forget_s {
        (settings.forget_s - age_s) / (settings.forget_s - settings.hold_s)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SETTINGS: RenderSettings =
        RenderSettings { hold_s: 5e-3, forget_s: 20e-3, damping_n_s_per_m: 0.5, max_stiffness_n_per_m: 2000.0 };

    /// A wall through the origin, 500 N/m, arm 1 mm inside.
    fn wall() -> LocalModel {
        LocalModel {
            point_m: DVec3::new(0.0, 0.0, -1e-3),
            normal: DVec3::Z,
            force_n: DVec3::new(0.0, 0.0, 0.5),
            stiffness_n_per_m: DMat3::from_diagonal(DVec3::new(-50.0, -50.0, -500.0)),
            validity_radius_m: 5e-3,
            max_force_n: 10.0,
        }
    }

    #[test]
    fn linear_inside_the_radius() {
        let out = wall().render(DVec3::new(1e-3, 0.0, -3e-3), DVec3::ZERO, 0.0, &SETTINGS);
        assert!((out.force_n - DVec3::new(-0.05, 0.0, 1.5)).length() < 1e-12);
        assert_eq!((out.weight, out.outside), (1.0, false));
    }

    #[test]
    fn never_pulls_but_keeps_the_tangential_part() {
        let out = wall().render(DVec3::new(1e-3, 0.0, 1e-3), DVec3::new(0.0, 0.0, -9.0), 0.0, &SETTINGS);
        assert!((out.force_n - DVec3::new(-0.05, 0.0, 0.0)).length() < 1e-12);
        // Leaving fast: the damper may not pull either.
        let out = wall().render(wall().point_m, DVec3::new(0.0, 0.0, 9.0), 0.0, &SETTINGS);
        assert_eq!(out.force_n.z, 0.0);
    }

    #[test]
    fn fades_outside_and_with_age() {
        let model = wall();
        let at = |radii: f64| model.point_m - DVec3::Z * radii * model.validity_radius_m;
        let edge_n = 0.5 + 500.0 * 5e-3;
        assert!((model.render(at(1.0), DVec3::ZERO, 0.0, &SETTINGS).force_n.z - edge_n).abs() < 1e-12);
        assert!((model.render(at(1.5), DVec3::ZERO, 0.0, &SETTINGS).force_n.z - edge_n / 2.0).abs() < 1e-12);
        assert_eq!(model.render(at(2.0), DVec3::ZERO, 0.0, &SETTINGS).force_n, DVec3::ZERO);
        assert_eq!(model.render(at(1e9), DVec3::ZERO, 0.0, &SETTINGS).force_n, DVec3::ZERO);
        let aged = |age_s: f64| model.render(at(0.0), DVec3::ZERO, age_s, &SETTINGS).force_n.z;
        assert_eq!(aged(5e-3), 0.5);
        assert!((aged(12.5e-3) - 0.25).abs() < 1e-12);
        assert_eq!((aged(20e-3), aged(f64::NAN)), (0.0, 0.0));
    }

    #[test]
    fn stiffness_is_bounded() {
        let stiff = LocalModel { stiffness_n_per_m: DMat3::from_diagonal(DVec3::splat(-1e5)), ..wall() };
        let out = stiff.render(DVec3::new(0.0, 0.0, -2e-3), DVec3::ZERO, 0.0, &SETTINGS);
        assert!((out.force_n.z - (0.5 + 2.0)).abs() < 1e-12);
    }

    #[test]
    fn received_models_are_checked() {
        assert_eq!(wall().accept(), Some(wall()));
        let nan = DVec3::new(0.0, f64::NAN, 0.0);
        for bad in [
            LocalModel { point_m: nan, ..wall() },
            LocalModel { force_n: nan, ..wall() },
            LocalModel { normal: DVec3::Z * 2.0, ..wall() },
            LocalModel { normal: DVec3::ZERO, ..wall() },
            LocalModel { validity_radius_m: 0.0, ..wall() },
            LocalModel { validity_radius_m: f64::INFINITY, ..wall() },
            LocalModel { max_force_n: 0.0, ..wall() },
            LocalModel { max_force_n: f64::NAN, ..wall() },
            LocalModel { stiffness_n_per_m: DMat3::from_diagonal(DVec3::splat(f64::MAX)) * 10.0, ..wall() },
        ] {
            assert_eq!(bad.accept(), None, "{bad:?}");
        }
        let skew = DMat3::from_cols(DVec3::new(-1.0, 2.0, 0.0), DVec3::new(0.0, -1.0, 0.0), DVec3::new(0.0, 0.0, -1.0));
        let accepted = LocalModel { stiffness_n_per_m: skew, ..wall() }.accept().unwrap();
        assert_eq!(accepted.stiffness_n_per_m.y_axis.x, accepted.stiffness_n_per_m.x_axis.y);
    }

    #[test]
    fn no_place_gives_more_than_the_largest_force() {
        let wall = LocalModel { max_force_n: 1.2, ..wall() };
        let deep = wall.render(DVec3::new(0.0, 0.0, -5e-3), DVec3::ZERO, 0.0, &SETTINGS).force_n;
        assert!((deep - DVec3::Z * 1.2).length() < 1e-12, "{deep}");
        let fast = wall.render(wall.point_m, DVec3::new(0.0, 0.0, -1e3), 0.0, &SETTINGS).force_n;
        assert!((fast - DVec3::Z * 1.2).length() < 1e-12, "{fast}");
        let half_faded = wall.render(DVec3::new(0.0, 0.0, -8.5e-3), DVec3::ZERO, 0.0, &SETTINGS).force_n;
        assert!((half_faded - DVec3::Z * 0.6).length() < 1e-12, "{half_faded}");
    }

    #[test]
    fn a_bad_arm_position_gives_no_force() {
        let nan = DVec3::splat(f64::NAN);
        assert_eq!(wall().render(nan, DVec3::ZERO, 0.0, &SETTINGS).force_n, DVec3::ZERO);
        assert_eq!(wall().render(DVec3::ZERO, nan, 0.0, &SETTINGS).force_n, DVec3::ZERO);
    }

    proptest! {
        #[test]
        fn never_pulls_and_is_continuous(
            p in (-0.02..0.02_f64, -0.02..0.02_f64, -0.02..0.02_f64),
            v in (-0.5..0.5_f64, -0.5..0.5_f64, -0.5..0.5_f64),
            age_s in 0.0..0.03_f64,
        ) {
            let (p, v) = (DVec3::from(p), DVec3::from(v));
            let out = wall().render(p, v, age_s, &SETTINGS);
            prop_assert!(out.force_n.dot(DVec3::Z) >= 0.0);
            // 500 N/m of the model, and the fade's slope (3/2 per radius, on at most 3 N): below 1500 N/m.
            let near = wall().render(p + DVec3::splat(1e-7), DVec3::ZERO, age_s, &SETTINGS);
            let here = wall().render(p, DVec3::ZERO, age_s, &SETTINGS);
            prop_assert!((near.force_n - here.force_n).length() < 1500.0 * 1e-7 * 3.0_f64.sqrt());
        }
    }
}
