//! The largest natural frequency of a discrete body.
use crate::{fem::element::RestTet, material::Material, mesh::TetMesh};
use glam::DVec3;

/// ω_max (rad/s) of `K φ = ω² M φ` at rest, on the free degrees of freedom (`inverse_mass_per_kg` is zero on fixed ones).
pub fn max_natural_frequency_rad_per_s(
    _mesh: &TetMesh,
    _rest_tets: &[RestTet],
    _tet_material: &[u16],
    _materials: &[Material],
    _inverse_mass_per_kg: &[DVec3],
) -> f64 {
    0.0
}
