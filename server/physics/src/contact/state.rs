//! The state of contact, which is carried from one tick to the next.
use super::{
    ContactModel, SelfContact,
    broad::{Candidates, ClusterBox, FittedBoxes, FittedBoxesMut},
    local_model::StiffnessEstimate,
    self_contact::NearWalls,
    touching::Touching,
};
use crate::hash::Chain;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Contact's part of [`crate::State`].
///
/// Samples in contact, friction springs, the force at the end of the tick and the estimate of stiffness are state in
/// the full sense: saved, restored, compared. The broad phase's boxes and lists follow from the positions; they are
/// neither saved nor compared, and are rebuilt whenever `force_is_current` is false.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ContactState {
    pub(super) tools: Vec<ToolContact>,
    #[serde(skip)]
    boxes: Vec<ClusterBox>,
    #[serde(skip)]
    travel_m: f64,
    /// Whether all motion of the surface since the last evaluation of forces was told to [`Self::travelled`].
    #[serde(skip)]
    is_tracked: bool,
    /// What of the body's own walls may meet.
    #[serde(skip)]
    pub(super) walls: NearWalls,
}

/// The contact of one tool.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct ToolContact {
    pub(super) touching: Touching,
    /// Whether it was just put where it is: samples inside it then carry nothing up to their present depth.
    pub(super) just_put: bool,
    /// Whether nothing is within the zone near the surface ([`super::proxy`]) now.
    pub(super) is_clear: bool,
    /// Force of the body on the tool now (N).
    pub(super) force_n: DVec3,
    /// Torque of the body on the tool now (N m).
    pub(super) torque_nm: DVec3,
    /// Largest depth (m) that any sample carries now.
    pub(super) deepest_m: f64,
    /// Square (m²) of the largest distance between neighbouring samples of a triangle that carries force now.
    pub(super) apart_sq_m2: f64,
    pub(super) estimate: StiffnessEstimate,
    #[serde(skip)]
    pub(super) candidates: Candidates,
}

impl ToolContact {
    fn keep_sums_of(&mut self, other: &Self) {
        (self.just_put, self.is_clear, self.estimate) = (other.just_put, other.is_clear, other.estimate);
        (self.force_n, self.torque_nm) = (other.force_n, other.torque_nm);
        (self.deepest_m, self.apart_sq_m2) = (other.deepest_m, other.apart_sq_m2);
    }
}

impl PartialEq for ContactState {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&ToolContact, &ToolContact)| {
            let forces = (a.force_n, a.torque_nm) == (b.force_n, b.torque_nm)
                && (a.deepest_m, a.apart_sq_m2) == (b.deepest_m, b.apart_sq_m2);
            let flags = (a.just_put, a.is_clear) == (b.just_put, b.is_clear);
            a.touching == b.touching && flags && forces && a.estimate == b.estimate
        };
        self.tools.len() == other.tools.len() && self.tools.iter().zip(&other.tools).all(same)
    }
}

impl ContactState {
    /// Whether a tool has any of the surface inside it, pressing or not; false for one that is not there.
    pub fn touches(&self, tool: usize) -> bool {
        self.tools.get(tool).is_some_and(|tool| !tool.touching.records().is_empty())
    }

    pub(super) fn new(model: &ContactModel) -> Self {
        let tool = |tool: &super::ToolModel| ToolContact {
            touching: Touching::with_capacity(tool.foundation.samples),
            just_put: false,
            is_clear: false,
            force_n: DVec3::ZERO,
            torque_nm: DVec3::ZERO,
            deepest_m: 0.0,
            apart_sq_m2: 0.0,
            estimate: StiffnessEstimate::default(),
            candidates: Candidates::with_capacity(model.triangles.len()),
        };
        Self {
            tools: model.tools.iter().map(tool).collect(),
            boxes: vec![ClusterBox::UNFITTED; model.triangles.clusters()],
            travel_m: 0.0,
            is_tracked: false,
            walls: model.walls().map(SelfContact::no_walls).unwrap_or_default(),
        }
    }

    /// Copies what was read from a snapshot into buffers of the model's size; returns `None` when it does not fit the
    /// model.
    pub(super) fn adopt(mut self, saved: &Self, samples: impl Fn(usize) -> usize) -> Option<Self> {
        if saved.tools.len() != self.tools.len() {
            return None;
        }
        for (index, (own, saved)) in self.tools.iter_mut().zip(&saved.tools).enumerate() {
            let touches = saved.touching.records();
            let ascending = touches.windows(2).all(|pair| pair[0].sample < pair[1].sample);
            let known = touches.last().is_none_or(|last| (last.sample as usize) < samples(index));
            let finite = saved.force_n.is_finite()
                && saved.torque_nm.is_finite()
                && saved.deepest_m.is_finite()
                && saved.apart_sq_m2.is_finite()
                && saved.estimate.is_finite()
                && touches.iter().all(|touch| {
                    touch.spring_origin_m.is_finite() && (0.0..f64::INFINITY).contains(&touch.free_depth_m)
                });
            if !(ascending && known && finite && touches.iter().all(|touch| own.touching.push(*touch))) {
                return None;
            }
            own.keep_sums_of(saved);
        }
        Some(self)
    }

    /// Adds all that is saved to a hash.
    pub(crate) fn chain(&self, chain: &mut Chain) {
        chain.list(&self.tools, |chain, tool| {
            chain.list(tool.touching.records(), |chain, touch| {
                chain.whole(u64::from(touch.sample));
                chain.whole(
                    u64::from(touch.from_behind) + 2 * u64::from(touch.came_round) + 4 * u64::from(touch.pushed_out),
                );
                chain.real(touch.free_depth_m);
                chain.vector(touch.spring_origin_m);
            });
            chain.flag(tool.just_put);
            chain.flag(tool.is_clear);
            chain.real(tool.deepest_m);
            chain.real(tool.apart_sq_m2);
            chain.vector(tool.force_n);
            chain.vector(tool.torque_nm);
            let estimate = &tool.estimate;
            chain.real(estimate.log_correction);
            chain.real(estimate.normal_n_per_m);
            chain.real(estimate.tangential_n_per_m);
            chain.matrix(&estimate.turning_nm_per_rad);
            chain.vector(estimate.start_centre_m);
            chain.real(estimate.start_force_n);
            chain.whole(u64::from(estimate.age_ticks));
        });
    }

    /// Copies another state of the same model. Allocates nothing.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.keep_memory_of(other);
        self.forget_geometry();
    }

    /// Copies what another state saves; the broad phase's boxes and lists are then out of date.
    pub(crate) fn keep_memory_of(&mut self, other: &Self) {
        for (own, other) in self.tools.iter_mut().zip(&other.tools) {
            own.touching.copy_from(&other.touching);
            own.keep_sums_of(other);
        }
    }

    /// Clears all contact: tools touch nothing. Allocates nothing.
    pub(crate) fn clear(&mut self) {
        for tool in &mut self.tools {
            tool.touching.clear();
            (tool.just_put, tool.is_clear) = (false, false);
            (tool.force_n, tool.torque_nm) = (DVec3::ZERO, DVec3::ZERO);
            (tool.deepest_m, tool.apart_sq_m2) = (0.0, 0.0);
            tool.estimate = StiffnessEstimate::default();
        }
        self.forget_geometry();
    }

    /// Resets the contact of a tool that was put somewhere: it has touched nothing yet. Allocates nothing.
    pub(crate) fn put_tool(&mut self, tool: usize) {
        let part = &mut self.tools[tool];
        part.touching.clear();
        (part.just_put, part.is_clear) = (true, false);
        (part.force_n, part.torque_nm) = (DVec3::ZERO, DVec3::ZERO);
        (part.deepest_m, part.apart_sq_m2) = (0.0, 0.0);
        part.estimate = StiffnessEstimate::default();
        part.candidates.slack_m = f64::NEG_INFINITY;
    }

    /// Makes the broad phase look at the positions anew.
    pub(crate) fn forget_geometry(&mut self) {
        self.boxes.fill(ClusterBox::UNFITTED);
        self.travel_m = 0.0;
        self.walls.forget();
        for tool in &mut self.tools {
            tool.candidates.slack_m = f64::NEG_INFINITY;
        }
    }

    /// Records that the surface moved by at most this distance (m).
    pub(crate) fn travelled(&mut self, distance_m: f64) {
        self.travel_m += distance_m;
        self.walls.slack_m -= distance_m;
        for tool in &mut self.tools {
            tool.candidates.slack_m -= distance_m;
        }
    }

    /// Records that the surface moved by at most this distance (m) as other nodes came to carry it. Where forces were
    /// current until then, its geometry is still known at the next evaluation.
    pub(crate) fn travelled_at_a_change(&mut self, distance_m: f64, forces_were_current: bool) {
        self.travelled(distance_m);
        self.is_tracked = forces_were_current;
    }

    /// Makes the broad phase look at the positions anew, before forces are evaluated that are not current, unless it
    /// knows how far the surface moved.
    pub(crate) fn forget_untracked_geometry(&mut self) {
        if !std::mem::take(&mut self.is_tracked) {
            self.forget_geometry();
        }
    }

    /// Returns what walls of the body that meet stored (J) at the last evaluation of forces, if it is known.
    pub(crate) fn stored_in_walls_j(&self) -> Option<f64> {
        self.walls.energy_j()
    }

    /// Returns the triangles that any tool may touch.
    pub(super) fn listed(&self) -> impl Iterator<Item = u32> + '_ {
        self.tools.iter().flat_map(|tool| tool.candidates.triangles().iter().copied())
    }

    /// Returns the triangles that a tool may touch before it and the surface have moved by this distance (m), and
    /// perhaps others; `None` where they are not known.
    pub(crate) fn listed_within(&self, tool: usize, distance_m: f64) -> Option<&[u32]> {
        let candidates = &self.tools.get(tool)?.candidates;
        (distance_m <= candidates.slack_m).then(|| candidates.triangles())
    }

    /// Returns the boxes as they were fitted, and the travel; they may be used while all motion of the surface was told
    /// to [`Self::travelled`].
    pub(crate) fn boxes(&self) -> FittedBoxes<'_> {
        FittedBoxes { boxes: &self.boxes, travel_m: self.travel_m }
    }

    /// Returns the contact of one tool, and the boxes with the travel.
    pub(super) fn split(&mut self, tool: usize) -> (&mut ToolContact, FittedBoxesMut<'_>) {
        let fitted = FittedBoxesMut { boxes: &mut self.boxes, travel_m: self.travel_m };
        (&mut self.tools[tool], fitted)
    }
}
