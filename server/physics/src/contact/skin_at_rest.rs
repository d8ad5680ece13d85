//! The skin of a body at rest, from which contact is built.
use super::{MostCarriers, SurfaceModuli};
use crate::mesh::Surface;
use glam::DVec3;

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
    /// How far apart (m) particles are of which the skin follows means; `None` where it follows no means.
    pub(crate) means_over_m: Option<f64>,
    /// What carries the skin.
    pub(crate) carriers: MostCarriers,
}

impl SkinAtRest<'_> {
    /// Returns ω²_max (rad²/s²). A body without a free node has no frequency; its contact does nothing then, but must be
    /// finite.
    pub(super) fn frequency_sq(&self) -> f64 {
        self.max_natural_frequency_rad_per_s.max(1.0).powi(2)
    }
}
