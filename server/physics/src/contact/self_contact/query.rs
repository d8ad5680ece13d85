//! The query: which vertices and triangles may meet soon, and when to ask again.
//!
//! At rest the triangles of two clusters that may meet are `D` apart or more, and displacements within boxes of the two
//! clusters differ by `|Δu|` at most. So they are no nearer than `D − |Δu|` now, and no nearer than their boxes. Two
//! clusters displaced by less than `½ (D − r)` each are farther apart than the reach `r`, whichever they are: most
//! clusters of most bodies are passed over by that alone.
//!
//! *Close* clusters, which are near at rest, have a `D` that was found vertex by vertex; others have that of their boxes.
//! A body that is pressed turns more than it is strained. With any rotation `R`, vertices `a` and `b` are
//! `|R (X_a − X_b) + w_a − w_b| ≥ |X_a − X_b| − |w_a − w_b|` apart, where `w = x − R X`: what displacements do not rule out is
//! looked at once more by those in the frame of one of the clusters, which turned with it.
//! Pairs that remain are looked at vertex by vertex. The surface moves by no more than its travel, as contact's broad
//! phase has it, so what is `r + 2 d` apart cannot meet within a travel of `d`.
use super::{
    bounds::{Ball, ClusterNow, Displacements, Turned, boxes_distance_m},
    lists::{NearWalls, Pair},
    rest::SelfContact,
};
use crate::contact::{
    broad::{self, CLUSTER, ROUNDING_M, box_distance_m},
    triangle::closest_weights,
};
use glam::{DMat3, DVec3};
use std::ops::Range;

/// Size of a cluster over that at rest from which it is torn. In a step that was too long and will be repeated, the body may
/// be anywhere, and would be looked at vertex by vertex for seconds.
const TORN: f64 = 8.0;
/// Distance of groups over that within which what may meet is listed, from which clusters of one are not compared with those
/// of the other.
const GROUPS_APART: f64 = 2.0;
/// Strides that a list serves at least where little is near, and how often clusters may be looked at vertex by vertex for it.
const STRIDES: f64 = 4.0;
const MOST_LOOKS: u32 = 8;
/// Number of clusters that are ruled out together.
const GROUP: usize = broad::GROUP / CLUSTER;

/// Buffers of queries and of pressing, sized once.
#[derive(Debug, Clone, Default)]
pub(in crate::contact) struct WallScratch {
    /// Positions (m) of the vertices of a skin whose vertices are no nodes.
    pub(super) x: Vec<DVec3>,
    clusters: Vec<ClusterNow>,
    /// The boxes (m) around [`GROUP`] clusters each.
    groups: Vec<[DVec3; 2]>,
    /// Numbers of groups that may be near one.
    near_groups: Vec<u32>,
    /// `Σ_j |K_ij|` (N/m) of the nodes that are pressed, else 0.
    pub(super) rows_n_per_m: Vec<f64>,
    /// Largest of them over mass (1/s²) in the tick so far.
    pub(in crate::contact) most_frequency_sq: f64,
    pub(super) seen: super::MeetingWalls,
}

impl WallScratch {
    /// Returns the walls that meet, at the last evaluation of forces.
    pub(in crate::contact) fn seen(&self) -> super::MeetingWalls {
        self.seen
    }

    pub(super) fn new(walls: &SelfContact) -> Self {
        let nodes = walls.rest_m.len();
        Self {
            x: walls.rest_m.clone(),
            clusters: (0..walls.clusters.len()).map(|cluster| walls.cluster_now(cluster, &walls.rest_m)).collect(),
            groups: vec![[DVec3::ZERO; 2]; walls.clusters.len().div_ceil(GROUP)],
            near_groups: Vec::with_capacity(walls.clusters.len().div_ceil(GROUP)),
            rows_n_per_m: vec![0.0; nodes],
            ..Self::default()
        }
    }
}

/// What a query reads, beside the body at rest, and the list that it makes.
struct Query<'a> {
    x: &'a [DVec3],
    clusters: &'a [ClusterNow],
    groups: &'a [[DVec3; 2]],
    near: &'a mut NearWalls,
    /// How far (m) the surface may move at least until the next query.
    stride_m: f64,
    /// How often vertices of one cluster were looked at with the triangles of another.
    looks: u32,
}

impl Query<'_> {
    /// Returns the distance (m) within which what may meet is listed, with the largest reach (m) of any vertex.
    fn listed_m(&self, reach_m: f64) -> f64 {
        reach_m + 2.0 * self.stride_m
    }
}

impl SelfContact {
    /// Renews the list of what may meet with nodes at `x` (m), where it is out of date. Returns whether it was.
    pub(super) fn renew(&self, x: &[DVec3], exhaustive: bool, near: &mut NearWalls, scratch: &mut WallScratch) -> bool {
        if near.slack_m > 0.0 || near.is_still_good(|near| near.farthest_m(x)) {
            return false;
        }
        self.query(x, exhaustive, near, scratch);
        near.remember(x);
        true
    }

    /// Lists what may meet soon. `exhaustive` looks at every vertex and triangle, and has to be asked again at once.
    pub(super) fn query(&self, x: &[DVec3], exhaustive: bool, near: &mut NearWalls, scratch: &mut WallScratch) {
        near.clear();
        if exhaustive {
            self.list_all(x, near);
            near.finish(0.0, |_| f64::NEG_INFINITY);
            return;
        }
        for (cluster, now) in scratch.clusters.iter_mut().enumerate() {
            *now = self.cluster_now(cluster, x);
        }
        for (group, clusters) in scratch.groups.iter_mut().zip(scratch.clusters.chunks(GROUP)) {
            let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            *group = clusters.iter().fold(none, |[low, high], now| [low.min(now.low_m), high.max(now.high_m)]);
        }
        let mut slack_m = None;
        if near.tries_long() {
            slack_m = self.list_near(x, STRIDES, MOST_LOOKS, near, scratch);
            near.tried_long(slack_m.is_some());
        }
        let slack_m = slack_m.unwrap_or_else(|| {
            near.clear();
            self.list_near(x, 1.0, u32::MAX, near, scratch).unwrap_or(f64::NEG_INFINITY)
        });
        near.finish(slack_m - ROUNDING_M, |of_vertex| self.later_m(of_vertex, x));
    }

    /// Lists what may meet within so many strides, with clusters as they are now. Returns how far (m) the surface may move until what
    /// was not listed might be within reach, or `None` where clusters would have to be looked at vertex by vertex more often than
    /// `most_looks`.
    fn list_near(
        &self,
        x: &[DVec3],
        strides: f64,
        most_looks: u32,
        near: &mut NearWalls,
        scratch: &mut WallScratch,
    ) -> Option<f64> {
        let WallScratch { clusters, groups, near_groups, .. } = scratch;
        let mut query = Query { x, clusters, groups, near, stride_m: strides * self.stride_m, looks: 0 };
        let mut slack_m = f64::INFINITY;
        for group in 0..query.groups.len() {
            let others_m = self.find_near_groups(group, &query, near_groups);
            for cluster in clusters_of(group, self.clusters.len()) {
                slack_m = slack_m.min(self.look_close(cluster, &mut query)).min(self.look_far(
                    cluster,
                    near_groups,
                    others_m,
                    &mut query,
                ));
                if query.looks > most_looks {
                    return None;
                }
            }
        }
        Some(slack_m)
    }

    /// Looks at a cluster with those that are close to it at rest. This and what follows return how far (m) the surface
    /// may move until what was not listed might be within reach.
    fn look_close(&self, one: usize, query: &mut Query<'_>) -> f64 {
        let left_m = |cluster: usize, query: &Query<'_>| {
            self.left_m(self.clusters[cluster].free_close_m, &query.clusters[cluster])
        };
        let mut slack_m = left_m(one, query);
        if slack_m >= query.stride_m {
            return slack_m;
        }
        slack_m = f64::INFINITY;
        let mut turned = None;
        for entry in self.close.row(one) {
            let other = entry.cluster as usize;
            // A pair of which both have moved far is looked at from the first.
            if other >= one || left_m(other, query) >= query.stride_m {
                slack_m = slack_m.min(self.close_pair([one, other], entry.free_m, &mut turned, query));
            }
        }
        slack_m
    }

    /// Finds the groups whose clusters may be near those of a group. Returns how far (m) the surface may move until what is
    /// in the others might be within reach.
    fn find_near_groups(&self, group: usize, query: &Query<'_>, near_groups: &mut Vec<u32>) -> f64 {
        near_groups.clear();
        let (groups, apart_m) = (query.groups, GROUPS_APART * query.listed_m(self.reach_m));
        let mut slack_m = f64::INFINITY;
        for (other, of_other) in (0..).zip(groups) {
            let bound_m = boxes_distance_m(groups[group], *of_other);
            if bound_m >= apart_m {
                slack_m = slack_m.min(0.5 * (bound_m - self.reach_m));
            } else {
                near_groups.push(other);
            }
        }
        slack_m
    }

    /// Does the same as [`Self::look_close`] with those that are not close, of the groups that may be near and of the others,
    /// of which it is known how far the surface may move.
    fn look_far(&self, one: usize, near_groups: &[u32], others_m: f64, query: &mut Query<'_>) -> f64 {
        let left_m = |cluster: usize, query: &Query<'_>| {
            self.left_m(self.clusters[cluster].free_far_m, &query.clusters[cluster])
        };
        let mut slack_m = left_m(one, query);
        if slack_m >= query.stride_m {
            return slack_m;
        }
        slack_m = others_m;
        let mut close = self.close.row(one).iter().map(|entry| entry.cluster as usize).peekable();
        let now = query.clusters[one];
        for &group in near_groups {
            let group = group as usize;
            let bound_m = boxes_distance_m([now.low_m, now.high_m], query.groups[group]);
            if bound_m >= query.listed_m(self.reach_m) {
                slack_m = slack_m.min(0.5 * (bound_m - self.reach_m));
                continue;
            }
            for other in clusters_of(group, self.clusters.len()) {
                while close.next_if(|close| *close < other).is_some() {}
                let is_close = close.peek() == Some(&other);
                if !is_close && (other >= one || left_m(other, query) >= query.stride_m) {
                    slack_m = slack_m.min(self.far_pair([one, other], query));
                }
            }
        }
        slack_m
    }

    /// Returns how far (m) a cluster may still move until something `free_m` away at rest might be within reach, if
    /// that has moved as far.
    fn left_m(&self, free_m: f64, now: &ClusterNow) -> f64 {
        0.5 * (free_m - self.reach_m) - now.displaced_m
    }

    /// Looks at a pair of clusters that are not close at rest, if their boxes do not rule it out.
    fn far_pair(&self, [one, other]: [usize; 2], query: &mut Query<'_>) -> f64 {
        let [a, b] = [&query.clusters[one], &query.clusters[other]];
        if self.is_torn(one, a) || self.is_torn(other, b) {
            query.near.miss();
            return f64::INFINITY;
        }
        let bound_m = a.distance_m(b);
        if bound_m >= query.listed_m(self.reach_m) {
            return 0.5 * (bound_m - self.reach_m);
        }
        let slack_m = self.list([one, other], None, query);
        if one == other { slack_m } else { slack_m.min(self.list([other, one], None, query)) }
    }

    /// Looks at a pair of close clusters, which are `free_m` apart at rest where they may meet, if bounds do not rule it out:
    /// first by displacements, then by displacements as the first cluster sees them, which turned.
    fn close_pair(
        &self,
        [one, other]: [usize; 2],
        free_m: f64,
        turned: &mut Option<Turned>,
        query: &mut Query<'_>,
    ) -> f64 {
        let [a, b] = [&query.clusters[one], &query.clusters[other]];
        if self.is_torn(one, a) || self.is_torn(other, b) {
            query.near.miss();
            return f64::INFINITY;
        }
        let bound_m = (free_m - a.displaced.differs_m(&b.displaced)).max(a.distance_m(b));
        if bound_m >= query.listed_m(self.reach_m) {
            return 0.5 * (bound_m - self.reach_m);
        }
        let turned = turned.get_or_insert_with(|| {
            let frame = self.frame(one, query.x);
            Turned { frame, displaced: self.displaced_in(one, &frame, query.x) }
        });
        let of_other = self.displaced_in(other, &turned.frame, query.x);
        let bound_m = bound_m.max(free_m - turned.displaced.differs_m(&of_other));
        if bound_m >= query.listed_m(self.reach_m) {
            return 0.5 * (bound_m - self.reach_m);
        }
        let frame = turned.frame;
        let slack_m = self.list([one, other], Some((&frame, &of_other)), query);
        if one == other {
            return slack_m;
        }
        let of_one = turned.displaced;
        slack_m.min(self.list([other, one], Some((&frame, &of_one)), query))
    }

    fn is_torn(&self, cluster: usize, now: &ClusterNow) -> bool {
        let at = &self.clusters[cluster];
        now.low_m.distance(now.high_m) > TORN * at.low_m.distance(at.high_m)
    }

    /// Lists the vertices of one cluster with the near triangles of another. Of close ones it is known how those of the
    /// triangles are displaced in a frame.
    fn list(
        &self,
        [of_nodes, of_triangles]: [usize; 2],
        close: Option<(&DMat3, &Displacements)>,
        query: &mut Query<'_>,
    ) -> f64 {
        query.looks += 1;
        let (x, other) = (query.x, &query.clusters[of_triangles]);
        let triangles = self.triangles.cluster_range(of_triangles);
        // Of most clusters no vertex is as near as that.
        let mut balls: Option<[Ball; CLUSTER]> = None;
        let mut slack_m = f64::INFINITY;
        for &node in self.of_cluster.row(of_nodes) {
            let (at, y) = (&self.nodes[node as usize], x[node as usize]);
            if at.stiffness_n_per_m == 0.0 {
                continue;
            }
            let reach_m = at.reach_m();
            let listed_m = query.listed_m(reach_m);
            let rest_m = self.rest_m[node as usize];
            let free_m = close.map_or(f64::NEG_INFINITY, |(frame, of_triangles)| {
                let as_seen = of_triangles.differs_from_m(y - *frame * rest_m);
                at.free_close_m - as_seen.min(other.displaced.differs_from_m(y - rest_m))
            });
            let bound_m = free_m.max(box_distance_m(y, other.low_m, other.high_m));
            if bound_m >= listed_m {
                slack_m = slack_m.min(0.5 * (bound_m - reach_m));
                continue;
            }
            let balls = balls.get_or_insert_with(|| self.balls_of(of_triangles, x));
            for (triangle, &mut ball) in triangles.clone().zip(balls) {
                let within_m = listed_m + ball.radius_m;
                if y.distance_squared(ball.middle_m) >= within_m * within_m {
                    slack_m = slack_m.min(query.stride_m);
                    continue;
                }
                let distance_m = self.distance_m(y, triangle, x);
                if distance_m >= listed_m {
                    slack_m = slack_m.min(0.5 * (distance_m - reach_m));
                } else if self.may_meet_m(node, triangle).is_some() {
                    let free_m = 0.5 * (distance_m - reach_m) - ROUNDING_M;
                    query.near.push(Pair { node, triangle: triangle as u32, free_m });
                }
            }
        }
        slack_m
    }

    /// Lists all that is within reach and may meet.
    fn list_all(&self, x: &[DVec3], near: &mut NearWalls) {
        for (node, at) in (0..).zip(&self.nodes).filter(|(_, at)| at.stiffness_n_per_m > 0.0) {
            for triangle in 0..self.triangles.len() {
                let is_within = self.distance_m(x[node as usize], triangle, x) <= at.reach_m();
                if is_within && self.may_meet_m(node, triangle).is_some() {
                    near.push(Pair { node, triangle: triangle as u32, free_m: f64::NEG_INFINITY });
                }
            }
        }
    }

    pub(super) fn distance_m(&self, y: DVec3, triangle: usize, x: &[DVec3]) -> f64 {
        let corners = self.triangles.corners(triangle, x);
        let [wa, wb, wc] = closest_weights(y, corners);
        y.distance(corners[0] * wa + corners[1] * wb + corners[2] * wc)
    }
}

/// Returns the clusters of a group, among so many.
fn clusters_of(group: usize, clusters: usize) -> Range<usize> {
    group * GROUP..((group + 1) * GROUP).min(clusters)
}
