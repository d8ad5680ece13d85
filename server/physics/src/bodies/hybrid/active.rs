//! Which particles are active, as the state keeps it; and what the loop works in.
use super::{
    balance::Balance,
    body::Hybrid,
    coming::Coming,
    fade::Fading,
    handover::Before,
    listed::ListedSkin,
    long_steps::{LongStepHistory, LongSteps},
    running::RunningPatch,
    spec::Waking,
    switching::{Ball, Looking},
};
use crate::world::{Model, State};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Active particles, ascending. Their positions and velocities follow those of the coarse nodes in [`State::x`] and [`State::v`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ActiveParticles {
    ids: Vec<u32>,
    /// Those to be: others while a switch is coming.
    pub(super) next: Vec<u32>,
    /// Those to be after that: what is to sleep does so first, what is to wake follows.
    pub(super) wanted: Vec<u32>,
    /// Of every place of every tool.
    pub(super) balls: Vec<Option<Ball>>,
    pub(crate) fading: Fading,
    /// Balancing forces (N), as many as positions, or none.
    pub(super) balance_n: Vec<DVec3>,
    /// Energy (J) that fading strains and balancing forces gave lately, beyond what they and switches took.
    pub(crate) given_j: f64,
    /// Elastic energy (J) of what a switch lately changed, the most of any.
    pub(super) switched_j: f64,
    pub(crate) long_steps: LongSteps,
}

impl ActiveParticles {
    pub(crate) fn none(model: &Model) -> Self {
        Self {
            ids: Vec::with_capacity(room(model)),
            next: Vec::with_capacity(room(model)),
            wanted: Vec::with_capacity(room(model)),
            balls: vec![None; places(model).sum()],
            fading: fading_with_room(model),
            balance_n: Vec::with_capacity(entries(model)),
            given_j: 0.0,
            switched_j: 0.0,
            long_steps: LongSteps::with_room(model.hybrid().map_or(0, Hybrid::node_count), entries(model)),
        }
    }

    /// Their numbers.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// What of them and of the coarse tets woke or fell asleep strained.
    pub fn fading(&self) -> &Fading {
        &self.fading
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Takes what is wanted: at first those of it that are awake, where others are, too.
    pub(super) fn want(&mut self, wanted: &[u32]) {
        self.wanted.clear();
        self.wanted.extend_from_slice(wanted);
        let Self { ids, next, wanted, .. } = self;
        let is_wanted = |id: &&u32| wanted.binary_search(id).is_ok();
        next.clear();
        if ids.iter().all(|id| is_wanted(&id)) {
            next.extend_from_slice(wanted);
        } else {
            next.extend(ids.iter().filter(is_wanted));
        }
    }

    pub(super) fn is_switching(&self) -> bool {
        self.next != self.ids
    }

    /// Whether all sleep.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Whether an active particle is at a cell.
    fn touches(&self, model: &Model, cell: u32) -> bool {
        let Some(partition) = model.hybrid().map(Hybrid::partition) else { return false };
        let is_active = |particle: &u32| self.ids.binary_search(particle).is_ok();
        (cell as usize) < partition.cells().len() && partition.corners(cell as usize).iter().any(is_active)
    }

    pub(crate) fn clear(&mut self) {
        self.ids.clear();
        self.next.clear();
        self.wanted.clear();
        self.balls.fill(None);
        self.fading.clear();
        self.balance_n.clear();
        self.given_j = 0.0;
        self.switched_j = 0.0;
        self.long_steps.forget();
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.ids.clone_from(&other.ids);
        self.next.clone_from(&other.next);
        self.wanted.clone_from(&other.wanted);
        self.balls.clone_from(&other.balls);
        self.fading.copy_from(&other.fading);
        self.balance_n.clone_from(&other.balance_n);
        self.given_j = other.given_j;
        self.switched_j = other.switched_j;
        self.long_steps.copy_from(&other.long_steps);
    }

    /// Whether they are ascending, may be awake, and have room.
    pub(crate) fn fit(&self, model: &Model) -> bool {
        let may_wake = |id: &u32| model.hybrid().is_some_and(|body| body.may_wake(*id));
        let finite = |ball: &Ball| ball.rest_m.is_finite();
        self.balls.len() == places(model).sum::<usize>()
            && self.balls.iter().flatten().all(finite)
            && self.fading.is_finite()
            && [0, model.rest_positions_m().len() + self.ids.len()].contains(&self.balance_n.len())
            && self.balance_n.iter().all(|force| force.is_finite())
            && self.given_j.is_finite()
            && self.switched_j.is_finite()
            && self.long_steps.fit(model.rest_positions_m().len(), model.rest_positions_m().len() + self.ids.len())
            && self.fading.is_sorted()
            && self.fading.cells.iter().all(|fade| self.touches(model, fade.cell))
            && self.fading.tets.iter().all(|fade| (fade.tet as usize) < model.mesh().tets().len())
            && [&self.ids, &self.next, &self.wanted]
                .into_iter()
                .all(|list| list.len() <= room(model) && list.is_sorted_by(|a, b| a < b) && list.iter().all(may_wake))
    }
}

/// Most active particles of a model.
pub(super) fn room(model: &Model) -> usize {
    model.spec().particles.as_ref().map_or(0, |particles| particles.most_active)
}

/// Most coarse nodes and active particles of a model.
fn entries(model: &Model) -> usize {
    model.hybrid().map_or(0, |body| body.node_count() + room(model))
}

/// Most awake cells of a model.
pub(super) fn room_for_cells(body: &Hybrid, most_active: usize) -> usize {
    (body.partition().most_cells_at() * most_active).min(body.partition().cells().len())
}

fn fading_with_room(model: &Model) -> Fading {
    let of = |body: &Hybrid| Fading::with_room(room_for_cells(body, room(model)), body.partition().shares().len());
    model.hybrid().map_or_else(Fading::default, of)
}

/// Places of each tool that may keep particles awake: so near to one another that the balls about them overlap.
pub(super) fn places(model: &Model) -> impl Iterator<Item = usize> + Clone {
    let tools = if model.hybrid().is_some() { &model.spec().tools[..] } else { &[] };
    let apart_m = match model.spec().particles.as_ref().map(|particles| particles.waking) {
        Some(Waking::ByTools { reach_m }) => reach_m,
        _ => f64::INFINITY,
    };
    tools.iter().map(move |tool| tool.place_count(apart_m))
}

/// Buffers for hybrid bodies.
#[derive(Debug, Clone)]
pub(crate) struct HybridScratch {
    pub(crate) patch: RunningPatch,
    pub(crate) skin: ListedSkin,
    pub(crate) accelerations: Vec<DVec3>,
    pub(crate) momenta: Vec<DVec3>,
    /// `v_f·M'_ff v_f` and `v_h·M'_hf v_f` (J) since the last kick of this tick.
    pub(crate) of_free_j: Option<(f64, f64)>,
    /// `fᵀ M'⁻¹ f` (N²/kg) at the last three kicks, the last one first.
    pub(crate) kick_sq: [f64; 3],
    pub(super) looking: Looking,
    pub(super) coming: Coming,
    pub(super) before: Before,
    pub(crate) balance: Balance,
    pub(super) long_steps: LongStepHistory,
    /// Forces are not current only because particles woke or fell asleep at the start of this tick, and contact knows how far the skin moved by that.
    pub(crate) skin_is_tracked: bool,
}

impl HybridScratch {
    pub(crate) fn new(model: &Model) -> Option<Self> {
        let (body, most) = (model.hybrid()?, room(model));
        let patch = || RunningPatch::new(body, most, model.spec().settings.precision);
        let (mut patch, coming) = (patch(), Coming::new(patch()));
        patch.wake(body, &[], &Fading::default());
        let entries = body.node_count() + most;
        Some(Self {
            coming,
            patch,
            skin: ListedSkin::new(body),
            accelerations: Vec::with_capacity(entries),
            momenta: Vec::with_capacity(entries),
            of_free_j: None,
            kick_sq: [0.0; 3],
            looking: Looking::new(model, body),
            before: Before::with_room(room_for_cells(body, most), body.partition().shares().len()),
            balance: Balance::with_room(entries),
            long_steps: LongStepHistory::with_room(body.node_count(), entries),
            skin_is_tracked: false,
        })
    }

    /// `aᵀ M'⁻¹ a` of forces (N²/kg) on free axes.
    pub(crate) fn size_sq(&mut self, forces_n: impl Iterator<Item = DVec3>) -> f64 {
        self.accelerations.clear();
        self.accelerations.extend(forces_n);
        self.patch.metric_mut().accelerate(&mut self.accelerations)
    }

    /// `vᵀ M' v` (J) of velocities, or of displacements (kg m²).
    pub(crate) fn twice_kinetic(&mut self, body: &Hybrid, v: impl Iterator<Item = DVec3>) -> f64 {
        let Self { patch, accelerations, momenta, .. } = self;
        accelerations.clear();
        accelerations.extend(v);
        momenta.clear();
        momenta.resize(accelerations.len(), DVec3::ZERO);
        patch.metric_mut().momenta(body, accelerations, momenta);
        momenta.iter().zip(accelerations.iter()).map(|(p, v)| p.dot(*v)).sum()
    }

    /// `(1 − ε) m_p` (kg) of the active particles.
    pub(crate) fn particle_kg(&self) -> &[f64] {
        self.patch.metric().particle_kg()
    }

    /// Makes the patch that of the state's active particles. Allocates nothing.
    pub(super) fn follow(&mut self, body: &Hybrid, active: &ActiveParticles) {
        if self.patch.active() != active.ids() {
            self.patch.wake(body, active.ids(), &active.fading);
        } else if !self.patch.knows(&active.fading) {
            self.patch.put_fades(&active.fading);
        }
    }
}

impl State {
    /// Goes over to these particles, which have room and may wake, of a body at rest.
    pub(crate) fn wake_at_rest(&mut self, ids: &[u32]) {
        self.active.ids.clear();
        self.active.ids.extend_from_slice(ids);
        self.active.next.clone_from(&self.active.ids);
        self.active.wanted.clone_from(&self.active.ids);
        for list in [&mut self.x, &mut self.v, &mut self.force_n, &mut self.external_n] {
            list.resize(list.len() + ids.len(), DVec3::ZERO);
        }
    }

    /// Goes over to the particles that are to be active next. `moved` is a buffer. Allocates nothing where there is room.
    pub(super) fn switch(&mut self, body: &Hybrid, moved: &mut Vec<DVec3>) {
        let wanted = &self.active.next;
        let nodes = body.node_count();
        for list in [&mut self.x, &mut self.v] {
            moved.clear();
            let (of_nodes, of_particles) = list.split_at(nodes);
            moved.extend(wanted.iter().map(|id| match self.active.ids.binary_search(id) {
                Ok(number) => of_particles[number],
                Err(_) => body.partition().anchor(*id).of(of_nodes),
            }));
            list.truncate(nodes);
            list.extend_from_slice(moved);
        }
        for list in [&mut self.force_n, &mut self.external_n] {
            list.resize(nodes + wanted.len(), DVec3::ZERO);
        }
        self.active.ids.clone_from(&self.active.next);
        self.active.balance_n.clear();
        self.active.long_steps.forget();
        self.force_is_current = false;
    }
}
