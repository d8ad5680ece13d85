//! What a kind of body is: what it is built from, what its rest state fixes, what a tick changes of it, and how it is stepped.
//!
//! A kind implements these four traits in its folder (`kind.rs`, and `stepped.rs` for [`Stepped`]); `bodies/mod.rs` registers it. What only some kinds have is answered
//! by a default here, which says what it means to have none.
use super::{
    AwakeFor, Energies, Environment, Evaluation, Judged, MaterialPoint, MechanicalState, PointForce, PrescribedNodes,
    RestBound, Tick, free_inverse_mass,
};
use crate::{
    contact::{ContactScratch, SubstepTime},
    elements::{natural_modes::ModesError, solid::Solid},
    hash::{Chain, Fnv},
    material::Law,
    mesh::{Surface, TetMesh},
    settings::PrescribedSpec,
};
use glam::{DMat3, DVec3};

/// What a kind of body is built from.
pub(crate) trait KindSpec {
    /// The tets, of whatever level, with their materials.
    fn solid(&self) -> Option<&Solid> {
        None
    }

    /// The same, to be changed.
    fn solid_mut(&mut self) -> Option<&mut Solid> {
        None
    }
}

/// What the rest state of a kind of body fixes, and what that tells about a state. Constant after load.
pub(crate) trait BodyKind {
    /// What a tick changes of it beside [`MechanicalState`].
    type State;

    /// Rest positions (m) of the nodes that masses and constraints are of.
    fn rest_positions_m(&self) -> &[DVec3];

    /// Lumped mass (kg) of every node.
    fn mass_kg(&self) -> &[f64];

    /// Mass (kg) of the body.
    fn total_mass_kg(&self) -> f64 {
        self.mass_kg().iter().sum()
    }

    /// Largest natural frequency (rad/s) at rest with its constraints, or a bound on it: for people to read.
    fn max_natural_frequency_rad_per_s(&self) -> f64;

    /// What the body holds now, with the ledger's work and dissipation. Held nodes that move have kinetic energy, too.
    fn energies(&self, gravity_m_per_s2: DVec3, own: &Self::State, state: &MechanicalState) -> Energies;

    /// Writes what it was built from into a hash, so that a state goes back only into the body it came from.
    fn fingerprint_into(&self, hash: &mut Fnv);

    /// Its tetrahedra at rest, of whatever level.
    fn tets(&self) -> Option<&TetMesh> {
        None
    }

    /// The tets that fill it by themselves.
    fn filling_tets(&self) -> Option<&Solid> {
        None
    }

    /// Rest positions (m) of what the surface's nodes are numbered by.
    fn surface_rest_positions_m(&self) -> &[DVec3] {
        self.rest_positions_m()
    }

    /// Particles, awake or not.
    fn particle_count(&self) -> usize {
        0
    }

    /// Most particles awake at once.
    fn most_awake_particles(&self) -> usize {
        0
    }

    /// How far particles are apart (m); 0 where there are none.
    fn particle_spacing_m(&self) -> f64 {
        0.0
    }

    /// Particles that never wake because no tetrahedron of the coarse level holds them.
    fn particles_that_never_wake(&self) -> usize {
        0
    }

    /// Most points awake at once: particles, or the nodes of springs.
    fn most_awake_points(&self) -> usize {
        self.most_awake_particles()
    }

    /// The most positions that a state of it ever has.
    fn most_positions(&self) -> usize {
        self.rest_positions_m().len()
    }

    /// Whether its steps book work and dissipation, so that the ledger can be balanced.
    fn books_energy(&self) -> bool {
        true
    }

    /// Whether it has a scheme of time integration of its own, whatever the settings ask for ([`Stepped::run_own_scheme`]).
    fn has_own_scheme(&self) -> bool {
        false
    }

    /// Whether leapfrog's step of it can be judged ([`Stepped::judged`]).
    fn can_be_judged(&self) -> bool {
        false
    }

    /// The constants of the bound on how far it is from rest; `None` of kinds that never sleep as a whole.
    ///
    /// # Errors
    /// A body that is not held, or whose lowest mode is not found.
    fn rest_bound(&self, _: &Surface) -> Result<Option<RestBound>, ModesError> {
        Ok(None)
    }

    /// A bound (m) on how far any of it is from rest, now and later, while nothing that acts on it changes; infinite while anything of it
    /// changes by itself.
    fn distance_from_rest_m(&self, _: &RestBound, _: &Self::State, _: &MechanicalState) -> f64 {
        f64::INFINITY
    }

    /// Writes where each vertex of the surface is (m).
    fn surface_into_m(&self, surface: &Surface, _: &Self::State, state: &MechanicalState, into_m: &mut Vec<DVec3>) {
        into_m.extend(surface.nodes.iter().map(|&node| state.x[node as usize]));
    }

    /// How far (m) a point of the material has gone from rest.
    fn displacement_m(&self, _: &Self::State, state: &MechanicalState, point: &MaterialPoint) -> DVec3 {
        point.of(&state.x) - point.of(self.rest_positions_m())
    }

    /// How many of the awake particles are awake for what, where that is known.
    fn awake_for(
        &self,
        _: &Environment,
        _: &Self::State,
        _load_factors: &[f64],
        _points: &[PointForce],
    ) -> Option<AwakeFor> {
        None
    }

    /// Tells the deformation gradient of every element, its law, and the number of the tet where it is; nothing where there is no volume.
    fn each_gradient(&self, _: &Self::State, _x: &[DVec3], _each: &mut dyn FnMut(&DMat3, Law, usize)) {}

    /// Adds `1/m` (1/kg) of every node and axis, zero where it is prescribed.
    fn chain_inverse_mass(&self, prescribed: &[PrescribedSpec], chain: &mut Chain) {
        // A node that is prescribed twice is refused when the model is built.
        chain.vectors(&free_inverse_mass(self.mass_kg(), prescribed).unwrap_or_default());
    }

    /// Adds constants of its rest state that no function of this trait tells, to the hash by which runs are compared bit by bit.
    fn chain(&self, _: &mut Chain) {}
}

/// What a tick changes of a kind of body beside [`MechanicalState`].
pub(crate) trait KindState {
    /// The body it is of.
    type Body;

    /// At rest.
    fn at_rest(body: &Self::Body, environment: &Environment) -> Self;

    /// Goes back to rest, in the buffers it has.
    fn reset(&mut self, body: &Self::Body);

    /// Copies another state of the same body. Allocates nothing.
    fn copy_from(&mut self, other: &Self);

    /// Whether it may be a state of a body: for states that come from elsewhere. Lengths and numbers of [`MechanicalState`] were looked at.
    fn fits(&self, body: &Self::Body, environment: &Environment, state: &MechanicalState) -> bool;

    /// Adds all of it.
    fn chain(&self, chain: &mut Chain);

    /// The nodes, ascending, whose positions a state has, where it does not have all nodes'.
    fn awake_nodes(&self) -> Option<&[u32]> {
        None
    }

    /// The particles, ascending, whose positions follow the nodes' in a state.
    fn active_particles(&self) -> &[u32] {
        &[]
    }

    /// Wakes these particles in a body at rest. There must be room for them, and they must be such as may wake. What samples of tools'
    /// axes keep awake from now on is about these rest positions (m), where any are given.
    fn wake_at_rest(&mut self, _ids: &[u32], _middles_m: &[Option<DVec3>], _state: &mut MechanicalState) {}

    /// Refines so many rings around vertices and nothing else, where that is done by hand.
    fn refine_only(&mut self, _body: &Self::Body, _centres: &[u32], _rings: u32) {}

    /// How many particles are awake.
    fn awake_particles(&self) -> usize {
        self.active_particles().len()
    }

    /// Positions (m) of the awake particles.
    fn awake_particles_m<'a>(&'a self, state: &'a MechanicalState) -> &'a [DVec3] {
        &state.x[state.x.len() - self.active_particles().len()..]
    }

    /// Whether its own numbers are finite; those of [`MechanicalState`] are looked at with everybody's.
    fn is_finite(&self) -> bool {
        true
    }

    /// Vectors that a hash of positions and velocities is of, beside those of [`MechanicalState`].
    fn vectors(&self) -> Box<dyn Iterator<Item = &DVec3> + '_> {
        Box::new(std::iter::empty())
    }
}

/// A body with its own state and buffers, while it is stepped.
pub(crate) trait Stepped<'a> {
    /// Overwrites `external_n`, what contact, loads and injections do (N), and `force_n`, the sum of that, weight and internal forces, at the
    /// present positions; `force_is_current` is true then. The integrator moves the positions.
    fn evaluate(
        &mut self,
        tick: &Tick<'_>,
        now: &Evaluation,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    );

    /// Gives a half or whole kick of length `h_s` (s): `v ← (v e^{−c h/2} + h f/m) e^{−c h/2}` with the mass damping `c` (1/s), and books it: the work of
    /// external forces and of what holds nodes, and what damping takes. [`super::lumped::LumpedMass`] does all of it for masses at nodes.
    fn kick(&mut self, environment: &Environment, state: &mut MechanicalState, h_s: f64, ends_long_step: bool);

    /// The force (N) that holds a node on its prescribed axes, its weight included: what the other forces lack. Zero on free axes.
    fn reaction_n(&self, node: usize, state: &MechanicalState) -> DVec3;

    /// Moves reactions (N) at nodes that only the body knows of to those of the regions that are held.
    fn move_reactions_to_faces(&self, _reactions_n: &mut [DVec3]) {}

    /// Comes before a tick: what is to wake or to fall asleep, to be refined or coarse, goes on its way. Allocates nothing.
    fn prepare(&mut self, _environment: &Environment, _state: &mut MechanicalState, _forces: &[PointForce]) {}

    /// Wakes these particles and no others, if there are particles.
    fn wake_only(&mut self, _: &Environment, _: &mut MechanicalState, _particles: &mut dyn Iterator<Item = u32>) {}

    /// Comes before the first kick of a tick.
    fn begin_kicks(&mut self) {}

    /// What leapfrog's step is judged by; `None` of bodies that step themselves.
    fn judged(&mut self) -> Option<&mut dyn Judged> {
        None
    }

    /// The nodes that prescribed sets move, or only hold; `None` where no set may move any.
    fn prescribed_nodes(&self) -> Option<PrescribedNodes<'a>> {
        None
    }

    /// Kinetic energy (J) that velocities of held axes have beside what lumped masses give them.
    fn held_kinetic_j(&self, _: &MechanicalState) -> f64 {
        0.0
    }

    /// Whether it may sleep on as a whole: nothing of it has woken.
    fn sleeps_on(&self) -> bool {
        true
    }

    /// Whether no tool is within a quarter of its radius of the surface. Contact's lists must be of the present positions.
    fn is_apart(&mut self, environment: &Environment, state: &MechanicalState) -> bool {
        environment.contact.is_apart(&state.x, &state.tools, &state.contact)
    }

    /// Moves the tools through a substep in which the body stands still. Stops and returns false as soon as one is near the surface.
    fn tools_stay_apart(
        &mut self,
        environment: &Environment,
        time: &SubstepTime,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) -> bool {
        environment.contact.substep_apart(&state.x, time, &mut state.tools, &mut state.contact, contact)
    }

    /// Runs all substeps of a tick, of a body with a scheme of its own ([`BodyKind::has_own_scheme`]).
    fn run_own_scheme(&mut self, _: &Tick<'_>, _: &mut MechanicalState, _: &mut ContactScratch) {}

    /// Keeps what quarantine goes back to, beside [`MechanicalState`].
    fn keep_last_good(&mut self) {}

    /// Goes back, in quarantine, to what was kept, at rest.
    fn stop_at_last_good(&mut self) {}

    /// Whether its own numbers are finite.
    fn is_finite(&self) -> bool {
        true
    }

    /// The number by which users know the node at a place of [`MechanicalState::x`].
    fn node_at(&self, place: u32) -> Option<u32> {
        Some(place)
    }
}
