//! Why a body of tetrahedra cannot be built.
use crate::{elements::solid::SolidError, mesh::MeshError, tick::EnvironmentError};
use thiserror::Error;

/// Why a body of tetrahedra cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TetBodyError {
    /// The mesh's boundary, its regions or their constants.
    #[error(transparent)]
    Solid(#[from] SolidError),
    /// Settings, constraints, loads or tools.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
}

impl From<MeshError> for TetBodyError {
    fn from(source: MeshError) -> Self {
        Self::Solid(source.into())
    }
}
