//! What a mass-spring surface is as a kind of body.
use super::{MassSpringBody, MassSpringSpec, MassSpringState};
use crate::{
    hash::{Chain, Fnv},
    mesh::Surface,
    tick::{BodyKind, Energies, KindSpec, MaterialPoint, MechanicalState},
};
use glam::DVec3;
use std::fmt::Write;

impl KindSpec for MassSpringSpec {}

impl BodyKind for MassSpringBody {
    type State = MassSpringState;

    /// Of the coarse vertices.
    fn rest_positions_m(&self) -> &[DVec3] {
        self.rest_positions_m()
    }

    fn mass_kg(&self) -> &[f64] {
        &self.model().spec().mass_kg
    }

    fn max_natural_frequency_rad_per_s(&self) -> f64 {
        self.model().frequency_rad_per_s()
    }

    fn energies(&self, gravity_m_per_s2: DVec3, own: &MassSpringState, state: &MechanicalState) -> Energies {
        self.energies(gravity_m_per_s2, own, state)
    }

    fn fingerprint_into(&self, hash: &mut Fnv) {
        // Writing to the hash cannot fail.
        let _ = write!(hash, "mass-spring {}", self.fingerprint());
    }

    /// Of the vertices of the surface refined everywhere.
    fn surface_rest_positions_m(&self) -> &[DVec3] {
        self.model().rest_m()
    }

    fn most_awake_points(&self) -> usize {
        self.most_positions()
    }

    fn most_positions(&self) -> usize {
        self.model().most_nodes()
    }

    fn can_be_judged(&self) -> bool {
        true
    }

    fn surface_into_m(
        &self,
        surface: &Surface,
        own: &MassSpringState,
        state: &MechanicalState,
        into_m: &mut Vec<DVec3>,
    ) {
        let vertices = 0..surface.nodes.len() as u32;
        into_m.extend(vertices.map(|vertex| self.vertex_m(&own.motion, vertex, &state.x)));
    }

    fn displacement_m(&self, own: &MassSpringState, state: &MechanicalState, point: &MaterialPoint) -> DVec3 {
        let rest_m = self.model().rest_m();
        let moved = |vertex: u32| self.vertex_m(&own.motion, vertex, &state.x) - rest_m[vertex as usize];
        let weighty = point.nodes.iter().zip(point.weights).filter(|(_, w)| *w != 0.0);
        weighty.map(|(&vertex, w)| moved(vertex) * w).sum()
    }

    fn chain(&self, chain: &mut Chain) {
        let spec = self.model().spec();
        chain.reals(&spec.mass_kg);
        for constants in [spec.coarse, spec.fine] {
            chain.real(constants.mesh_n_per_m);
            chain.real(constants.anchor_n_per_m);
        }
        chain.wholes(&spec.held);
    }
}
