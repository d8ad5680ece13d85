//! The buffers that a hybrid body's ticks work in.
use super::{
    activation_query::ActivationQuery,
    body::HybridBody,
    carried_skin::Carried,
    long_steps::LongStepHistory,
    prestrain::{PrestrainDecay, Progress},
    running::RunningPatch,
    staged_patch::StagedPatch,
    state::{HybridState, room_for_cells},
    state_transfer::Before,
    transition_force::TransitionForce,
};
use crate::tick::{Environment, ListedVertices};
use glam::DVec3;

/// Buffers of a hybrid body.
#[derive(Debug, Clone)]
pub(crate) struct HybridScratch {
    pub(crate) patch: RunningPatch,
    pub(crate) skin: ListedVertices<Carried>,
    pub(crate) accelerations: Vec<DVec3>,
    pub(crate) momenta: Vec<DVec3>,
    /// `v_f·M'_ff v_f` and `v_h·M'_hf v_f` (J) since the last kick of this tick.
    pub(crate) of_free_j: Option<(f64, f64)>,
    /// `fᵀ M'⁻¹ f` (N²/kg) at the last three kicks, the last one first.
    pub(crate) kick_sq: [f64; 3],
    pub(super) query: ActivationQuery,
    pub(super) staged: StagedPatch,
    pub(super) before: Before,
    pub(crate) transition: TransitionForce,
    pub(super) long_steps: LongStepHistory,
    /// What decays within a tick, as a tick that is repeated or refused began with it.
    decay_at_start: Decay,
}

/// The prestrain's progress, and [`HybridState::given_j`].
#[derive(Debug, Clone, Copy, Default)]
struct Decay {
    prestrain: Progress,
    given_j: f64,
}

impl HybridScratch {
    /// Makes the buffers of a body in its environment.
    pub(crate) fn new(body: &HybridBody, environment: &Environment) -> Self {
        let (most, positions) = (body.particles.most_active, body.most_positions());
        let patch = || RunningPatch::new(body, most, environment.settings.precision);
        let (mut patch, staged) = (patch(), StagedPatch::new(patch()));
        patch.wake(body, &[], &PrestrainDecay::default());
        Self {
            staged,
            patch,
            skin: ListedVertices::new(body.vertex_points.len()),
            accelerations: Vec::with_capacity(positions),
            momenta: Vec::with_capacity(positions),
            of_free_j: None,
            kick_sq: [0.0; 3],
            query: ActivationQuery::new(body, environment),
            before: Before::with_room(
                room_for_cells(body, body.particles.most_active),
                body.partition().residual_elements().len(),
            ),
            transition: TransitionForce::with_room(positions),
            long_steps: LongStepHistory::with_room(body.node_count(), positions),
            decay_at_start: Decay::default(),
        }
    }

    /// Keeps what decays within a tick.
    pub(super) fn keep_decay(&mut self, own: &HybridState) {
        self.decay_at_start = Decay { prestrain: own.prestrain.progress(), given_j: own.given_j };
    }

    /// Restores what [`Self::keep_decay`] kept.
    pub(super) fn put_decay_back(&self, own: &mut HybridState) {
        own.prestrain.go_back(self.decay_at_start.prestrain);
        own.given_j = self.decay_at_start.given_j;
    }

    /// Returns `fᵀ M'⁻¹ f` (N²/kg) of forces on free axes.
    pub(crate) fn size_sq(&mut self, forces_n: impl Iterator<Item = DVec3>) -> f64 {
        self.accelerations.clear();
        self.accelerations.extend(forces_n);
        self.patch.mass_matrix_mut().accelerate(&mut self.accelerations)
    }

    /// Returns `vᵀ M' v` (J) of velocities; of displacements it is in kg m².
    pub(crate) fn twice_kinetic(&mut self, body: &HybridBody, v: impl Iterator<Item = DVec3>) -> f64 {
        let Self { patch, accelerations, momenta, .. } = self;
        accelerations.clear();
        accelerations.extend(v);
        momenta.clear();
        momenta.resize(accelerations.len(), DVec3::ZERO);
        patch.mass_matrix_mut().momenta(body, accelerations, momenta);
        momenta.iter().zip(accelerations.iter()).map(|(p, v)| p.dot(*v)).sum()
    }

    /// Returns `(1 − ε) m_p` (kg) of the active particles.
    pub(crate) fn particle_kg(&self) -> &[f64] {
        self.patch.mass_matrix().particle_kg()
    }

    /// Makes the patch that of the state's active particles and prestrains, where it is not. Allocates nothing.
    pub(super) fn follow(&mut self, body: &HybridBody, active: &HybridState) {
        if self.patch.active() != active.ids() {
            self.transition.forget_due();
            self.patch.wake(body, active.ids(), &active.prestrain);
        } else if !self.patch.knows(&active.prestrain) {
            self.patch.put_prestrains(&active.prestrain);
        }
    }
}
