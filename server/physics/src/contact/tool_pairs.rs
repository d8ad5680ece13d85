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
use super::{Axis, ContactModel, ToolState};
use glam::DVec3;

/// `k R/F_max`.
const STIFFNESS: f64 = 8.0;

/// What other tools do to a tool.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Push {
    /// Force (N).
    pub(super) force_n: DVec3,
    /// Torque about its centre (N m); zero for a tool that does not turn.
    pub(super) torque_nm: DVec3,
    /// Its half of the energy (J) of each pair.
    pub(super) energy_j: f64,
}

impl ContactModel {
    /// Returns what other tools do to a tool, `None` where it meets none.
    pub(super) fn push_of_others(&self, index: usize, tools: &[ToolState]) -> Option<Push> {
        let others = (0..tools.len()).filter(|&other| other != index);
        others.filter_map(|other| self.push_of(index, other, tools)).reduce(|sum, push| Push {
            force_n: sum.force_n + push.force_n,
            torque_nm: sum.torque_nm + push.torque_nm,
            energy_j: sum.energy_j + push.energy_j,
        })
    }

    /// Returns what one other tool does to a tool. It is worked out alike from both sides, so that the sum is zero.
    fn push_of(&self, index: usize, other: usize, tools: &[ToolState]) -> Option<Push> {
        let pair = [index.min(other), index.max(other)];
        let [one, two] = pair.map(|tool| &self.tools[tool]);
        let stiffness_n_per_m = pair
            .map(|tool| {
                self.tools[tool].spring().map(|spring| STIFFNESS * spring.limit_n / self.tools[tool].spec.radius_m)
            })
            .into_iter()
            .flatten()
            .reduce(f64::min)?;
        let [a, b] = pair.map(|tool| self.tools[tool].axis(&tools[tool]));
        let reach_m = one.spec.radius_m + two.spec.radius_m;
        if a.centre_m.distance(b.centre_m) - a.half_length_m() - b.half_length_m() >= reach_m {
            return None;
        }
        let [arm, other_arm] = Axis::nearest_of(&a, &b);
        let way = a.centre_m + arm - b.centre_m - other_arm;
        let distance_m = way.length();
        let depth_m = reach_m - distance_m;
        if depth_m <= 0.0 || distance_m == 0.0 {
            return None;
        }
        let on_first_n = way * (stiffness_n_per_m * depth_m / distance_m);
        let (force_n, arm) = if index < other { (on_first_n, arm) } else { (-on_first_n, other_arm) };
        let turns = self.tools[index].spec.shape.as_capsule().is_some();
        Some(Push {
            force_n,
            torque_nm: if turns { arm.cross(force_n) } else { DVec3::ZERO },
            energy_j: 0.25 * stiffness_n_per_m * depth_m * depth_m,
        })
    }
}
