//! What a tick changes of a body beside what every body has, and the buffers that it works in.
use super::{
    Body,
    hybrid::{HybridScratch, HybridState},
    mass_spring::{MassSpringScratch, MassSpringState},
    seed::{SeedBodyScratch, SeedBodyState},
    tet::TetScratch,
};
use crate::tick::{Environment, MechanicalState};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What a tick changes of a body beside [`MechanicalState`], by its kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum BodyState {
    /// Of tetrahedra there is nothing more.
    Tet,
    /// Which particles are active, their prestrain, and the transition force.
    Hybrid(Box<HybridState>),
    /// Which nodes are awake, and what is refined.
    MassSpring(Box<MassSpringState>),
    /// All that the papers' steps change; positions and velocities are copies of its nodes'.
    Seed(Box<SeedBodyState>),
}

impl BodyState {
    /// At rest.
    pub(crate) fn at_rest(body: &Body, environment: &Environment) -> Self {
        match body {
            Body::Tet(_) => Self::Tet,
            Body::Hybrid(body) => Self::Hybrid(Box::new(HybridState::at_rest(body, &environment.tools))),
            Body::MassSpring(body) => Self::MassSpring(Box::new(MassSpringState::at_rest(body))),
            Body::Seed(body) => Self::Seed(Box::new(SeedBodyState::at_rest(body.model()))),
        }
    }

    /// Positions (m) at rest, of what is awake then.
    pub(crate) fn rest_m<'a>(&'a self, body: &'a Body) -> impl ExactSizeIterator<Item = DVec3> + 'a {
        let rest_m = body.rest_positions_m();
        let awake = if let Self::MassSpring(own) = self { Some(&own.motion.ids[..]) } else { None };
        let count = awake.map_or(rest_m.len(), <[u32]>::len);
        (0..count).map(move |place| rest_m[awake.map_or(place, |ids| ids[place] as usize)])
    }

    /// Back to rest, in the buffers it has.
    pub(crate) fn reset(&mut self, body: &Body) {
        match (self, body) {
            (Self::Hybrid(own), _) => own.clear(),
            (Self::MassSpring(own), Body::MassSpring(body)) => own.reset(body),
            (Self::Seed(own), Body::Seed(body)) => own.reset(body.model()),
            _ => {}
        }
    }

    /// Goes over to these particles, which have room and may wake, of a body at rest; other bodies have none.
    pub(crate) fn wake_at_rest(&mut self, ids: &[u32], state: &mut MechanicalState) {
        if let Self::Hybrid(own) = self {
            own.wake_at_rest(ids, state);
        }
    }

    /// Refines so many rings around vertices and nothing else, of a body that is refined by hand; others are not refined.
    pub(crate) fn refine_only(&mut self, body: &Body, centres: &[u32], rings: u32) {
        if let (Self::MassSpring(own), Body::MassSpring(body)) = (self, body) {
            own.refine_only(body, centres, rings);
        }
    }

    /// Copies another state of the same body. Allocates nothing.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        match (self, other) {
            (Self::Hybrid(own), Self::Hybrid(other)) => own.copy_from(other),
            (Self::MassSpring(own), Self::MassSpring(other)) => own.copy_from(other),
            (Self::Seed(own), Self::Seed(other)) => own.copy_from(other),
            _ => {}
        }
    }

    /// Whether it may be a state of a body, beside one of what every body has: for states that come from elsewhere.
    pub(crate) fn fits(&self, body: &Body, environment: &Environment, state: &MechanicalState) -> bool {
        match (self, body) {
            (Self::Tet, Body::Tet(_)) => true,
            (Self::Hybrid(own), Body::Hybrid(body)) => own.fits(body, &environment.tools),
            (Self::MassSpring(own), Body::MassSpring(body)) => own.fits(body),
            (Self::Seed(own), Body::Seed(body)) => own.fits(body.model(), &state.x, &state.v),
            _ => false,
        }
    }

    /// How many positions a state of the body has.
    pub(crate) fn positions(&self, body: &Body) -> usize {
        match self {
            Self::Tet | Self::Seed(_) => body.rest_positions_m().len(),
            Self::Hybrid(own) => body.rest_positions_m().len() + own.len(),
            Self::MassSpring(own) => own.motion.ids.len(),
        }
    }

    /// Whether another is of the same kind of body.
    pub(crate) fn is_alike(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }

    /// How many of a state's positions are of nodes that are always there.
    pub(crate) fn always_there(&self, positions: usize) -> Option<usize> {
        match self {
            Self::Tet | Self::Seed(_) => Some(positions),
            Self::Hybrid(own) => positions.checked_sub(own.len()),
            Self::MassSpring(own) => positions.checked_sub(own.motion.ids.len()),
        }
    }

    /// Whether numbers that are looked at with nobody else's are finite.
    pub(crate) fn is_finite(&self) -> bool {
        if let Self::Seed(own) = self { own.particles_are_finite() } else { true }
    }

    /// Vectors that a hash of positions and velocities is of, beside those of [`MechanicalState`].
    pub(crate) fn vectors(&self) -> impl Iterator<Item = &DVec3> {
        let seed = if let Self::Seed(own) = self { Some(own) } else { None };
        seed.into_iter().flat_map(|own| own.vectors())
    }

    /// Particles of the lattice that are active, ascending; none of other bodies.
    pub fn active_particles(&self) -> &[u32] {
        if let Self::Hybrid(own) = self { own.ids() } else { &[] }
    }

    /// Particles that are awake.
    pub fn awake_particles(&self) -> usize {
        match self {
            Self::Hybrid(own) => own.len(),
            Self::Seed(own) => own.awake as usize,
            Self::Tet | Self::MassSpring(_) => 0,
        }
    }

    /// Positions (m) of the awake particles.
    pub(crate) fn awake_particles_m<'a>(&'a self, state: &'a MechanicalState) -> &'a [DVec3] {
        match self {
            Self::Hybrid(own) => &state.x[state.x.len() - own.len()..],
            Self::Seed(own) => &own.now.particles.x[..own.awake as usize],
            Self::Tet | Self::MassSpring(_) => &[],
        }
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

/// Buffers of a body's steps, sized once.
#[derive(Debug, Clone)]
pub(crate) enum BodyScratch {
    Tet(Box<TetScratch>),
    Hybrid(Box<HybridScratch>),
    MassSpring(Box<MassSpringScratch>),
    Seed(Box<SeedBodyScratch>),
}

impl BodyScratch {
    /// For a body in its environment.
    pub(crate) fn new(body: &Body, environment: &Environment) -> Self {
        match body {
            Body::Tet(body) => Self::Tet(Box::new(TetScratch::new(body, environment))),
            Body::Hybrid(body) => Self::Hybrid(Box::new(HybridScratch::new(body, environment))),
            Body::MassSpring(body) => Self::MassSpring(Box::new(MassSpringScratch::new(body))),
            Body::Seed(body) => Self::Seed(Box::new(SeedBodyScratch::new(body.model()))),
        }
    }
}
