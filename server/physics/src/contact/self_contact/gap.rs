//! The gap between a vertex and the walls before it.
//!
//! It is the distance `|y − p|` from the nearest point `p` of the triangles that face the vertex. That point may lie on
//! an edge or a corner, where the signs of the triangles' planes differ; the vertex is in front where it is in front of
//! the one among all triangles there whose normal is most aligned with the way to it (Bærentzen and Aanæs 2005 give the
//! same answer by angle-weighted normals).
//!
//! *At a rim*, where the facing part of a wall ends at a sharp edge, a vertex beside the edge would be pushed sideways,
//! all the more the nearer it is: two walls that are pressed rim on rim would slip off each other. There the gap is the
//! height `h = n̂·(y − a)` over the plane of the triangle, and what it does fades with the distance `δ` beside it:
//! ```text
//! F = 1 − 3q² + 2q³,   q = δ²/D²,   δ² = |y − p|² − h²        D = 2 m
//! ∂h = n̂·(∂y − Σ β_i ∂x_i)        ∂|y − p|² = 2 (y − p)·(∂y − Σ w_i ∂x_i)
//! ```
//! with the weights `β` of the foot of `y` on the plane, which may be negative, and `w` of `p`. On the rim itself, at
//! `δ = 0`, both gaps are the same and `F` has neither slope nor curvature.
use super::{
    facing::OwnTriangles,
    rest::{SelfContact, twice_area_m2},
};
use crate::contact::triangle::closest_weights;
use glam::DVec3;

/// Distance (m) below which the way from an edge to a vertex has no direction.
const NO_DISTANCE_M: f64 = 1e-12;
/// `D/m`.
const FADES_WITHIN: f64 = 2.0;
/// Part of a squared distance that is more than rounding.
const ROUNDING: f64 = 1e-9;

/// The gap between a vertex and a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gap {
    /// `g` (m), negative behind the wall.
    pub(super) distance_m: f64,
    /// `∂g/∂y`, of length 1.
    pub(super) direction: DVec3,
    /// The triangle of the nearest point.
    pub(super) triangle: u32,
    /// `−∂g/∂x_i` along `direction`: weights of its corners.
    pub(super) weights: [f64; 3],
    /// Weights `w` of the corners at `p`.
    pub(super) at: [f64; 3],
    /// `y − p` (m).
    pub(super) way: DVec3,
    /// `F`, 1 where there is no rim.
    pub(super) fade: f64,
    /// `∂F/∂δ²` (1/m²).
    pub(super) slope_per_m2: f64,
}

/// The nearest point of a triangle.
#[derive(Clone, Copy)]
struct Nearest {
    triangle: u32,
    weights: [f64; 3],
    way: DVec3,
    normal: DVec3,
}

impl SelfContact {
    /// Returns the gap between a vertex and the nearest of these triangles (ascending) that face it, where any is within
    /// its reach; nodes are at `x` (m). Gaps of `within_m` and more may be left out.
    pub(super) fn gap(
        &self,
        node: u32,
        within_m: f64,
        triangles: &(impl Iterator<Item = u32> + Clone),
        x: &[DVec3],
    ) -> Option<Gap> {
        let y = x[node as usize];
        let mut own = None;
        let mut nearest_sq = self.nodes[node as usize].reach_m().powi(2);
        let mut nearest: Option<Nearest> = None;
        for triangle in triangles.clone() {
            let corners = self.triangles.corners(triangle as usize, x);
            let weights = closest_weights(y, corners);
            let way = y - (corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]);
            let distance_sq = way.length_squared();
            if distance_sq >= nearest_sq {
                continue;
            }
            let normal = twice_area_m2(corners).normalize_or_zero();
            if own.get_or_insert_with(|| self.own_triangles(node, x)).face(normal) {
                (nearest_sq, nearest) = (distance_sq, Some(Nearest { triangle, weights, way, normal }));
            }
        }
        let (nearest, own) = (nearest?, own?);
        if nearest.weights.iter().all(|weight| *weight > 0.0) {
            return Some(nearest.over_face());
        }
        let rim_m = FADES_WITHIN * self.nodes[node as usize].margin_m;
        // At a rim, too, `h < within` would be with `δ > D`.
        let apart_sq = (1.0 + ROUNDING) * (within_m * within_m + rim_m * rim_m);
        if nearest_sq > apart_sq && self.is_before(&nearest, x) {
            return None;
        }
        if self.is_rim(&own, &nearest, x) {
            return self.gap_at_rim(node, &own, &nearest, triangles, x);
        }
        let distance_m = nearest.way.length();
        if distance_m < NO_DISTANCE_M {
            return Some(nearest.over_face());
        }
        let sign = self.side(&nearest, x);
        let direction = nearest.way * (sign / distance_m);
        let Nearest { triangle, weights, .. } = nearest;
        Some(Gap { distance_m: sign * distance_m, direction, triangle, weights, ..nearest.over_face() })
    }

    /// Returns the triangles that have the edge or corner on which the nearest point lies.
    fn around_point<'a>(&'a self, nearest: &'a Nearest) -> impl Iterator<Item = u32> + 'a {
        let nodes = self.triangles.nodes[nearest.triangle as usize];
        let of_point = move |node: &u32| nodes.iter().zip(nearest.weights).any(|(n, w)| n == node && w > 0.0);
        let has_all = move |other: &u32| {
            let corners = self.triangles.nodes[*other as usize];
            nodes.iter().filter(|node| of_point(node)).all(|node| corners.contains(node))
        };
        let first = nodes.into_iter().find(|node| of_point(node));
        first.into_iter().flat_map(|node| self.around.row(node as usize)).copied().filter(has_all)
    }

    /// Returns whether a vertex is in front of the planes of all triangles that have the edge or corner on which the nearest
    /// point lies.
    fn is_before(&self, nearest: &Nearest, x: &[DVec3]) -> bool {
        self.around_point(nearest)
            .all(|other| twice_area_m2(self.triangles.corners(other as usize, x)).dot(nearest.way) > 0.0)
    }

    /// Returns whether the nearest point is on a rim: whether a triangle there does not face the vertex.
    fn is_rim(&self, own: &OwnTriangles, nearest: &Nearest, x: &[DVec3]) -> bool {
        self.around_point(nearest).any(|other| {
            let normal = twice_area_m2(self.triangles.corners(other as usize, x)).normalize_or_zero();
            !own.face(normal)
        })
    }

    /// Returns the gap at a rim. At a corner of several triangles that of the plane counts that the vertex is lowest over.
    fn gap_at_rim(
        &self,
        node: u32,
        own: &OwnTriangles,
        nearest: &Nearest,
        triangles: &(impl Iterator<Item = u32> + Clone),
        x: &[DVec3],
    ) -> Option<Gap> {
        let y = x[node as usize];
        let mut lowest: Option<(f64, u32, DVec3)> = None;
        for other in self.around_point(nearest).filter(|other| triangles.clone().any(|listed| listed == *other)) {
            let corners = self.triangles.corners(other as usize, x);
            let normal = twice_area_m2(corners).normalize_or_zero();
            let height_m = (y - corners[0]).dot(normal);
            if own.face(normal) && lowest.is_none_or(|(least_m, ..)| height_m < least_m) {
                lowest = Some((height_m, other, normal));
            }
        }
        let (height_m, triangle, normal) = lowest?;
        let corners = self.triangles.corners(triangle as usize, x);
        let [a, b, c] = corners;
        let (area, from) = (twice_area_m2(corners), y - a);
        let (wb, wc) = (
            from.cross(c - a).dot(area) / area.length_squared(),
            (b - a).cross(from).dot(area) / area.length_squared(),
        );
        let at = closest_weights(y, corners);
        let way = y - (a * at[0] + b * at[1] + c * at[2]);
        let fades_sq = (FADES_WITHIN * self.nodes[node as usize].margin_m).powi(2);
        let q = (way.length_squared() - height_m * height_m).max(0.0) / fades_sq;
        if q >= 1.0 {
            return None;
        }
        let (fade, slope_per_m2) = (1.0 - q * q * (3.0 - 2.0 * q), 6.0 * q * (q - 1.0) / fades_sq);
        let weights = [1.0 - wb - wc, wb, wc];
        Some(Gap { distance_m: height_m, direction: normal, triangle, weights, at, way, fade, slope_per_m2 })
    }

    /// Returns 1 where the way from a point on an edge or corner leads to the front of the skin, else −1.
    fn side(&self, nearest: &Nearest, x: &[DVec3]) -> f64 {
        let along =
            |other: u32| twice_area_m2(self.triangles.corners(other as usize, x)).normalize_or_zero().dot(nearest.way);
        let most = self
            .around_point(nearest)
            .map(along)
            .fold(0.0_f64, |most, along_m| if along_m.abs() > most.abs() { along_m } else { most });
        if most < 0.0 { -1.0 } else { 1.0 }
    }
}

impl Nearest {
    fn over_face(&self) -> Gap {
        let Self { triangle, weights, way, normal } = *self;
        let (distance_m, direction) = (way.dot(normal), normal);
        Gap { distance_m, direction, triangle, weights, at: weights, way, fade: 1.0, slope_per_m2: 0.0 }
    }
}
