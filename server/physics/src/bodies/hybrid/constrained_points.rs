//! The points of a patch that follow coarse nodes, in groups of those that follow the same nodes.
use super::composite::Anchor;
use glam::DVec3;

/// Constrained points, sorted by the nodes that they follow, so that the nodes are read and written once per group.
#[derive(Debug, Clone)]
pub(super) struct ConstrainedPoints {
    followers: Vec<Follower>,
}

#[derive(Debug, Clone, Copy)]
struct Follower {
    point: u32,
    nodes: [u32; 4],
    weights: [f64; 4],
}

impl ConstrainedPoints {
    pub(super) fn with_room(points: usize) -> Self {
        Self { followers: Vec::with_capacity(points) }
    }

    /// Replaces the points by these, each with what it follows. Allocates nothing as long as there is room.
    pub(super) fn take(&mut self, points: impl Iterator<Item = (u32, Anchor)>) {
        self.followers.clear();
        self.followers.extend(points.map(|(point, Anchor { nodes, weights, .. })| Follower { point, nodes, weights }));
        self.followers.sort_unstable_by_key(|follower| (follower.nodes, follower.point));
    }

    /// Writes `u_p = Σ ζ_pi u_i` of every point, from the values `u_i` of the nodes.
    pub(super) fn follow(&self, of_nodes: &[DVec3], of_points: &mut [DVec3]) {
        for group in self.groups() {
            let [a, b, c, d] = group[0].nodes.map(|node| of_nodes[node as usize]);
            for Follower { point, weights: [wa, wb, wc, wd], .. } in group {
                of_points[*point as usize] = (a * *wa + b * *wb) + (c * *wc + d * *wd);
            }
        }
    }

    /// Adds the points' forces (N) to those of the nodes by the transpose: `f_i ← f_i + Σ_p ζ_pi f_p`.
    pub(super) fn push(&self, on_points_n: &[DVec3], on_nodes_n: &mut [DVec3]) {
        for group in self.groups() {
            let mut sums = [DVec3::ZERO; 4];
            for Follower { point, weights, .. } in group {
                let force_n = on_points_n[*point as usize];
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum += force_n * *weight;
                }
            }
            for (node, sum) in group[0].nodes.iter().zip(sums) {
                on_nodes_n[*node as usize] += sum;
            }
        }
    }

    fn groups(&self) -> impl Iterator<Item = &[Follower]> {
        self.followers.chunk_by(|one, other| one.nodes == other.nodes)
    }
}
