//! The query: which vertices and triangles may meet soon, and when to ask again.
//!
//! At rest the triangles of two clusters that may meet are `D` apart or more, and displacements within boxes of the two
//! clusters differ by `|Δu|` at most. So they are no nearer than `D − |Δu|` now, and no nearer than their boxes at rest
//! grown by the displacements. Two clusters displaced by less than `½ (D − r)` each are farther apart than the reach
//! `r`, whichever they are: most clusters of most bodies are passed over by that alone.
//!
//! *Close* clusters, which are near at rest, have a `D` that was found vertex by vertex; others have that of their boxes.
//! Pairs that remain are looked at vertex by vertex. The surface moves by no more than its travel, as contact's broad
//! phase has it, so what is `r + 2 d` apart cannot meet within a travel of `d`.
use super::{
    lists::{NearWalls, Pair},
    rest::{ClusterAtRest, SelfContact},
};
use crate::contact::{
    broad::{ROUNDING_M, box_distance_m},
    triangle::closest_weights,
};
use glam::DVec3;

/// Buffers of queries and of pressing, sized once.
#[derive(Debug, Clone, Default)]
pub(in crate::contact) struct WallScratch {
    /// Positions (m) of the nodes of clusters that were looked at in the present query.
    x: Vec<DVec3>,
    /// What each cluster was displaced by.
    displaced: Vec<Displaced>,
    /// Balls around the triangles of such clusters: middle (m), and radius (m).
    balls: Vec<(DVec3, f64)>,
    /// Box (m) of each cluster that was looked at in the present query.
    fitted: Vec<Option<[DVec3; 2]>>,
    /// `Σ_j |K_ij|` (N/m) of the nodes that are pressed, else 0.
    pub(super) rows_n_per_m: Vec<f64>,
    /// Largest of them over mass (1/s²) in the tick so far.
    pub(in crate::contact) most_frequency_sq: f64,
    pub(super) seen: super::MeetingWalls,
}

/// Displacements of a cluster's vertices.
#[derive(Debug, Clone, Copy)]
struct Displaced {
    low_m: DVec3,
    high_m: DVec3,
    /// Largest displacement (m).
    most_m: f64,
    /// A ball around its vertices: middle and radius (m).
    middle_m: DVec3,
    radius_m: f64,
}

/// A surface, as a query asks about it.
pub(in crate::contact) struct MovedSurface<'a> {
    /// Returns a box (m) around the displacements of a cluster's vertices.
    pub(in crate::contact) displacements_m: &'a dyn Fn(usize) -> [DVec3; 2],
    /// Returns the position (m) of a node.
    pub(in crate::contact) position_m: &'a dyn Fn(u32) -> DVec3,
}

impl WallScratch {
    /// Returns the walls that meet, at the last evaluation of forces.
    pub(in crate::contact) fn seen(&self) -> super::MeetingWalls {
        self.seen
    }

    pub(super) fn new(walls: &SelfContact) -> Self {
        let (nodes, clusters) = (walls.rest_m.len(), walls.clusters.len());
        let (low_m, high_m, middle_m) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        let still = Displaced { low_m, high_m, most_m: 0.0, middle_m, radius_m: 0.0 };
        Self {
            x: vec![DVec3::ZERO; nodes],
            balls: vec![(DVec3::ZERO, 0.0); walls.triangles.len()],
            displaced: vec![still; clusters],
            fitted: vec![None; clusters],
            rows_n_per_m: vec![0.0; nodes],
            ..Self::default()
        }
    }
}

impl WallScratch {
    fn balls_apart_m(&self, one: usize, other: usize) -> f64 {
        let (a, b) = (&self.displaced[one], &self.displaced[other]);
        a.middle_m.distance(b.middle_m) - a.radius_m - b.radius_m
    }

    /// Returns a lower bound (m) of the distance between two clusters that are `free_m` or more apart at rest where they
    /// may meet.
    fn bound_m(&self, walls: &SelfContact, pair: [usize; 2], free_m: f64) -> f64 {
        let [a, b] = pair.map(|cluster| self.displaced[cluster]);
        let apart = (a.high_m - b.low_m).abs().max((b.high_m - a.low_m).abs());
        let boxes =
            pair.map(|cluster| self.fitted[cluster].unwrap_or(walls.clusters[cluster].moved(&self.displaced[cluster])));
        (free_m - apart.length()).max(boxes_distance_m(boxes[0], boxes[1]))
    }
}

impl SelfContact {
    /// Lists what may meet soon. `exhaustive` looks at every pair of clusters, and has to be asked again at once.
    pub(in crate::contact) fn query(
        &self,
        surface: &MovedSurface<'_>,
        exhaustive: bool,
        near: &mut NearWalls,
        scratch: &mut WallScratch,
    ) {
        near.clear();
        scratch.fitted.fill(None);
        for (cluster, displaced) in scratch.displaced.iter_mut().enumerate() {
            let [low_m, high_m] = (surface.displacements_m)(cluster);
            let at = &self.clusters[cluster];
            *displaced = Displaced {
                low_m,
                high_m,
                most_m: low_m.abs().max(high_m.abs()).length(),
                middle_m: (at.low_m + low_m + at.high_m + high_m) * 0.5,
                radius_m: (at.high_m + high_m - at.low_m - low_m).length() * 0.5,
            };
        }
        let listed_m = self.reach_m + 2.0 * self.stride_m;
        let mut slack_m = f64::INFINITY;
        for one in 0..self.clusters.len() {
            if exhaustive {
                (one..self.clusters.len()).for_each(|other| {
                    self.look_at([one, other], surface, near, scratch);
                });
                continue;
            }
            let close = self.left_m(scratch, one, self.clusters[one].free_close_m);
            let far = self.left_m(scratch, one, self.clusters[one].free_far_m);
            slack_m = slack_m.min(if close < self.stride_m { f64::INFINITY } else { close });
            slack_m = slack_m.min(if far < self.stride_m { f64::INFINITY } else { far });
            if close < self.stride_m {
                for entry in self.close.row(one) {
                    let other = entry.cluster as usize;
                    // A pair of which both have moved far is looked at from the first.
                    if other >= one || self.left_m(scratch, other, self.clusters[other].free_close_m) >= self.stride_m {
                        slack_m = slack_m.min(self.pair([one, other], entry.free_m, surface, near, scratch));
                    }
                }
            }
            if far < self.stride_m {
                let mut close = self.close.row(one).iter().map(|entry| entry.cluster as usize).peekable();
                for other in 0..self.clusters.len() {
                    if close.next_if_eq(&other).is_some() {
                        continue;
                    }
                    if other >= one || self.left_m(scratch, other, self.clusters[other].free_far_m) >= self.stride_m {
                        let bound_m = scratch.balls_apart_m(one, other);
                        if bound_m >= listed_m {
                            slack_m = slack_m.min(0.5 * (bound_m - self.reach_m));
                            continue;
                        }
                        let [a, b] = [one, other].map(|cluster| &self.clusters[cluster]);
                        slack_m = slack_m.min(self.pair([one, other], a.rest_distance_m(b), surface, near, scratch));
                    }
                }
            }
        }
        if exhaustive { near.finish_for_now() } else { near.finish(slack_m - ROUNDING_M) }
    }

    /// Returns how far (m) a cluster may still move until something `free_m` away at rest might be within reach, if
    /// that has moved as far.
    fn left_m(&self, scratch: &WallScratch, cluster: usize, free_m: f64) -> f64 {
        0.5 * (free_m - self.reach_m) - scratch.displaced[cluster].most_m
    }

    /// Looks at a pair of clusters if bounds do not rule it out. Returns how far (m) each may move until what was not
    /// listed might be within reach.
    fn pair(
        &self,
        pair: [usize; 2],
        free_m: f64,
        surface: &MovedSurface<'_>,
        near: &mut NearWalls,
        scratch: &mut WallScratch,
    ) -> f64 {
        let listed_m = self.reach_m + 2.0 * self.stride_m;
        let bound_m = scratch.bound_m(self, pair, free_m);
        if bound_m >= listed_m {
            return 0.5 * (bound_m - self.reach_m);
        }
        // Where its vertices are known, a cluster's displacements are, too.
        if self.fit(pair, surface, scratch) {
            let bound_m = scratch.bound_m(self, pair, free_m);
            if bound_m >= listed_m {
                return 0.5 * (bound_m - self.reach_m);
            }
        }
        self.look_at(pair, surface, near, scratch)
    }

    /// Makes the boxes of two clusters and of their displacements exact. Returns whether any was not.
    fn fit(&self, pair: [usize; 2], surface: &MovedSurface<'_>, scratch: &mut WallScratch) -> bool {
        let mut changed = false;
        for cluster in pair {
            if scratch.fitted[cluster].is_none() {
                self.fit_one(cluster, surface, scratch);
                changed = true;
            }
        }
        changed
    }

    fn fit_one(&self, cluster: usize, surface: &MovedSurface<'_>, scratch: &mut WallScratch) {
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let (mut places, mut displacements) = (none, none);
        let hold = |[low, high]: [DVec3; 2], p: DVec3| [low.min(p), high.max(p)];
        for &node in self.of_triangles.row(cluster) {
            let p = (surface.position_m)(node);
            scratch.x[node as usize] = p;
            places = hold(places, p);
            displacements = hold(displacements, p - self.rest_m[node as usize]);
        }
        for triangle in self.triangles.cluster_range(cluster) {
            let [a, b, c] = self.triangles.corners(triangle, &scratch.x);
            let middle = (a + b + c) / 3.0;
            let farthest_sq =
                a.distance_squared(middle).max(b.distance_squared(middle)).max(c.distance_squared(middle));
            scratch.balls[triangle] = (middle, farthest_sq.sqrt());
        }
        let [low_m, high_m] = displacements;
        scratch.fitted[cluster] = Some(places);
        scratch.displaced[cluster] = Displaced { low_m, high_m, ..scratch.displaced[cluster] };
    }

    /// Lists the vertices of each of two clusters with the triangles of the other that are near, and returns the same as
    /// [`Self::pair`].
    fn look_at(
        &self,
        [one, other]: [usize; 2],
        surface: &MovedSurface<'_>,
        near: &mut NearWalls,
        scratch: &mut WallScratch,
    ) -> f64 {
        self.fit([one, other], surface, scratch);
        let slack_m = self.list(one, other, near, scratch);
        if one == other { slack_m } else { slack_m.min(self.list(other, one, near, scratch)) }
    }

    /// Lists the vertices of one cluster with the near triangles of another.
    fn list(&self, of_nodes: usize, of_triangles: usize, near: &mut NearWalls, scratch: &WallScratch) -> f64 {
        let Some([low_m, high_m]) = scratch.fitted[of_triangles] else { return f64::INFINITY };
        let mut slack_m = f64::INFINITY;
        for &node in self.of_cluster.row(of_nodes) {
            let (at, y) = (&self.nodes[node as usize], scratch.x[node as usize]);
            if at.stiffness_n_per_m == 0.0 {
                continue;
            }
            let reach_m = at.reach_m();
            let listed_m = reach_m + 2.0 * self.stride_m;
            let bound_m = box_distance_m(y, low_m, high_m);
            if bound_m >= listed_m {
                slack_m = slack_m.min(0.5 * (bound_m - reach_m));
                continue;
            }
            for triangle in self.triangles.cluster_range(of_triangles) {
                let (middle_m, radius_m) = scratch.balls[triangle];
                let away_sq = y.distance_squared(middle_m);
                let within_m = listed_m + radius_m;
                if away_sq >= within_m * within_m {
                    slack_m = slack_m.min(self.stride_m);
                    continue;
                }
                let corners = self.triangles.corners(triangle, &scratch.x);
                let [wa, wb, wc] = closest_weights(y, corners);
                let distance_m = y.distance(corners[0] * wa + corners[1] * wb + corners[2] * wc);
                if distance_m >= listed_m {
                    slack_m = slack_m.min(0.5 * (distance_m - reach_m));
                } else if self.may_meet_m(node, triangle).is_some() {
                    let free_m = 0.5 * (distance_m - reach_m) - ROUNDING_M;
                    near.push(Pair { node, triangle: triangle as u32, free_m });
                }
            }
        }
        slack_m
    }
}

impl ClusterAtRest {
    /// Returns the distance (m) between the boxes of two clusters at rest.
    pub(super) fn rest_distance_m(&self, other: &Self) -> f64 {
        boxes_distance_m([self.low_m, self.high_m], [other.low_m, other.high_m])
    }

    fn moved(&self, by: &Displaced) -> [DVec3; 2] {
        [self.low_m + by.low_m, self.high_m + by.high_m]
    }
}

fn boxes_distance_m([low, high]: [DVec3; 2], [other_low, other_high]: [DVec3; 2]) -> f64 {
    (low - other_high).max(other_low - high).max(DVec3::ZERO).length()
}
