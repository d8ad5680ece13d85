//! What the step of a mass-spring surface is judged by.
use super::SteppedMassSpring;
use crate::{
    lanes::StepForces,
    tick::{Environment, Judged, MechanicalState, StepEvidence, StepForcesNow},
};
use glam::DVec3;

impl Judged for SteppedMassSpring<'_> {
    fn evidence(
        &mut self,
        _: &Environment,
        state: &MechanicalState,
        [one, two]: [StepForcesNow<'_>; 2],
        held_sq: f64,
        _: u32,
    ) -> StepEvidence {
        let forces = StepForces {
            total_n: [&state.force_n, one.total_n, two.total_n],
            external_n: [&state.external_n, one.external_n, two.external_n],
            inverse_mass_per_kg: &self.scratch.inverse_mass_per_kg,
        };
        let [answer_sq, one_sq, two_sq] = forces.sums();
        StepEvidence { answer_sq, cause_sq: one_sq.max(two_sq) + held_sq, long_step: 0.0 }
    }

    fn evidence_of_first_step(
        &mut self,
        environment: &Environment,
        state: &MechanicalState,
        before: StepForcesNow<'_>,
        start_x: &[DVec3],
        start_v: &[DVec3],
    ) -> StepEvidence {
        let dt_s = environment.settings.tick_period_s;
        let answer_sq = self.change(StepForcesNow::of(state), before).powi(2);
        let (mut moved_sq, mut speed_sq) = (0.0, 0.0);
        for (((x, start_x), start_v), mass) in state.x.iter().zip(start_x).zip(start_v).zip(&self.scratch.mass_kg) {
            moved_sq += mass.x * x.distance_squared(*start_x);
            speed_sq += mass.x * start_v.length_squared();
        }
        let cause_sq = (moved_sq / (dt_s * dt_s)).max(speed_sq) / (dt_s * dt_s);
        StepEvidence { answer_sq, cause_sq, long_step: 0.0 }
    }

    fn change(&mut self, one: StepForcesNow<'_>, two: StepForcesNow<'_>) -> f64 {
        let changes = one.internal_n().zip(two.internal_n()).map(|(g, before)| g - before);
        let weighted = changes.zip(&self.scratch.inverse_mass_per_kg);
        weighted.map(|(change, inverse_mass)| (change * change).dot(*inverse_mass)).sum::<f64>().sqrt()
    }

    fn internal_sq(&self, environment: &Environment, state: &MechanicalState) -> f64 {
        let nodes = StepForcesNow::of(state).internal_n().zip(&self.scratch.mass_kg);
        // The mass of held nodes is zero here.
        let free = nodes.filter(|(_, mass)| mass.x > 0.0);
        free.map(|(g, mass)| (g - environment.gravity_m_per_s2 * *mass).length_squared() / mass.x).sum()
    }

    fn is_viscous(&self) -> bool {
        false
    }

    fn strides(&self, _: &MechanicalState, _: f64) -> f64 {
        0.0
    }

    fn keep(&mut self, _: &MechanicalState) {}

    fn put_back(&mut self) {}

    fn note_long_step(&mut self, _: &MechanicalState) {}

    fn accept(&mut self) {}
}
