//! What the step of a body of tetrahedra is judged by.
use super::SteppedTet;
use crate::tick::{
    Environment, Judged, MechanicalState, StepEvidence, StepForcesNow,
    lumped_evidence::{LumpedEvidence, StepStart, internal_sq},
};
use glam::DVec3;

impl SteppedTet<'_> {
    fn lumped(&self) -> LumpedEvidence<'_> {
        LumpedEvidence { inverse_mass_per_kg: self.body.inverse_mass_per_kg() }
    }
}

impl Judged for SteppedTet<'_> {
    fn evidence(
        &mut self,
        _: &Environment,
        state: &MechanicalState,
        older: [StepForcesNow<'_>; 2],
        held_sq: f64,
        _: u32,
    ) -> StepEvidence {
        self.lumped().of(state, older, held_sq)
    }

    fn evidence_of_first_step(
        &mut self,
        environment: &Environment,
        state: &MechanicalState,
        before: StepForcesNow<'_>,
        start_x: &[DVec3],
        start_v: &[DVec3],
    ) -> StepEvidence {
        let start = StepStart { x: start_x, v: start_v, dt_s: environment.settings.tick_period_s };
        self.lumped().of_first_step(state, before, start, self.body.mass_kg().iter().copied())
    }

    fn change(&mut self, one: StepForcesNow<'_>, two: StepForcesNow<'_>) -> f64 {
        self.lumped().change_sq(one, two).sqrt()
    }

    fn internal_sq(&self, environment: &Environment, state: &MechanicalState) -> f64 {
        internal_sq(state, environment.gravity_m_per_s2, self.body.mass_kg().iter().copied())
    }

    fn is_viscous(&self) -> bool {
        self.body.kernel().is_viscous()
    }
}
