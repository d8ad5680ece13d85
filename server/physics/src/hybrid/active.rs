//! Which particles are active, as the state keeps it; and what the loop works in.
use super::{
    body::Hybrid,
    listed::ListedSkin,
    running::RunningPatch,
    switching::{Ball, Looking},
};
use crate::world::{Model, State};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Active particles, ascending. Their positions and velocities follow those of the coarse nodes in [`State::x`] and [`State::v`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ActiveParticles {
    ids: Vec<u32>,
    /// Of every tool.
    pub(super) balls: Vec<Option<Ball>>,
}

impl ActiveParticles {
    pub(crate) fn none(model: &Model) -> Self {
        Self { ids: Vec::with_capacity(room(model)), balls: vec![None; tools(model)] }
    }

    /// Their numbers.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Whether all sleep.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    pub(crate) fn clear(&mut self) {
        self.ids.clear();
        self.balls.fill(None);
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.ids.clone_from(&other.ids);
        self.balls.clone_from(&other.balls);
    }

    /// Whether they are ascending, may be awake, and have room.
    pub(crate) fn fit(&self, model: &Model) -> bool {
        let may_wake = |id: &u32| model.hybrid().is_some_and(|body| body.may_wake(*id));
        let finite = |ball: &Ball| ball.rest_m.is_finite();
        self.balls.len() == tools(model)
            && self.balls.iter().flatten().all(finite)
            && self.ids.len() <= room(model)
            && self.ids.is_sorted_by(|a, b| a < b)
            && self.ids.iter().all(may_wake)
    }
}

/// Most active particles of a model.
fn room(model: &Model) -> usize {
    model.spec().particles.as_ref().map_or(0, |particles| particles.most_active)
}

/// Tools that may keep particles awake.
fn tools(model: &Model) -> usize {
    if model.hybrid().is_some() { model.spec().tools.len() } else { 0 }
}

/// Buffers for hybrid bodies.
#[derive(Debug, Clone)]
pub(crate) struct HybridScratch {
    pub(crate) patch: RunningPatch,
    pub(crate) skin: ListedSkin,
    pub(crate) accelerations: Vec<DVec3>,
    pub(crate) momenta: Vec<DVec3>,
    pub(super) looking: Looking,
}

impl HybridScratch {
    pub(crate) fn new(model: &Model) -> Option<Self> {
        let (body, most) = (model.hybrid()?, room(model));
        let mut patch = RunningPatch::new(body, most, model.spec().settings.precision);
        patch.wake(body, &[]);
        let entries = body.node_count() + most;
        Some(Self {
            patch,
            skin: ListedSkin::new(body),
            accelerations: Vec::with_capacity(entries),
            momenta: Vec::with_capacity(entries),
            looking: Looking::new(model, body),
        })
    }

    /// Makes the patch that of the state's active particles. Allocates nothing.
    pub(super) fn follow(&mut self, body: &Hybrid, active: &ActiveParticles) {
        if self.patch.active() != active.ids() {
            self.patch.wake(body, active.ids());
        }
    }
}

impl State {
    /// Wakes these particles and no others: what was active goes on, what wakes moves as the coarse nodes have moved it. Particles that may not wake
    /// ([`Hybrid::may_wake`]), and those for which there is no room, are left out.
    pub fn wake_only(&mut self, model: &Model, particles: impl IntoIterator<Item = u32>) {
        let Some(body) = model.hybrid() else { return };
        let mut wanted: Vec<u32> = particles.into_iter().filter(|&particle| body.may_wake(particle)).collect();
        wanted.sort_unstable();
        wanted.dedup();
        wanted.truncate(room(model));
        self.switch(body, &wanted, &mut Vec::with_capacity(wanted.len()));
    }

    /// `wanted` is ascending; `moved` a buffer. Allocates nothing where there is room.
    pub(super) fn switch(&mut self, body: &Hybrid, wanted: &[u32], moved: &mut Vec<DVec3>) {
        if self.active.ids == wanted {
            return;
        }
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
        self.active.ids.clear();
        self.active.ids.extend_from_slice(wanted);
        self.force_is_current = false;
    }
}
