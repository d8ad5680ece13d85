//! Lumped mass: each tet gives a quarter of its mass to each corner.
use crate::mesh::TetMesh;

/// Nodal masses (kg): `m_i = Σ_{t∋i} ρ_t V_t / 4`. Positive for every node of a valid mesh.
///
/// `density_kg_per_m3[t]` is the density of tet `t`.
pub fn lumped_kg(mesh: &TetMesh, density_kg_per_m3: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut mass = vec![0.0; mesh.positions_m().len()];
    for (tet, nodes) in mesh.tets().iter().enumerate() {
        let quarter = density_kg_per_m3(tet) * mesh.volume_m3(tet) / 4.0;
        for &node in nodes {
            mass[node as usize] += quarter;
        }
    }
    mass
}
