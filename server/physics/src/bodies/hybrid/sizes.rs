//! Cells of two sizes: near the surface those of the lattice, deeper down cells merged from eight of them.
//!
//! Blocks of 2 × 2 × 2 cells whose first corner is at even sites become one cell of twice the spacing, with particles
//! at its own corners only. A site in the middle of one of its edges or faces *hangs*: smaller cells beside it have a
//! corner there that is no particle. It moves by the mean of the particles at the ends of the edge, or at the corners
//! of the face, as the doubled cell does there, so that displacements are continuous.
//!
//! A cell beside a doubled one shares one corner, `v`, with the block of eight that it would belong to. Where the
//! corner along axes `A` from it hangs, the block's own corner in that direction takes its place among the cell's
//! particles, so that it has eight again. With corners numbered by bits (`sites`), and particles likewise,
//! ```text
//! y_c = Σ_p T_cp y_p
//! T_cp = 2^−|A| for p = v ⊕ B, B ⊆ A, of a corner c = v ⊕ A that hangs;  T_cc = 1 of one that does not
//! ```
//! If the middle of a face hangs, so do those of its edges: the corners that `T` refers to exist. All that is linear in
//! a cell's corners (gradients, hourglasses, weights, masses) is transferred to its particles by `Tᵀ`. Affine motion is
//! reproduced as before, and uniform stress is balanced as before, since the force of small cells on a hanging site is
//! distributed as the doubled cell's own force there is.
use super::{moments::CellMoments, sites::Sites};
use std::ops::{Add, Mul};

/// Which corners of a cell hang.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hanging {
    /// A bit per corner, set where it hangs.
    corners: u8,
    /// The corner that the cell shares with its block.
    shared: u8,
}

impl Hanging {
    /// No corner hangs.
    pub const NONE: Self = Self { corners: 0, shared: 0 };

    /// Collects which corners of a cell hang; the cell is given in cells from the lattice's origin.
    pub fn new([i, j, k]: [usize; 3], hangs: impl Fn(usize) -> bool) -> Self {
        let corners = (0..8).filter(|&corner| hangs(corner)).fold(0, |bits, corner| bits | 1 << corner);
        Self { corners, shared: (i & 1 | (j & 1) << 1 | (k & 1) << 2) as u8 }
    }

    /// Returns whether some corner hangs.
    pub fn any(self) -> bool {
        self.corners != 0
    }

    /// Returns `Tᵀ a`: values of the cell's corners, distributed to its particles.
    #[must_use]
    pub fn to_particles<T: Copy + Add<Output = T> + Mul<f64, Output = T>>(self, of_corners: [T; 8]) -> [T; 8] {
        if !self.any() {
            return of_corners;
        }
        let zero = of_corners[0] * 0.0;
        let mut of_particles = [zero; 8];
        for (corner, value) in of_corners.into_iter().enumerate() {
            if self.corners >> corner & 1 == 0 {
                of_particles[corner] = of_particles[corner] + value;
                continue;
            }
            let axes = corner as u8 ^ self.shared;
            let part = value * 0.5_f64.powi(axes.count_ones() as i32);
            for some in (0..8_u8).filter(|some| some & !axes == 0) {
                let particle = usize::from(self.shared ^ some);
                of_particles[particle] = of_particles[particle] + part;
            }
        }
        of_particles
    }
}

/// Returns the site of the corner of a cell's block that has the same number as the cell's corner.
pub fn corner_of_block(sites: &Sites, cell: [usize; 3], corner: usize) -> usize {
    sites.site(std::array::from_fn(|axis| (cell[axis] & !1) + 2 * (corner >> axis & 1)))
}

/// Merges blocks of eight cells that lie beneath so many layers, where `may_merge` allows it for the cells' numbers.
/// The first layer is made of the cells that the surface cuts and of those that touch a cell which does not exist; each
/// further layer of the cells that touch the one before.
pub fn merge(
    sites: &Sites,
    cells: Vec<CellMoments>,
    layers: usize,
    may_merge: impl Fn(&[usize; 8]) -> bool,
) -> Vec<CellMoments> {
    let mut is_deep = vec![false; sites.cell_count()];
    for cell in &cells {
        is_deep[cell.cell] = true;
    }
    (0..3).for_each(|axis| erode(sites, &mut is_deep, axis, 1));
    for cell in cells.iter().filter(|cell| cell.gradients_m2.is_some()) {
        is_deep[cell.cell] = false;
    }
    (0..3).for_each(|axis| erode(sites, &mut is_deep, axis, layers.saturating_sub(1)));
    let block_of = |cell: usize| {
        let first = sites.cell_at(cell).map(|n| n & !1);
        let inside = (0..3).all(|axis| first[axis] + 1 < sites.cells()[axis]);
        inside.then(|| eight(sites, first))
    };
    let is_merged = |block: &[usize; 8]| block.iter().all(|&cell| is_deep[cell]) && may_merge(block);
    let mut merged = Vec::with_capacity(cells.len());
    for moments in cells {
        match block_of(moments.cell).filter(is_merged) {
            None => merged.push(moments),
            Some(block) if block[0] == moments.cell => {
                merged.push(CellMoments { volume_m3: 8.0 * moments.volume_m3, doubled: true, ..moments });
            }
            Some(_) => {}
        }
    }
    merged
}

/// Returns the cells of the block whose first cell is given.
pub fn eight(sites: &Sites, [i, j, k]: [usize; 3]) -> [usize; 8] {
    std::array::from_fn(|c| sites.cell([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]))
}

/// Leaves those set that have at least `depth` set beside them along an axis, on both sides.
fn erode(sites: &Sites, is_set: &mut [bool], axis: usize, depth: usize) {
    let counts = sites.cells();
    let stride = counts[..axis].iter().product::<usize>();
    let along = counts[axis];
    for first in (0..is_set.len()).filter(|cell| sites.cell_at(*cell)[axis] == 0) {
        let (mut run, mut start) = (0, 0);
        // Runs of set cells lose `depth` at both ends.
        for n in 0..=along {
            if n < along && is_set[first + n * stride] {
                if run == 0 {
                    start = n;
                }
                run += 1;
                continue;
            }
            for lost in (start..start + run).filter(|at| at - start < depth || start + run - 1 - at < depth) {
                is_set[first + lost * stride] = false;
            }
            run = 0;
        }
    }
}

/// Returns which sites are corners of cells, and which of these hang.
pub fn mark(sites: &Sites, cells: &[CellMoments]) -> Vec<Site> {
    let mut marks = vec![Site::Unused; sites.site_count()];
    for cell in cells.iter().filter(|cell| cell.doubled) {
        let [i, j, k] = sites.cell_at(cell.cell);
        for at in 0..27 {
            let [a, b, c] = [at % 3, at / 3 % 3, at / 9];
            let site = sites.site([i + a, j + b, k + c]);
            let odd = [a, b, c].into_iter().filter(|n| *n == 1).count();
            marks[site] = match odd {
                0 => Site::Particle,
                3 => Site::Unused,
                _ => Site::Hangs,
            };
        }
    }
    for cell in cells.iter().filter(|cell| !cell.doubled) {
        for site in sites.corners(cell.cell) {
            if marks[site] == Site::Unused {
                marks[site] = Site::Particle;
            }
        }
    }
    marks
}

/// What a site of the lattice is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Site {
    /// It is no corner of any cell.
    Unused,
    /// It is a particle.
    Particle,
    /// It hangs: it is in the middle of an edge or a face of a doubled cell.
    Hangs,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::{
        moments::Moments,
        partition::{NONE, Partition},
        sites::{CORNERS, trilinear},
        testing::embedded_balls,
    };
    use std::collections::BTreeMap;

    /// Returns the weights with which particles move a corner of a cell.
    fn at_corner(partition: &Partition, cell: usize, corner: usize) -> BTreeMap<u32, f64> {
        let mut one = [0.0; 8];
        one[corner] = 1.0;
        of(partition.corners(cell), partition.hanging(cell).to_particles(one))
    }

    fn of(particles: [u32; 8], weights: [f64; 8]) -> BTreeMap<u32, f64> {
        particles.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0).collect()
    }

    #[test]
    fn displacements_are_continuous_between_cells_of_two_sizes() {
        let [one_size, partition] = embedded_balls();
        let sites = *partition.sites();
        let doubled = partition.cells().iter().filter(|cell| cell.doubled).count();
        assert_eq!(one_size.cells().len(), partition.cells().len() + 7 * doubled);
        let mut by_site: BTreeMap<usize, BTreeMap<u32, f64>> = BTreeMap::new();
        let (mut shared, mut hanging) = (0, 0);
        for (number, cell) in partition.cells().iter().enumerate() {
            let at = sites.cell_at(cell.site_cell as usize);
            assert!(!partition.corners(number).contains(&NONE));
            let seen: Vec<(usize, BTreeMap<u32, f64>)> = if cell.doubled {
                let middles = (0..27).map(|n| [n % 3, n / 3 % 3, n / 9]).filter(|n| *n != [1, 1, 1]);
                let seen = |n: [usize; 3]| {
                    let local = glam::DVec3::from(n.map(|n| 0.5 * n as f64));
                    let site = sites.site(std::array::from_fn(|axis| at[axis] + n[axis]));
                    (site, of(partition.corners(number), trilinear(local)))
                };
                middles.map(seen).collect()
            } else {
                let corners = sites.corners(cell.site_cell as usize).into_iter().enumerate();
                corners.map(|(corner, site)| (site, at_corner(&partition, number, corner))).collect()
            };
            for (site, moved_by) in seen {
                hanging += usize::from(moved_by.len() > 1 && !cell.doubled);
                match by_site.insert(site, moved_by.clone()) {
                    Some(before) => {
                        assert_eq!(before, moved_by);
                        shared += 1;
                    }
                    None => assert!((moved_by.values().sum::<f64>() - 1.0).abs() < 1e-15),
                }
            }
        }
        assert!(doubled > 50 && shared > 5000 && hanging > 200, "{doubled} {shared} {hanging}");
    }

    /// A doubled cell at rest is eight cells of half its edge.
    #[test]
    fn particles_reproduce_positions_and_volume() {
        let [_, partition] = embedded_balls();
        for number in 0..partition.cells().len() {
            let cell = partition.cells()[number];
            let first_m = partition.sites().cell_m(cell.site_cell as usize);
            let positions_m = partition.corners(number).map(|p| partition.particle_m(p));
            for corner in 0..8 {
                let at_m: glam::DVec3 = at_corner(&partition, number, corner)
                    .into_iter()
                    .map(|(particle, weight)| partition.particle_m(particle) * weight)
                    .sum();
                assert!((at_m - first_m - CORNERS[corner] * partition.edge_m(number)).length() < 1e-16);
            }
            let Moments { volume_m3, gradients_m2 } = partition.moments(number);
            let rest = partition.rest_cell(number, 1.0);
            for axis in 0..3 {
                let column: glam::DVec3 = gradients_m2.iter().zip(positions_m).map(|(g, x)| *g * x[axis]).sum();
                assert!((column - glam::DVec3::AXES[axis] * volume_m3).length() < 1e-12 * 1e-9);
            }
            assert!(rest.amplitudes(&positions_m).iter().all(|q| q.length() < 1e-16));
            assert!((partition.particles_m3(number).iter().sum::<f64>() / volume_m3 - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn only_what_is_whole_and_deep_enough_is_merged() {
        let [one_size, _] = embedded_balls();
        let sites = *one_size.sites();
        let is_whole = |at: [usize; 3]| {
            let cell = one_size.cell_at(sites.cell(at));
            cell != NONE && one_size.is_whole(cell as usize)
        };
        let moments: Vec<CellMoments> = (0..one_size.cells().len())
            .map(|number| CellMoments {
                cell: one_size.cells()[number].site_cell as usize,
                doubled: false,
                volume_m3: one_size.moments(number).volume_m3,
                gradients_m2: (!one_size.is_whole(number)).then(|| Box::new(one_size.moments(number).gradients_m2)),
            })
            .collect();
        for layers in 1..4 {
            let merged = merge(&sites, moments.clone(), layers, |_| true);
            let found: Vec<usize> = merged.iter().filter(|cell| cell.doubled).map(|cell| cell.cell).collect();
            let around = |at: [usize; 3], reach: usize, of: &dyn Fn([usize; 3]) -> bool| {
                let wide = 2 * reach + 1;
                (0..wide.pow(3)).all(|n| {
                    let n = [n % wide, n / wide % wide, n / wide / wide];
                    (0..3).all(|axis| at[axis] + n[axis] >= reach && at[axis] + n[axis] - reach < sites.cells()[axis])
                        && of(std::array::from_fn(|axis| at[axis] + n[axis] - reach))
                })
            };
            let is_there = |at: [usize; 3]| one_size.cell_at(sites.cell(at)) != NONE;
            let is_beneath = |at: [usize; 3]| is_whole(at) && around(at, 1, &is_there);
            let deep = |first: [usize; 3]| {
                let mut cells = (0..8).map(|c| [first[0] + (c & 1), first[1] + (c >> 1 & 1), first[2] + (c >> 2)]);
                cells.all(|at| around(at, layers - 1, &is_beneath))
            };
            let firsts = (0..sites.cell_count()).filter(|&cell| sites.cell_at(cell).iter().all(|n| n % 2 == 0));
            let expected: Vec<usize> = firsts.filter(|&cell| deep(sites.cell_at(cell))).collect();
            assert_eq!(found, expected);
            assert!(!found.is_empty());
        }
        assert_eq!(merge(&sites, moments.clone(), 1, |_| false), moments);
    }
}
