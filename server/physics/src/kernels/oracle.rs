//! The scalar f64 oracle of the force kernel: plain loops over [`RestTet`], slow and easy to believe.
use crate::{
    elements::linear_tet::RestTet,
    material::{Material, viscous},
    mesh::TetMesh,
};
use glam::DVec3;

/// Internal forces, tet by tet.
#[derive(Debug, Clone)]
pub struct Oracle {
    rest_tets: Vec<RestTet>,
    tets: Vec<[u32; 4]>,
    tet_material: Vec<u16>,
    materials: Vec<Material>,
}

impl Oracle {
    /// Takes what [`super::ForceKernel::build`] takes.
    pub fn build(mesh: &TetMesh, rest_tets: &[RestTet], tet_material: &[u16], materials: &[Material]) -> Self {
        Self {
            rest_tets: rest_tets.to_vec(),
            tets: mesh.tets().to_vec(),
            tet_material: tet_material.to_vec(),
            materials: materials.to_vec(),
        }
    }

    /// As [`super::ForceKernel::forces_n`]: overwrites `forces_n` (N), returns the viscous power (W).
    pub fn forces_n(&self, x: &[DVec3], v: &[DVec3], forces_n: &mut [DVec3]) -> f64 {
        forces_n.fill(DVec3::ZERO);
        let mut viscous_power_w = 0.0;
        for ((rest, nodes), &material) in self.rest_tets.iter().zip(&self.tets).zip(&self.tet_material) {
            let material = &self.materials[material as usize];
            let corners = nodes.map(|n| x[n as usize]);
            let velocities = nodes.map(|n| v[n as usize]);
            if !material.viscosity.is_zero() {
                viscous_power_w += rest.viscous_power_w(material, &corners, &velocities);
            }
            for (&node, force) in nodes.iter().zip(rest.forces_n(material, &corners, &velocities)) {
                forces_n[node as usize] += force;
            }
        }
        viscous_power_w
    }

    /// As [`super::ForceKernel::products_n`]: overwrites `products_n` with `−(α K + β C) a` at positions `x`.
    pub fn products_n(&self, [elastic, viscosity]: [f64; 2], x: &[DVec3], a: &[DVec3], products_n: &mut [DVec3]) {
        products_n.fill(DVec3::ZERO);
        for ((rest, nodes), &material) in self.rest_tets.iter().zip(&self.tets).zip(&self.tet_material) {
            let material = &self.materials[material as usize];
            let f = rest.gradient_of(&nodes.map(|n| x[n as usize]));
            let df = rest.gradient_of(&nodes.map(|n| a[n as usize]));
            let p = material.piola_differential(&f, &df) * elastic
                + viscous::piola(material.viscosity, &f, &df) * viscosity;
            for (&node, force) in nodes.iter().zip(rest.corner_forces_n(&p)) {
                products_n[node as usize] += force;
            }
        }
    }
}
