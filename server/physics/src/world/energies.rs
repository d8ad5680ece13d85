//! The energies of a state.
use super::{Model, State};
use crate::tick::Energies;
use glam::DVec3;

impl Energies {
    /// Returns the kinetic, elastic and gravitational energy of a state (in O(tets)), with the ledger's work and
    /// dissipation. The elastic energy of a seed body is that of its core, as that of its particles and links is not
    /// known; neither is its dissipation.
    pub fn of(model: &Model, state: &State) -> Self {
        model.body().energies(model.gravity_m_per_s2(), &state.body, &state.mechanical)
    }
}

/// Returns the elastic energy (J): `Σ V Ψ(F)`, or that of the springs.
pub fn elastic_energy_j(model: &Model, state: &State) -> f64 {
    model.body().energies(DVec3::ZERO, &state.body, &state.mechanical).elastic_j
}
