//! Meshes at rest: tetrahedra, their boundary surface, and measures of quality.
pub mod quality;
pub mod surface;
pub mod tet;
pub mod triangulation;
mod triangulation_error;

pub use surface::Surface;
pub use tet::{MeshError, TetMesh};
pub use triangulation::{Triangulation, TriangulationError};
