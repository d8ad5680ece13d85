//! The patch as the loop runs it: it is rebuilt without allocating when other particles wake, and has its cells in
//! lanes. Its oracle is `patch`.
//!
//! *Points* are the particles of awake cells, ascending: those that are active, and the constrained points, which
//! follow the coarse nodes.
mod forces;
mod layout;
mod mass_matrix;
#[cfg(test)]
mod tests;

pub(super) use mass_matrix::RunningMassMatrix;

use super::kernels::{CellRow, CutCells, ResidualKernel, Room, RowKernel};
use super::{
    body::HybridBody,
    clusters::SkinClusters,
    composite::Anchor,
    constrained_points::ConstrainedPoints,
    partition::{Cell, NONE},
    patch::KEPT,
    prestrain::PrestrainDecay,
    residual_element::ResidualElement,
    state::room_for_cells,
};
use crate::settings::Precision;
use glam::DVec3;
use layout::Slot;

/// A patch with room for the most active particles there may be.
#[derive(Debug, Clone)]
pub(crate) struct RunningPatch {
    /// Active particles, ascending.
    active: Vec<u32>,
    points: Vec<Point>,
    constrained: ConstrainedPoints,
    /// Numbers of the active particles' points, ascending.
    points_of_active: Vec<u32>,
    /// Displacements (m) of the points.
    displacements_m: Vec<DVec3>,
    /// Numbers, among the active particles, of those that carry the skin, ascending.
    carrying: Vec<u32>,
    /// How far (m) each active particle that carries the skin is from where it would be asleep.
    deviations_m: Vec<DVec3>,
    /// Number of every particle among the active ones, [`NONE`] for one that is asleep.
    number_of: Vec<u32>,
    /// A buffer for the kernels' values of points.
    of_points: Vec<DVec3>,
    /// Awake cells, ascending.
    cells: Vec<u32>,
    full: RowKernel,
    rows: Vec<CellRow>,
    cut: CutCells,
    /// Where the kernels have every awake cell.
    slots: Vec<Slot>,
    /// Numbers, among the awake cells, of those with prestrain.
    prestrained_cells: Vec<u32>,
    prestrained_tets: Vec<u32>,
    prestrain_mark: u64,
    /// Residual elements of the coarse tets.
    residual_elements: Vec<ResidualElement>,
    residual_kernel: ResidualKernel,
    /// Number of every coarse node among those of a residual element, while cells are taken from it.
    number_of_node: Vec<u32>,
    /// Coarse tets of which cells were taken.
    taken_from: Vec<u32>,
    mass_matrix: RunningMassMatrix,
    /// Displacements (m) of coarse nodes.
    node_displacements_m: Vec<DVec3>,
    /// Number of every particle among the points, [`NONE`] for one that is no point.
    point_of: Vec<u32>,
    /// Whether active particles carry any vertex of each cluster, and of each group.
    carries_of_cluster: Vec<bool>,
    carries_of_group: Vec<bool>,
    carries_of_walls: Vec<bool>,
    is_awake: Vec<bool>,
    is_viscous: bool,
    /// Number of sets of active particles that there have been.
    number: u64,
}

#[derive(Debug, Clone, Copy)]
struct Point {
    particle: u32,
    /// Its number among the active particles, [`NONE`] for a constrained point.
    active: u32,
    rest_m: DVec3,
    anchor: Anchor,
}

impl RunningPatch {
    /// Makes room for `most_active` active particles; none is awake.
    pub(crate) fn new(hybrid: &HybridBody, most_active: usize, precision: Precision) -> Self {
        let partition = &hybrid.partition;
        let most_cells = room_for_cells(hybrid, most_active);
        let around = if partition.has_doubled() { 8 * partition.most_cells_at() } else { 27 };
        let most_points = (around * most_active).min(partition.particle_count());
        let (edge_m, room) = (partition.sites().spacing_m(), Room { points: most_points, cells: most_cells });
        Self {
            active: Vec::with_capacity(most_active),
            points: Vec::with_capacity(most_points),
            constrained: ConstrainedPoints::with_room(most_points),
            points_of_active: Vec::with_capacity(most_active),
            displacements_m: Vec::with_capacity(most_points),
            carrying: Vec::with_capacity(most_active),
            deviations_m: Vec::with_capacity(most_active),
            number_of: vec![NONE; partition.particle_count()],
            of_points: Vec::with_capacity(most_points),
            cells: Vec::with_capacity(most_cells),
            rows: Vec::with_capacity(most_cells),
            full: RowKernel::new(edge_m, 1.0 - KEPT, &hybrid.materials, precision, room),
            cut: CutCells::with_capacity(edge_m, &hybrid.materials, precision, room),
            residual_kernel: ResidualKernel::build(
                partition.residual_elements(),
                hybrid.node_count(),
                &hybrid.of_tet,
                &hybrid.materials,
                precision,
            ),
            residual_elements: partition.residual_elements().to_vec(),
            slots: Vec::with_capacity(most_cells),
            prestrained_cells: Vec::with_capacity(most_cells),
            prestrained_tets: Vec::with_capacity(partition.residual_elements().len()),
            prestrain_mark: 0,
            number_of_node: vec![0; hybrid.node_count()],
            taken_from: Vec::with_capacity(partition.residual_elements().len()),
            mass_matrix: RunningMassMatrix::new(hybrid, most_active),
            node_displacements_m: vec![DVec3::ZERO; hybrid.node_count()],
            point_of: vec![NONE; partition.particle_count()],
            carries_of_cluster: vec![false; hybrid.clusters.clusters()],
            carries_of_group: vec![false; hybrid.clusters.groups()],
            carries_of_walls: vec![false; hybrid.wall_clusters.clusters()],
            is_awake: vec![false; partition.cells().len()],
            is_viscous: hybrid.materials.iter().any(|m| !m.viscosity.is_zero()),
            number: 0,
        }
    }

    /// Returns the mass matrix.
    pub(crate) fn mass_matrix(&self) -> &RunningMassMatrix {
        &self.mass_matrix
    }

    /// Returns the mass matrix, to be solved with.
    pub(crate) fn mass_matrix_mut(&mut self) -> &mut RunningMassMatrix {
        &mut self.mass_matrix
    }

    /// Returns the number of sets of active particles that there have been.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Returns the number of a particle among the points, [`NONE`] for one that is no point.
    pub(super) fn point_of(&self, particle: u32) -> u32 {
        self.point_of[particle as usize]
    }

    /// Returns the number of a particle among the active ones, [`NONE`] for one that is asleep.
    pub(super) fn number_of(&self, particle: u32) -> u32 {
        self.number_of[particle as usize]
    }

    /// Returns the displacements (m) of the points after [`Self::displace`].
    pub(super) fn displacements_m(&self) -> &[DVec3] {
        &self.displacements_m
    }

    /// Returns how far (m) an active particle that carries the skin, given by its number, is from where it would be asleep, after
    /// [`Self::displace`].
    pub(super) fn deviation_of_m(&self, number: u32) -> DVec3 {
        self.deviations_m[number as usize]
    }

    /// Returns the displacements (m) of the coarse nodes after [`Self::displace`].
    pub(super) fn node_displacements_m(&self) -> &[DVec3] {
        &self.node_displacements_m
    }

    /// Returns the active particles, ascending, each with its anchor and its displacement (m).
    pub(super) fn active_displacements_m(&self) -> impl Iterator<Item = (u32, &Anchor, DVec3)> {
        let active = self.points.iter().zip(&self.displacements_m).filter(|(point, _)| point.active != NONE);
        active.map(|(point, u)| (point.particle, &point.anchor, *u))
    }

    /// Returns the active particles, each with its distance (m) from where it would be asleep.
    pub(super) fn deviations_m(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        let active = self.active_displacements_m();
        active.map(|(particle, anchor, u)| (particle, u.distance(anchor.of(&self.node_displacements_m))))
    }

    /// Returns the largest distance (m) of [`Self::deviations_m`].
    pub(super) fn deviation_m(&self) -> f64 {
        self.deviations_m().map(|(_, deviation_m)| deviation_m).fold(0.0, f64::max)
    }

    /// Returns whether active particles carry any vertex of a cluster of the skin.
    pub(super) fn carries_of_cluster(&self, cluster: usize) -> bool {
        self.carries_of_cluster[cluster]
    }

    /// Returns the same for a group.
    pub(super) fn carries_of_group(&self, group: usize) -> bool {
        self.carries_of_group[group]
    }

    /// Returns the same for a cluster of walls.
    pub(super) fn carries_of_walls(&self, cluster: usize) -> bool {
        self.carries_of_walls[cluster]
    }

    /// Returns the awake cells, ascending.
    pub(super) fn cells(&self) -> &[u32] {
        &self.cells
    }

    /// Returns whether a cell is awake.
    pub(super) fn is_awake(&self, cell: u32) -> bool {
        self.is_awake[cell as usize]
    }

    /// Returns the coarse tets that have lost some of their cells.
    pub(super) fn taken_from(&self) -> &[u32] {
        &self.taken_from
    }

    /// Returns the residual element of a coarse tet.
    pub(super) fn residual_element(&self, tet: u32) -> &ResidualElement {
        &self.residual_elements[tet as usize]
    }

    /// Returns the positions (m) of the particles of an awake cell.
    pub(super) fn corners_m(&self, hybrid: &HybridBody, cell: u32) -> [DVec3; 8] {
        hybrid.partition.corners(cell as usize).map(|particle| {
            let point = self.point_of[particle as usize] as usize;
            self.points[point].rest_m + self.displacements_m[point]
        })
    }

    /// Returns whether some particle of an awake cell follows one of these coarse nodes.
    pub(super) fn follows(&self, hybrid: &HybridBody, cell: u32, nodes: &[bool]) -> bool {
        hybrid.partition.corners(cell as usize).into_iter().any(|particle| {
            let point = &self.points[self.point_of[particle as usize] as usize];
            let anchor = &point.anchor;
            point.active == NONE
                && anchor.nodes.iter().zip(anchor.weights).any(|(node, weight)| weight != 0.0 && nodes[*node as usize])
        })
    }

    /// Returns the active particles, ascending.
    pub(crate) fn active(&self) -> &[u32] {
        &self.active
    }

    /// Wakes these particles (ascending, no more than there is room for) and no others, with these prestrains.
    /// Allocates nothing.
    pub(crate) fn wake(&mut self, hybrid: &HybridBody, active: &[u32], decay: &PrestrainDecay) {
        (0..Self::SLICES).for_each(|slice| self.set_slice(hybrid, active, slice));
        self.put_prestrains(decay);
    }

    /// Number of slices in which a patch is laid out.
    pub(super) const SLICES: u32 = 3;

    /// Does a slice of [`Self::wake`]. They have to be done one after the other, before the prestrains are given.
    pub(super) fn set_slice(&mut self, hybrid: &HybridBody, active: &[u32], slice: u32) {
        match slice {
            0 => {
                self.forget(hybrid);
                self.number += 1;
                self.active.extend_from_slice(active);
                self.find_cells(hybrid);
                self.find_points(hybrid);
                self.mark_carried(hybrid, true);
            }
            1 => self.take_from_residual_elements(hybrid),
            _ => {
                self.lay_out(hybrid);
                let points = self.points.iter().filter(|point| point.active != NONE);
                self.mass_matrix.factorise(hybrid, points.map(|point| (point.particle, point.anchor)));
            }
        }
    }

    /// Numbers this patch as the one after another.
    pub(super) fn number_after(&mut self, other: &Self) {
        self.number = other.number + 1;
    }

    fn mark_carried(&mut self, hybrid: &HybridBody, carried: bool) {
        for &particle in &self.active {
            for cluster in hybrid.clusters.carried_by(particle) {
                self.carries_of_cluster[cluster] = carried;
                self.carries_of_group[SkinClusters::group_of(cluster)] = carried;
            }
            for cluster in hybrid.wall_clusters.carried_by(particle) {
                self.carries_of_walls[cluster] = carried;
            }
        }
    }

    fn forget(&mut self, hybrid: &HybridBody) {
        self.mark_carried(hybrid, false);
        for point in &self.points {
            self.point_of[point.particle as usize] = NONE;
            self.number_of[point.particle as usize] = NONE;
        }
        for &cell in &self.cells {
            self.is_awake[cell as usize] = false;
        }
        for &tet in &self.taken_from {
            let (residual, whole) =
                (&mut self.residual_elements[tet as usize], &hybrid.partition.residual_elements()[tet as usize]);
            residual.volume_m3 = whole.volume_m3;
            residual.moments_m2.copy_from_slice(&whole.moments_m2);
            self.residual_kernel.put(tet as usize, whole);
        }
        self.taken_from.clear();
        self.active.clear();
        self.points.clear();
        self.cells.clear();
    }

    fn find_cells(&mut self, hybrid: &HybridBody) {
        for &particle in &self.active {
            for cell in hybrid.partition.cells_at(particle) {
                if !self.is_awake[cell] {
                    self.is_awake[cell] = true;
                    self.cells.push(cell as u32);
                }
            }
        }
        self.cells.sort_unstable();
    }

    fn find_points(&mut self, hybrid: &HybridBody) {
        for &cell in &self.cells {
            for particle in hybrid.partition.corners(cell as usize) {
                if self.point_of[particle as usize] == NONE {
                    self.point_of[particle as usize] = 0;
                    let anchor = hybrid.partition.anchor(particle);
                    let rest_m = hybrid.partition.particle_m(particle);
                    self.points.push(Point { particle, active: NONE, rest_m, anchor });
                }
            }
        }
        self.points.sort_unstable_by_key(|point| point.particle);
        self.points_of_active.clear();
        for (number, point) in self.points.iter_mut().enumerate() {
            self.point_of[point.particle as usize] = number as u32;
            let next = self.points_of_active.len();
            if self.active.get(next) == Some(&point.particle) {
                point.active = next as u32;
                self.number_of[point.particle as usize] = next as u32;
                self.points_of_active.push(number as u32);
            }
        }
        let numbered = (0..).zip(&self.points).filter(|(_, point)| point.active == NONE);
        self.constrained.take(numbered.map(|(number, point)| (number, point.anchor)));
        self.displacements_m.resize(self.points.len(), DVec3::ZERO);
        self.carrying.clear();
        let carries = |(_, particle): &(u32, &u32)| hybrid.skin_carriers.has(**particle);
        self.carrying.extend((0..).zip(&self.active).filter(carries).map(|(number, _)| number));
        self.deviations_m.clear();
        self.deviations_m.resize(self.active.len(), DVec3::ZERO);
    }

    /// Takes the awake cells from the residual elements: `V_g ← V_g − (1 − ε) V_c`, and likewise `T_gi`.
    fn take_from_residual_elements(&mut self, hybrid: &HybridBody) {
        let partition = &hybrid.partition;
        let mut last = NONE;
        for &cell in &self.cells {
            let Cell { tet, part, .. } = partition.cells()[cell as usize];
            if tet != last {
                last = tet;
                if !self.taken_from.contains(&tet) {
                    self.taken_from.push(tet);
                }
                for (number, node) in (0..).zip(&self.residual_elements[tet as usize].nodes) {
                    self.number_of_node[*node as usize] = number;
                }
            }
            let moments = partition.moments(cell as usize);
            let anchors = partition
                .corners(cell as usize)
                .map(|particle| self.points[self.point_of[particle as usize] as usize].anchor);
            let numbers = anchors.map(|anchor| anchor.nodes.map(|node| self.number_of_node[node as usize]));
            self.residual_elements[tet as usize].add_numbered(part, KEPT - 1.0, &moments, &anchors, &numbers);
        }
        for &tet in &self.taken_from {
            self.residual_kernel.put(tet as usize, &self.residual_elements[tet as usize]);
        }
    }
}
