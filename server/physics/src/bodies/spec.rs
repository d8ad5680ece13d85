//! What a body is built from, and why it cannot be.
use super::{
    hybrid::{HybridError, HybridSpec},
    mass_spring::{MassSpringError, MassSpringSpec},
    seed::{SeedBodySpec, SeedError},
    tet::TetBodyError,
};
use crate::elements::solid::Solid;
use thiserror::Error;

/// What a body is built from.
#[derive(Debug, Clone, PartialEq)]
pub enum BodySpec {
    /// Linear tetrahedra throughout.
    Tet(Solid),
    /// Coarse tetrahedra, and particles.
    Hybrid(HybridSpec),
    /// A surface of masses on springs.
    MassSpring(MassSpringSpec),
    /// The papers' own hybrid.
    Seed(SeedBodySpec),
}

impl BodySpec {
    /// A hybrid body, if it is one.
    pub fn as_hybrid(&self) -> Option<&HybridSpec> {
        if let Self::Hybrid(spec) = self { Some(spec) } else { None }
    }

    /// A mass-spring surface, if it is one.
    pub fn as_mass_spring(&self) -> Option<&MassSpringSpec> {
        if let Self::MassSpring(spec) = self { Some(spec) } else { None }
    }

    /// The papers' hybrid, if it is one.
    pub fn as_seed(&self) -> Option<&SeedBodySpec> {
        if let Self::Seed(spec) = self { Some(spec) } else { None }
    }

    /// The tets, of whatever level, with their materials; none of a surface of springs.
    pub fn solid(&self) -> Option<&Solid> {
        match self {
            Self::Tet(solid) => Some(solid),
            Self::Hybrid(spec) => Some(&spec.coarse),
            Self::MassSpring(_) => None,
            Self::Seed(spec) => Some(&spec.core),
        }
    }

    /// The same, to be changed.
    pub fn solid_mut(&mut self) -> Option<&mut Solid> {
        match self {
            Self::Tet(solid) => Some(solid),
            Self::Hybrid(spec) => Some(&mut spec.coarse),
            Self::MassSpring(_) => None,
            Self::Seed(spec) => Some(&mut spec.core),
        }
    }
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
