//! Energies and momenta of a hybrid body, by the oracle: for diagnostics, not for every substep.
use super::{
    body::HybridBody,
    mass_matrix::MassMatrix,
    patch::{Field, Patch},
    state::HybridState,
};
use crate::{
    material::Law,
    tick::{Energies, MechanicalState},
};
use glam::{DMat3, DVec3};
use std::collections::BTreeSet;

impl HybridBody {
    fn patch_of(&self, own: &HybridState) -> (Patch, BTreeSet<u32>) {
        let active: BTreeSet<u32> = own.ids().iter().copied().collect();
        (Patch::new(&self.partition, &active).with_prestrain(own.prestrain().clone()), active)
    }

    fn field(&self, list: &[DVec3]) -> Field {
        let (nodes, particles) = list.split_at(self.node_count());
        Field { nodes: nodes.to_vec(), particles: particles.to_vec() }
    }

    /// Returns kinetic, elastic and gravitational energy, beside the ledger's work and dissipation.
    pub(crate) fn energies(&self, gravity_m_per_s2: DVec3, own: &HybridState, state: &MechanicalState) -> Energies {
        let (patch, active) = self.patch_of(own);
        let (at, rate) = (self.field(&state.x), self.field(&state.v));
        let rest = patch.at_rest(&self.partition);
        let mass_matrix = MassMatrix::new(&self.partition, &self.masses, &active);
        let moved = |list: &[DVec3], rest: &[DVec3]| -> Vec<DVec3> {
            list.iter().zip(rest).map(|(x, rest)| *x - *rest).collect()
        };
        let moved_m = moved(&at.nodes, &rest.nodes);
        let weights = self.masses.node_weight_kg.iter().zip(&self.masses.node_kg);
        let beside: DVec3 = moved_m.iter().zip(weights).map(|(u, (weight, mass))| *u * (weight - mass)).sum();
        let of_nodes = mass_matrix.momenta(&moved_m).iter().sum::<DVec3>() + beside;
        let particles = moved(&at.particles, &rest.particles);
        let of_particles: DVec3 = particles.iter().zip(mass_matrix.particle_kg()).map(|(u, m)| *u * *m).sum();
        let kinetic_j = mass_matrix.kinetic_j(&rate.nodes, &rate.particles);
        let gravitational_j = 0.0 - gravity_m_per_s2.dot(of_nodes + of_particles);
        Energies {
            kinetic_j,
            elastic_j: patch.energy_j(&self.materials(), &at),
            gravitational_j,
            external_work_j: state.ledger.external_work_j,
            dissipated_j: state.ledger.dissipated_j,
        }
    }

    /// Tells the deformation gradients of awake cells and the means of coarse tets.
    pub(crate) fn each_gradient(&self, own: &HybridState, x: &[DVec3], each: &mut dyn FnMut(&DMat3, Law, usize)) {
        let materials = self.materials();
        let patch = self.patch_of(own).0;
        patch.each_gradient(&self.field(x), &mut |f, tet| each(f, materials.of(tet).law, tet));
    }

    /// Returns momentum (kg m/s) and angular momentum about the origin (kg m²/s).
    pub fn momentum(&self, own: &HybridState, state: &MechanicalState) -> (DVec3, DVec3) {
        let active = self.patch_of(own).1;
        let (at, rate) = (self.field(&state.x), self.field(&state.v));
        let mass_matrix = MassMatrix::new(&self.partition, &self.masses, &active);
        let of_nodes = mass_matrix.momenta(&rate.nodes);
        let of_particles = rate.particles.iter().zip(mass_matrix.particle_kg()).map(|(w, m)| *w * *m);
        let pairs = at.nodes.iter().chain(&at.particles).zip(of_nodes.into_iter().chain(of_particles));
        pairs.fold((DVec3::ZERO, DVec3::ZERO), |(linear, angular), (x, p)| (linear + p, angular + x.cross(p)))
    }
}
