//! How far the vertices of a skin are from where they were listed, with the positions of few of them.
//!
//! Most clusters of a skin follow coarse nodes alone, and those tell a bound of how far all vertices of a cluster have moved. Vertices are
//! placed only where that bound says too little: about a tool, where awake particles carry them.
use super::{lists::NearWalls, rest::SelfContact};
use crate::contact::broad::Skin;

impl SelfContact {
    /// Returns a bound of how far (m) any vertex is from where it was when the list was made. It is infinite where one is so far that the
    /// list is not worth keeping.
    pub(super) fn farthest_m(&self, skin: &impl Skin, near: &NearWalls) -> f64 {
        let worth_m = near.worth_keeping_m();
        let mut farthest_m = 0.0;
        for cluster in 0..self.clusters.len() {
            let mut moved_m = skin.walls_moved_m(cluster, &near.clusters_then);
            if moved_m.is_nan() || moved_m > worth_m {
                moved_m = self.placed_m(cluster, skin, near);
            }
            if moved_m.is_nan() || moved_m > worth_m {
                return f64::INFINITY;
            }
            farthest_m = f64::max(farthest_m, moved_m);
        }
        farthest_m
    }

    /// Returns how far (m) the farthest of a cluster's own vertices is from where it was; NaN if one is nowhere.
    fn placed_m(&self, cluster: usize, skin: &impl Skin, near: &NearWalls) -> f64 {
        let mut farthest_sq = 0.0;
        for &node in self.of_cluster.row(cluster) {
            let moved_sq = skin.position_m(node).distance_squared(near.then_m(node));
            if moved_sq > farthest_sq || moved_sq.is_nan() {
                farthest_sq = moved_sq;
            }
        }
        farthest_sq.sqrt()
    }
}
