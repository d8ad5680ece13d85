//! Meshes at rest: tetrahedra, their boundary surface, and measures of quality.
mod parts;
pub mod quality;
pub mod surface;
pub mod tet;
pub mod triangulation;
mod triangulation_error;

pub use parts::connected_parts;
pub use surface::Surface;
pub use tet::{MeshError, TetMesh};
pub use triangulation::{Triangulation, TriangulationError};
