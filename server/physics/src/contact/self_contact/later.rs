//! How far the surface has to move before a vertex that is listed may be pressed.
use super::{
    lists::Pair,
    rest::{SelfContact, twice_area_m2},
};
use crate::contact::broad::ROUNDING_M;
use glam::DVec3;

/// By how much a height over a plane may fall more than the plane's corners and the point tell, since the plane turns.
const TURNING: f64 = 1.1;
/// Way of a triangle's corners over its least height while which its plane turns by no more than 25°.
const TURNS_WITHIN: f64 = 0.2;

impl SelfContact {
    /// Returns how far (m) the surface has to move before a vertex with these pairs may be pressed: before it is within its
    /// margin of a triangle or, as at a rim, of the plane of one, or behind the plane of one that has a corner with it in
    /// common, by which it may be told that it is behind. −∞ where it may be pressed already.
    pub(super) fn later_m(&self, of_vertex: &[Pair], x: &[DVec3]) -> f64 {
        let Some(first) = of_vertex.first() else { return f64::NEG_INFINITY };
        let (y, margin_m) = (x[first.node as usize], self.nodes[first.node as usize].margin_m);
        let of_pair_m = |pair: &Pair| {
            let triangle = pair.triangle as usize;
            let to_wall_m = 0.5 * (self.distance_m(y, triangle, x) - margin_m);
            let around = self.triangles.nodes[triangle].iter().flat_map(|node| self.around.row(*node as usize));
            let behind_m =
                around.map(|&other| self.to_plane_m(y, other as usize, 0.0, x)).fold(f64::INFINITY, f64::min);
            to_wall_m.min(self.to_plane_m(y, triangle, margin_m, x)).min(behind_m)
        };
        let least_m = of_vertex.iter().map(of_pair_m).fold(f64::INFINITY, f64::min) - ROUNDING_M;
        if least_m > 0.0 { least_m } else { f64::NEG_INFINITY }
    }

    /// Returns how far (m) the surface has to move before a vertex at `y` (m) may be lower than this over a triangle's plane.
    /// With the weights `β` of its foot on the plane, its height falls by no more than `1 + Σ |β_i|` times that over the cosine
    /// by which the plane turns, which is little while its corners move by no more than a part of the triangle's least height.
    fn to_plane_m(&self, y: DVec3, triangle: usize, height_m: f64, x: &[DVec3]) -> f64 {
        let [a, b, c] = self.triangles.corners(triangle, x);
        let (area, from) = (twice_area_m2([a, b, c]), y - a);
        let area_sq = area.length_squared();
        let wb = from.cross(c - a).dot(area) / area_sq;
        let wc = (b - a).cross(from).dot(area) / area_sq;
        let falls = TURNING * (1.0 + (1.0 - wb - wc).abs() + wb.abs() + wc.abs());
        let turns_m = TURNS_WITHIN * area_sq.sqrt() / a.distance(b).max(b.distance(c).max(c.distance(a)));
        turns_m.min((from.dot(area) / area_sq.sqrt() - height_m) / falls)
    }
}
