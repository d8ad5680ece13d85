//! Bounding boxes of the skin's triangles that are found without the positions of their vertices.
//!
//! A vertex of the skin moves by a mean of the displacements of what it follows, so a cluster's box is its box at rest,
//! shifted and widened by the least and largest displacement of the coarse nodes it follows, and by how far any active
//! particle is from where it would be asleep:
//! ```text
//! x = X + Σ_i w_i u_i + Σ_p w_p d_p,   Σ w_i = 1, Σ |w_i| ≤ a
//! x − X ∈ ū ± (a ½(u_max − u_min) + a max |d_p|),   ū = ½(u_min + u_max)
//! ```
//! The last term is left out where no active particle carries a vertex.
use super::{body::HybridBody, partition::NONE, skin_influence::amplification};
use crate::contact::broad::{CLUSTER, GROUP, box_distance_m};
use glam::DVec3;
use std::{collections::BTreeSet, ops::Range};

/// Boxes at rest of clusters of triangles and of groups of clusters, with the coarse nodes that they follow.
#[derive(Debug, Clone, Default)]
pub struct SkinClusters {
    clusters: Boxes,
    groups: Boxes,
    /// Particles with the clusters whose vertices they carry, ascending.
    carried: Vec<[u32; 2]>,
    /// One of the clusters that each vertex belongs to.
    of_vertex: Vec<u32>,
}

#[derive(Debug, Clone, Default)]
struct Boxes {
    low_m: Vec<DVec3>,
    high_m: Vec<DVec3>,
    /// Index in `nodes` of the first entry of each box, and the end of the last.
    first: Vec<u32>,
    nodes: Vec<u32>,
    /// `a` of each.
    amplification: Vec<f64>,
    /// Index in `vertices` of the first entry of each cluster, and the end of the last; empty for groups.
    first_vertex: Vec<u32>,
    vertices: Vec<u32>,
}

impl SkinClusters {
    /// Computes the boxes of triangles, which are given in the order of the broad phase.
    pub(crate) fn new(hybrid: &HybridBody, rest_positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let boxes = |size: usize| {
            let mut boxes = Boxes { first: vec![0], first_vertex: vec![0], ..Boxes::default() };
            for triangles in triangles.chunks(size) {
                boxes.push(hybrid, rest_positions_m, triangles);
            }
            boxes
        };
        let (clusters, groups) = (boxes(CLUSTER), boxes(GROUP));
        let mut carried: Vec<[u32; 2]> = Vec::new();
        let mut of_vertex = vec![NONE; rest_positions_m.len()];
        for (cluster, ends) in (0..).zip(clusters.first_vertex.windows(2)) {
            let mut of_cluster = BTreeSet::new();
            for &vertex in &clusters.vertices[ends[0] as usize..ends[1] as usize] {
                of_vertex[vertex as usize] = cluster;
                of_cluster.extend(hybrid.carriers_of_vertex(vertex).iter().map(|(particle, _)| [*particle, cluster]));
            }
            carried.extend(of_cluster);
        }
        carried.sort_unstable();
        Self { clusters, groups, carried, of_vertex }
    }

    /// Returns the number of clusters.
    pub(super) fn clusters(&self) -> usize {
        self.clusters.low_m.len()
    }

    /// Returns the number of nodes that clusters follow, each counted with each of its clusters.
    pub(super) fn followed(&self) -> usize {
        self.clusters.nodes.len()
    }

    /// Notes the displacements (m) of the nodes that a cluster follows, given all.
    pub(super) fn remember(&self, cluster: usize, displacements_m: &[DVec3], then_m: &mut [DVec3]) {
        let followed = self.clusters.followed(cluster);
        for (then_m, &node) in then_m[followed.clone()].iter_mut().zip(&self.clusters.nodes[followed]) {
            *then_m = displacements_m[node as usize];
        }
    }

    /// Returns a bound of how far (m) any vertex of a cluster that no active particle carries, then or now, has moved since:
    /// `a max_i |u_i − u_i,then|`.
    pub(super) fn moved_m(&self, cluster: usize, displacements_m: &[DVec3], then_m: &[DVec3]) -> f64 {
        let followed = self.clusters.followed(cluster);
        let mut most_sq = 0.0;
        for (then_m, &node) in then_m[followed.clone()].iter().zip(&self.clusters.nodes[followed]) {
            let moved_sq = then_m.distance_squared(displacements_m[node as usize]);
            if moved_sq > most_sq || moved_sq.is_nan() {
                most_sq = moved_sq;
            }
        }
        self.clusters.amplification[cluster] * most_sq.sqrt()
    }

    /// Returns the clusters that have a vertex which a particle carries.
    pub(super) fn carried_by(&self, particle: u32) -> impl Iterator<Item = usize> + '_ {
        let first = self.carried.partition_point(|carried| carried[0] < particle);
        self.carried[first..]
            .iter()
            .take_while(move |carried| carried[0] == particle)
            .map(|carried| carried[1] as usize)
    }

    /// Returns one of the clusters that a vertex belongs to; `None` for one of no triangle.
    pub(super) fn of_vertex(&self, vertex: u32) -> Option<usize> {
        self.of_vertex.get(vertex as usize).filter(|cluster| **cluster != NONE).map(|cluster| *cluster as usize)
    }

    /// Returns the number of groups.
    pub(super) fn groups(&self) -> usize {
        self.groups.low_m.len()
    }

    /// Returns the group that a cluster belongs to.
    pub(super) fn group_of(cluster: usize) -> usize {
        cluster / (GROUP / CLUSTER)
    }

    /// Returns the vertices of a cluster.
    pub(super) fn vertices(&self, cluster: usize) -> &[u32] {
        let first = &self.clusters.first_vertex;
        &self.clusters.vertices[first[cluster] as usize..first[cluster + 1] as usize]
    }

    /// Returns a lower bound (m) of the distance of a cluster from a point, by the module's formula.
    pub(super) fn cluster_distance_m(&self, cluster: usize, from_m: DVec3, bounds: &Displaced<'_>) -> f64 {
        self.clusters.distance_m(cluster, from_m, bounds)
    }

    /// Does the same for a group.
    pub(super) fn group_distance_m(&self, group: usize, from_m: DVec3, bounds: &Displaced<'_>) -> f64 {
        self.groups.distance_m(group, from_m, bounds)
    }
}

/// What bounds how the skin moved.
#[derive(Debug, Clone, Copy)]
pub(super) struct Displaced<'a> {
    /// Displacements (m) of the coarse nodes.
    pub(super) displacements_m: &'a [DVec3],
    /// `max |d_p|` (m); 0 for clusters of which no active particle carries a vertex.
    pub(super) deviation_m: f64,
}

impl Boxes {
    fn push(&mut self, hybrid: &HybridBody, rest_positions_m: &[DVec3], triangles: &[[u32; 3]]) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (start, first_vertex) = (self.nodes.len(), self.vertices.len());
        for &vertex in triangles.iter().flatten() {
            let rest_m = rest_positions_m[vertex as usize];
            (low, high) = (low.min(rest_m), high.max(rest_m));
            let partition = hybrid.partition();
            if triangles.len() <= CLUSTER && !self.vertices[first_vertex..].contains(&vertex) {
                self.vertices.push(vertex);
            }
            let mut follow = |particle: u32| {
                for node in partition.anchor(particle).nodes {
                    if !self.nodes[start..].contains(&node) {
                        self.nodes.push(node);
                    }
                }
            };
            for particle in partition.corners(hybrid.vertex_point(vertex).cell as usize) {
                follow(particle);
            }
            if hybrid.particles().smooth_skin {
                for (particle, _) in hybrid.carriers_of_vertex(vertex) {
                    follow(*particle);
                }
            }
        }
        let of_vertex = triangles.iter().flatten().map(|&vertex| amplification(&hybrid.skin_carriers, vertex));
        self.amplification.push(of_vertex.fold(1.0, f64::max));
        self.low_m.push(low);
        self.high_m.push(high);
        self.first.push(self.nodes.len() as u32);
        self.first_vertex.push(self.vertices.len() as u32);
    }

    /// Returns which of `nodes` a box follows.
    fn followed(&self, number: usize) -> Range<usize> {
        self.first[number] as usize..self.first[number + 1] as usize
    }

    fn distance_m(&self, number: usize, from_m: DVec3, bounds: &Displaced<'_>) -> f64 {
        let nodes = &self.nodes[self.followed(number)];
        let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &node in nodes {
            let u = bounds.displacements_m[node as usize];
            (least, most) = (least.min(u), most.max(u));
        }
        let middle = (least + most) * 0.5;
        let reach = ((most - least) * 0.5 + bounds.deviation_m) * self.amplification[number];
        box_distance_m(from_m, self.low_m[number] + middle - reach, self.high_m[number] + middle + reach)
    }
}
