//! What a hybrid body is as a kind of body.
use super::{HybridBody, HybridSpec, HybridState, coarse_modes::CoarseModes, trilinear_point::TrilinearPoint};
use crate::{
    elements::{natural_modes::ModesError, solid::Solid},
    hash::{Chain, Fnv},
    material::Law,
    mesh::{Surface, TetMesh},
    settings::PrescribedSpec,
    tick::{
        AwakeFor, BodyKind, Energies, Environment, KindSpec, MaterialPoint, MechanicalState, NaturalBand, NodeMasses,
        PointForce, RestBound,
    },
};
use glam::{DMat3, DVec3};
use std::fmt::Write;

impl KindSpec for HybridSpec {
    fn solid(&self) -> Option<&Solid> {
        Some(&self.coarse)
    }

    fn solid_mut(&mut self) -> Option<&mut Solid> {
        Some(&mut self.coarse)
    }
}

impl BodyKind for HybridBody {
    type State = HybridState;

    /// Of the coarse level's nodes, with those in the middle of its edges.
    fn rest_positions_m(&self) -> &[DVec3] {
        self.rest_positions_m()
    }

    fn mass_kg(&self) -> &[f64] {
        &self.masses().node_kg
    }

    /// Lumped masses sum to more where particles are outside the coarse tets.
    fn total_mass_kg(&self) -> f64 {
        self.masses().particle_kg.iter().sum()
    }

    fn max_natural_frequency_rad_per_s(&self) -> f64 {
        self.max_natural_frequency_rad_per_s()
    }

    fn energies(&self, gravity_m_per_s2: DVec3, own: &HybridState, state: &MechanicalState) -> Energies {
        self.energies(gravity_m_per_s2, own, state)
    }

    fn fingerprint_into(&self, hash: &mut Fnv) {
        // A float prints as the shortest text that reads back to its bits. Writing to the hash cannot fail.
        let _ =
            write!(hash, "hybrid {:?}", (self.coarse(), self.materials(), &self.densities_kg_per_m3, self.particles()));
    }

    /// The coarse level's.
    fn tets(&self) -> Option<&TetMesh> {
        Some(self.coarse())
    }

    fn surface_rest_positions_m(&self) -> &[DVec3] {
        self.skin_rest_m()
    }

    fn particle_count(&self) -> usize {
        self.partition().particle_count()
    }

    fn most_awake_particles(&self) -> usize {
        self.particles().most_active
    }

    fn particle_spacing_m(&self) -> f64 {
        self.particles().spacing_m
    }

    fn particles_that_never_wake(&self) -> usize {
        self.embedding().outside
    }

    fn most_positions(&self) -> usize {
        self.most_positions()
    }

    fn can_be_judged(&self) -> bool {
        true
    }

    /// Each vertex is worked out from some particles.
    fn surface_into_m(&self, surface: &Surface, own: &HybridState, state: &MechanicalState, into_m: &mut Vec<DVec3>) {
        into_m.extend((0..surface.nodes.len() as u32).map(|vertex| self.vertex_m(vertex, own.ids(), &state.x)));
    }

    /// As the particles around the point have gone.
    fn displacement_m(&self, own: &HybridState, state: &MechanicalState, point: &MaterialPoint) -> DVec3 {
        let at = TrilinearPoint::new(self.partition(), point.rest_m);
        let moved_m = |particle: u32| self.particle_moved_m(particle, own.ids(), &state.x);
        at.particles.into_iter().zip(at.weights).map(|(particle, w)| moved_m(particle) * w).sum()
    }

    /// Of the coarse level, which moves alone while all particles sleep, with its own lumped masses.
    fn rest_bound(&self, _: &Surface) -> Result<Option<RestBound>, ModesError> {
        let CoarseModes { lowest_rad_per_s, unfelt } = self.coarse_modes()?;
        let highest_rad_per_s = self.coarse_frequency_rad_per_s();
        let band = NaturalBand { lowest_rad_per_s, highest_rad_per_s, left_out: unfelt };
        Ok(Some(RestBound::new(self.node_masses(), band, self.materials().materials)))
    }

    /// No vertex of the skin goes farther than the farthest node, times its amplification. What is left of the transition force fades: it is
    /// as if its opposite came from one side.
    fn distance_from_rest_m(&self, bound: &RestBound, own: &HybridState, state: &MechanicalState) -> f64 {
        if !own.is_settled() {
            return f64::INFINITY;
        }
        let force_n = |node: usize| state.force_n[node] + own.long_steps.beyond_of(node);
        let left_n = |node: usize| own.transition_force_n.get(node).copied().unwrap_or_default();
        let moving_m = bound.distance_m(self.node_masses(), force_n, |node| state.v[node]);
        let fading_m = bound.distance_m(self.node_masses(), left_n, |_| DVec3::ZERO);
        self.amplification().max(1.0) * (moving_m + fading_m)
    }

    fn awake_for(
        &self,
        environment: &Environment,
        own: &HybridState,
        load_factors: &[f64],
        points: &[PointForce],
    ) -> Option<AwakeFor> {
        Some(self.awake_for(environment, own, load_factors, points))
    }

    /// Of the awake cells, and the coarse tets' means.
    fn each_gradient(&self, own: &HybridState, x: &[DVec3], each: &mut dyn FnMut(&DMat3, Law, usize)) {
        self.each_gradient(own, x, each);
    }

    fn chain_inverse_mass(&self, _: &[PrescribedSpec], chain: &mut Chain) {
        chain.vectors(self.inverse_mass_per_kg());
    }
}

impl HybridBody {
    fn node_masses(&self) -> NodeMasses<'_> {
        NodeMasses { mass_kg: &self.masses().node_kg, inverse_mass_per_kg: self.inverse_mass_per_kg() }
    }
}
