//! The positions of the surface that tools touch, and the transfer of forces from it to the nodes.
use super::{
    body::MassSpringBody,
    motion::{SpringMotion, SpringScratch},
};
use crate::{
    contact::broad::{CLUSTER, GROUP, Skin, box_distance_m},
    tick::CarriedSkin,
};
use glam::DVec3;

/// Bounding boxes, at rest, of the skin's clusters and of groups of clusters.
#[derive(Debug, Clone, Default)]
pub(super) struct SkinBoxes {
    clusters: Vec<[DVec3; 2]>,
    groups: Vec<[DVec3; 2]>,
    /// First entry of each cluster in `vertices`, then the end of the last one's.
    first: Vec<u32>,
    vertices: Vec<u32>,
}

impl SkinBoxes {
    /// Returns the boxes of triangles, which are given in the order of the broad phase.
    pub(super) fn new(rest_m: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let around = |vertices: &[u32]| {
            let corners = vertices.iter().map(|&vertex| rest_m[vertex as usize]);
            corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
        };
        let mut boxes = Self { first: vec![0], ..Self::default() };
        for cluster in triangles.chunks(CLUSTER) {
            let mut vertices: Vec<u32> = cluster.iter().flatten().copied().collect();
            vertices.sort_unstable();
            vertices.dedup();
            boxes.clusters.push(around(&vertices));
            boxes.vertices.extend(vertices);
            boxes.first.push(boxes.vertices.len() as u32);
        }
        let join = |group: &[[DVec3; 2]]| {
            let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            group.iter().fold(none, |[low, high], of| [low.min(of[0]), high.max(of[1])])
        };
        boxes.groups = boxes.clusters.chunks(GROUP / CLUSTER).map(join).collect();
        boxes
    }
}

/// The skin at an instant.
pub(crate) struct SpringSkin<'a> {
    body: &'a MassSpringBody,
    motion: &'a SpringMotion,
    scratch: &'a SpringScratch,
    x_m: &'a [DVec3],
    /// Velocities (m/s) of the awake nodes; empty where no vertex' velocity is asked for.
    v: &'a [DVec3],
    /// Largest distance (m) of an awake node from its rest position.
    farthest_m: f64,
}

/// What carries a vertex of the skin: places of nodes with weights, and the position (m) of the vertex if these were at
/// 0.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Carried {
    offset_m: DVec3,
    by: [(u32, f64); 3],
    count: usize,
}

impl<'a> SpringSkin<'a> {
    /// Returns the skin at the positions `x_m` (m) of the awake nodes.
    pub(crate) fn new(
        body: &'a MassSpringBody,
        motion: &'a SpringMotion,
        scratch: &'a SpringScratch,
        x_m: &'a [DVec3],
    ) -> Self {
        Self { body, motion, scratch, x_m, v: &[], farthest_m: 0.0 }
    }

    /// Returns the same skin with the velocities (m/s) of the awake nodes.
    pub(crate) fn moving(self, v: &'a [DVec3]) -> Self {
        Self { v, ..self }
    }

    /// Returns the coarse vertex of a vertex of the skin, or of a vertex on an edge the end that is nearer to the point
    /// `from_m` (m).
    pub(crate) fn coarse_vertex(&self, vertex: u32, from_m: DVec3) -> u32 {
        let model = self.body.model();
        let Some(edge) = vertex.checked_sub(model.vertices()) else { return vertex };
        let [a, b] = model.surface().edges()[edge as usize].nodes;
        let distance_m = |end: u32| self.position_m(end).distance(from_m);
        if distance_m(b) < distance_m(a) { b } else { a }
    }
}

fn carried(body: &MassSpringBody, motion: &SpringMotion, scratch: &SpringScratch, vertex: u32) -> Carried {
    let model = body.model();
    let rest_of_m = |node: u32| model.rest_m()[node as usize];
    let mut found = Carried { offset_m: rest_of_m(vertex), by: [(0, 0.0); 3], count: 0 };
    let mut add = |node: u32, weight: f64| {
        if let Some(place) = scratch.place(node).filter(|_| weight != 0.0) {
            found.offset_m -= rest_of_m(node) * weight;
            found.by[found.count] = (place as u32, weight);
            found.count += 1;
        }
    };
    match vertex.checked_sub(model.vertices()) {
        None => add(vertex, 1.0),
        Some(edge) => {
            let level =
                if scratch.place(vertex).is_some() { motion.levels.of_edge(model.surface(), edge) } else { 0.0 };
            add(vertex, level);
            model.surface().edges()[edge as usize].nodes.into_iter().for_each(|end| add(end, 0.5 * (1.0 - level)));
        }
    }
    found
}

impl Carried {
    fn by(&self) -> &[(u32, f64)] {
        &self.by[..self.count]
    }

    fn position_m(&self, x_m: &[DVec3]) -> DVec3 {
        self.by().iter().fold(self.offset_m, |sum, (place, weight)| sum + x_m[*place as usize] * *weight)
    }
}

impl Skin for SpringSkin<'_> {
    fn begin(&mut self) {
        let rest_m = self.motion.ids.iter().map(|&id| self.body.model().rest_m()[id as usize]);
        let farthest_sq = self.x_m.iter().zip(rest_m).map(|(x, rest_m)| x.distance_squared(rest_m)).fold(0.0, f64::max);
        self.farthest_m = farthest_sq.sqrt();
    }

    fn group_distance_m(&self, group: usize, from_m: DVec3) -> f64 {
        let [low, high] = self.body.boxes.groups[group];
        box_distance_m(from_m, low, high) - self.farthest_m
    }

    fn cluster_distance_m(&self, cluster: usize, from_m: DVec3) -> f64 {
        let [low, high] = self.body.boxes.clusters[cluster];
        box_distance_m(from_m, low, high) - self.farthest_m
    }

    fn clusters(&self) -> usize {
        self.body.boxes.clusters.len()
    }

    fn vertices(&self, cluster: usize) -> &[u32] {
        let boxes = &self.body.boxes;
        &boxes.vertices[boxes.first[cluster] as usize..boxes.first[cluster + 1] as usize]
    }

    fn position_m(&self, vertex: u32) -> DVec3 {
        carried(self.body, self.motion, self.scratch, vertex).position_m(self.x_m)
    }
}

impl CarriedSkin for SpringSkin<'_> {
    type Carriers = Carried;

    fn layout(&self) -> u64 {
        self.scratch.layout()
    }

    fn carriers(&self, vertex: u32) -> Carried {
        carried(self.body, self.motion, self.scratch, vertex)
    }

    fn carried_m(&self, carried: &Carried) -> DVec3 {
        carried.position_m(self.x_m)
    }

    fn velocity_m_per_s(&self, vertex: u32) -> DVec3 {
        let carried = self.carriers(vertex);
        carried.by().iter().map(|(place, weight)| self.v[*place as usize] * *weight).sum()
    }

    fn push(&self, carried: &Carried, force_n: DVec3, forces_n: &mut [DVec3]) {
        for (place, weight) in carried.by() {
            forces_n[*place as usize] += force_n * *weight;
        }
    }
}

impl MassSpringBody {
    /// Returns the position (m) of a vertex of the skin, where the awake nodes are at `x_m` (m).
    pub fn vertex_m(&self, motion: &SpringMotion, vertex: u32, x_m: &[DVec3]) -> DVec3 {
        let model = self.model();
        let rest_of_m = |node: u32| model.rest_m()[node as usize];
        let moved = |node: u32| {
            let place = motion.ids.binary_search(&node).ok();
            place.map(|place| x_m[place] - rest_of_m(node))
        };
        let Some(edge) = vertex.checked_sub(model.vertices()) else {
            return rest_of_m(vertex) + moved(vertex).unwrap_or_default();
        };
        let ends = model.surface().edges()[edge as usize].nodes.map(|end| moved(end).unwrap_or_default());
        let as_ends = (ends[0] + ends[1]) * 0.5;
        let level = motion.levels.of_edge(model.surface(), edge);
        rest_of_m(vertex) + moved(vertex).map_or(as_ends, |own| own * level + as_ends * (1.0 - level))
    }
}
