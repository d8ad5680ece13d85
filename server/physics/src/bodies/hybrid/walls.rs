//! The walls of a hybrid body: its skin, cut no finer than its particles lie.
//!
//! The skin of a body follows its particles, so a skin that is cut finer than these lie moves no more freely, and self-contact would
//! only look at more of it. Walls are made of some of the skin's vertices, about a spacing apart.
use super::HybridBody;
use crate::{
    contact::{SelfContact, SkinAtRest, coarse_walls, moduli},
    mesh::Surface,
    tick::EnvironmentSpec,
};
use glam::DVec2;

impl HybridBody {
    /// Returns the self-contact of a body with this skin, where it is to have it, with the moduli (Pa) at each vertex.
    pub(super) fn walls(
        &self,
        skin: &SkinAtRest<'_>,
        moduli_pa: &[DVec2],
        around: &EnvironmentSpec,
    ) -> Option<SelfContact> {
        let triangles = coarse_walls(skin.positions_m, &skin.surface.triangles, self.particles().spacing_m);
        let surface = Surface::of_triangles(skin.positions_m.len(), &triangles);
        let (mass_kg, bearing_kg) = (self.vertex_masses_kg(&triangles), self.bearing_masses_kg(&surface.nodes));
        let moduli = moduli::mean_over_corners(moduli_pa, &surface);
        let coarse =
            SkinAtRest { surface: &surface, moduli: &moduli, mass_kg: &mass_kg, bearing_kg: &bearing_kg, ..*skin };
        around.walls_of(&coarse)
    }
}
