//! A body with its own state and buffers, while it is stepped: the one place where a tick asks which kind it is.
use super::{
    Body, BodyScratch, BodyState, hybrid::SteppedHybrid, mass_spring::SteppedMassSpring, seed::SteppedSeed,
    tet::SteppedTet,
};
use crate::{
    contact::ContactScratch,
    tick::{Environment, Evaluation, Judged, MechanicalState, PointForce, PrescribedNodes, Tick},
};
use glam::DVec3;

/// A body with its own state and buffers.
#[derive(Debug)]
pub(crate) enum SteppedBody<'a> {
    Tet(SteppedTet<'a>),
    Hybrid(SteppedHybrid<'a>),
    MassSpring(SteppedMassSpring<'a>),
    Seed(SteppedSeed<'a>),
}

impl<'a> SteppedBody<'a> {
    /// `None`: state or buffers are of another kind of body.
    pub(crate) fn of(body: &'a Body, own: &'a mut BodyState, scratch: &'a mut BodyScratch) -> Option<Self> {
        Some(match (body, own, scratch) {
            (Body::Tet(body), BodyState::Tet, BodyScratch::Tet(scratch)) => Self::Tet(SteppedTet { body, scratch }),
            (Body::Hybrid(body), BodyState::Hybrid(own), BodyScratch::Hybrid(scratch)) => {
                Self::Hybrid(SteppedHybrid { body, own, scratch })
            }
            (Body::MassSpring(body), BodyState::MassSpring(own), BodyScratch::MassSpring(scratch)) => {
                Self::MassSpring(SteppedMassSpring { body, own, scratch })
            }
            (Body::Seed(body), BodyState::Seed(own), BodyScratch::Seed(scratch)) => {
                Self::Seed(SteppedSeed { body, own, scratch })
            }
            _ => return None,
        })
    }

    /// Before a tick: what is to wake or to fall asleep, to be refined or coarse, goes on its way. Allocates nothing.
    pub(crate) fn prepare(&mut self, environment: &Environment, state: &mut MechanicalState, forces: &[PointForce]) {
        match self {
            Self::Hybrid(body) => body.prepare(environment, state),
            Self::MassSpring(body) => body.prepare(environment, state, forces),
            Self::Tet(_) | Self::Seed(_) => {}
        }
    }

    /// Wakes these particles and no others, if there are particles.
    pub(crate) fn wake_only(
        &mut self,
        environment: &Environment,
        state: &mut MechanicalState,
        particles: impl IntoIterator<Item = u32>,
    ) {
        if let Self::Hybrid(body) = self {
            body.wake_only(environment, state, particles);
        }
    }

    /// Total force (N) at the present positions, and its external part.
    pub(crate) fn evaluate(
        &mut self,
        tick: &Tick<'_>,
        now: &Evaluation,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) {
        match self {
            Self::Tet(body) => body.evaluate(tick, now, state, contact),
            Self::Hybrid(body) => body.evaluate(tick, now, state, contact),
            Self::MassSpring(body) => body.evaluate(tick, now, state, contact),
            Self::Seed(body) => body.evaluate(tick, now, state, contact),
        }
    }

    /// Forces at the start of a tick, unless the last tick left them.
    pub(crate) fn make_force_current(
        &mut self,
        tick: &Tick<'_>,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) {
        if !state.force_is_current {
            state.contact.forget_untracked_geometry();
            self.evaluate(tick, &Evaluation::at_start(), state, contact);
        }
    }

    /// Before the first kick of a tick.
    pub(crate) fn begin_kicks(&mut self) {
        if let Self::Hybrid(body) = self {
            body.begin_kicks();
        }
    }

    /// A half or whole kick of length `h_s` (s).
    pub(crate) fn kick(
        &mut self,
        environment: &Environment,
        state: &mut MechanicalState,
        h_s: f64,
        ends_long_step: bool,
    ) {
        match self {
            Self::Tet(body) => body.kick(environment, state, h_s),
            Self::Hybrid(body) => body.kick(environment, state, h_s, ends_long_step),
            Self::MassSpring(body) => body.kick(environment, state, h_s),
            // Its own steps move it.
            Self::Seed(_) => {}
        }
    }

    /// All substeps of a tick, of a body with a scheme of its own ([`Body::has_own_scheme`]).
    pub(crate) fn run_own_scheme(
        &mut self,
        tick: &Tick<'_>,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) {
        if let Self::Seed(body) = self {
            body.run(tick, state, contact);
        }
    }

    /// What leapfrog's step is judged by; `None` of bodies whose step is never too long.
    ///
    /// A mass-spring surface's step is stable at any stretch, and the seeds' schemes run as their authors describe them.
    pub(crate) fn judged(&mut self) -> Option<&mut dyn Judged> {
        match self {
            Self::Tet(body) => Some(body),
            Self::Hybrid(body) => Some(body),
            Self::MassSpring(_) | Self::Seed(_) => None,
        }
    }

    /// The nodes that prescribed sets move; `None` where what they hold stands still.
    pub(crate) fn prescribed_nodes(&self) -> Option<PrescribedNodes<'a>> {
        match self {
            Self::Tet(SteppedTet { body, .. }) => Some(body.prescribed_nodes()),
            Self::Hybrid(SteppedHybrid { body, .. }) => Some(body.prescribed_nodes()),
            Self::MassSpring(_) | Self::Seed(_) => None,
        }
    }

    /// Kinetic energy (J) that velocities of held axes have beside what lumped masses give them.
    pub(crate) fn held_kinetic_j(&self, state: &MechanicalState) -> f64 {
        if let Self::Hybrid(body) = self { body.held_kinetic_j(state) } else { 0.0 }
    }

    /// The force (N) that holds a node on its prescribed axes: what the other forces lack.
    pub(crate) fn reaction_n(&self, node: usize, state: &MechanicalState) -> DVec3 {
        match self {
            Self::Tet(body) => body.reaction_n(node, state),
            Self::Hybrid(body) => body.reaction_n(node, state),
            Self::MassSpring(body) => body.reaction_n(node, state),
            Self::Seed(body) => body.reaction_n(node, state),
        }
    }

    /// Keeps what quarantine goes back to, beside [`MechanicalState`].
    pub(crate) fn keep_last_good(&mut self) {
        if let Self::Seed(body) = self {
            body.keep_last_good();
        }
    }

    /// In quarantine: goes back to what was kept, at rest.
    pub(crate) fn stop_at_last_good(&mut self) {
        match self {
            Self::Hybrid(body) => body.own.long_steps.forget(),
            Self::Seed(body) => body.stop_at_last_good(),
            Self::Tet(_) | Self::MassSpring(_) => {}
        }
    }

    /// Whether numbers that are looked at with nobody else's are finite.
    pub(crate) fn is_finite(&self) -> bool {
        if let Self::Seed(body) = self { body.own.particles_are_finite() } else { true }
    }

    /// The number by which users know the node at a place of [`MechanicalState::x`].
    pub(crate) fn node_at(&self, place: u32) -> Option<u32> {
        if let Self::MassSpring(body) = self { body.node_at(place) } else { Some(place) }
    }
}
