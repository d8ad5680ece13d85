//! The volume between two surfaces, filled with tetrahedra.
pub(crate) mod prisms;
pub(crate) mod trimesh;
