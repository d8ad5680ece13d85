//! The registry of the kinds of body. Scenes and the daemon have one each, too: `compile/kinds/mod.rs`, `bodies/mod.rs`.
//!
//! A kind has its own folder: what it is made from, what its rest state fixes, what a tick changes of it beside
//! [`crate::tick::MechanicalState`], its buffers, and how it is stepped. It implements [`crate::tick::KindSpec`], [`crate::tick::BodyKind`],
//! [`crate::tick::KindState`] and [`crate::tick::Stepped`]; no kind knows another, nor this file. Here each has its lines: a variant of every enumeration, how its parts are made,
//! and an arm of the macros by which the enumerations answer.
mod body;
pub mod hybrid;
pub mod mass_spring;
pub mod seed;
mod spec;
mod state;
mod stepped;
pub mod tet;

pub use crate::tick::MaterialPoint;

use crate::tick::{Environment, EnvironmentSpec, KindState};
use hybrid::{HybridBody, HybridError, HybridScratch, HybridSpec, HybridState, SteppedHybrid};
use mass_spring::{
    MassSpringBody, MassSpringError, MassSpringScratch, MassSpringSpec, MassSpringState, SteppedMassSpring,
};
use seed::{SeedBody, SeedBodyScratch, SeedBodySpec, SeedBodyState, SeedError, SteppedSeed};
use serde::{Deserialize, Serialize};
use tet::{SteppedTet, TetBody, TetBodyError, TetScratch, TetSpec, TetState};
use thiserror::Error;

/// What a body is built from.
#[derive(Debug, Clone, PartialEq)]
pub enum BodySpec {
    /// Tetrahedra throughout.
    Tet(TetSpec),
    /// Coarse tetrahedra, and particles.
    Hybrid(HybridSpec),
    /// A surface of masses on springs.
    MassSpring(MassSpringSpec),
    /// The papers' own hybrid.
    Seed(SeedBodySpec),
}

/// Why a body cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum BodyError {
    /// Of tetrahedra.
    #[error(transparent)]
    Tet(#[from] TetBodyError),
    /// With particles.
    #[error(transparent)]
    Hybrid(#[from] HybridError),
    /// A mass-spring surface.
    #[error(transparent)]
    MassSpring(#[from] MassSpringError),
    /// The papers' hybrid.
    #[error(transparent)]
    Seed(#[from] SeedError),
}

/// A body: all that its rest state fixes. Constant after load.
#[derive(Debug, Clone)]
pub enum Body {
    /// Tetrahedra throughout.
    Tet(Box<TetBody>),
    /// Coarse tetrahedra throughout, and particles of which those near a contact are awake.
    Hybrid(Box<HybridBody>),
    /// A surface of masses on springs, refined where it is touched.
    MassSpring(Box<MassSpringBody>),
    /// The papers' own hybrid.
    Seed(Box<SeedBody>),
}

/// What a tick changes of a body beside [`crate::tick::MechanicalState`], by its kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum BodyState {
    /// Of tetrahedra there is nothing more.
    Tet(Box<TetState>),
    /// Which particles are active, their prestrain, and the transition force.
    Hybrid(Box<HybridState>),
    /// Which nodes are awake, and what is refined.
    MassSpring(Box<MassSpringState>),
    /// All that the papers' steps change; positions and velocities are copies of its nodes'.
    Seed(Box<SeedBodyState>),
}

/// Buffers of a body's steps, sized once.
#[derive(Debug, Clone)]
pub(crate) enum BodyScratch {
    Tet(Box<TetScratch>),
    Hybrid(Box<HybridScratch>),
    MassSpring(Box<MassSpringScratch>),
    Seed(Box<SeedBodyScratch>),
}

/// A body with its own state and buffers, while it is stepped: the one place where a tick asks which kind it is.
#[derive(Debug)]
pub(crate) enum SteppedBody<'a> {
    Tet(SteppedTet<'a>),
    Hybrid(SteppedHybrid<'a>),
    MassSpring(SteppedMassSpring<'a>),
    Seed(SteppedSeed<'a>),
}

impl Body {
    /// Builds a body in its environment; `progress` is told the part done of what takes long.
    ///
    /// # Errors
    /// The kind's own error.
    pub(crate) fn build(
        spec: BodySpec,
        around: EnvironmentSpec,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Self, Environment), BodyError> {
        Ok(match spec {
            BodySpec::Tet(spec) => built(Self::Tet, TetBody::build(spec, around, progress)?),
            BodySpec::Hybrid(spec) => built(Self::Hybrid, HybridBody::build(spec, around, progress)?),
            BodySpec::MassSpring(spec) => built(Self::MassSpring, MassSpringBody::build(spec, around)?),
            BodySpec::Seed(spec) => built(Self::Seed, SeedBody::build(spec, around)?),
        })
    }
}

fn built<K>(kind: fn(Box<K>) -> Body, (body, environment): (K, Environment)) -> (Body, Environment) {
    (kind(Box::new(body)), environment)
}

impl BodyState {
    /// The state of a body at rest.
    pub(crate) fn at_rest(body: &Body, environment: &Environment) -> Self {
        match body {
            Body::Tet(body) => Self::Tet(Box::new(KindState::at_rest(&**body, environment))),
            Body::Hybrid(body) => Self::Hybrid(Box::new(KindState::at_rest(&**body, environment))),
            Body::MassSpring(body) => Self::MassSpring(Box::new(KindState::at_rest(&**body, environment))),
            Body::Seed(body) => Self::Seed(Box::new(KindState::at_rest(&**body, environment))),
        }
    }
}

impl BodyScratch {
    /// Buffers for a body in its environment.
    pub(crate) fn new(body: &Body, environment: &Environment) -> Self {
        match body {
            Body::Tet(body) => Self::Tet(Box::new(TetScratch::new(body, environment))),
            Body::Hybrid(body) => Self::Hybrid(Box::new(HybridScratch::new(body, environment))),
            Body::MassSpring(body) => Self::MassSpring(Box::new(MassSpringScratch::new(body))),
            Body::Seed(body) => Self::Seed(Box::new(SeedBodyScratch::new(body.model()))),
        }
    }
}

impl<'a> SteppedBody<'a> {
    /// `None`: state or buffers are of another kind of body.
    pub(crate) fn of(body: &'a Body, own: &'a mut BodyState, scratch: &'a mut BodyScratch) -> Option<Self> {
        Some(match (body, own, scratch) {
            (Body::Tet(body), BodyState::Tet(_), BodyScratch::Tet(scratch)) => Self::Tet(SteppedTet { body, scratch }),
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
}

/// What the kind says that one of the enumerations holds: `of_kind!(Body, self, body => body.mass_kg())`.
macro_rules! of_kind {
    ($enumeration:ident, $value:expr, $kind:ident => $answer:expr) => {
        match $value {
            $enumeration::Tet($kind) => $answer,
            $enumeration::Hybrid($kind) => $answer,
            $enumeration::MassSpring($kind) => $answer,
            $enumeration::Seed($kind) => $answer,
        }
    };
}

/// The same of two enumerations that hold the same kind, else another value.
macro_rules! of_both {
    ($one:ident, $a:expr, $other:ident, $b:expr, ($kind:ident, $own:ident) => $answer:expr, else $otherwise:expr) => {
        match ($a, $b) {
            ($one::Tet($kind), $other::Tet($own)) => $answer,
            ($one::Hybrid($kind), $other::Hybrid($own)) => $answer,
            ($one::MassSpring($kind), $other::MassSpring($own)) => $answer,
            ($one::Seed($kind), $other::Seed($own)) => $answer,
            _ => $otherwise,
        }
    };
}
use {of_both, of_kind};
