//! Why a model cannot be built.
use crate::{
    bodies::{BodyError, hybrid::HybridError, mass_spring::MassSpringError, seed::SeedError, tet::TetBodyError},
    elements::natural_modes::ModesError,
    tick::EnvironmentError,
};
use thiserror::Error;

/// Why a model cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// The body or its surroundings are wrong.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The body is to sleep, but has no lowest natural frequency from which its distance to rest follows.
    #[error(
        "whether a body may sleep follows from its lowest natural frequency, which it has where it is held (or let it never sleep)"
    )]
    Sleep {
        /// Why there is no such frequency.
        source: Box<ModesError>,
    },
}

impl ModelError {
    /// Returns what is wrong with settings, constraints, loads or tools, for any kind of body.
    pub fn environment(&self) -> Option<&EnvironmentError> {
        match self {
            Self::Body(
                BodyError::Tet(TetBodyError::Environment(error))
                | BodyError::Hybrid(HybridError::Environment(error))
                | BodyError::MassSpring(MassSpringError::Environment(error))
                | BodyError::Seed(SeedError::Environment(error)),
            ) => Some(error),
            Self::Body(_) | Self::Sleep { .. } => None,
        }
    }
}
