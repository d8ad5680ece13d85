//! What a body answers, whichever kind it is.
use super::{
    Body, BodyScratch, BodyState, MaterialPoint, hybrid::HybridBody, mass_spring::MassSpringBody, of_both, of_kind,
    seed::SeedBody, tet::TetBody,
};
use crate::{
    elements::{natural_modes::ModesError, solid::Solid},
    hash::{Chain, Fnv},
    material::Law,
    mesh::TetMesh,
    settings::PrescribedSpec,
    tick::{AwakeFor, BodyKind, Energies, Environment, MechanicalState, PointForce, RestBound},
};
use glam::{DMat3, DVec3};

impl Body {
    /// The body of tetrahedra, if it is one.
    pub fn as_tet(&self) -> Option<&TetBody> {
        if let Self::Tet(body) = self { Some(body) } else { None }
    }

    /// The hybrid body, if it is one.
    pub fn as_hybrid(&self) -> Option<&HybridBody> {
        if let Self::Hybrid(body) = self { Some(body) } else { None }
    }

    /// The mass-spring surface, if it is one.
    pub fn as_mass_spring(&self) -> Option<&MassSpringBody> {
        if let Self::MassSpring(body) = self { Some(body) } else { None }
    }

    /// The papers' hybrid, if it is one.
    pub fn as_seed(&self) -> Option<&SeedBody> {
        if let Self::Seed(body) = self { Some(body) } else { None }
    }

    /// Its tetrahedra at rest: all there are, the coarse level's, or the core's; none of a surface of springs.
    pub fn tets(&self) -> Option<&TetMesh> {
        of_kind!(Body, self, body => BodyKind::tets(&**body))
    }

    /// The tets that fill it by themselves; none of a body with particles, or of springs.
    pub fn filling_tets(&self) -> Option<&Solid> {
        of_kind!(Body, self, body => BodyKind::filling_tets(&**body))
    }

    /// Rest positions (m) of the nodes that masses and constraints are of: of tets, of a coarse level with its edges' middles, of coarse
    /// vertices, of a core and then its skin.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        of_kind!(Body, self, body => BodyKind::rest_positions_m(&**body))
    }

    /// Rest positions (m) of what the surface's nodes are numbered by.
    pub fn surface_rest_positions_m(&self) -> &[DVec3] {
        of_kind!(Body, self, body => BodyKind::surface_rest_positions_m(&**body))
    }

    /// Lumped mass (kg) of every node of [`Self::rest_positions_m`].
    pub fn mass_kg(&self) -> &[f64] {
        of_kind!(Body, self, body => BodyKind::mass_kg(&**body))
    }

    /// Mass (kg) of the body.
    pub fn total_mass_kg(&self) -> f64 {
        of_kind!(Body, self, body => BodyKind::total_mass_kg(&**body))
    }

    /// Largest natural frequency (rad/s) at rest.
    pub fn max_natural_frequency_rad_per_s(&self) -> f64 {
        of_kind!(Body, self, body => BodyKind::max_natural_frequency_rad_per_s(&**body))
    }

    /// Particles, awake or not.
    pub fn particle_count(&self) -> usize {
        of_kind!(Body, self, body => BodyKind::particle_count(&**body))
    }

    /// Most particles awake at once.
    pub fn most_awake_particles(&self) -> usize {
        of_kind!(Body, self, body => BodyKind::most_awake_particles(&**body))
    }

    /// Most points awake at once: particles, or the nodes of springs.
    pub fn most_awake_points(&self) -> usize {
        of_kind!(Body, self, body => BodyKind::most_awake_points(&**body))
    }

    /// Particles that never wake because no tetrahedron of the coarse level holds them.
    pub fn particles_that_never_wake(&self) -> usize {
        of_kind!(Body, self, body => BodyKind::particles_that_never_wake(&**body))
    }

    /// How far particles are apart (m); 0 where there are none.
    pub fn particle_spacing_m(&self) -> f64 {
        of_kind!(Body, self, body => BodyKind::particle_spacing_m(&**body))
    }

    /// Whether its steps book work and dissipation, so that the ledger can be balanced.
    pub fn books_energy(&self) -> bool {
        of_kind!(Body, self, body => BodyKind::books_energy(&**body))
    }

    /// The most positions that a state of it ever has.
    pub(crate) fn most_positions(&self) -> usize {
        of_kind!(Body, self, body => BodyKind::most_positions(&**body))
    }

    /// Whether it has a scheme of time integration of its own, whatever the settings ask for.
    pub(crate) fn has_own_scheme(&self) -> bool {
        of_kind!(Body, self, body => BodyKind::has_own_scheme(&**body))
    }

    /// Whether leapfrog's step of it can be judged.
    pub(crate) fn can_be_judged(&self) -> bool {
        of_kind!(Body, self, body => BodyKind::can_be_judged(&**body))
    }

    /// The constants of the bound on how far it is from rest; `None` of bodies that never sleep as a whole.
    ///
    /// # Errors
    /// A body that is not held, or whose lowest mode is not found.
    pub(crate) fn rest_bound(&self, environment: &Environment) -> Result<Option<RestBound>, ModesError> {
        of_kind!(Body, self, body => body.rest_bound(&environment.surface))
    }

    /// A bound (m) on how far any of it is from rest, now and later, while nothing that acts on the body changes.
    pub(crate) fn distance_from_rest_m(&self, bound: &RestBound, own: &BodyState, state: &MechanicalState) -> f64 {
        of_both!(Body, self, BodyState, own, (body, own) => {
            body.distance_from_rest_m(bound, own, state)
        }, else f64::INFINITY)
    }

    /// Writes where each vertex of the surface is (m).
    pub(crate) fn surface_positions_m(
        &self,
        environment: &Environment,
        own: &BodyState,
        state: &MechanicalState,
        positions_m: &mut Vec<DVec3>,
    ) {
        positions_m.clear();
        of_both!(Body, self, BodyState, own, (body, own) => {
            body.surface_into_m(&environment.surface, own, state, positions_m);
        }, else ());
    }

    /// How far (m) a point has gone from rest; not a number where the state is of another kind.
    pub(crate) fn displacement_m(&self, own: &BodyState, state: &MechanicalState, point: &MaterialPoint) -> DVec3 {
        of_both!(Body, self, BodyState, own, (body, own) => body.displacement_m(own, state, point), else DVec3::NAN)
    }

    /// What the body holds now, beside the ledger's work and dissipation.
    pub(crate) fn energies(&self, gravity_m_per_s2: DVec3, own: &BodyState, state: &MechanicalState) -> Energies {
        of_both!(Body, self, BodyState, own, (body, own) => {
            BodyKind::energies(&**body, gravity_m_per_s2, own, state)
        }, else Energies::NAN)
    }

    /// How many of the awake particles are awake for what; `None` of bodies without particles that wake and sleep by claims.
    pub(crate) fn awake_for(
        &self,
        environment: &Environment,
        own: &BodyState,
        load_factors: &[f64],
        points: &[PointForce],
    ) -> Option<AwakeFor> {
        of_both!(Body, self, BodyState, own, (body, own) => {
            BodyKind::awake_for(&**body, environment, own, load_factors, points)
        }, else None)
    }

    /// Tells the deformation gradient of every tet, its law and its number; of a hybrid body, of the awake cells and the coarse tets' means.
    /// A surface of springs has none.
    pub(crate) fn each_gradient(&self, own: &BodyState, x: &[DVec3], each: &mut dyn FnMut(&DMat3, Law, usize)) {
        of_both!(Body, self, BodyState, own, (body, own) => BodyKind::each_gradient(&**body, own, x, each), else ());
    }

    /// Does the same with the buffers of a run that is at this state, where they have most of it ready.
    pub(crate) fn each_gradient_in(
        &self,
        own: &BodyState,
        scratch: &mut BodyScratch,
        x: &[DVec3],
        each: &mut dyn FnMut(&DMat3, Law, usize),
    ) {
        match (self, own, scratch) {
            (Self::Hybrid(body), BodyState::Hybrid(own), BodyScratch::Hybrid(scratch)) if scratch.is_of(own) => {
                scratch.each_gradient(body, x, each);
            }
            _ => self.each_gradient(own, x, each),
        }
    }

    /// Writes what it was built from into a hash, so that a state goes back only into the body it came from.
    pub(crate) fn fingerprint_into(&self, hash: &mut Fnv) {
        of_kind!(Body, self, body => body.fingerprint_into(hash));
    }

    /// Adds `1/m` (1/kg) of every node and axis, zero where it is prescribed.
    pub(crate) fn chain_inverse_mass(&self, prescribed: &[PrescribedSpec], chain: &mut Chain) {
        of_kind!(Body, self, body => body.chain_inverse_mass(prescribed, chain));
    }

    /// Adds what of its rest state no function that every body has tells.
    pub(crate) fn chain(&self, chain: &mut Chain) {
        of_kind!(Body, self, body => body.chain(chain));
    }
}
