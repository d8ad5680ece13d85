//! The broad phase finds the triangles that a tool can touch, without looking at the others.
//!
//! The boundary's triangles are sorted along a Morton curve of their rest centroids and cut into clusters of
//! [`CLUSTER`] neighbours. A cluster's box is refitted only when a tool might be near it. What makes a stale box safe
//! is the *travel* `τ(t) = ∫ max_i |v_i| dt`: no surface point moves further than `τ(t) − τ(t₀)` after `t₀`, so the box
//! of `t₀`, grown by that much, still holds its triangles. The leapfrog drift is a straight line at a known velocity,
//! so the bound is exact, not an estimate.
//!
//! A query lists the triangles within `reach` of a tool's axis and returns how much further away all others are. As
//! long as the path of any point of that axis plus the travel stay below that slack, the list holds every triangle that
//! can be touched: far from the body a tick costs two additions per tool and substep. A box is at least as far from an
//! axis as from the axis's centre, less half its length; the same holds for pieces of the axis
//! ([`Axis::distance_bound_m`]).
use super::{CarriersThen, ClustersThen, axis::Axis};
use crate::mesh::Surface;
use glam::DVec3;
use std::ops::Range;

/// Number of triangles per cluster.
pub(crate) const CLUSTER: usize = 32;
/// Number of triangles per group of clusters.
pub(crate) const GROUP: usize = 32 * CLUSTER;
/// A length (m) far above the rounding of the travel's sums.
pub(crate) const ROUNDING_M: f64 = 1e-12;

/// The boundary's triangles in the order of the broad phase.
#[derive(Debug, Clone, Default)]
pub(super) struct Triangles {
    /// Nodes of each triangle, in Morton order.
    pub(super) nodes: Vec<[u32; 3]>,
    /// Index of each in [`Surface::triangles`].
    pub(super) surface_triangle: Vec<u32>,
}

/// Box of a cluster at the time when it was fitted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClusterBox {
    lo: DVec3,
    hi: DVec3,
    /// Travel `τ` (m) when the box was fitted; −∞ if it never was.
    fitted_at_m: f64,
}

impl ClusterBox {
    pub(super) const UNFITTED: Self = Self { lo: DVec3::ZERO, hi: DVec3::ZERO, fitted_at_m: f64::NEG_INFINITY };

    /// Returns a lower bound of the distance (m) from `p` to the cluster's triangles when the travel is `travel_m`.
    pub(crate) fn distance_bound_m(&self, p: DVec3, travel_m: f64) -> f64 {
        box_distance_m(p, self.lo, self.hi) - (travel_m - self.fitted_at_m)
    }

    /// Returns the same from an axis; the bound is refined where it is below `wanted_m`.
    fn axis_bound_m(&self, axis: &Axis, wanted_m: f64, travel_m: f64) -> f64 {
        axis.distance_bound_m(wanted_m, |p| self.distance_bound_m(p, travel_m))
    }

    fn around(points: impl Iterator<Item = DVec3>, travel_m: f64) -> Self {
        let none = Self { lo: DVec3::INFINITY, hi: DVec3::NEG_INFINITY, fitted_at_m: travel_m };
        points.fold(none, |fitted, p| Self { lo: fitted.lo.min(p), hi: fitted.hi.max(p), ..fitted })
    }
}

/// The clusters' boxes and the travel by which they are out of date.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FittedBoxes<'a> {
    /// Box of every cluster.
    pub(crate) boxes: &'a [ClusterBox],
    /// Travel `τ` (m) now.
    pub(crate) travel_m: f64,
}

/// The same boxes, to be refitted.
#[derive(Debug)]
pub(super) struct FittedBoxesMut<'a> {
    /// Box of every cluster.
    pub(super) boxes: &'a mut [ClusterBox],
    /// Travel `τ` (m) now.
    pub(super) travel_m: f64,
}

/// How far from a tool's axis triangles are listed.
#[derive(Debug, Clone, Copy)]
pub(super) struct ListReach {
    /// Triangles within this distance (m) are listed.
    pub(super) listed_m: f64,
    /// No triangle within this distance (m) may be missing from the list while it is used.
    pub(super) complete_m: f64,
}

/// A surface whose positions are computed when they are asked for: a hybrid body's skin, or a refined mass-spring
/// surface.
pub(crate) trait Skin {
    /// Begins queries, at positions that do not change before the last of them.
    fn begin(&mut self);
    /// Returns a lower bound (m) of the distance from a point to the triangles of a group.
    fn group_distance_m(&self, group: usize, from_m: DVec3) -> f64;
    /// Returns the same for a cluster.
    fn cluster_distance_m(&self, cluster: usize, from_m: DVec3) -> f64;
    /// Returns the number of clusters.
    fn clusters(&self) -> usize;
    /// Returns the vertices of a cluster.
    fn vertices(&self, cluster: usize) -> &[u32];
    /// Returns the position (m) of a vertex.
    fn position_m(&self, vertex: u32) -> DVec3;

    /// Notes where what carries the skin is.
    fn remember(&self, _: &mut CarriersThen) {}

    /// Returns a bound of how far (m) any vertex is from where it was then. Nothing is known of a skin that notes nothing.
    fn moved_m(&self, _: &CarriersThen) -> f64 {
        f64::INFINITY
    }

    /// Notes where what carries a cluster of walls is.
    fn remember_walls(&self, _cluster: usize, _: &mut ClustersThen) {}

    /// Returns a bound of how far (m) any vertex of a cluster of walls is from where it was then.
    fn walls_moved_m(&self, _cluster: usize, _: &ClustersThen) -> f64 {
        f64::INFINITY
    }
}

/// Triangles that a tool may touch, and how far things may move before the list is out of date.
#[derive(Debug, Clone)]
pub(super) struct Candidates {
    list: Box<[u32]>,
    /// Each triangle's distance (m) less the slack when it was looked at last; −∞ if it never was.
    above_slack_m: Box<[f64]>,
    count: usize,
    /// Relative motion (m) that is left until the list must be renewed.
    pub(super) slack_m: f64,
}

impl Default for Candidates {
    fn default() -> Self {
        Self::with_capacity(0)
    }
}

impl Candidates {
    pub(super) fn with_capacity(triangles: usize) -> Self {
        Self {
            list: vec![0; triangles].into_boxed_slice(),
            above_slack_m: vec![f64::NEG_INFINITY; triangles].into_boxed_slice(),
            count: 0,
            slack_m: f64::NEG_INFINITY,
        }
    }

    /// Returns the listed triangles, ascending.
    pub(super) fn triangles(&self) -> &[u32] {
        &self.list[..self.count]
    }

    fn push(&mut self, triangle: usize) {
        self.list[self.count] = triangle as u32;
        self.above_slack_m[self.count] = f64::NEG_INFINITY;
        self.count += 1;
    }

    /// Returns a lower bound (m) of the distance from the tool's axis to a listed triangle: its distance when it was
    /// looked at last, less the motion since. It is not a number where all triangles are listed
    /// ([`Triangles::list_all`]).
    pub(super) fn least_distance_m(&self, number: usize) -> f64 {
        self.above_slack_m[number] + self.slack_m - ROUNDING_M
    }

    /// Records how far (m) a listed triangle is from the tool's axis now.
    pub(super) fn set_distance_m(&mut self, number: usize, distance_m: f64) {
        self.above_slack_m[number] = distance_m - self.slack_m;
    }
}

impl Triangles {
    pub(super) fn of(surface: &Surface, rest_positions_m: &[DVec3]) -> Self {
        let nodes_of = |t: u32| surface.triangle_nodes(t as usize);
        let centroid = |t: u32| nodes_of(t).iter().map(|&n| rest_positions_m[n as usize]).sum::<DVec3>() * (1.0 / 3.0);
        let (lo, hi) =
            rest_positions_m.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |b, p| (b.0.min(*p), b.1.max(*p)));
        let scale = 1023.0 / (hi - lo).max_element().max(f64::MIN_POSITIVE);
        let mut order: Vec<(u32, u32)> =
            (0..surface.triangles.len() as u32).map(|t| (morton((centroid(t) - lo) * scale), t)).collect();
        order.sort_unstable();
        let surface_triangle: Vec<u32> = order.iter().map(|o| o.1).collect();
        Self { nodes: surface_triangle.iter().map(|&t| nodes_of(t)).collect(), surface_triangle }
    }

    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(super) fn clusters(&self) -> usize {
        self.nodes.len().div_ceil(CLUSTER)
    }

    pub(super) fn corners(&self, triangle: usize, x: &[DVec3]) -> [DVec3; 3] {
        self.nodes[triangle].map(|n| x[n as usize])
    }

    pub(super) fn cluster_range(&self, cluster: usize) -> Range<usize> {
        cluster * CLUSTER..((cluster + 1) * CLUSTER).min(self.nodes.len())
    }

    fn fit(&self, cluster: usize, x: &[DVec3], travel_m: f64) -> ClusterBox {
        let nodes = self.nodes[self.cluster_range(cluster)].iter().flatten();
        ClusterBox::around(nodes.map(|&node| x[node as usize]), travel_m)
    }

    /// Lists the triangles within `reach.listed_m` of an axis, and sets the slack: how much further away than
    /// `reach.complete_m` all others are.
    pub(super) fn query(
        &self,
        x: &[DVec3],
        FittedBoxesMut { boxes, travel_m }: FittedBoxesMut<'_>,
        axis: &Axis,
        ListReach { listed_m: reach_m, complete_m }: ListReach,
        candidates: &mut Candidates,
    ) {
        candidates.count = 0;
        let mut others_m = f64::INFINITY;
        for (cluster, fitted) in boxes.iter_mut().enumerate() {
            if fitted.axis_bound_m(axis, reach_m, travel_m) < reach_m {
                *fitted = self.fit(cluster, x, travel_m);
            }
            let bound_m = fitted.axis_bound_m(axis, reach_m, travel_m);
            if bound_m >= reach_m {
                others_m = others_m.min(bound_m);
                continue;
            }
            for triangle in self.cluster_range(cluster) {
                let distance_m = axis.distance_m(self.corners(triangle, x));
                if distance_m >= reach_m {
                    others_m = others_m.min(distance_m);
                } else {
                    candidates.push(triangle);
                }
            }
        }
        candidates.slack_m = others_m - complete_m - ROUNDING_M;
    }

    /// Does the same as [`Self::query`] on a skin, whose positions are computed only where they are needed: bounds that
    /// need none rule clusters out first. Positions (m) of the others' vertices are written into `x`.
    pub(super) fn query_skin(
        &self,
        skin: &mut impl Skin,
        x: &mut [DVec3],
        FittedBoxesMut { boxes, travel_m }: FittedBoxesMut<'_>,
        axis: &Axis,
        ListReach { listed_m: reach_m, complete_m }: ListReach,
        candidates: &mut Candidates,
    ) {
        candidates.count = 0;
        skin.begin();
        let mut others_m = f64::INFINITY;
        for group in (0..self.len()).step_by(GROUP) {
            let end = (group + GROUP).min(self.len());
            let bound_m = axis.distance_bound_m(reach_m, |p| skin.group_distance_m(group / GROUP, p));
            if bound_m >= reach_m {
                others_m = others_m.min(bound_m);
                continue;
            }
            for cluster in (group..end).step_by(CLUSTER) {
                let cluster = cluster / CLUSTER;
                let fitted = &mut boxes[cluster];
                let mut bound_m = fitted.axis_bound_m(axis, reach_m, travel_m);
                if bound_m < reach_m {
                    bound_m = bound_m.max(axis.distance_bound_m(reach_m, |p| skin.cluster_distance_m(cluster, p)));
                }
                if bound_m < reach_m {
                    skin.vertices(cluster).iter().for_each(|&vertex| x[vertex as usize] = skin.position_m(vertex));
                    *fitted = self.fit(cluster, x, travel_m);
                    bound_m = fitted.axis_bound_m(axis, reach_m, travel_m);
                }
                if bound_m >= reach_m {
                    others_m = others_m.min(bound_m);
                    continue;
                }
                for triangle in self.cluster_range(cluster) {
                    let distance_m = axis.distance_m(self.corners(triangle, x));
                    if distance_m >= reach_m {
                        others_m = others_m.min(distance_m);
                    } else {
                        candidates.push(triangle);
                    }
                }
            }
        }
        candidates.slack_m = others_m - complete_m - ROUNDING_M;
    }

    /// Lists every triangle: the oracle of [`Self::query`].
    pub(super) fn list_all(&self, candidates: &mut Candidates) {
        candidates.count = 0;
        for triangle in 0..self.len() {
            candidates.push(triangle);
        }
        candidates.slack_m = f64::NEG_INFINITY;
    }
}

pub(crate) fn box_distance_m(p: DVec3, lo: DVec3, hi: DVec3) -> f64 {
    (lo - p).max(p - hi).max(DVec3::ZERO).length()
}

/// Interleaves the bits of three coordinates in 0..1024.
fn morton(p: DVec3) -> u32 {
    let spread = |value: f64| {
        let mut bits = (value as u32).min(1023);
        bits = (bits | bits << 16) & 0x0300_00ff;
        bits = (bits | bits << 8) & 0x0300_f00f;
        bits = (bits | bits << 4) & 0x030c_30c3;
        (bits | bits << 2) & 0x0924_9249
    };
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{contact::triangle::closest_point, mesh::TetMesh};

    /// Returns a strip of separate tets along x.
    fn strip(tets: usize) -> (Surface, Vec<DVec3>) {
        let corner = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let positions: Vec<DVec3> = (0..tets).flat_map(|t| corner.map(|c| c * 0.5 + DVec3::X * t as f64)).collect();
        let indices = (0..tets as u32).map(|t| [4 * t, 4 * t + 1, 4 * t + 2, 4 * t + 3]).collect();
        let mesh = TetMesh::new(positions.clone(), indices).unwrap();
        (Surface::of(&mesh).unwrap(), positions)
    }

    fn within(triangles: &Triangles, x: &[DVec3], centre: DVec3, distance_m: f64) -> Vec<u32> {
        let near = |t: &u32| centre.distance(closest_point(centre, triangles.corners(*t as usize, x))) < distance_m;
        (0..triangles.len() as u32).filter(near).collect()
    }

    #[test]
    fn every_triangle_is_listed_once() {
        let (surface, positions) = strip(50);
        let triangles = Triangles::of(&surface, &positions);
        let mut seen = triangles.surface_triangle.clone();
        seen.sort_unstable();
        assert_eq!(seen, (0..200).collect::<Vec<u32>>());
    }

    #[test]
    fn stale_boxes_never_lose_a_triangle() {
        let (surface, mut x) = strip(50);
        let triangles = Triangles::of(&surface, &x);
        let mut boxes = vec![ClusterBox::UNFITTED; triangles.clusters()];
        let mut candidates = Candidates::with_capacity(triangles.len());
        let (mut travel, mut queries) = (0.0, 0);
        let inner = 1.2;
        let reach = ListReach { listed_m: 1.5, complete_m: inner };
        let mut centre = DVec3::new(-5.0, 0.3, 0.0);
        for step in 0..2000 {
            let motion = DVec3::new(0.03, 0.01 * (f64::from(step) * 0.1).sin(), 0.0);
            centre += motion;
            let mut fastest = 0.0_f64;
            for (node, p) in x.iter_mut().enumerate() {
                let v = DVec3::new(0.0, 0.01 * (node as f64).sin(), 0.02 * (f64::from(step) * 0.01).cos());
                *p += v;
                fastest = fastest.max(v.length());
            }
            travel += fastest;
            candidates.slack_m -= motion.length() + fastest;
            if candidates.slack_m <= 0.0 {
                let fitted = FittedBoxesMut { boxes: &mut boxes, travel_m: travel };
                triangles.query(&x, fitted, &Axis::point(centre), reach, &mut candidates);
                queries += 1;
            }
            for needed in within(&triangles, &x, centre, inner) {
                assert!(candidates.triangles().contains(&needed), "step {step}");
            }
        }
        assert!(queries < 600, "{queries} queries in 2000 steps");
    }
    /// A tool flies straight at a surface that stands still: its list is renewed in the very step in which the slack
    /// runs out.
    #[test]
    fn a_straight_approach_uses_all_of_the_slack_and_no_more() {
        let (surface, x) = strip(50);
        let triangles = Triangles::of(&surface, &x);
        let mut boxes = vec![ClusterBox::UNFITTED; triangles.clusters()];
        let mut candidates = Candidates::with_capacity(triangles.len());
        let (inner, motion) = (1.2, DVec3::X * 1e-3);
        let mut centre = DVec3::X * -5.0;
        let (mut found_at, mut queries) = (None, 0);
        for _ in 0..5000 {
            centre += motion;
            candidates.slack_m -= motion.length();
            if candidates.slack_m <= 0.0 {
                let fitted = FittedBoxesMut { boxes: &mut boxes, travel_m: 0.0 };
                let reach = ListReach { listed_m: 1.5, complete_m: inner };
                triangles.query(&x, fitted, &Axis::point(centre), reach, &mut candidates);
                queries += 1;
            }
            let needed = within(&triangles, &x, centre, inner);
            assert!(needed.iter().all(|t| candidates.triangles().contains(t)), "{centre}");
            found_at = found_at.or((!needed.is_empty()).then_some(centre.x));
        }
        let found_at = found_at.unwrap();
        assert!((found_at + inner).abs() < 2e-3 && queries < 30, "{found_at}, {queries} queries");
    }
}
