//! What a tick changes of a body beside what every body has, whichever kind it is.
use super::{
    Body, BodyState, hybrid::HybridState, mass_spring::MassSpringState, of_both, of_kind, seed::SeedBodyState,
};
use crate::{
    hash::Chain,
    tick::{Environment, KindState, MechanicalState},
};
use glam::DVec3;

impl BodyState {
    /// Positions (m) at rest, of what is awake then.
    pub(crate) fn rest_m<'a>(&'a self, body: &'a Body) -> impl ExactSizeIterator<Item = DVec3> + 'a {
        let rest_m = body.rest_positions_m();
        let awake = self.awake_nodes();
        let count = awake.map_or(rest_m.len(), <[u32]>::len);
        (0..count).map(move |place| rest_m[awake.map_or(place, |ids| ids[place] as usize)])
    }

    /// Goes back to rest, in the buffers it has.
    pub(crate) fn reset(&mut self, body: &Body) {
        of_both!(BodyState, self, Body, body, (own, body) => KindState::reset(&mut **own, body), else ());
    }

    /// Wakes these particles in a body at rest. There must be room for them, and they must be such as may wake; other bodies have none.
    pub(crate) fn wake_at_rest(&mut self, ids: &[u32], middles_m: &[Option<DVec3>], state: &mut MechanicalState) {
        of_kind!(BodyState, self, own => KindState::wake_at_rest(&mut **own, ids, middles_m, state));
    }

    /// Refines so many rings around vertices and nothing else, of a body that is refined by hand; others are not refined.
    pub(crate) fn refine_only(&mut self, body: &Body, centres: &[u32], rings: u32) {
        of_both!(BodyState, self, Body, body, (own, body) => {
            KindState::refine_only(&mut **own, body, centres, rings);
        }, else ());
    }

    /// Copies another state of the same body. Allocates nothing.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        of_both!(BodyState, self, BodyState, other, (own, other) => KindState::copy_from(&mut **own, other), else ());
    }

    /// Whether it may be a state of a body, beside one of what every body has: for states that come from elsewhere.
    pub(crate) fn fits(&self, body: &Body, environment: &Environment, state: &MechanicalState) -> bool {
        of_both!(BodyState, self, Body, body, (own, body) => {
            KindState::fits(&**own, body, environment, state)
        }, else false)
    }

    /// Adds all of it.
    pub(crate) fn chain(&self, chain: &mut Chain) {
        of_kind!(BodyState, self, own => KindState::chain(&**own, chain));
    }

    /// How many positions a state of the body has.
    pub(crate) fn positions(&self, body: &Body) -> usize {
        self.awake_nodes().map_or_else(|| body.rest_positions_m().len() + self.active_particles().len(), <[u32]>::len)
    }

    /// Whether another is of the same kind of body.
    pub(crate) fn is_alike(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }

    /// How many of a state's positions are of nodes that are always there.
    pub(crate) fn always_there(&self, positions: usize) -> Option<usize> {
        positions.checked_sub(self.awake_nodes().unwrap_or(self.active_particles()).len())
    }

    /// Whether numbers that are looked at with nobody else's are finite.
    pub(crate) fn is_finite(&self) -> bool {
        of_kind!(BodyState, self, own => own.is_finite())
    }

    /// Vectors that a hash of positions and velocities is of, beside those of [`MechanicalState`].
    pub(crate) fn vectors(&self) -> Box<dyn Iterator<Item = &DVec3> + '_> {
        of_kind!(BodyState, self, own => KindState::vectors(&**own))
    }

    /// The nodes, ascending, whose positions a state has, where it does not have all nodes'.
    fn awake_nodes(&self) -> Option<&[u32]> {
        of_kind!(BodyState, self, own => own.awake_nodes())
    }

    /// Particles of the lattice that are active, ascending; none of other bodies.
    pub fn active_particles(&self) -> &[u32] {
        of_kind!(BodyState, self, own => own.active_particles())
    }

    /// How many particles are awake.
    pub fn awake_particles(&self) -> usize {
        of_kind!(BodyState, self, own => own.awake_particles())
    }

    /// Positions (m) of the awake particles.
    pub(crate) fn awake_particles_m<'a>(&'a self, state: &'a MechanicalState) -> &'a [DVec3] {
        of_kind!(BodyState, self, own => own.awake_particles_m(state))
    }

    /// A hybrid body's part.
    pub fn as_hybrid(&self) -> Option<&HybridState> {
        if let Self::Hybrid(own) = self { Some(own) } else { None }
    }

    /// A mass-spring surface's part.
    pub fn as_mass_spring(&self) -> Option<&MassSpringState> {
        if let Self::MassSpring(own) = self { Some(own) } else { None }
    }

    /// A seed body's part.
    pub fn as_seed(&self) -> Option<&SeedBodyState> {
        if let Self::Seed(own) = self { Some(own) } else { None }
    }

    /// A seed body's part, to be changed by hand.
    pub fn as_seed_mut(&mut self) -> Option<&mut SeedBodyState> {
        if let Self::Seed(own) = self { Some(own) } else { None }
    }
}
