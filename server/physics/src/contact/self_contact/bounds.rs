//! Bounds of where clusters of triangles are, and of how they are displaced.
use super::rest::{ClusterAtRest, SelfContact};
use crate::contact::broad::CLUSTER;
use glam::{DMat3, DVec3};

/// Where a cluster's nodes are.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::struct_field_names)] // all of them are lengths
pub(super) struct ClusterNow {
    /// Its box (m).
    pub(super) low_m: DVec3,
    pub(super) high_m: DVec3,
    pub(super) displaced: Displacements,
    /// A bound (m) of the largest of them.
    pub(super) displaced_m: f64,
}

/// The box (m) around displacements of a cluster's vertices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Displacements {
    least_m: DVec3,
    most_m: DVec3,
}

/// How a cluster turned, and how it is displaced beside that.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turned {
    pub(super) frame: DMat3,
    pub(super) displaced: Displacements,
}

impl Displacements {
    const NONE: Self = Self { least_m: DVec3::INFINITY, most_m: DVec3::NEG_INFINITY };

    fn add(&mut self, u: DVec3) {
        (self.least_m, self.most_m) = (self.least_m.min(u), self.most_m.max(u));
    }

    /// Returns `|Δu|` (m), how much any of these may differ from one of others.
    pub(super) fn differs_m(&self, other: &Self) -> f64 {
        (self.most_m - other.least_m).max(other.most_m - self.least_m).length()
    }

    /// Returns the same of one displacement.
    pub(super) fn differs_from_m(&self, u: DVec3) -> f64 {
        (self.most_m - u).max(u - self.least_m).length()
    }
}

impl SelfContact {
    pub(super) fn cluster_now(&self, cluster: usize, x: &[DVec3]) -> ClusterNow {
        let (mut low_m, mut high_m) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut displaced = Displacements::NONE;
        let mut is_finite = true;
        for &node in self.of_triangles.row(cluster) {
            let p = x[node as usize];
            (low_m, high_m) = (low_m.min(p), high_m.max(p));
            displaced.add(p - self.rest_m[node as usize]);
            is_finite &= p.is_finite();
        }
        if !is_finite {
            // Minima and maxima may not see it.
            (low_m, high_m) = (DVec3::NEG_INFINITY, DVec3::INFINITY);
        }
        let displaced_m = displaced.least_m.abs().max(displaced.most_m.abs()).length();
        ClusterNow { low_m, high_m, displaced, displaced_m }
    }

    /// Returns how a cluster turned, as three of its vertices tell.
    pub(super) fn frame(&self, cluster: usize, x: &[DVec3]) -> DMat3 {
        let corners = self.clusters[cluster].turns_with;
        axes(corners.map(|node| x[node as usize])) * axes(corners.map(|node| self.rest_m[node as usize])).transpose()
    }

    /// Returns the box around `x − R X` of a cluster's vertices.
    pub(super) fn displaced_in(&self, cluster: usize, frame: &DMat3, x: &[DVec3]) -> Displacements {
        let mut displaced = Displacements::NONE;
        for &node in self.of_triangles.row(cluster) {
            displaced.add(x[node as usize] - *frame * self.rest_m[node as usize]);
        }
        displaced
    }

    pub(super) fn balls_of(&self, cluster: usize, x: &[DVec3]) -> [Ball; CLUSTER] {
        let mut balls = [Ball::default(); CLUSTER];
        for (triangle, ball) in self.triangles.cluster_range(cluster).zip(&mut balls) {
            *ball = Ball::around(self.triangles.corners(triangle, x));
        }
        balls
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
    pub(super) fn distance_m(&self, other: &Self) -> f64 {
        boxes_distance_m([self.low_m, self.high_m], [other.low_m, other.high_m])
    }
}

/// A ball.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ball {
    pub(super) middle_m: DVec3,
    pub(super) radius_m: f64,
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

/// Returns right-handed axes of three points, the first along their first edge; some axes where they are in one line.
fn axes([a, b, c]: [DVec3; 3]) -> DMat3 {
    let along = (b - a).try_normalize().unwrap_or(DVec3::X);
    let normal = along.cross(c - a).try_normalize().unwrap_or_else(|| along.any_orthonormal_vector());
    DMat3::from_cols(along, normal.cross(along), normal)
}

pub(super) fn boxes_distance_m([low, high]: [DVec3; 2], [other_low, other_high]: [DVec3; 2]) -> f64 {
    (low - other_high).max(other_low - high).max(DVec3::ZERO).length()
}
