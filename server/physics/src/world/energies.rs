//! The energies of a state.
use super::{Model, State};
use crate::{contact::MeetingWalls, tick::Energies};
use glam::DVec3;

impl Energies {
    /// Returns the kinetic, elastic and gravitational energy of a state (in O(tets)), with the ledger's work and
    /// dissipation. What walls that meet store is counted as elastic. The elastic energy of a seed body is that of its
    /// core, as that of its particles and links is not known; neither is its dissipation.
    pub fn of(model: &Model, state: &State) -> Self {
        let own = model.body().energies(model.gravity_m_per_s2(), &state.body, &state.mechanical);
        let known_j = state.mechanical.contact.stored_in_walls_j().filter(|_| state.mechanical.force_is_current);
        let stored_j = known_j.unwrap_or_else(|| meeting_walls(model, state).energy_j);
        // The ledger books what walls that meet do to the body, which they take back from what they store.
        Self { elastic_j: own.elastic_j + stored_j, external_work_j: own.external_work_j + stored_j, ..own }
    }
}

/// Returns which walls of the body meet in a state, of a body whose walls press each other.
pub fn meeting_walls(model: &Model, state: &State) -> MeetingWalls {
    let Some(walls) = model.contact().walls() else { return MeetingWalls::default() };
    let (mut of_vertices_m, mut x) = (Vec::new(), model.surface_rest_positions_m().to_vec());
    model.surface_positions_m(state, &mut of_vertices_m);
    for (&node, position_m) in model.surface().nodes.iter().zip(of_vertices_m) {
        x[node as usize] = position_m;
    }
    walls.meeting(&x)
}

/// Returns the elastic energy (J): `Σ V Ψ(F)`, or that of the springs.
pub fn elastic_energy_j(model: &Model, state: &State) -> f64 {
    model.body().energies(DVec3::ZERO, &state.body, &state.mechanical).elastic_j
}
