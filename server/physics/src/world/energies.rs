//! What a body holds now.
use super::{Model, State};
use crate::{bodies::VolumeRatio, tick::Energies};
use glam::DVec3;

impl Energies {
    /// Kinetic, elastic and gravitational energy now (O(tets)), beside the ledger's work and dissipation. Of a seed body the elastic energy is
    /// its core's, for its particles and links have none that is known, and so is no dissipation.
    pub fn of(model: &Model, state: &State) -> Self {
        model.body().energies(model.gravity_m_per_s2(), &state.body, &state.mechanical)
    }
}

/// `Σ V Ψ(F)` (J), or what springs hold.
pub fn elastic_energy_j(model: &Model, state: &State) -> f64 {
    model.body().energies(DVec3::ZERO, &state.body, &state.mechanical).elastic_j
}

/// The smallest `J = det F` over all tets; of a hybrid body, over the coarse tets' means and the awake cells. A surface of springs has
/// none.
pub fn min_volume_ratio(model: &Model, state: &State) -> Option<VolumeRatio> {
    model.body().min_volume_ratio(&state.body, &state.mechanical.x)
}
