//! Rays through the skin at rest: how thick a wall is, and whether it faces another.
use super::rest::{SelfContact, twice_area_m2};
use glam::DVec3;

impl SelfContact {
    /// Returns how far (m) a ray goes from a vertex at rest until it meets a triangle that is not at that vertex, `∞`
    /// where it meets none. The ray's direction has length 1.
    pub(super) fn ray_m(&self, node: u32, direction: DVec3) -> f64 {
        let from = self.rest_m[node as usize];
        let mut nearest_m = f64::INFINITY;
        for (cluster, at) in self.clusters.iter().enumerate() {
            if enters_m(from, direction, at.low_m, at.high_m) >= nearest_m {
                continue;
            }
            for triangle in self.triangles.cluster_range(cluster) {
                let nodes = self.triangles.nodes[triangle];
                if !nodes.contains(&node) {
                    let hit_m = hits_m(from, direction, nodes.map(|n| self.rest_m[n as usize]));
                    nearest_m = nearest_m.min(hit_m);
                }
            }
        }
        nearest_m
    }
}

/// Returns how far (m) a ray goes until it enters a box, `∞` where it does not.
fn enters_m(from: DVec3, direction: DVec3, low_m: DVec3, high_m: DVec3) -> f64 {
    let (mut enters_m, mut leaves_m) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if from[axis] < low_m[axis] || from[axis] > high_m[axis] {
                return f64::INFINITY;
            }
            continue;
        }
        let (one_m, two_m) =
            ((low_m[axis] - from[axis]) / direction[axis], (high_m[axis] - from[axis]) / direction[axis]);
        enters_m = enters_m.max(one_m.min(two_m));
        leaves_m = leaves_m.min(one_m.max(two_m));
    }
    if enters_m <= leaves_m { enters_m } else { f64::INFINITY }
}

/// Returns how far (m) a ray goes until it hits a triangle, `∞` where it does not. A hit on an edge counts.
fn hits_m(from: DVec3, direction: DVec3, corners: [DVec3; 3]) -> f64 {
    let area_m2 = twice_area_m2(corners);
    let across_m2 = direction.dot(area_m2);
    if across_m2 == 0.0 {
        return f64::INFINITY;
    }
    let way_m = (corners[0] - from).dot(area_m2) / across_m2;
    let at = from + direction * way_m;
    // Each part of the area, as seen from the hit, over the whole; a hair outside still counts.
    let inside = [0, 1, 2].into_iter().all(|i| {
        let part = (corners[i] - at).cross(corners[(i + 1) % 3] - at).dot(area_m2);
        part >= -1e-9 * area_m2.length_squared()
    });
    if way_m > 0.0 && inside { way_m } else { f64::INFINITY }
}
