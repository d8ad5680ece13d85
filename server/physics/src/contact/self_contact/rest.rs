//! What self-contact needs of the body at rest.
use crate::contact::{MostCarriers, broad::Triangles, triangle::closest_weights};
use glam::DVec3;

/// Gap over the size of the skin's triangles below which walls press each other.
pub(super) const MARGIN: f64 = 0.12;
/// Depth over that size down to which a vertex that is behind a wall is still pushed back.
pub(super) const DEEPEST: f64 = 0.5;
/// Stiffness of walls that meet over that of one layer of elements, `(λ + 2µ)/h`, half of it in each wall's vertices.
pub(super) const STIFFNESS_RATIO: f64 = 4.0;
/// Largest addition of a vertex at its margin to the squared frequency at a node, over the body's ω²_max.
pub(super) const FREQUENCY_FRACTION: f64 = 0.25;
/// Triangles nearer at rest than this, over the size of those at the vertex, are beside it along the skin unless they
/// face it across a gap. If it were less, every query would look at all that is beside wherever the body bends strongly.
const BESIDE: f64 = 12.0;
/// Sine of the least angle with a triangle at which a vertex is before it.
const BEFORE: f64 = 0.1;
/// Part of the size of triangles that is rounding.
const NOTHING: f64 = 1e-9;
/// Sine of the angle with the skin from which a way counts as one into the material.
const INTO: f64 = 0.25;
/// Cosine of the angle between a triangle's normal and the opposite of one at a vertex from which they face each other.
pub(super) const FACING: f64 = 0.25;
/// Thickness of the wall within which what lies behind both skins is the other side of the same wall.
const WITHIN_WALL: f64 = 2.0;

/// The walls of a body at rest, and how they press each other. Indices are those of [`Triangles`].
#[derive(Debug, Clone)]
pub(crate) struct SelfContact {
    pub(super) triangles: Triangles,
    /// Rest positions (m) by node.
    pub(super) rest_m: Vec<DVec3>,
    /// By node; nodes inside the body have no stiffness.
    pub(super) nodes: Vec<NodeAtRest>,
    /// Outward unit normals of the triangles at rest.
    pub(super) normals: Vec<DVec3>,
    /// Triangles around each node.
    pub(super) around: Rows<u32>,
    /// Nodes of each cluster, each node in one cluster only.
    pub(super) of_cluster: Rows<u32>,
    /// Nodes of the triangles of each cluster.
    pub(super) of_triangles: Rows<u32>,
    pub(super) clusters: Vec<ClusterAtRest>,
    /// Clusters near each cluster at rest, itself included, with the least distance (m) of what may meet.
    pub(super) close: Rows<CloseCluster>,
    /// Largest distance (m) from a wall at which any vertex is pushed.
    pub(super) reach_m: f64,
    /// How far (m) the surface may move at least between two queries.
    pub(super) stride_m: f64,
    /// What carries the skin, if its vertices are no nodes.
    pub(super) carriers: MostCarriers,
    /// Number of vertices that are left out because the body lies against itself there at rest.
    pub(super) left_out: usize,
}

/// A vertex of the skin at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NodeAtRest {
    /// Outward unit normal.
    pub(super) normal: DVec3,
    /// Cosine of the angle between this and a triangle's normal from which no triangle at it faces that triangle.
    pub(super) faces_below: f64,
    /// Longest edge (m) at it.
    pub(super) size_m: f64,
    /// Thickness (m) of the wall behind it.
    pub(super) thickness_m: f64,
    /// `m` (m).
    pub(super) margin_m: f64,
    /// `κ` (N/m); 0 where it is left out.
    pub(super) stiffness_n_per_m: f64,
    /// `c`, the part of it that its mass bears, up to 1.
    pub(super) bears: f64,
    /// Mass (kg) that bears what is pressed there.
    pub(super) bearing_kg: f64,
    /// Least distance (m) at rest of triangles in close clusters that it may meet.
    pub(super) free_close_m: f64,
}

impl NodeAtRest {
    /// Stands for a node inside the body.
    pub(super) const INSIDE: Self = Self {
        normal: DVec3::ZERO,
        faces_below: 1.0,
        size_m: 0.0,
        thickness_m: 0.0,
        margin_m: 0.0,
        stiffness_n_per_m: 0.0,
        bears: 1.0,
        bearing_kg: f64::INFINITY,
        free_close_m: f64::INFINITY,
    };

    /// Returns the distance (m) at rest within which triangles are beside it along the skin unless they face it across a gap.
    pub(super) fn beside_m(&self) -> f64 {
        BESIDE * self.size_m
    }

    /// Returns the largest distance (m) from a wall at which it is pushed.
    pub(super) fn reach_m(&self) -> f64 {
        DEEPEST * self.size_m
    }
}

/// A cluster of triangles at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::struct_field_names)] // all of them are lengths
pub(super) struct ClusterAtRest {
    /// Its box (m).
    pub(super) low_m: DVec3,
    pub(super) high_m: DVec3,
    /// Least distance (m) to what it may meet, of close clusters and of all others.
    pub(super) free_close_m: f64,
    pub(super) free_far_m: f64,
    /// Three of its vertices that tell how it turns: two that are far apart, and one far from the line through them.
    pub(super) turns_with: [u32; 3],
}

/// A cluster that is close to another at rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct CloseCluster {
    pub(super) cluster: u32,
    /// Least distance (m) at rest of a vertex of one and a triangle of the other that may meet.
    pub(super) free_m: f64,
}

/// Lists of different lengths, one after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct Rows<T> {
    first: Vec<u32>,
    entries: Vec<T>,
}

impl<T> Rows<T> {
    pub(super) fn of(rows: impl IntoIterator<Item = Vec<T>>) -> Self {
        let mut all = Self { first: vec![0], entries: Vec::new() };
        for row in rows {
            all.entries.extend(row);
            all.first.push(all.entries.len() as u32);
        }
        all
    }

    pub(super) fn row(&self, number: usize) -> &[T] {
        &self.entries[self.first[number] as usize..self.first[number + 1] as usize]
    }
}

/// Returns twice a triangle's area vector (m²), which points outwards.
pub(super) fn twice_area_m2([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

impl SelfContact {
    /// Returns the distance (m) at rest of a vertex and a triangle that may ever meet, `None` of others. They may not
    /// - where the straight way from one to the other goes into the material at both ends, and is shorter than twice
    ///   the thickness of the wall there: the triangle is the other side of the vertex's own wall;
    /// - where they are beside each other along the skin, and do not face each other across a gap.
    pub(super) fn may_meet_m(&self, node: u32, triangle: usize) -> Option<f64> {
        let corners = self.triangles.nodes[triangle];
        if corners.contains(&node) {
            return None;
        }
        let (at, rest) = (&self.nodes[node as usize], self.rest_m[node as usize]);
        let corners_m = corners.map(|n| self.rest_m[n as usize]);
        let (beside_m, normal) = (at.beside_m(), self.normals[triangle]);
        let is_near = rest.distance_squared(corners_m[0]) < beside_m * beside_m;
        // Behind its plane, more than rounding could be, is not across a gap from it.
        if is_near && (rest - corners_m[0]).dot(normal) < -2.0 * NOTHING * at.size_m {
            return None;
        }
        let faces = at.normal.dot(normal) < at.faces_below
            && self.around.row(node as usize).iter().any(|&own| -self.normals[own as usize].dot(normal) > FACING);
        if is_near && !faces {
            return None;
        }
        let [wa, wb, wc] = closest_weights(rest, corners_m);
        let from = rest - (corners_m[0] * wa + corners_m[1] * wb + corners_m[2] * wc);
        let distance_m = from.length();
        let into_m = (INTO * distance_m).max(NOTHING * at.size_m);
        let is_through = from.dot(normal) < -into_m && from.dot(at.normal) > into_m;
        if is_through && distance_m < WITHIN_WALL * at.thickness_m {
            return None;
        }
        // Parts that lie against each other are told apart from neighbours, too.
        let across = || from.dot(normal) > BEFORE * distance_m - NOTHING * at.size_m;
        let may = distance_m >= beside_m || faces && across() && !self.is_adjacent(node, corners);
        may.then_some(distance_m)
    }

    /// Returns whether a triangle has a corner in common with those around a vertex.
    fn is_adjacent(&self, node: u32, corners: [u32; 3]) -> bool {
        let around = self.around.row(node as usize).iter();
        around.flat_map(|&triangle| self.triangles.nodes[triangle as usize]).any(|n| corners.contains(&n))
    }

    pub(super) fn cluster_count(&self) -> usize {
        self.clusters.len()
    }

    /// Returns the triangles in the order in which clusters are made of them.
    pub(crate) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles.nodes
    }

    /// Returns the vertices of its triangles, in the order of clusters.
    pub(super) fn vertices(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.clusters.len()).flat_map(|cluster| self.of_cluster.row(cluster)).copied()
    }

    /// Takes clusters to follow so many nodes of what carries the skin, each counted with each of its clusters.
    pub(in crate::contact) fn follow(&mut self, of_clusters: usize) {
        self.carriers.of_clusters = of_clusters;
    }

    /// Returns the number of vertices that are left out because the body lies against itself there at rest.
    pub(crate) fn left_out(&self) -> usize {
        self.left_out
    }
}
