//! The skin of a body at rest, from which contact is built.
use super::{MostCarriers, SurfaceModuli};
use crate::mesh::Surface;
use glam::DVec3;

/// What the nodes of a skin follow, and so how well they give way to a small load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum SkinFollows {
    /// Nodes of linear elements or of springs, or points of particles' cells: they give way less than a solid.
    StiffElements,
    /// Nodes of elements that give way as a solid does.
    TrueElements,
    /// Means of particles, which give way less than a solid by what is finer than the means.
    Means {
        /// How far apart (m) the particles are.
        apart_m: f64,
    },
}

/// What contact needs to know of a body's skin at rest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SkinAtRest<'a> {
    /// Positions (m) of the surface's nodes.
    pub(crate) positions_m: &'a [DVec3],
    /// The skin.
    pub(crate) surface: &'a Surface,
    /// Moduli behind its triangles.
    pub(crate) moduli: &'a [SurfaceModuli],
    /// Each node's part of the mass (kg) that bears contact, by its area.
    pub(crate) mass_kg: &'a [f64],
    /// Mass (kg) that bears what is pressed at each node, if its neighbours are pressed alike.
    pub(crate) bearing_kg: &'a [f64],
    /// ω_max (rad/s) of the body without contact.
    pub(crate) max_natural_frequency_rad_per_s: f64,
    /// What its nodes follow.
    pub(crate) follows: SkinFollows,
    /// What carries the skin.
    pub(crate) carriers: MostCarriers,
}

impl SkinFollows {
    /// How far apart (m) particles are of whose means the skin is made.
    pub(super) fn apart_m(self) -> Option<f64> {
        match self {
            Self::Means { apart_m } => Some(apart_m),
            Self::StiffElements | Self::TrueElements => None,
        }
    }
}

impl SkinAtRest<'_> {
    /// Returns ω²_max (rad²/s²). A body without a free node has no frequency; its contact does nothing then, but must be
    /// finite.
    pub(super) fn frequency_sq(&self) -> f64 {
        self.max_natural_frequency_rad_per_s.max(1.0).powi(2)
    }
}
