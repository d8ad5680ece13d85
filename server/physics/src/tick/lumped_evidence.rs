//! What the step of a body with lumped masses is judged by.
use super::{MechanicalState, StepEvidence, StepForcesNow};
use crate::lanes::StepForces;
use glam::DVec3;

/// Inverse masses `M⁻¹` (1/kg) of all positions, zero on held axes, and the norm `‖a‖² = Σ aᵀ M⁻¹ a` that they make.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LumpedEvidence<'a> {
    pub(crate) inverse_mass_per_kg: &'a [DVec3],
}

/// Where the positions were (m), and how fast (m/s), at the start of a step of length `dt_s` (s).
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepStart<'a> {
    pub(crate) x: &'a [DVec3],
    pub(crate) v: &'a [DVec3],
    pub(crate) dt_s: f64,
}

impl LumpedEvidence<'_> {
    /// Returns the evidence of the last three instants ([`super::Judged::evidence`]).
    pub(crate) fn of(self, state: &MechanicalState, [one, two]: [StepForcesNow<'_>; 2], held_sq: f64) -> StepEvidence {
        let forces = StepForces {
            total_n: [&state.force_n, one.total_n, two.total_n],
            external_n: [&state.external_n, one.external_n, two.external_n],
            inverse_mass_per_kg: self.inverse_mass_per_kg,
        };
        let [answer_sq, one_sq, two_sq] = forces.sums();
        StepEvidence { answer_sq, cause_sq: one_sq.max(two_sq) + held_sq, long_step: 0.0 }
    }

    /// Returns the evidence of a first step ([`super::Judged::evidence_of_first_step`]), of positions with these masses
    /// (kg).
    pub(crate) fn of_first_step(
        self,
        state: &MechanicalState,
        before: StepForcesNow<'_>,
        start: StepStart<'_>,
        mass_kg: impl Iterator<Item = f64>,
    ) -> StepEvidence {
        let dt_s = start.dt_s;
        let (mut moved_sq, mut speed_sq) = (0.0, 0.0);
        for (((x, start_x), start_v), mass_kg) in state.x.iter().zip(start.x).zip(start.v).zip(mass_kg) {
            moved_sq += mass_kg * x.distance_squared(*start_x);
            speed_sq += mass_kg * start_v.length_squared();
        }
        let cause_sq = (moved_sq / (dt_s * dt_s)).max(speed_sq) / (dt_s * dt_s);
        StepEvidence { answer_sq: self.change_sq(StepForcesNow::of(state), before), cause_sq, long_step: 0.0 }
    }

    /// Returns `‖g₁ − g₂‖²` (N²/kg) of the internal forces at two instants.
    pub(crate) fn change_sq(self, one: StepForcesNow<'_>, two: StepForcesNow<'_>) -> f64 {
        let changes = one.internal_n().zip(two.internal_n()).map(|(g, before)| g - before);
        let weighted = changes.zip(self.inverse_mass_per_kg);
        weighted.map(|(change, inverse_mass)| (change * change).dot(*inverse_mass)).sum()
    }
}

/// Returns `Σ |g − m g_gravity|²/m` (N²/kg) over all positions, of masses `m` (kg), that have any mass.
pub(crate) fn internal_sq(state: &MechanicalState, gravity: DVec3, mass_kg: impl Iterator<Item = f64>) -> f64 {
    let mut internal_sq = 0.0;
    for (internal_n, mass_kg) in StepForcesNow::of(state).internal_n().zip(mass_kg).filter(|(_, kg)| *kg > 0.0) {
        internal_sq += (internal_n - gravity * mass_kg).length_squared() / mass_kg;
    }
    internal_sq
}
