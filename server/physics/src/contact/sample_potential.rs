//! The potential of one sample of the foundation, for methods with a contact of their own.
use super::{
    depth::DepthResponse,
    stretched_area::{AreaFactor, TriangleArea},
};
use glam::DVec3;

/// `φ(r) E(g)` of a sample and its derivatives, per `k_f a` (see [`super::depth`] and [`super::stretched_area`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SamplePotential {
    /// `φ E` (m²).
    pub energy_m2: f64,
    /// `φ E'` (m), the force that presses along the normal.
    pub force_m: f64,
    /// `φ' E ∂r/∂x_i` (m) of the triangle's corners.
    pub area_gradients_m: [DVec3; 3],
}

impl SamplePotential {
    /// Returns that of a sample which is `depth_m` (m) deep in a tool of this radius (m), on a triangle whose area was
    /// `rest_m2` (m²) at rest.
    pub fn of(corners: [DVec3; 3], rest_m2: f64, depth_m: f64, radius_m: f64) -> Self {
        let area = TriangleArea::of(corners, rest_m2);
        let AreaFactor { factor, slope, .. } = area.factor;
        let DepthResponse { energy_m2, force_m, .. } = DepthResponse::of(depth_m, radius_m);
        Self {
            energy_m2: factor * energy_m2,
            force_m: factor * force_m,
            area_gradients_m: area.gradients_per_m.map(|gradient| gradient * (slope * energy_m2)),
        }
    }
}
