//! How the length of a hybrid body's step is judged: by norms in the mass matrix of what is awake, and by its long
//! steps.
use super::{HybridScratch, SteppedHybrid};
use crate::tick::{Environment, Judged, MechanicalState, StepEvidence, StepForcesNow};
use glam::DVec3;

/// Longest way of a particle in one step, over the spacing of particles. Where a rigid sphere leapt 6 mm deep into a
/// ventricle and particles moved by 0.7 spacings in a step, a cell turned inside out and 7 % of the energy went; with
/// this limit, 0.3 %.
const STRIDE: f64 = 0.25;

impl Judged for SteppedHybrid<'_> {
    fn evidence(
        &mut self,
        environment: &Environment,
        state: &MechanicalState,
        [one, two]: [StepForcesNow<'_>; 2],
        held_sq: f64,
        substeps: u32,
    ) -> StepEvidence {
        let scratch = &mut *self.scratch;
        let now = StepForcesNow::of(state).internal_n();
        let second = now.zip(one.internal_n()).zip(two.internal_n()).map(|((g0, g1), g2)| g0 - g1 * 2.0 + g2);
        let answer_sq = scratch.size_sq(second);
        let [one_sq, two_sq] = if substeps == 1 {
            [one, two].map(|forces| scratch.size_sq(forces.total_n.iter().copied()))
        } else {
            let [_, one_sq, two_sq] = scratch.kick_sq;
            [one_sq, two_sq]
        };
        let long_step = scratch.long_step_quotient(self.body, self.own, environment, state, substeps);
        StepEvidence { answer_sq, cause_sq: one_sq.max(two_sq) + held_sq, long_step }
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
        let Self { body, scratch, .. } = self;
        let changes = StepForcesNow::of(state).internal_n().zip(before.internal_n()).map(|(g, before)| g - before);
        let answer_sq = scratch.size_sq(changes);
        let moved_sq = scratch.twice_kinetic(body, state.x.iter().zip(start_x).map(|(x, before)| *x - *before));
        let speed_sq = scratch.twice_kinetic(body, start_v.iter().copied());
        let cause_sq = (moved_sq / (dt_s * dt_s)).max(speed_sq) / (dt_s * dt_s);
        StepEvidence { answer_sq, cause_sq, long_step: 0.0 }
    }

    fn change(&mut self, one: StepForcesNow<'_>, two: StepForcesNow<'_>) -> f64 {
        self.scratch.size_sq(one.internal_n().zip(two.internal_n()).map(|(g, before)| g - before)).sqrt()
    }

    fn internal_sq(&self, environment: &Environment, state: &MechanicalState) -> f64 {
        let mut internal_sq = 0.0;
        let masses = self.body.masses().node_kg.iter().chain(HybridScratch::particle_kg(self.scratch));
        // Coarse nodes that nothing follows have no mass.
        for (internal_n, mass) in StepForcesNow::of(state).internal_n().zip(masses).filter(|(_, mass)| **mass > 0.0) {
            internal_sq += (internal_n - environment.gravity_m_per_s2 * *mass).length_squared() / mass;
        }
        internal_sq
    }

    fn is_viscous(&self) -> bool {
        self.body.materials().materials.iter().any(|material| !material.viscosity.is_zero())
    }

    /// `max |v_p − v̄| dt/(STRIDE h)` over awake particles, with the mean `v̄` of all points: a motion of the whole body does not
    /// count.
    fn strides(&self, state: &MechanicalState, dt_s: f64) -> f64 {
        let mean = state.v.iter().sum::<DVec3>() / state.v.len().max(1) as f64;
        let particles = &state.v[self.body.node_count()..];
        let fastest_sq = particles.iter().map(|v| v.distance_squared(mean)).fold(0.0, f64::max);
        fastest_sq.sqrt() * dt_s / (STRIDE * self.body.partition().sites().spacing_m())
    }

    fn keep(&mut self, state: &MechanicalState) {
        self.scratch.keep_long_steps(self.own, state);
    }

    fn put_back(&mut self) {
        self.scratch.put_decay_back(self.own);
        self.scratch.put_long_steps_back(self.own);
        self.scratch.transition.put_back(self.own);
    }

    fn note_long_step(&mut self, state: &MechanicalState) {
        self.scratch.note_long_step(self.own, state);
    }

    fn accept(&mut self) {
        self.scratch.pass_on_long_step(self.own);
    }
}
