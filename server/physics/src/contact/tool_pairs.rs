//! Tools that hold each other off.
//!
//! Two coupled tools that squeeze a wall from both sides can meet through it: the wall gives way, and neither foundation
//! knows the other tool. So tools have a contact of their own. With the distance `d` of their axes and
//! `g = R₁ + R₂ − d`,
//! ```text
//! Φ = ½ k g²        f = ± k g along the shortest way between the axes
//! ```
//! `k = 8 F_max/R` of the softer coupling: two saturated couplings overlap their tools by an eighth of R. It is a third
//! or less of the bound of what the body's surface does to a tool (`F_max ≈ 0.09 π k_f R³`, against `4 π R² k_f`), for
//! which the substeps are made. Two rigid tools go where their devices go.
//!
//! Near another tool a coupled one is as near a surface ([`super::proxy`]): its coupling is limited, and so is the speed of its
//! approach. Quick tools would leap over each other's potential.
use super::{Axis, ContactModel, ToolState, narrow::Pressed, proxy::NEAR};
use glam::DVec3;

/// `k R/F_max`.
const STIFFNESS: f64 = 8.0;
/// Distance (m) to another tool's surface that is told where the axis is on it or behind it: one that has a direction.
const ON_IT_M: f64 = 1e-9;

/// What other tools do to a tool that is near them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Push {
    /// Force (N).
    pub(super) force_n: DVec3,
    /// Torque about its centre (N m); zero for a tool that does not turn.
    pub(super) torque_nm: DVec3,
    /// Its half of the energy (J) of each pair.
    pub(super) energy_j: f64,
    /// The way (m) to the nearest tool's surface, from the point of the axis that is nearest to it.
    to_other_m: DVec3,
    /// That point (m), seen from the centre.
    arm_m: DVec3,
    /// Velocity (m/s) of the nearest tool there.
    pub(super) other_m_per_s: DVec3,
}

impl Push {
    fn and(self, other: Self) -> Self {
        let nearest = if other.to_other_m.length() < self.to_other_m.length() { other } else { self };
        Self {
            force_n: self.force_n + other.force_n,
            torque_nm: self.torque_nm + other.torque_nm,
            energy_j: self.energy_j + other.energy_j,
            ..nearest
        }
    }

    /// Adds it to what presses the tool. A tool that is nearer than the body's surface stands for it.
    pub(super) fn add_to(&self, pressed: &mut Pressed) {
        pressed.force_n += self.force_n;
        pressed.torque_nm += self.torque_nm;
        pressed.energy_j += self.energy_j;
        if self.to_other_m.length() < pressed.to_surface_m.length() {
            (pressed.to_surface_m, pressed.arm_m) = (self.to_other_m, self.arm_m);
            pressed.nearest.1 = [0.0; 3];
        }
    }
}

impl ContactModel {
    /// Returns what other tools do to a tool, `None` where it is near none.
    pub(super) fn push_of_others(&self, index: usize, tools: &[ToolState]) -> Option<Push> {
        let others = (0..tools.len()).filter(|&other| other != index);
        others.filter_map(|other| self.push_of(index, other, tools)).reduce(Push::and)
    }

    /// Returns what one other tool does to a tool. The force is worked out alike from both sides, so that the sum is zero.
    fn push_of(&self, index: usize, other: usize, tools: &[ToolState]) -> Option<Push> {
        let pair = [index.min(other), index.max(other)];
        let stiffness = |tool: usize| {
            let model = &self.tools[tool];
            model.spring().map(|spring| STIFFNESS * spring.limit_n / model.spec.radius_m)
        };
        let stiffness_n_per_m = pair.into_iter().filter_map(stiffness).reduce(f64::min)?;
        let [a, b] = pair.map(|tool| self.tools[tool].axis(&tools[tool]));
        let [own_radius_m, other_radius_m] = [index, other].map(|tool| self.tools[tool].spec.radius_m);
        let reach_m = own_radius_m + other_radius_m;
        let near_m = reach_m + NEAR * own_radius_m;
        if a.centre_m.distance(b.centre_m) - a.half_length_m() - b.half_length_m() >= near_m {
            return None;
        }
        let arms_m = Axis::nearest_of(&a, &b);
        let way = a.centre_m + arms_m[0] - b.centre_m - arms_m[1];
        let distance_m = way.length();
        if distance_m >= near_m || distance_m == 0.0 {
            return None;
        }
        let (from_second, depth_m) = (way / distance_m, (reach_m - distance_m).max(0.0));
        let (away, [arm_m, other_arm_m]) =
            if index < other { (from_second, arms_m) } else { (-from_second, [arms_m[1], arms_m[0]]) };
        // f = k g, and each has half of ½ k g²
        let force_n = away * (stiffness_n_per_m * depth_m);
        let turns = self.tools[index].spec.shape.as_capsule().is_some();
        Some(Push {
            force_n,
            torque_nm: if turns { arm_m.cross(force_n) } else { DVec3::ZERO },
            energy_j: 0.25 * stiffness_n_per_m * depth_m * depth_m,
            to_other_m: away * -(distance_m - other_radius_m).max(ON_IT_M),
            arm_m,
            other_m_per_s: tools[other].velocity_m_per_s + tools[other].angular_velocity_rad_per_s.cross(other_arm_m),
        })
    }
}
