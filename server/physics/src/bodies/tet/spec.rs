//! What a body of tetrahedra is built from.
use crate::elements::solid::Solid;

/// What the elastic energy of a body of tetrahedra is taken of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TetElements {
    /// The strain of every tet. They are too stiff in bending, and lock as Poisson's ratio nears ½.
    Linear,
    /// Mostly of the mean strain around every node (docs/adr/smoothed-tets.md).
    Smoothed,
}

/// What a body of tetrahedra is built from.
#[derive(Debug, Clone, PartialEq)]
pub struct TetSpec {
    /// The tets with their materials.
    pub solid: Solid,
    /// What their energy is taken of.
    pub elements: TetElements,
}

impl From<Solid> for TetSpec {
    /// A body of linear tets.
    fn from(solid: Solid) -> Self {
        Self { solid, elements: TetElements::Linear }
    }
}
