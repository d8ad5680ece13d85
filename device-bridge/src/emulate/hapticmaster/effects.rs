//! The effects on an emulated HapticMASTER: bias forces and flat planes, by their names.
use crate::device::hapticmaster::{
    grammar,
    plane::{DampFactor, LARGEST, POSITION},
};
use glam::DVec3;
use palpate_control::Motion;
use std::collections::BTreeMap;

/// A plane that pushes out what is beneath it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FlatPlane {
    point_m: DVec3,
    normal: DVec3,
    stiffness_n_per_m: f64,
    dampfactor: f64,
    no_pull: bool,
    friction: f64,
    tang_damping_n_s_per_m: f64,
    largest_n: f64,
}

impl FlatPlane {
    const NEW: Self = Self {
        point_m: DVec3::ZERO,
        normal: DVec3::Z,
        stiffness_n_per_m: 0.0,
        dampfactor: 0.0,
        no_pull: false,
        friction: 0.0,
        tang_damping_n_s_per_m: 0.0,
        largest_n: 0.0,
    };

    /// `F = F_n n − (B_t + μ F_n/|v_t|) v_t`, `F_n = min(k d − B v·n, F_max)` beneath the surface, and not below 0 without pull.
    fn force_n(&self, motion: &Motion, factor: DampFactor) -> DVec3 {
        let (n, v) = (self.normal, motion.velocity_m_per_s);
        let depth_m = (self.point_m - motion.position_m).dot(n);
        if depth_m <= 0.0 {
            return DVec3::ZERO;
        }
        let damping = factor.damping_n_s_per_m(self.dampfactor, self.stiffness_n_per_m);
        let outward_n = (self.stiffness_n_per_m * depth_m - damping * v.dot(n)).min(self.largest_n);
        let normal_n = if self.no_pull { outward_n.max(0.0) } else { outward_n };
        let tangential = v - v.dot(n) * n;
        let friction_n = self.friction * normal_n.max(0.0) * tangential.normalize_or_zero();
        normal_n * n - self.tang_damping_n_s_per_m * tangential - friction_n
    }

    /// Sets one of its parameters; `None` for one that it does not have, or a value that is none.
    fn set(&mut self, what: &str, value: &str) -> Option<&'static str> {
        let number = || value.parse::<f64>().ok().filter(|number| number.is_finite() && *number >= 0.0);
        match what {
            POSITION => self.point_m = grammar::vector(value)?,
            "normal" => self.normal = grammar::vector(value)?.try_normalize()?,
            "stiffness" => self.stiffness_n_per_m = number()?,
            "dampfactor" => self.dampfactor = number()?,
            "no_pull" => self.no_pull = grammar::truth(value)?,
            "friction" => self.friction = number()?,
            "tang_damping" => self.tang_damping_n_s_per_m = number()?,
            LARGEST => self.largest_n = number()?,
            _ => return None,
        }
        Some(match what {
            "normal" => "Flat plane's normal set",
            "stiffness" => "Shape's stiffness set",
            "dampfactor" => "Shape's damp factor set",
            "no_pull" => "Shape's no pull set",
            "friction" => "Shape's friction mu set",
            "tang_damping" => "Shape's tangential damping set",
            LARGEST => "Shape's outward force max set",
            _ => "Shape's position set",
        })
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// A force (N).
    Bias(DVec3),
    Plane(FlatPlane),
}

/// All of them, each with whether it is enabled.
#[derive(Debug)]
pub(super) struct Effects {
    factor: DampFactor,
    named: BTreeMap<String, (Kind, bool)>,
}

impl Effects {
    pub(super) fn new(factor: DampFactor) -> Self {
        Self { factor, named: BTreeMap::new() }
    }

    /// A `dampfactor` means this from now on.
    pub(super) fn mean(&mut self, factor: DampFactor) {
        self.factor = factor;
    }

    pub(super) fn clear(&mut self) {
        self.named.clear();
    }

    /// Force (N) of those that are enabled on an arm that moves so.
    pub(super) fn force_n(&self, motion: &Motion) -> DVec3 {
        self.named.keys().map(|name| self.force_of_n(name, motion)).sum()
    }

    /// Of one, if it is there and enabled.
    pub(super) fn force_of_n(&self, name: &str, motion: &Motion) -> DVec3 {
        match self.named.get(name) {
            Some((Kind::Bias(force_n), true)) => *force_n,
            Some((Kind::Plane(plane), true)) => plane.force_n(motion, self.factor),
            _ => DVec3::ZERO,
        }
    }

    /// Whether one is there and enabled.
    pub(super) fn is_enabled(&self, name: &str) -> bool {
        self.named.get(name).is_some_and(|(_, enabled)| *enabled)
    }

    /// The answer to `create`; `None` for a kind that is none.
    pub(super) fn create(&mut self, kind: &str, name: &str) -> Option<String> {
        let effect = match kind {
            "biasforce" => Kind::Bias(DVec3::ZERO),
            "flatplane" => Kind::Plane(FlatPlane::NEW),
            _ => return None,
        };
        self.named.insert(name.to_owned(), (effect, false));
        Some(format!("Effect {kind} with name {name} created"))
    }

    /// The answer to `set NAME …`; `None` for what it does not know.
    pub(super) fn set(&mut self, name: &str, what: &[&str]) -> Option<String> {
        let (kind, enabled) = self.named.get_mut(name)?;
        match (kind, what) {
            (_, ["enable"]) => *enabled = true,
            (_, ["disable"]) => *enabled = false,
            (Kind::Bias(force_n), ["force", value]) => {
                *force_n = grammar::vector(value)?;
                return Some("Biasforce's force set".into());
            }
            (Kind::Plane(plane), [what, value]) => return plane.set(what, value).map(str::to_owned),
            _ => return None,
        }
        Some(format!("Effect {}d", what[0]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(factor: DampFactor, parameters: &[(&str, &str)]) -> Effects {
        let mut effects = Effects::new(factor);
        effects.create("flatplane", "wall").unwrap();
        let common = [("pos", "[0,0,0.1]"), ("normal", "[0,0,2]"), ("stiffness", "200"), (LARGEST, "5")];
        for (what, value) in common.iter().chain(parameters) {
            assert!(effects.set("wall", &[what, value]).is_some(), "{what} {value}");
        }
        assert_eq!(effects.set("wall", &["enable"]).unwrap(), "Effect enabled");
        effects
    }

    /// Beneath the surface at z = 0.1 m by so much, moving so.
    fn at(depth_m: f64, velocity_m_per_s: DVec3) -> Motion {
        Motion { velocity_m_per_s, ..Motion::at(DVec3::new(0.3, 0.4, 0.1 - depth_m)) }
    }

    #[test]
    fn a_plane_pushes_out_what_is_beneath_it_and_no_harder_than_it_may() {
        let effects = plane(DampFactor::Coefficient, &[("dampfactor", "10"), ("no_pull", "true")]);
        let n = |depth_m, v: DVec3| effects.force_n(&at(depth_m, v));
        assert!((n(0.01, DVec3::ZERO) - 2.0 * DVec3::Z).length() < 1e-12);
        assert!((n(0.01, DVec3::new(0.5, 0.0, -0.1)) - 3.0 * DVec3::Z).length() < 1e-12);
        assert_eq!(n(0.01, DVec3::Z * 0.3), DVec3::ZERO, "no pull");
        assert_eq!(n(-1e-6, DVec3::ZERO), DVec3::ZERO);
        assert!((n(1.0, DVec3::ZERO) - 5.0 * DVec3::Z).length() < 1e-12);
        let pulls = plane(DampFactor::Coefficient, &[("dampfactor", "10")]);
        assert!((pulls.force_n(&at(0.01, DVec3::Z * 0.3)) + DVec3::Z).length() < 1e-12);
    }

    #[test]
    fn damping_is_either_and_friction_is_against_the_way() {
        // B = 2 · 0.5 · √(200 · 2) = 20.
        let ratio = plane(DampFactor::Ratio { inertia_kg: 2.0 }, &[("dampfactor", "0.5")]);
        assert!((ratio.force_n(&at(0.005, DVec3::Z * -0.1)) - 3.0 * DVec3::Z).length() < 1e-12);
        let rough = plane(DampFactor::Coefficient, &[("friction", "0.5"), ("tang_damping", "3")]);
        let expected_n = DVec3::new(-1.0 - 3.0 * 0.2, 0.0, 2.0);
        assert!((rough.force_n(&at(0.01, DVec3::X * 0.2)) - expected_n).length() < 1e-12);
    }

    #[test]
    fn what_it_does_not_know_it_refuses() {
        let mut effects = plane(DampFactor::Coefficient, &[]);
        assert!(effects.create("sphere", "ball").is_none());
        for bad in [
            &["stiffness", "-1"][..],
            &["stiffness", "nan"],
            &["normal", "[0,0,0]"],
            &["pos", "[1,2]"],
            &["no_pull", "1"],
            &["size", "1"],
            &["force", "[0,0,1]"],
            &["stiffness"],
            &[],
        ] {
            assert!(effects.set("wall", bad).is_none(), "{bad:?}");
        }
        assert!(effects.set("nobody", &["enable"]).is_none());
        effects.set("wall", &["disable"]).unwrap();
        assert_eq!((effects.is_enabled("wall"), effects.force_n(&at(0.01, DVec3::ZERO))), (false, DVec3::ZERO));
    }
}
