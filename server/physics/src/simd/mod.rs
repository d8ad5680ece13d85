//! The force kernel: internal forces of all tets, in blocks, beside its scalar oracle.
use crate::{fem::element::RestTet, material::Material, mesh::TetMesh, world::Precision};
use glam::DVec3;

/// Internal forces of a body: rest data laid out for the kernel of the chosen precision.
#[derive(Debug, Clone)]
pub struct ForceKernel {
    rest_tets: Vec<RestTet>,
    tets: Vec<[u32; 4]>,
    tet_material: Vec<u16>,
    materials: Vec<Material>,
    any_viscosity: bool,
}

/// Buffers of the kernel.
#[derive(Debug, Clone, Default)]
pub struct KernelScratch {}

impl ForceKernel {
    /// Lays out the rest data. `tet_material[t]` indexes `materials`.
    pub fn build(
        mesh: &TetMesh,
        rest_tets: &[RestTet],
        tet_material: &[u16],
        materials: &[Material],
        _precision: Precision,
    ) -> Self {
        Self {
            rest_tets: rest_tets.to_vec(),
            tets: mesh.tets().to_vec(),
            tet_material: tet_material.to_vec(),
            materials: materials.to_vec(),
            any_viscosity: materials.iter().any(|m| !m.viscosity.is_zero()),
        }
    }

    /// Buffers for [`Self::forces_n`].
    pub fn scratch(&self) -> KernelScratch {
        KernelScratch {}
    }

    /// Overwrites `forces_n` (N) with elastic and viscous forces at positions `x` (m) and velocities `v` (m/s), and
    /// returns the power (W) that viscous stress takes. `v` is not read when no material is viscous.
    pub fn forces_n(
        &self,
        _rest_positions_m: &[DVec3],
        x: &[DVec3],
        v: &[DVec3],
        forces_n: &mut [DVec3],
        _scratch: &mut KernelScratch,
    ) -> f64 {
        forces_n.fill(DVec3::ZERO);
        let mut viscous_power_w = 0.0;
        for (tet, nodes) in self.tets.iter().enumerate() {
            let material = &self.materials[self.tet_material[tet] as usize];
            let corners = nodes.map(|n| x[n as usize]);
            let velocities = nodes.map(|n| v[n as usize]);
            let rest = &self.rest_tets[tet];
            let f = rest.forces_n(material, &corners, &velocities);
            if self.any_viscosity {
                viscous_power_w += rest.viscous_power_w(material, &corners, &velocities);
            }
            for (corner, &node) in nodes.iter().enumerate() {
                forces_n[node as usize] += f[corner];
            }
        }
        viscous_power_w
    }
}
