//! The partition of the body's volume into the cells of the lattice, the coarse tets that these are counted to, and the
//! particles between them.
//!
//! The coarse level has no geometry of its own. Its energy is that of the lattice's cells, moved by the coarse nodes
//! and integrated with few points: cells are counted to the part (`composite`) that holds their middle, and a part `g`
//! has the mean gradient of its cells,
//! ```text
//! F_g = (1/V_g) Σ_i x_i T_giᵀ        T_gi = Σ_{c∈g} V_c Σ_p ζ_pi b_cp        V_g = Σ_{c∈g} V_c
//! ```
//! Affine motion is reproduced (`Σ_i T_gi = 0`, `Σ_i X_i T_giᵀ = V_g I`), whether or not the coarse tets follow the
//! body's shape, and since cells balance at interior particles, the `T_gi` of all parts sum to zero at interior nodes.
use super::{
    cell::RestCell,
    composite::{Anchor, Composite},
    moments::{CellMoments, Moments, full_gradients_m2},
    residual_element::ResidualElement,
    sites::Sites,
    sizes::{self, Hanging, Site},
};
use glam::DVec3;
use std::collections::BTreeMap;

/// The number that stands for an entry that does not exist.
pub const NONE: u32 = u32::MAX;

/// A cell that holds some of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Its number in the lattice's box; that of the first of its eight cells for a doubled one.
    pub site_cell: u32,
    /// The coarse tet that it is counted to.
    pub tet: u32,
    /// The part of the tet.
    pub part: u8,
    /// Whether its edge is twice the spacing.
    pub doubled: bool,
    /// Index of its moments among those of cut cells, [`NONE`] for a full one none of whose corners hangs.
    cut: u32,
}

/// Progress is reported whenever this many cells or sites are done.
const TELL_EVERY: usize = 1 << 15;

/// The lattice's cells and particles on the coarse tets.
#[derive(Debug, Clone)]
pub struct Partition {
    sites: Sites,
    coarse: Composite,
    cells: Vec<Cell>,
    /// `V_c` and `V_c b_cp` of cells that the surface cuts or that have hanging corners.
    cut: Vec<Moments>,
    /// Index in `cells` of every cell of the box; a doubled one is at eight of them.
    cell_at: Vec<u32>,
    /// Whether some cells are doubled.
    has_doubled: bool,
    /// Largest number of cells that a particle moves.
    most_cells_at: usize,
    /// Site of every particle, ascending.
    particles: Vec<u32>,
    /// Index in `particles` of every site of the box.
    particle_at: Vec<u32>,
    /// The coarse tet that each particle follows.
    tet_of_particle: Vec<u32>,
    /// The coarse node of each particle that is held by one of its own ([`super::held_particles`]), [`NONE`] of others.
    held_by: Vec<u32>,
    residual_elements: Vec<ResidualElement>,
}

impl Partition {
    /// Counts every cell to a coarse tet.
    pub fn new(sites: Sites, coarse: Composite, moments: &[CellMoments]) -> Self {
        Self::new_with(sites, coarse, moments, &BTreeMap::new(), &mut |_| {})
    }

    /// Does the same, with coarse nodes of their own for particles at some sites; `progress` is told the fraction done.
    pub(super) fn new_with(
        sites: Sites,
        coarse: Composite,
        moments: &[CellMoments],
        node_at: &BTreeMap<usize, u32>,
        progress: &mut dyn FnMut(f64),
    ) -> Self {
        let mut tell = |third: f64, done: usize, all: usize| {
            if done.is_multiple_of(TELL_EVERY) {
                progress((third + done as f64 / all as f64) / 3.0);
            }
        };
        let mut partition = Self {
            sites,
            cells: Vec::with_capacity(moments.len()),
            cut: Vec::new(),
            cell_at: vec![NONE; sites.cell_count()],
            has_doubled: moments.iter().any(|moments| moments.doubled),
            most_cells_at: 8,
            particles: Vec::new(),
            particle_at: vec![NONE; sites.site_count()],
            tet_of_particle: Vec::new(),
            held_by: Vec::new(),
            residual_elements: vec![ResidualElement::default(); coarse.tets().len()],
            coarse,
        };
        let marks = sizes::mark(&sites, moments);
        let count = moments.len();
        for moments in moments {
            tell(0.0, partition.cells.len(), count);
            partition.count(moments, &marks);
        }
        for site in 0..partition.particle_at.len() {
            tell(1.0, site, partition.particle_at.len());
            if marks[site] == Site::Particle {
                partition.particle_at[site] = partition.particles.len() as u32;
                partition.particles.push(site as u32);
                partition.tet_of_particle.push(partition.coarse.anchor(sites.site_m(site)).tet);
                partition.held_by.push(node_at.get(&site).copied().unwrap_or(NONE));
            }
        }
        if partition.has_doubled {
            let particles = 0..partition.particles.len() as u32;
            partition.most_cells_at = particles.map(|p| partition.cells_at(p).count()).max().unwrap_or(0);
        }
        for cell in 0..partition.cells.len() {
            tell(2.0, cell, count);
            let moments = partition.moments(cell);
            let anchors = partition.corners(cell).map(|particle| partition.anchor(particle));
            let Cell { tet, part, .. } = partition.cells[cell];
            partition.residual_elements[tet as usize].add(part, 1.0, &moments, &anchors);
        }
        partition
    }

    /// Adds a cell that holds some of the body.
    fn count(&mut self, moments: &CellMoments, marks: &[Site]) {
        let (sites, number) = (self.sites, self.cells.len() as u32);
        let at = sites.cell_at(moments.cell);
        let half = DVec3::splat(if moments.doubled { 1.0 } else { 0.5 } * sites.spacing_m());
        let Anchor { tet, part, .. } = self.coarse.anchor(sites.cell_m(moments.cell) + half);
        self.cell_at[moments.cell] = number;
        let mut hanging = Hanging::NONE;
        if moments.doubled {
            for cell in sizes::eight(&sites, at) {
                self.cell_at[cell] = number;
            }
        } else if self.has_doubled {
            let corners = sites.corners(moments.cell);
            hanging = Hanging::new(at, |corner| marks[corners[corner]] == Site::Hangs);
        }
        let mut cut = NONE;
        if hanging.any() || moments.gradients_m2.is_some() {
            let of_corners = moments.gradients_m2.as_deref().copied();
            let of_corners = of_corners.unwrap_or_else(|| full_gradients_m2(sites.spacing_m()));
            let gradients_m2 = hanging.to_particles(of_corners);
            self.cut.push(Moments { volume_m3: moments.volume_m3, gradients_m2 });
            cut = self.cut.len() as u32 - 1;
        }
        self.cells.push(Cell { site_cell: moments.cell as u32, tet, part, doubled: moments.doubled, cut });
    }

    /// Returns the lattice.
    pub fn sites(&self) -> &Sites {
        &self.sites
    }

    /// Returns the coarse level's shape functions.
    pub fn coarse(&self) -> &Composite {
        &self.coarse
    }

    /// Returns the cells that hold some of the body.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// Returns the index in [`Self::cells`] of a cell of the lattice's box, [`NONE`] where it holds nothing of the
    /// body.
    pub fn cell_at(&self, site_cell: usize) -> u32 {
        self.cell_at[site_cell]
    }

    /// Returns the number of particles.
    pub fn particle_count(&self) -> usize {
        self.particles.len()
    }

    /// Returns the rest position (m) of a particle.
    pub fn particle_m(&self, particle: u32) -> DVec3 {
        self.sites.site_m(self.particles[particle as usize] as usize)
    }

    /// Tells the particles within a distance of a point (both m, at rest), ascending, with their squared distances
    /// (m²).
    pub fn particles_within(&self, point_m: DVec3, reach_m: f64, mut tell: impl FnMut(u32, f64)) {
        let [nx, ny, nz] = self.sites.cells();
        let from = self.sites.cell_near(point_m - reach_m);
        let to = self.sites.cell_near(point_m + reach_m);
        for k in from[2]..=(to[2] + 1).min(nz) {
            for j in from[1]..=(to[1] + 1).min(ny) {
                for i in from[0]..=(to[0] + 1).min(nx) {
                    let site = self.sites.site([i, j, k]);
                    let distance_sq = self.sites.site_m(site).distance_squared(point_m);
                    if self.particle_at[site] != NONE && distance_sq <= reach_m * reach_m {
                        tell(self.particle_at[site], distance_sq);
                    }
                }
            }
        }
    }

    /// Returns the coarse nodes that a particle follows while it sleeps.
    pub fn anchor(&self, particle: u32) -> Anchor {
        let anchor = self.coarse.anchor_in(self.tet_of_particle[particle as usize], self.particle_m(particle));
        match self.held_by[particle as usize] {
            NONE => anchor,
            node => Anchor { nodes: [node; 4], weights: [1.0, 0.0, 0.0, 0.0], ..anchor },
        }
    }

    /// Returns the eight particles of a cell: those at its corners, in their order; in place of a hanging corner, the
    /// one at the corner of its block (`sizes`).
    pub fn corners(&self, cell: usize) -> [u32; 8] {
        let Cell { site_cell, doubled, .. } = self.cells[cell];
        let site_cell = site_cell as usize;
        if doubled {
            let at = self.sites.cell_at(site_cell);
            return std::array::from_fn(|c| self.particle_at[sizes::corner_of_block(&self.sites, at, c)]);
        }
        let mut corners = self.sites.corners(site_cell).map(|site| self.particle_at[site]);
        if self.has_doubled && corners.contains(&NONE) {
            let at = self.sites.cell_at(site_cell);
            for (number, corner) in corners.iter_mut().enumerate().filter(|(_, corner)| **corner == NONE) {
                *corner = self.particle_at[sizes::corner_of_block(&self.sites, at, number)];
            }
        }
        corners
    }

    /// Returns which corners of a cell hang.
    pub fn hanging(&self, cell: usize) -> Hanging {
        let Cell { site_cell, doubled, cut, .. } = self.cells[cell];
        if !self.has_doubled || doubled || cut == NONE {
            return Hanging::NONE;
        }
        let corners = self.sites.corners(site_cell as usize);
        Hanging::new(self.sites.cell_at(site_cell as usize), |corner| self.particle_at[corners[corner]] == NONE)
    }

    /// Returns whether a cell is whole, and its edge is the lattice's spacing.
    pub fn is_plain(&self, cell: usize) -> bool {
        self.is_whole(cell) && !self.cells[cell].doubled
    }

    /// Returns whether a cell is a whole cube, none of whose corners hangs.
    pub fn is_whole(&self, cell: usize) -> bool {
        self.cells[cell].cut == NONE
    }

    /// Returns the edge (m) of a cell.
    pub fn edge_m(&self, cell: usize) -> f64 {
        if self.cells[cell].doubled { 2.0 * self.sites.spacing_m() } else { self.sites.spacing_m() }
    }

    /// Returns `V_c` (m³) and `V_c b_cp` (m²) of a cell, `p` its particles.
    pub fn moments(&self, cell: usize) -> Moments {
        match self.cells[cell].cut {
            NONE => Moments::full(self.edge_m(cell)),
            cut => self.cut[cut as usize],
        }
    }

    /// Returns a cell's rest data; it answers for `fraction` of the cell's volume.
    pub fn rest_cell(&self, cell: usize, fraction: f64) -> RestCell {
        RestCell::with_hanging(self.edge_m(cell), fraction, &self.moments(cell), self.hanging(cell))
    }

    /// Returns the cells that a particle moves.
    pub fn cells_at(&self, particle: u32) -> impl Iterator<Item = usize> + '_ {
        let site = self.particles[particle as usize] as usize;
        let [nx, ny, nz] = self.sites.cells();
        let at = [site % (nx + 1), site / (nx + 1) % (ny + 1), site / ((nx + 1) * (ny + 1))];
        let of_blocks = self.has_doubled && at.iter().all(|n| n % 2 == 0);
        (0..8_usize).flat_map(move |corner| {
            let beside = |axis: usize| at[axis].checked_sub(corner >> axis & 1);
            let around = (|| Some([beside(0)?, beside(1)?, beside(2)?]))();
            let around = around.filter(|[i, j, k]| *i < nx && *j < ny && *k < nz);
            let direct = around.map_or(NONE, |around| self.cell_at[self.sites.cell(around)]);
            // Other cells of the same block have this particle in place of a hanging corner.
            let block = around.filter(|_| of_blocks && (direct == NONE || !self.cells[direct as usize].doubled));
            let others = block.into_iter().flat_map(move |around| {
                let others = self.cells_of_block(around).into_iter();
                others.filter(move |&cell| cell != NONE && cell != direct)
            });
            let others = others.filter(move |&cell| self.corners(cell as usize).contains(&particle));
            let direct = (direct != NONE).then_some(direct);
            direct.into_iter().chain(others).map(|cell| cell as usize)
        })
    }

    /// Returns whether some cells are doubled.
    pub fn has_doubled(&self) -> bool {
        self.has_doubled
    }

    /// Returns the largest number of cells that a particle moves: eight where all are of one size.
    pub fn most_cells_at(&self) -> usize {
        self.most_cells_at
    }

    /// Returns the cells, or [`NONE`], of the block of eight that a cell of the box belongs to.
    fn cells_of_block(&self, around: [usize; 3]) -> [u32; 8] {
        let counts = self.sites.cells();
        std::array::from_fn(|c| {
            let at: [usize; 3] = std::array::from_fn(|axis| (around[axis] & !1) + (c >> axis & 1));
            let inside = (0..3).all(|axis| at[axis] < counts[axis]);
            if inside { self.cell_at[self.sites.cell(at)] } else { NONE }
        })
    }

    /// Returns the parts of a cell's volume (m³) that its particles have: an eighth for each corner.
    pub fn particles_m3(&self, cell: usize) -> [f64; 8] {
        self.hanging(cell).to_particles([self.moments(cell).volume_m3 / 8.0; 8])
    }

    /// Returns the residual elements of the coarse tets while all particles sleep: they have all of the body.
    pub fn residual_elements(&self) -> &[ResidualElement] {
        &self.residual_elements
    }

    /// Returns the volume of all cells (m³).
    pub fn volume_m3(&self) -> f64 {
        (0..self.cells.len()).map(|cell| self.moments(cell).volume_m3).sum()
    }

    /// Returns the fraction of the volume that is in cells that the surface does not cut.
    pub fn whole_part(&self) -> f64 {
        let spacing_m = self.sites.spacing_m();
        let whole_m3 = |doubled: bool| if doubled { 8.0 * spacing_m.powi(3) } else { spacing_m.powi(3) };
        let is_cut = |cell: usize| self.moments(cell).volume_m3 < (1.0 - 1e-6) * whole_m3(self.cells[cell].doubled);
        let whole = (0..self.cells.len()).filter(|&cell| !is_cut(cell));
        // The sum of no numbers is −0.
        whole.map(|cell| self.moments(cell).volume_m3).fold(0.0, |sum, volume_m3| sum + volume_m3) / self.volume_m3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::{composite::PARTS, testing::embedded_balls};

    #[test]
    fn parts_reproduce_affine_motion_and_balance_at_interior_nodes() {
        for partition in embedded_balls() {
            let coarse = partition.coarse();
            let mut total = vec![DVec3::ZERO; coarse.positions_m().len()];
            for residual in partition.residual_elements() {
                for part in 0..PARTS {
                    let sum: DVec3 = residual.moments_m2.iter().map(|m| m[part]).sum();
                    assert!(sum.length() < 1e-18);
                    for axis in 0..3 {
                        let column: DVec3 = residual
                            .nodes
                            .iter()
                            .zip(&residual.moments_m2)
                            .map(|(&n, m)| m[part] * coarse.positions_m()[n as usize][axis])
                            .sum();
                        let expected = DVec3::AXES[axis] * residual.volume_m3[part];
                        assert!((column - expected).length() < 1e-12 * 1e-6, "{column} {expected}");
                    }
                }
                for (&node, moments) in residual.nodes.iter().zip(&residual.moments_m2) {
                    total[node as usize] += moments.iter().sum::<DVec3>();
                }
            }
            let volume: f64 = partition.residual_elements().iter().flat_map(|s| s.volume_m3).sum();
            assert!((volume / partition.volume_m3() - 1.0).abs() < 1e-12);
            // Nodes whose whole support lies within the body: none of its cut cells' particles follows them.
            let mut at_surface = vec![false; total.len()];
            for (cell, _) in partition.cells().iter().enumerate().filter(|(_, c)| c.cut != NONE) {
                for particle in partition.corners(cell) {
                    let anchor = partition.anchor(particle);
                    anchor.nodes.iter().for_each(|&n| at_surface[n as usize] = true);
                }
            }
            let interior: Vec<usize> = (0..total.len()).filter(|&n| !at_surface[n]).collect();
            assert!(interior.len() > 3, "{}", interior.len());
            for node in interior {
                assert!(total[node].length() < 1e-14 * 1e-4, "{node}: {}", total[node]);
            }
        }
    }

    #[test]
    fn cells_and_particles_know_each_other() {
        for partition in embedded_balls() {
            for particle in 0..partition.particle_count() as u32 {
                let around: Vec<usize> = partition.cells_at(particle).collect();
                assert!(!around.is_empty());
                assert!(around.iter().all(|&cell| partition.corners(cell).contains(&particle)));
            }
            let all = || 0..partition.particle_count() as u32;
            for at in [DVec3::new(0.3e-3, 2e-3, -1e-3), DVec3::new(9.5e-3, 0.0, 1e-3), DVec3::splat(-0.02)] {
                let near: Vec<u32> = all().filter(|&p| partition.particle_m(p).distance(at) <= 2.3e-3).collect();
                let mut told = Vec::new();
                partition.particles_within(at, 2.3e-3, |particle, _| told.push(particle));
                assert_eq!(told, near);
            }
            let volume_m3: f64 = (0..partition.cells().len()).flat_map(|cell| partition.particles_m3(cell)).sum();
            assert!((volume_m3 / partition.volume_m3() - 1.0).abs() < 1e-12);
            assert_eq!(all().map(|p| partition.cells_at(p).count()).sum::<usize>(), 8 * partition.cells().len());
        }
    }
}
