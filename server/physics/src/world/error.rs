//! Why a model cannot be built.
use crate::{
    bodies::{
        BodyError,
        hybrid::HybridError,
        mass_spring::MassSpringError,
        seed::SeedError,
        tet::{ModesError, TetBodyError},
    },
    tick::EnvironmentError,
};
use thiserror::Error;

/// Why a model cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// The body.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// A body that cannot tell how near to rest it is.
    #[error(
        "whether a body may sleep follows from its lowest natural frequency, which it has where it is held (or let it never sleep)"
    )]
    Sleep {
        /// Why there is none.
        source: Box<ModesError>,
    },
}

impl ModelError {
    /// What is wrong with settings, constraints, loads or tools, whatever the kind of body.
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
