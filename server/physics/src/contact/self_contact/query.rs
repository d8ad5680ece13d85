//! The query: which vertices and triangles may meet soon, and when to ask again.
//!
//! At rest the triangles of two clusters that may meet are `D` apart or more, and displacements within boxes of the two
//! clusters differ by `|Δu|` at most. So they are no nearer than `D − |Δu|` now, and no nearer than their boxes. Two
//! clusters displaced by less than `½ (D − r)` each are farther apart than the reach `r`, whichever they are: most
//! clusters of most bodies are passed over by that alone.
//!
//! *Close* clusters, which are near at rest, have a `D` that was found vertex by vertex; others have that of their boxes.
//! Pairs that remain are looked at vertex by vertex. The surface moves by no more than its travel, as contact's broad
//! phase has it, so what is `r + 2 d` apart cannot meet within a travel of `d`.
use super::{
    lists::{NearWalls, Pair},
    rest::{ClusterAtRest, SelfContact, twice_area_m2},
};
use crate::contact::{
    broad::{self, CLUSTER, ROUNDING_M, box_distance_m},
    triangle::closest_weights,
};
use glam::DVec3;

/// Size of a cluster over that at rest from which it is torn. In a step that was too long and will be repeated, the body may
/// be anywhere, and would be looked at vertex by vertex for seconds.
const TORN: f64 = 8.0;
/// By how much a height over a plane may fall more than the plane's corners and the point tell, since the plane turns.
const TURNING: f64 = 1.1;
/// Way of a triangle's corners over its least height while which its plane turns by no more than 25°.
const TURNS_WITHIN: f64 = 0.2;
/// Number of clusters that are ruled out together.
const GROUP: usize = broad::GROUP / CLUSTER;

/// Buffers of queries and of pressing, sized once.
#[derive(Debug, Clone, Default)]
pub(in crate::contact) struct WallScratch {
    /// Positions (m) of the vertices of a skin whose vertices are no nodes.
    pub(super) x: Vec<DVec3>,
    /// Displacements (m) of the particles that carry them.
    pub(super) of_carriers_m: Vec<DVec3>,
    clusters: Vec<ClusterNow>,
    /// The boxes (m) around [`GROUP`] clusters each.
    groups: Vec<[DVec3; 2]>,
    /// `Σ_j |K_ij|` (N/m) of the nodes that are pressed, else 0.
    pub(super) rows_n_per_m: Vec<f64>,
    /// Largest of them over mass (1/s²) in the tick so far.
    pub(in crate::contact) most_frequency_sq: f64,
    pub(super) seen: super::MeetingWalls,
}

/// Where a cluster's nodes are.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::struct_field_names)] // all of them are lengths
struct ClusterNow {
    /// Its box (m).
    low_m: DVec3,
    high_m: DVec3,
    /// The box (m) around its nodes' displacements.
    least_m: DVec3,
    most_m: DVec3,
    /// A bound (m) of the largest of them.
    displaced_m: f64,
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
            of_carriers_m: vec![DVec3::ZERO; walls.carriers.of_skin],
            clusters: (0..walls.clusters.len()).map(|cluster| walls.cluster_now(cluster, &walls.rest_m)).collect(),
            groups: vec![[DVec3::ZERO; 2]; walls.clusters.len().div_ceil(GROUP)],
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
        let mut query = Query { x, clusters: &scratch.clusters, groups: &scratch.groups, near };
        let slack_m = (0..self.clusters.len())
            .map(|cluster| f64::min(self.look_close(cluster, &mut query), self.look_far(cluster, &mut query)))
            .fold(f64::INFINITY, f64::min);
        near.finish(slack_m - ROUNDING_M, |of_vertex| self.later_m(of_vertex, x));
    }

    fn cluster_now(&self, cluster: usize, x: &[DVec3]) -> ClusterNow {
        let (mut low_m, mut high_m) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut least_m, mut most_m) = (low_m, high_m);
        let mut is_finite = true;
        for &node in self.of_triangles.row(cluster) {
            let p = x[node as usize];
            let u = p - self.rest_m[node as usize];
            (low_m, high_m) = (low_m.min(p), high_m.max(p));
            (least_m, most_m) = (least_m.min(u), most_m.max(u));
            is_finite &= p.is_finite();
        }
        if !is_finite {
            // Minima and maxima may not see it.
            (low_m, high_m) = (DVec3::NEG_INFINITY, DVec3::INFINITY);
        }
        ClusterNow { low_m, high_m, least_m, most_m, displaced_m: least_m.abs().max(most_m.abs()).length() }
    }

    /// Looks at a cluster with those that are close to it at rest. This and what follows return how far (m) the surface
    /// may move until what was not listed might be within reach.
    fn look_close(&self, one: usize, query: &mut Query<'_>) -> f64 {
        let left_m = |cluster: usize, query: &Query<'_>| {
            self.left_m(self.clusters[cluster].free_close_m, &query.clusters[cluster])
        };
        let mut slack_m = left_m(one, query);
        if slack_m >= self.stride_m {
            return slack_m;
        }
        slack_m = f64::INFINITY;
        for entry in self.close.row(one) {
            let other = entry.cluster as usize;
            // A pair of which both have moved far is looked at from the first.
            if other >= one || left_m(other, query) >= self.stride_m {
                slack_m = slack_m.min(self.pair([one, other], Some(entry.free_m), query));
            }
        }
        slack_m
    }

    /// Does the same with those that are not close.
    fn look_far(&self, one: usize, query: &mut Query<'_>) -> f64 {
        let left_m = |cluster: usize, query: &Query<'_>| {
            self.left_m(self.clusters[cluster].free_far_m, &query.clusters[cluster])
        };
        let mut slack_m = left_m(one, query);
        if slack_m >= self.stride_m {
            return slack_m;
        }
        slack_m = f64::INFINITY;
        let mut close = self.close.row(one).iter().map(|entry| entry.cluster as usize).peekable();
        let now = query.clusters[one];
        for (group, of_group) in query.groups.iter().enumerate() {
            let bound_m = boxes_distance_m([now.low_m, now.high_m], *of_group);
            if bound_m >= self.listed_m() {
                slack_m = slack_m.min(0.5 * (bound_m - self.reach_m));
                continue;
            }
            for other in group * GROUP..((group + 1) * GROUP).min(self.clusters.len()) {
                while close.next_if(|close| *close < other).is_some() {}
                let is_close = close.peek() == Some(&other);
                if !is_close && (other >= one || left_m(other, query) >= self.stride_m) {
                    slack_m = slack_m.min(self.pair([one, other], None, query));
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

    /// Looks at a pair of clusters if bounds do not rule it out. `free_m` is how far apart close ones are at rest where
    /// they may meet.
    fn pair(&self, [one, other]: [usize; 2], free_m: Option<f64>, query: &mut Query<'_>) -> f64 {
        let [a, b] = [&query.clusters[one], &query.clusters[other]];
        if self.is_torn(one, a) || self.is_torn(other, b) {
            query.near.miss();
            return f64::INFINITY;
        }
        let bound_m = match free_m {
            Some(free_m) => (free_m - a.differs_m(b.least_m, b.most_m)).max(a.distance_m(b)),
            None => a.distance_m(b),
        };
        if bound_m >= self.listed_m() {
            return 0.5 * (bound_m - self.reach_m);
        }
        let slack_m = self.list(one, other, free_m.is_some(), query);
        if one == other { slack_m } else { slack_m.min(self.list(other, one, free_m.is_some(), query)) }
    }

    /// Returns the distance (m) within which what may meet is listed, whatever vertex it is.
    fn listed_m(&self) -> f64 {
        self.reach_m + 2.0 * self.stride_m
    }

    fn is_torn(&self, cluster: usize, now: &ClusterNow) -> bool {
        let at = &self.clusters[cluster];
        now.low_m.distance(now.high_m) > TORN * at.low_m.distance(at.high_m)
    }

    /// Lists the vertices of one cluster with the near triangles of another.
    fn list(&self, of_nodes: usize, of_triangles: usize, is_close: bool, query: &mut Query<'_>) -> f64 {
        let (x, other) = (query.x, &query.clusters[of_triangles]);
        let triangles = self.triangles.cluster_range(of_triangles);
        let mut balls = [Ball::default(); CLUSTER];
        for (triangle, ball) in triangles.clone().zip(&mut balls) {
            *ball = Ball::around(self.triangles.corners(triangle, x));
        }
        let mut slack_m = f64::INFINITY;
        for &node in self.of_cluster.row(of_nodes) {
            let (at, y) = (&self.nodes[node as usize], x[node as usize]);
            if at.stiffness_n_per_m == 0.0 {
                continue;
            }
            let reach_m = at.reach_m();
            let listed_m = reach_m + 2.0 * self.stride_m;
            let u = y - self.rest_m[node as usize];
            let free_m = if is_close { at.free_close_m - other.differs_m(u, u) } else { f64::NEG_INFINITY };
            let bound_m = free_m.max(box_distance_m(y, other.low_m, other.high_m));
            if bound_m >= listed_m {
                slack_m = slack_m.min(0.5 * (bound_m - reach_m));
                continue;
            }
            for (triangle, ball) in triangles.clone().zip(balls) {
                let within_m = listed_m + ball.radius_m;
                if y.distance_squared(ball.middle_m) >= within_m * within_m {
                    slack_m = slack_m.min(self.stride_m);
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

    /// Returns how far (m) the surface has to move before a vertex with these pairs may be pressed: before it is within its margin
    /// of a triangle or, as at a rim, of the plane of one. With the weights `β` of its foot on the plane, its height falls by no more than
    /// `1 + Σ |β_i|` times that over the cosine by which the plane turns, which is little while its corners move by no more than a part
    /// of the triangle's least height. −∞ where it may be pressed already.
    fn later_m(&self, of_vertex: &[Pair], x: &[DVec3]) -> f64 {
        let Some(first) = of_vertex.first() else { return f64::NEG_INFINITY };
        let (y, margin_m) = (x[first.node as usize], self.nodes[first.node as usize].margin_m);
        let of_pair_m = |pair: &Pair| {
            let corners = self.triangles.corners(pair.triangle as usize, x);
            let (area, from) = (twice_area_m2(corners), y - corners[0]);
            let area_sq = area.length_squared();
            let wb = from.cross(corners[2] - corners[0]).dot(area) / area_sq;
            let wc = (corners[1] - corners[0]).cross(from).dot(area) / area_sq;
            let falls = TURNING * (1.0 + (1.0 - wb - wc).abs() + wb.abs() + wc.abs());
            let height_m = from.dot(area) / area_sq.sqrt();
            let longest_m = corners[0]
                .distance(corners[1])
                .max(corners[1].distance(corners[2]).max(corners[2].distance(corners[0])));
            let turns_m = TURNS_WITHIN * area_sq.sqrt() / longest_m;
            f64::min(0.5 * (self.distance_m(y, pair.triangle as usize, x) - margin_m), (height_m - margin_m) / falls)
                .min(turns_m)
        };
        let least_m = of_vertex.iter().map(of_pair_m).fold(f64::INFINITY, f64::min) - ROUNDING_M;
        if least_m > 0.0 { least_m } else { f64::NEG_INFINITY }
    }

    fn distance_m(&self, y: DVec3, triangle: usize, x: &[DVec3]) -> f64 {
        let corners = self.triangles.corners(triangle, x);
        let [wa, wb, wc] = closest_weights(y, corners);
        y.distance(corners[0] * wa + corners[1] * wb + corners[2] * wc)
    }
}

impl ClusterAtRest {
    /// Returns the distance (m) between the boxes of two clusters at rest.
    pub(super) fn rest_distance_m(&self, other: &Self) -> f64 {
        boxes_distance_m([self.low_m, self.high_m], [other.low_m, other.high_m])
    }
}

impl ClusterNow {
    /// Returns the distance (m) between the boxes of two clusters.
    fn distance_m(&self, other: &Self) -> f64 {
        boxes_distance_m([self.low_m, self.high_m], [other.low_m, other.high_m])
    }

    /// Returns `|Δu|` (m), how much any of its displacements may differ from one between these.
    fn differs_m(&self, least_m: DVec3, most_m: DVec3) -> f64 {
        (self.most_m - least_m).max(most_m - self.least_m).length()
    }
}

/// A ball.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ball {
    middle_m: DVec3,
    radius_m: f64,
}

impl Ball {
    /// Returns one around a triangle.
    pub(super) fn around([a, b, c]: [DVec3; 3]) -> Self {
        let middle_m = (a + b + c) / 3.0;
        let of = |corner: DVec3| corner.distance_squared(middle_m);
        Self { middle_m, radius_m: of(a).max(of(b)).max(of(c)).sqrt() }
    }

    /// Returns how far (m) a point is from it, negative inside.
    pub(super) fn distance_m(self, point_m: DVec3) -> f64 {
        point_m.distance(self.middle_m) - self.radius_m
    }
}

fn boxes_distance_m([low, high]: [DVec3; 2], [other_low, other_high]: [DVec3; 2]) -> f64 {
    (low - other_high).max(other_low - high).max(DVec3::ZERO).length()
}
