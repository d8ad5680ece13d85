//! The order of the skin's triangles in which clusters are compact.
//!
//! The broad phase's order (a Morton curve) leaps now and then, and its clusters have triangles of both sides of a wall.
//! Tools do not mind one large box; two that overlap have to be looked at vertex by vertex. Here triangles are halved,
//! again and again, along the longest extent of their middles and normals, so that the sides of a wall part first.
use crate::{
    contact::broad::{CLUSTER, Triangles},
    mesh::Surface,
};
use glam::DVec3;

/// Extent of the two directions of a normal, over the mean edge: as long as a cluster.
const NORMALS: f64 = 8.0;

/// Returns a surface's triangles in compact clusters, with nodes at these positions (m).
pub(super) fn compact(surface: &Surface, positions_m: &[DVec3]) -> Triangles {
    let count = surface.triangles.len();
    let corners_m = |triangle: usize| surface.triangle_nodes(triangle).map(|node| positions_m[node as usize]);
    let edges_m: f64 = (0..count).map(corners_m).map(|[a, b, c]| a.distance(b) + b.distance(c) + c.distance(a)).sum();
    let half_m = 0.5 * NORMALS * edges_m / (3 * count).max(1) as f64;
    let key = |triangle: usize| {
        let [a, b, c] = corners_m(triangle);
        let (middle, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize_or_zero() * half_m);
        [middle.x, middle.y, middle.z, normal.x, normal.y, normal.z]
    };
    let keys: Vec<[f64; 6]> = (0..count).map(key).collect();
    let mut order: Vec<u32> = (0..count as u32).collect();
    halve(&keys, &mut order);
    Triangles {
        nodes: order.iter().map(|&triangle| surface.triangle_nodes(triangle as usize)).collect(),
        surface_triangle: order,
    }
}

/// Sorts triangles so that each run of [`CLUSTER`] is near together.
fn halve(keys: &[[f64; 6]], order: &mut [u32]) {
    if order.len() <= CLUSTER {
        order.sort_unstable();
        return;
    }
    let extent = |axis: usize| {
        let values = order.iter().map(|&triangle| keys[triangle as usize][axis]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        high - low
    };
    let axis = (0..6).max_by(|a, b| extent(*a).total_cmp(&extent(*b))).unwrap_or(0);
    let half = order.len().div_ceil(2 * CLUSTER) * CLUSTER;
    let along = |triangle: &u32| keys[*triangle as usize][axis];
    order.select_nth_unstable_by(half, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
    let (one, other) = order.split_at_mut(half);
    halve(keys, one);
    halve(keys, other);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::sphere;

    #[test]
    fn every_triangle_is_in_one_cluster_and_few_clusters_have_both_sides_of_a_wall() {
        // A shell: a sphere of radius 1, and one of 0.9 inside it that faces inwards.
        let (points, triangles) = sphere(3);
        let count = points.len() as u32;
        let positions: Vec<DVec3> = points.iter().copied().chain(points.iter().map(|p| *p * 0.9)).collect();
        let inner = triangles.iter().map(|&[a, b, c]| [a + count, c + count, b + count]);
        let surface = Surface::alone(positions.len(), triangles.iter().copied().chain(inner).collect());
        let compact = compact(&surface, &positions);
        let mut seen = compact.surface_triangle.clone();
        seen.sort_unstable();
        assert_eq!(seen, (0..surface.triangles.len() as u32).collect::<Vec<u32>>());
        let with_both = |triangles: &Triangles| {
            let is_outer = |triangle: &[u32; 3]| triangle[0] < count;
            let clusters = triangles.nodes.chunks(CLUSTER);
            clusters.filter(|cluster| cluster.iter().any(is_outer) && !cluster.iter().all(is_outer)).count()
        };
        let (here, along_the_curve) = (with_both(&compact), with_both(&Triangles::of(&surface, &positions)));
        println!("both sides in {here} of {} clusters, along the curve in {along_the_curve}", compact.clusters());
        assert!(4 * here <= compact.clusters() && 2 * here < along_the_curve, "{here} {along_the_curve}");
    }
}
