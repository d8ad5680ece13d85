//! What the papers' hybrid is as a kind of body.
use super::{SeedBody, SeedBodySpec, SeedBodyState, layer::Layer};
use crate::{
    elements::solid::Solid,
    hash::{Chain, Fnv},
    material::Law,
    mesh::TetMesh,
    settings::PrescribedSpec,
    tick::{BodyKind, Energies, KindSpec, MechanicalState},
};
use glam::{DMat3, DVec3};
use std::fmt::Write;

impl KindSpec for SeedBodySpec {
    fn solid(&self) -> Option<&Solid> {
        Some(&self.core)
    }

    fn solid_mut(&mut self) -> Option<&mut Solid> {
        Some(&mut self.core)
    }
}

impl BodyKind for SeedBody {
    type State = SeedBodyState;

    /// Of the core and then its skin.
    fn rest_positions_m(&self) -> &[DVec3] {
        self.rest_positions_m()
    }

    fn mass_kg(&self) -> &[f64] {
        self.mass_kg()
    }

    fn max_natural_frequency_rad_per_s(&self) -> f64 {
        self.max_natural_frequency_rad_per_s()
    }

    fn energies(&self, _: DVec3, own: &SeedBodyState, state: &MechanicalState) -> Energies {
        self.energies(own, state)
    }

    fn fingerprint_into(&self, hash: &mut Fnv) {
        // A float prints as the shortest text that reads back to its bits. Writing to the hash cannot fail.
        let _ = write!(hash, "seed {:?}", self.spec());
    }

    /// The core's.
    fn tets(&self) -> Option<&TetMesh> {
        Some(self.mesh())
    }

    fn filling_tets(&self) -> Option<&Solid> {
        self.model().layer().is_none().then(|| self.core())
    }

    fn particle_count(&self) -> usize {
        self.model().layer().map_or(0, Layer::particle_count)
    }

    fn most_awake_particles(&self) -> usize {
        self.model().most_awake()
    }

    fn particle_spacing_m(&self) -> f64 {
        self.model().layer().map_or(0.0, |layer| layer.voxels.spacing_m)
    }

    fn books_energy(&self) -> bool {
        false
    }

    fn has_own_scheme(&self) -> bool {
        true
    }

    /// Of the core.
    fn each_gradient(&self, _: &SeedBodyState, x: &[DVec3], each: &mut dyn FnMut(&DMat3, Law, usize)) {
        for (tet, (nodes, rest)) in self.mesh().tets().iter().zip(self.model().core().rest_tets()).enumerate() {
            each(&rest.gradient_of(&nodes.map(|n| x[n as usize])), Law::StVenantKirchhoff, tet);
        }
    }

    fn chain_inverse_mass(&self, _: &[PrescribedSpec], chain: &mut Chain) {
        chain.vectors(self.inverse_mass_per_kg());
    }
}
