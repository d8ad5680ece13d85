//! The part of a local model that an arm can render by itself: a plane that pushes along its normal, as stiff as the model is in that direction.
use crate::local_model::{LocalModel, RenderSettings, age_weight};
use glam::DVec3;

/// Softer than this (N/m) a plane is none.
const LEAST_STIFFNESS_N_PER_M: f64 = 1.0;

/// A plane that pushes out whatever is beneath it: `F = min(max(k d − B v·n, 0), F_max) n` at a depth `d = (p_s − p)·n > 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPlane {
    /// A point of it, `p_s` (m).
    pub point_m: DVec3,
    /// Its outward unit normal `n`.
    pub normal: DVec3,
    /// Its stiffness `k` along the normal (N/m).
    pub stiffness_n_per_m: f64,
    /// Its damping `B` along the normal (N s/m).
    pub damping_n_s_per_m: f64,
    /// The largest force (N) on the arm now, of plane and all else together.
    pub max_force_n: f64,
}

impl ContactPlane {
    /// The plane of a model beneath an arm at `position_m`: its normal force there, and its stiffness along the normal.
    ///
    /// `k = −n·K n`, and `p_s = p + n (n·F(p))/k` with the model's spring force `F(p) = f₀ + K (p − p₀)`: wherever along the normal the arm goes from there, plane and model give the same.
    /// Where the model couples directions, the plane moves as the arm moves along the surface. `None` where the model is no plane: outside its radius, forgotten, without stiffness along its
    /// normal, or anything not finite.
    pub fn of(model: &LocalModel, position_m: DVec3, age_s: f64, settings: &RenderSettings) -> Option<Self> {
        let d = position_m - model.point_m;
        let inside = d.is_finite() && d.length() <= model.validity_radius_m;
        let weight = age_weight(age_s, settings);
        let k = model.bounded_stiffness(settings.max_stiffness_n_per_m);
        let stiffness_n_per_m = -model.normal.dot(k * model.normal);
        let normal_n = model.normal.dot(model.force_n + k * d);
        let plane = Self {
            point_m: position_m + model.normal * (normal_n / stiffness_n_per_m),
            normal: model.normal,
            stiffness_n_per_m,
            damping_n_s_per_m: settings.damping_n_s_per_m,
            max_force_n: model.max_force_n,
        };
        (inside && plane.is_one()).then(|| plane.weighted(weight)).filter(Self::is_one)
    }

    /// Its force (N) along the normal on an arm that is there (m) and moves so (m/s).
    pub fn normal_force_n(&self, position_m: DVec3, velocity_m_per_s: DVec3) -> f64 {
        let depth_m = (self.point_m - position_m).dot(self.normal);
        let force_n = self.stiffness_n_per_m * depth_m - self.damping_n_s_per_m * velocity_m_per_s.dot(self.normal);
        // NaN is no force: it is not larger than 0.
        if depth_m > 0.0 && force_n > 0.0 { force_n.min(self.max_force_n) } else { 0.0 }
    }

    /// Energy (J) of its spring on an arm at `position_m`: `½ k d²`, and from where it gives its largest force on, that times the way.
    pub fn stored_j(&self, position_m: DVec3) -> f64 {
        let depth_m = (self.point_m - position_m).dot(self.normal).max(0.0);
        let yields_at_m = depth_m.min(self.max_force_n / self.stiffness_n_per_m);
        0.5 * self.stiffness_n_per_m * yields_at_m * yields_at_m + self.max_force_n * (depth_m - yields_at_m)
    }

    /// How much less work (J) its spring did on an arm that went from one place (m) to another than the force that it had at the first, held: `F(p)·(p' − p) − (U(p) − U(p'))`.
    pub fn spared_j(&self, from_m: DVec3, to_m: DVec3) -> f64 {
        let held_n = self.normal_force_n(from_m, DVec3::ZERO);
        held_n * (to_m - from_m).dot(self.normal) - (self.stored_j(from_m) - self.stored_j(to_m))
    }

    /// What a law has left of it: `ramp` of it, and at this place and velocity no more than the force (N) that the law gives along the normal there. `largest_n` (N) bounds the whole.
    ///
    /// What rate, warmth and energy take from the force they take from the plane, which so never pushes where something else would have to pull it back.
    pub fn limited(&self, force_n: DVec3, at: (DVec3, DVec3), ramp: f64, largest_n: f64) -> Option<Self> {
        let ramped = self.weighted(ramp);
        let ramped = Self { max_force_n: ramped.max_force_n.min(largest_n * ramp), ..ramped };
        let given_n = force_n.dot(self.normal).max(0.0);
        let share = if ramped.normal_force_n(at.0, at.1) > given_n {
            // Beyond its largest force the spring is softened to be at it.
            given_n / Self { max_force_n: f64::INFINITY, ..ramped }.normal_force_n(at.0, at.1)
        } else {
            1.0
        };
        let softened = Self {
            stiffness_n_per_m: ramped.stiffness_n_per_m * share,
            damping_n_s_per_m: ramped.damping_n_s_per_m * share,
            ..ramped
        };
        let finite = force_n.is_finite() && at.0.is_finite() && at.1.is_finite();
        (finite && softened.is_one()).then_some(softened)
    }

    /// A share of its force.
    fn weighted(self, weight: f64) -> Self {
        Self {
            stiffness_n_per_m: self.stiffness_n_per_m * weight,
            damping_n_s_per_m: self.damping_n_s_per_m * weight,
            max_force_n: self.max_force_n * weight,
            ..self
        }
    }

    /// Finite, with a stiffness and a force.
    pub fn is_one(&self) -> bool {
        self.point_m.is_finite()
            && self.normal.is_finite()
            && self.stiffness_n_per_m.is_finite()
            && self.stiffness_n_per_m >= LEAST_STIFFNESS_N_PER_M
            && self.damping_n_s_per_m.is_finite()
            && self.damping_n_s_per_m >= 0.0
            && self.max_force_n.is_finite()
            && self.max_force_n > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use proptest::prelude::*;

    #[test]
    fn a_place_or_a_velocity_that_is_no_number_leaves_no_plane() {
        let plane = ContactPlane {
            point_m: DVec3::ZERO,
            normal: DVec3::Z,
            stiffness_n_per_m: 400.0,
            damping_n_s_per_m: 1.0,
            max_force_n: 3.0,
        };
        let at = |position_m, velocity_m_per_s| plane.limited(DVec3::Z, (position_m, velocity_m_per_s), 1.0, 3.0);
        assert!(at(-1e-3 * DVec3::Z, DVec3::ZERO).is_some());
        assert_eq!(at(DVec3::NAN, DVec3::ZERO), None);
        assert_eq!(at(-1e-3 * DVec3::Z, DVec3::NAN), None);
    }

    const SETTINGS: RenderSettings =
        RenderSettings { hold_s: 5e-3, forget_s: 20e-3, damping_n_s_per_m: 2.0, max_stiffness_n_per_m: 2000.0 };

    /// 500 N/m, stiff along the surface and between the two as well.
    fn model() -> LocalModel {
        let stiffness_n_per_m = DMat3::from_cols(
            DVec3::new(-100.0, 0.0, 60.0),
            DVec3::new(0.0, -150.0, -40.0),
            DVec3::new(60.0, -40.0, -500.0),
        );
        LocalModel {
            point_m: DVec3::new(0.01, 0.0, -1e-3),
            normal: DVec3::Z,
            force_n: DVec3::new(0.1, 0.0, 0.5),
            stiffness_n_per_m,
            validity_radius_m: 5e-3,
            max_force_n: 10.0,
        }
    }

    proptest! {
        /// The plane's force is the model's along the normal, where it was made and wherever along the normal the arm goes from there.
        #[test]
        fn it_gives_the_models_normal_force(
            p in (-2e-3..2e-3_f64, -2e-3..2e-3_f64, -2e-3..2e-3_f64), along_m in -1e-3..1e-3_f64,
            v in (-0.2..0.2_f64, -0.2..0.2_f64, -0.2..0.2_f64), age_s in 0.0..0.019_f64, turn in -3.0..3.0_f64,
        ) {
            // Turned somewhere, nothing is along an axis.
            let r = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), turn);
            let flat = model();
            let model = LocalModel {
                point_m: r * flat.point_m,
                normal: r * flat.normal,
                force_n: r * flat.force_n,
                stiffness_n_per_m: r * flat.stiffness_n_per_m * r.transpose(),
                ..flat
            };
            // Its largest column sum is below the bound: nothing is softened.
            let p = model.point_m + DVec3::from(p);
            let plane = ContactPlane::of(&model, p, age_s, &SETTINGS).unwrap();
            for p in [p, p + along_m * model.normal] {
                let rendered_n = model.render(p, DVec3::from(v), age_s, &SETTINGS).force_n.dot(model.normal);
                let given_n = plane.normal_force_n(p, DVec3::from(v));
                prop_assert!((rendered_n - given_n).abs() < 1e-9, "{} N, {} N", rendered_n, given_n);
            }
        }

        /// Whatever a law leaves, the plane pushes no harder where the arm is, is never stiffer, and never beyond the limit anywhere.
        #[test]
        fn it_is_never_more_than_the_law_leaves(
            given_n in -5.0..5.0_f64, depth_m in -2e-3..4e-3_f64, v in -0.3..0.3_f64, ramp in 0.0..1.0_f64, largest_n in 0.01..5.0_f64,
        ) {
            let at = (model().point_m - depth_m * DVec3::Z, v * DVec3::Z);
            let plane = ContactPlane::of(&model(), at.0, 0.0, &SETTINGS).unwrap();
            if let Some(left) = plane.limited(given_n * DVec3::Z, at, ramp, largest_n) {
                prop_assert!(left.normal_force_n(at.0, at.1) < given_n.max(0.0) + 1e-9);
                prop_assert!(left.stiffness_n_per_m <= plane.stiffness_n_per_m * ramp + 1e-9);
                prop_assert!(left.normal_force_n(at.0 - DVec3::Z, DVec3::ZERO) <= largest_n * ramp + 1e-12);
            }
        }
    }

    /// The work that is left is the spring's own, whatever the way and however it is sampled: nothing over a closed one.
    #[test]
    fn what_a_held_force_does_too_much_is_spared() {
        let plane = ContactPlane::of(&model(), model().point_m, 0.0, &SETTINGS).unwrap();
        let plane = ContactPlane { max_force_n: 1.0, ..plane };
        for depths_m in [vec![-3e-3, 2e-3, 5e-3, 0.0, -3e-3], vec![-1e-3, 1.9e-3, 1e-3, -1e-3]] {
            let mut work_j = 0.0;
            for pair in depths_m.windows(2) {
                let [from_m, to_m] = [pair[0], pair[1]].map(|d| plane.point_m - d * DVec3::Z + pair[0] * DVec3::X);
                let held_n = plane.normal_force_n(from_m, DVec3::ZERO) * DVec3::Z;
                let spared_j = plane.spared_j(from_m, to_m);
                assert!(spared_j > -1e-15, "{spared_j}");
                work_j += held_n.dot(to_m - from_m) - spared_j;
            }
            assert!(work_j.abs() < 1e-15, "{work_j} J");
        }
        // 500 N/m yield at 2 mm: 1 mJ, and 3 mm at 1 N.
        assert!((plane.stored_j(plane.point_m - 5e-3 * DVec3::Z) - 4e-3).abs() < 1e-15);
    }

    #[test]
    fn a_model_that_is_no_plane_is_none() {
        let of = |model: LocalModel, p: DVec3, age_s| ContactPlane::of(&model, p, age_s, &SETTINGS);
        let p = model().point_m;
        assert!(of(model(), p, 0.0).is_some());
        assert_eq!(of(model(), p + DVec3::Z * 5.1e-3, 0.0), None, "outside its radius");
        for age_s in [20e-3, f64::NAN] {
            assert_eq!(of(model(), p, age_s), None, "forgotten");
        }
        for p in [DVec3::NAN, DVec3::INFINITY] {
            assert_eq!(of(model(), p, 0.0), None);
        }
        for k in [DMat3::ZERO, DMat3::from_diagonal(DVec3::splat(100.0)), DMat3::from_diagonal(DVec3::splat(-1e-300))] {
            assert_eq!(of(LocalModel { stiffness_n_per_m: k, ..model() }, p, 0.0), None, "{k}");
        }
        let stiff = of(LocalModel { stiffness_n_per_m: DMat3::from_diagonal(DVec3::splat(-1e5)), ..model() }, p, 0.0);
        assert!((stiff.unwrap().stiffness_n_per_m - 2000.0).abs() < 1e-9);
    }

    #[test]
    fn no_ramp_no_force_and_no_number_leave_none() {
        let at = (model().point_m, DVec3::ZERO);
        let plane = ContactPlane::of(&model(), at.0, 0.0, &SETTINGS).unwrap();
        assert_eq!(plane.limited(0.5 * DVec3::Z, at, 1.0, 3.0).unwrap().max_force_n, 3.0);
        assert_eq!(plane.limited(0.25 * DVec3::Z, at, 0.5, 3.0).unwrap().stiffness_n_per_m, 250.0);
        assert_eq!(plane.limited(0.25 * DVec3::Z, at, 1.0, 3.0).unwrap().stiffness_n_per_m, 250.0);
        assert_eq!(plane.limited(0.5 * DVec3::Z, at, 0.0, 3.0), None);
        assert_eq!(plane.limited(DVec3::ZERO, at, 1.0, 3.0), None);
        assert_eq!(plane.limited(DVec3::NAN, at, 1.0, 3.0), None);
        assert_eq!(plane.limited(0.5 * DVec3::Z, at, f64::NAN, 3.0), None);
        assert_eq!(plane.normal_force_n(DVec3::NAN, DVec3::ZERO), 0.0);
    }
}
