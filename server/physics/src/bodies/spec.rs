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
    /// The tets, of whatever level, with their materials; none of a surface of springs.
    pub fn solid(&self) -> Option<&Solid> {
        match self {
            Self::Tet(solid) => Some(solid),
            Self::Hybrid(spec) => Some(&spec.coarse),
            Self::MassSpring(_) => None,
            Self::Seed(spec) => Some(&spec.core),
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
