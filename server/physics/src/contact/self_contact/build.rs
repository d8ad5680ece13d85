//! Builds self-contact from the body at rest.
use super::{
    bounds::Ball,
    compact::compact,
    lists::NearWalls,
    query::WallScratch,
    rest::{
        CloseCluster, ClusterAtRest, FACING, FREQUENCY_FRACTION, MARGIN, NodeAtRest, Rows, STIFFNESS_RATIO,
        SelfContact, twice_area_m2,
    },
};
use crate::contact::{
    SkinAtRest,
    broad::{ROUNDING_M, box_distance_m},
};
use glam::DVec3;

/// Clusters nearer at rest than so many mean edges of the skin are close.
const CLOSE: f64 = 8.0;
/// How far the surface may move at least between two queries, over the mean edge.
const STRIDE: f64 = 0.5;
/// Gap at rest over the size of the skin's triangles below which the body lies against itself.
const AGAINST_ITSELF: f64 = 0.02;
/// Least part of the stiffness that counts as borne.
const LEAST_BORNE: f64 = 1e-6;
/// Part of the gap at rest that a margin may take.
const OF_GAP: f64 = 0.5;

impl SelfContact {
    /// Returns the self-contact of a body, or `None` where its skin nowhere faces itself at rest and `only_if_facing`.
    pub(crate) fn build(skin: &SkinAtRest<'_>, only_if_facing: bool) -> Option<Self> {
        let triangles = compact(skin.surface, skin.positions_m);
        let mut built = Self {
            around: rows_of(skin.positions_m.len(), triangles.nodes.iter()),
            nodes: vec![NodeAtRest::INSIDE; skin.positions_m.len()],
            rest_m: skin.positions_m.to_vec(),
            of_cluster: Rows::default(),
            of_triangles: Rows::default(),
            clusters: Vec::new(),
            close: Rows::default(),
            reach_m: 0.0,
            stride_m: 0.0,
            carriers: skin.carriers,
            left_out: 0,
            normals: triangles
                .nodes
                .iter()
                .map(|nodes| twice_area_m2(nodes.map(|n| skin.positions_m[n as usize])).normalize_or_zero())
                .collect(),
            triangles,
        };
        built.box_clusters();
        built.measure_nodes(skin);
        let surface_nodes = || skin.surface.nodes.iter().copied();
        if only_if_facing
            && surface_nodes().all(|node| built.ray_m(node, built.nodes[node as usize].normal).is_infinite())
        {
            return None;
        }
        for node in surface_nodes() {
            built.nodes[node as usize].thickness_m = built.ray_m(node, -built.nodes[node as usize].normal);
        }
        let mean_m = built.mean_edge_m();
        built.stride_m = STRIDE * mean_m;
        built.reach_m = built.nodes.iter().map(NodeAtRest::reach_m).fold(0.0, f64::max);
        built.find_close(CLOSE * mean_m);
        built.fit_margins();
        Some(built)
    }

    /// Returns an empty list with room for what may meet.
    pub(in crate::contact) fn no_walls(&self) -> NearWalls {
        let vertices = self.nodes.iter().filter(|at| at.stiffness_n_per_m > 0.0).count();
        NearWalls::with_room(vertices, self.rest_m.len(), self.clusters.len(), self.carriers)
    }

    /// Returns buffers.
    pub(in crate::contact) fn scratch(&self) -> WallScratch {
        WallScratch::new(self)
    }

    /// Lists what is near with nodes at `x` (m).
    pub(super) fn near_at(&self, x: &[DVec3]) -> NearWalls {
        let (mut near, mut scratch) = (self.no_walls(), self.scratch());
        self.query(x, false, &mut near, &mut scratch);
        near
    }

    fn box_clusters(&mut self) {
        let mut is_taken = vec![false; self.rest_m.len()];
        let (mut own, mut all) = (Vec::new(), Vec::new());
        for cluster in 0..self.triangles.clusters() {
            let (mut low_m, mut high_m) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let mut nodes = Vec::new();
            for &node in self.triangles.nodes[self.triangles.cluster_range(cluster)].iter().flatten() {
                let rest_m = self.rest_m[node as usize];
                (low_m, high_m) = (low_m.min(rest_m), high_m.max(rest_m));
                if !std::mem::replace(&mut is_taken[node as usize], true) {
                    nodes.push(node);
                }
            }
            own.push(nodes);
            let mut of_triangles: Vec<u32> =
                self.triangles.nodes[self.triangles.cluster_range(cluster)].iter().flatten().copied().collect();
            of_triangles.sort_unstable();
            of_triangles.dedup();
            all.push(of_triangles);
            let far = f64::INFINITY;
            let turns_with = self.far_apart(&all[cluster]);
            self.clusters.push(ClusterAtRest { low_m, high_m, free_close_m: far, free_far_m: far, turns_with });
        }
        (self.of_cluster, self.of_triangles) = (Rows::of(own), Rows::of(all));
    }

    /// Returns three of some vertices: the farthest from the first, the farthest from that, and the one that spans the
    /// largest triangle with them.
    fn far_apart(&self, nodes: &[u32]) -> [u32; 3] {
        let at = |node: u32| self.rest_m[node as usize];
        let most = |size: &dyn Fn(DVec3) -> f64| {
            let larger = |one: &&u32, other: &&u32| size(at(**one)).total_cmp(&size(at(**other)));
            nodes.iter().max_by(larger).copied().unwrap_or(nodes[0])
        };
        let first = most(&|p| p.distance_squared(at(nodes[0])));
        let second = most(&|p| p.distance_squared(at(first)));
        let third = most(&|p| (p - at(first)).cross(at(second) - at(first)).length_squared());
        [first, second, third]
    }

    /// Finds normals, sizes and stiffness of the surface's nodes, and what part of it their masses bear: a vertex and the
    /// corners that press it add `4 κ c/m` to its squared frequency.
    fn measure_nodes(&mut self, skin: &SkinAtRest<'_>) {
        let frequency_sq = skin.frequency_sq();
        for &node in &skin.surface.nodes {
            let (mut normal, mut area_m2, mut size_m, mut wanted) = (DVec3::ZERO, 0.0, 0.0_f64, 0.0);
            for &triangle in self.around.row(node as usize) {
                let corners = self.triangles.corners(triangle as usize, &self.rest_m);
                let twice_m2 = twice_area_m2(corners);
                let third_m2 = twice_m2.length() / 6.0;
                let [one, other] = beside(self.triangles.nodes[triangle as usize], corners, node, &self.rest_m);
                let modulus_pa = skin.moduli[self.triangles.surface_triangle[triangle as usize] as usize].p_wave_pa;
                // Weighted by angles, the normal does not depend on how the surface is cut into triangles.
                normal += twice_m2.normalize_or_zero() * one.angle_between(other);
                size_m = size_m.max(one.length()).max(other.length());
                area_m2 += third_m2;
                wanted += third_m2 * modulus_pa;
            }
            let stiffness_n_per_m = 0.5 * STIFFNESS_RATIO * wanted / size_m;
            let most_n_per_m = 0.25 * FREQUENCY_FRACTION * frequency_sq * skin.mass_kg[node as usize];
            let bears = (most_n_per_m / stiffness_n_per_m).clamp(LEAST_BORNE, 1.0);
            let is_usable = area_m2 > 0.0 && stiffness_n_per_m.is_finite() && bears.is_finite();
            self.nodes[node as usize] = NodeAtRest {
                normal: normal.normalize_or_zero(),
                faces_below: self.faces_below(node, normal.normalize_or_zero()),
                size_m,
                thickness_m: f64::INFINITY,
                margin_m: MARGIN * size_m,
                stiffness_n_per_m: if is_usable { stiffness_n_per_m } else { 0.0 },
                bears: if is_usable { bears } else { LEAST_BORNE },
                bearing_kg: skin.bearing_kg[node as usize],
                free_close_m: f64::INFINITY,
            };
        }
    }

    /// Returns the cosine of the angle from a vertex's normal beyond which no triangle around it is faced: with `α` the
    /// largest angle between that normal and one of theirs, `cos(arccos(−FACING) − α)`.
    fn faces_below(&self, node: u32, normal: DVec3) -> f64 {
        let angle_of = |&triangle: &u32| self.normals[triangle as usize].dot(normal).clamp(-1.0, 1.0).acos();
        let widest = self.around.row(node as usize).iter().map(angle_of).fold(0.0, f64::max);
        // Within rounding: what is told apart here is told apart by the triangles, too.
        ((-FACING).acos() - widest - 1e-6).max(0.0).cos()
    }

    fn mean_edge_m(&self) -> f64 {
        let sizes = || (0..self.triangles.len()).map(|triangle| self.triangles.corners(triangle, &self.rest_m));
        let sum_m: f64 = sizes().map(|[a, b, c]| a.distance(b) + b.distance(c) + c.distance(a)).sum();
        sum_m / (3 * self.triangles.len()).max(1) as f64
    }

    /// Finds which clusters are within a distance (m) of each other at rest, and how far apart what may meet is.
    fn find_close(&mut self, within_m: f64) {
        let count = self.clusters.len();
        let balls: Vec<Ball> = (0..self.triangles.len())
            .map(|triangle| Ball::around(self.triangles.corners(triangle, &self.rest_m)))
            .collect();
        let cones: Vec<Cone> = (0..count).map(|cluster| self.cone(cluster)).collect();
        let mut close: Vec<Vec<CloseCluster>> = vec![Vec::new(); count];
        for one in 0..count {
            for other in one..count {
                let boxes_m = self.clusters[one].rest_distance_m(&self.clusters[other]);
                if boxes_m >= within_m {
                    for cluster in [one, other] {
                        let free_m = &mut self.clusters[cluster].free_far_m;
                        *free_m = free_m.min(boxes_m);
                    }
                    continue;
                }
                let free_m = self.free_m([one, other], &cones[other], &balls).min(self.free_m(
                    [other, one],
                    &cones[one],
                    &balls,
                ));
                close[one].push(CloseCluster { cluster: other as u32, free_m });
                if other != one {
                    close[other].push(CloseCluster { cluster: one as u32, free_m });
                }
                for cluster in [one, other] {
                    let least_m = &mut self.clusters[cluster].free_close_m;
                    *least_m = least_m.min(free_m);
                }
            }
        }
        for row in &mut close {
            row.sort_unstable_by_key(|entry| entry.cluster);
        }
        self.close = Rows::of(close);
    }

    /// Returns the least distance (m) at rest between vertices of one cluster and triangles of another that may meet, and
    /// notes it of each vertex. What is too far away to lower either is passed over.
    fn free_m(&mut self, [of_nodes, of_triangles]: [usize; 2], cone: &Cone, balls: &[Ball]) -> f64 {
        let ClusterAtRest { low_m, high_m, .. } = self.clusters[of_triangles];
        let mut least_m = f64::INFINITY;
        for &node in self.of_cluster.row(of_nodes) {
            let (at, rest_m) = (&self.nodes[node as usize], self.rest_m[node as usize]);
            let mut of_node_m = at.free_close_m;
            let farthest_m = (rest_m - low_m).abs().max((rest_m - high_m).abs()).length();
            if box_distance_m(rest_m, low_m, high_m) - ROUNDING_M >= of_node_m.max(least_m)
                || farthest_m < at.beside_m() - ROUNDING_M && cone.faces_away_from(at)
            {
                continue;
            }
            for triangle in self.triangles.cluster_range(of_triangles) {
                if balls[triangle].distance_m(rest_m) - ROUNDING_M >= of_node_m.max(least_m) {
                    continue;
                }
                if let Some(distance_m) = self.may_meet_m(node, triangle) {
                    (of_node_m, least_m) = (of_node_m.min(distance_m), least_m.min(distance_m));
                }
            }
            self.nodes[node as usize].free_close_m = of_node_m;
        }
        least_m
    }

    fn cone(&self, cluster: usize) -> Cone {
        let normals = || &self.normals[self.triangles.cluster_range(cluster)];
        let axis = normals().iter().sum::<DVec3>().normalize_or_zero();
        let angle = |normal: &DVec3| normal.dot(axis).clamp(-1.0, 1.0).acos();
        Cone { axis, half_angle: normals().iter().map(angle).fold(0.0, f64::max) }
    }

    /// Makes the margins so small that nothing is pressed at rest, and leaves vertices out that lie against a wall.
    fn fit_margins(&mut self) {
        let near = self.near_at(&self.rest_m);
        for of_vertex in near.pairs().chunk_by(|one, next| one.node == next.node) {
            let node = of_vertex[0].node;
            let Some(gap) = self.gap(node, f64::INFINITY, &of_vertex.iter().map(|pair| pair.triangle), &self.rest_m)
            else {
                continue;
            };
            let at = &mut self.nodes[node as usize];
            at.margin_m = at.margin_m.min(OF_GAP * gap.distance_m);
            if gap.distance_m < AGAINST_ITSELF * at.size_m {
                at.stiffness_n_per_m = 0.0;
                self.left_out += 1;
            }
        }
    }
}

/// A cone that holds the normals of a cluster's triangles.
struct Cone {
    axis: DVec3,
    half_angle: f64,
}

impl Cone {
    /// Returns whether none of the triangles faces a vertex, by the normals alone.
    fn faces_away_from(&self, at: &NodeAtRest) -> bool {
        let from_axis = at.normal.dot(self.axis).clamp(-1.0, 1.0).acos();
        from_axis + self.half_angle < at.faces_below.acos() - 1e-6
    }
}

/// Returns the triangles around each of so many nodes.
fn rows_of<'a>(nodes: usize, triangles: impl Iterator<Item = &'a [u32; 3]>) -> Rows<u32> {
    let mut around = vec![Vec::new(); nodes];
    for (triangle, corners) in (0..).zip(triangles) {
        for &node in corners {
            around[node as usize].push(triangle);
        }
    }
    Rows::of(around)
}

/// Returns the two edges (m) of a triangle that begin at one of its corners.
fn beside(nodes: [u32; 3], corners: [DVec3; 3], node: u32, rest_m: &[DVec3]) -> [DVec3; 2] {
    let at = nodes.iter().position(|n| *n == node).unwrap_or(0);
    [corners[(at + 1) % 3] - rest_m[node as usize], corners[(at + 2) % 3] - rest_m[node as usize]]
}
