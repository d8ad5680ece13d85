//! The gap between a vertex and the walls before it.
//!
//! It is the distance from the nearest point of the triangles that face the vertex. That point may lie on an edge or a
//! corner, where the signs of the triangles' planes differ; the vertex is in front where it is in front of the one
//! among all triangles there whose normal is most aligned with the way to it (Bærentzen and Aanæs 2005 give the same
//! answer by angle-weighted normals).
use super::rest::{SelfContact, twice_area_m2};
use crate::contact::triangle::closest_weights;
use glam::DVec3;

/// Distance (m) below which the way from an edge to a vertex has no direction.
const NO_DISTANCE_M: f64 = 1e-12;

/// The gap between a vertex and a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gap {
    /// `g` (m), negative behind the wall.
    pub(super) gap_m: f64,
    /// `n̂ = ∂g/∂y`.
    pub(super) direction: DVec3,
    /// The triangle of the nearest point.
    pub(super) triangle: u32,
    /// Weights of its corners.
    pub(super) weights: [f64; 3],
}

impl SelfContact {
    /// Returns the gap between a vertex and the nearest of these triangles (ascending) that face it, where any is within
    /// its reach; nodes are at `x` (m).
    pub(super) fn gap(&self, node: u32, triangles: impl Iterator<Item = u32>, x: &[DVec3]) -> Option<Gap> {
        let y = x[node as usize];
        let mut nearest_sq = self.nodes[node as usize].reach_m().powi(2);
        let mut nearest = None;
        for triangle in triangles {
            let corners = self.triangles.corners(triangle as usize, x);
            let weights = closest_weights(y, corners);
            let way = y - (corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]);
            let distance_sq = way.length_squared();
            if distance_sq >= nearest_sq {
                continue;
            }
            let normal = twice_area_m2(corners).normalize_or_zero();
            if self.faces(node, normal, x) {
                (nearest_sq, nearest) = (distance_sq, Some((triangle, weights, way, normal)));
            }
        }
        let (triangle, weights, way, normal) = nearest?;
        let distance_m = way.length();
        let is_inside_face = weights.iter().all(|weight| *weight > 0.0);
        if is_inside_face || distance_m < NO_DISTANCE_M {
            return Some(Gap { gap_m: way.dot(normal), direction: normal, triangle, weights });
        }
        let sign = self.side(triangle, weights, way, x);
        Some(Gap { gap_m: sign * distance_m, direction: way * (sign / distance_m), triangle, weights })
    }

    /// Returns 1 where the way from a point on an edge or corner of a triangle leads to the front of the skin, else −1.
    fn side(&self, triangle: u32, weights: [f64; 3], way: DVec3, x: &[DVec3]) -> f64 {
        let nodes = self.triangles.nodes[triangle as usize];
        let on = |other: &[u32; 3]| nodes.iter().zip(weights).all(|(node, weight)| weight == 0.0 || other.contains(node));
        let Some(shared) = nodes.iter().zip(weights).find(|(_, weight)| *weight > 0.0).map(|(node, _)| *node) else {
            return 1.0;
        };
        let mut most = 0.0_f64;
        for &other in self.around.row(shared as usize) {
            if on(&self.triangles.nodes[other as usize]) {
                let along_m = twice_area_m2(self.triangles.corners(other as usize, x)).normalize_or_zero().dot(way);
                if along_m.abs() > most.abs() {
                    most = along_m;
                }
            }
        }
        if most < 0.0 { -1.0 } else { 1.0 }
    }
}
