//! The quantities by which the step of a body is judged (`integrate::stability`): norms in the metric of its mass
//! matrix `M`.
use super::{Environment, MechanicalState};
use glam::DVec3;

/// Both sides of the quotient `Q` that tells whether a step was too long, squared (N²/kg).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StepEvidence {
    /// Square `‖Δ²g‖²` of the second difference of the internal force `g`, or `‖Δg‖²` in a first step.
    pub(crate) answer_sq: f64,
    /// Square `max(‖f‖², ‖f₋‖²)` of the total force `f`, or what stands for it in a first step.
    pub(crate) cause_sq: f64,
    /// Quotient of long steps of a coarse level, in the place of `Q`; 0 where there are none.
    pub(crate) long_step: f64,
}

/// Forces (N) at an instant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepForcesNow<'a> {
    /// Total force at each position.
    pub(crate) total_n: &'a [DVec3],
    /// The part of it that loads, tools and injected forces make.
    pub(crate) external_n: &'a [DVec3],
}

impl<'a> StepForcesNow<'a> {
    /// Returns the forces of a state.
    pub(crate) fn of(state: &'a MechanicalState) -> Self {
        Self { total_n: &state.force_n, external_n: &state.external_n }
    }

    /// Returns the internal force `g = f − e` (N) at every position, where `e` is the external force.
    pub(crate) fn internal_n(self) -> impl Iterator<Item = DVec3> + 'a {
        self.total_n.iter().zip(self.external_n).map(|(force, external)| *force - *external)
    }
}

/// A body whose steps are judged, and whose ticks are taken back and repeated where they prove too long.
pub(crate) trait Judged {
    /// Returns `‖g₀ − 2 g₁ + g₂‖²`, and the larger one of `‖f₁‖²` and `‖f₂‖²`, of the newest and the two older instants
    /// of a tick of `substeps` substeps. `held_sq` (N²/kg) is what held axes add to the latter.
    fn evidence(
        &mut self,
        environment: &Environment,
        state: &MechanicalState,
        older: [StepForcesNow<'_>; 2],
        held_sq: f64,
        substeps: u32,
    ) -> StepEvidence;

    /// Returns the same for a first step, from the forces one step before and the state at the tick's start.
    fn evidence_of_first_step(
        &mut self,
        environment: &Environment,
        state: &MechanicalState,
        before: StepForcesNow<'_>,
        start_x: &[DVec3],
        start_v: &[DVec3],
    ) -> StepEvidence;

    /// Returns `‖g₁ − g₂‖` (N/√kg) of two instants.
    fn change(&mut self, one: StepForcesNow<'_>, two: StepForcesNow<'_>) -> f64;

    /// Returns `Σ |g − m g_gravity|²/m` (N²/kg) over all positions including held axes, which is the size of internal
    /// forces.
    fn internal_sq(&self, environment: &Environment, state: &MechanicalState) -> f64;

    /// Returns whether viscous stress acts, whose part of `Q` falls with the step and not with its square.
    fn is_viscous(&self) -> bool;

    /// Returns how far the fastest point goes in a step of `dt_s`, over how far it may; 0 where nothing limits it.
    fn strides(&self, _: &MechanicalState, _dt_s: f64) -> f64 {
        0.0
    }

    /// Keeps what a tick that may be repeated changes beside positions and velocities.
    fn keep(&mut self, _: &MechanicalState) {}

    /// Puts back what was kept, so that the tick can be taken again.
    fn put_back(&mut self) {}

    /// Notes that a long step of a coarse level begins at this state.
    fn note_long_step(&mut self, _: &MechanicalState) {}

    /// Ends a tick that was accepted.
    fn accept(&mut self) {}
}
