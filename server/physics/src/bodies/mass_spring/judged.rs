//! What the step of a mass-spring surface is judged by.
use super::SteppedMassSpring;
use crate::tick::{
    Environment, Judged, MechanicalState, StepEvidence, StepForcesNow,
    lumped_evidence::{LumpedEvidence, StepStart, internal_sq},
};
use glam::DVec3;

impl SteppedMassSpring<'_> {
    fn lumped(&self) -> LumpedEvidence<'_> {
        LumpedEvidence { inverse_mass_per_kg: &self.scratch.inverse_mass_per_kg }
    }

    /// Returns the masses (kg) of the awake nodes. Held ones have that of their vertex, whatever nodes of type 2 have taken
    /// of it.
    fn mass_kg(&self) -> impl Iterator<Item = f64> {
        let of_vertices = &self.body.model().spec().mass_kg;
        self.own.motion.ids.iter().zip(&self.scratch.mass_kg).map(|(id, free_kg)| {
            // The buffer has no mass of held nodes.
            if free_kg.x > 0.0 { free_kg.x } else { of_vertices.get(*id as usize).copied().unwrap_or_default() }
        })
    }
}

impl Judged for SteppedMassSpring<'_> {
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
        self.lumped().of_first_step(state, before, start, self.mass_kg())
    }

    fn change(&mut self, one: StepForcesNow<'_>, two: StepForcesNow<'_>) -> f64 {
        self.lumped().change_sq(one, two).sqrt()
    }

    fn internal_sq(&self, environment: &Environment, state: &MechanicalState) -> f64 {
        internal_sq(state, environment.gravity_m_per_s2, self.mass_kg())
    }

    fn is_viscous(&self) -> bool {
        false
    }
}
