//! The cut cells of a hybrid body's patch (`hybrid::cell`), in blocks of lanes; their oracle is `hybrid::cell`.
//!
//! A cut cell carries its gradients and modes, and has its points anywhere. Displacements are taken as differences to
//! the first point in f64 and rounded then; forces are summed in f64, that on the first point as minus the sum of the
//! others.
mod forces;
#[cfg(test)]
pub(crate) mod testing;

use super::{
    Room,
    prestrains::{ENTRIES, Found, Split, entries},
};
use crate::{
    bodies::hybrid::{cell::RestCell, prestrain::CellPrestrain},
    lanes::{
        Available, InstructionSet, LANES_F32, LANES_F64,
        grid::DisplacementGrid,
        nodes::{Node, Sum, node},
        real::Scalar,
    },
    material::Material,
    settings::Precision,
};
use forces::CutForces;
use glam::DVec3;
use std::ops::Range;

/// Consecutive cells are spread over the lanes of this many blocks: sums of one point would wait for each other in the
/// scatter.
const BLOCKS_PER_WINDOW: usize = 16;
/// Cut cells in lanes. Lanes of padding have the spare point eight times, and zeros.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
struct CutBlock<T, const N: usize> {
    points: [[u32; 8]; N],
    /// `b_p` (1/m) of points 1 to 7.
    gradients: [[T; N]; 21],
    /// `γ_kp` of modes 0 to 3 and points 1 to 7: entry `7k + p − 1`.
    modes: [[T; N]; 28],
    /// `−V` (m³).
    minus_volume: [T; N],
    /// `−κ` (N/m).
    minus_kappa: [T; N],
    /// `β/h²` (1/m²).
    growth: [T; N],
}

/// Prestrains of the cells of a block.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
struct PrestrainBlock<T, const N: usize> {
    entries: [[T; N]; ENTRIES],
    /// A bit per lane, set where the cell has prestrain.
    lanes: u32,
}

/// Cells of one material.
#[derive(Debug, Clone)]
struct Run {
    material: u16,
    blocks: Range<usize>,
    cells: usize,
}

/// Blocks of all materials.
#[derive(Debug, Clone)]
struct Tables<T, const N: usize> {
    materials: Vec<Split<T>>,
    blocks: Vec<CutBlock<T, N>>,
    /// Prestrains of the blocks, one for each.
    prestrains: Vec<PrestrainBlock<T, N>>,
    runs: Vec<Run>,
    spare: u32,
}

#[derive(Debug, Clone)]
enum Layout {
    Single(Tables<f32, LANES_F32>),
    Double(Tables<f64, LANES_F64>),
}

/// Forces of cut cells, which may be exchanged for others without allocating.
#[derive(Debug, Clone)]
pub struct CutCells {
    layout: Layout,
    grid: DisplacementGrid,
    instruction_set: Available,
    displacements: Vec<Node>,
    /// Empty unless some material is viscous.
    velocities: Vec<Node>,
    sums: Vec<Sum>,
}

impl CutCells {
    /// Makes room for cells of edge `h` (m), or of twice that, over points.
    pub fn with_capacity(edge_m: f64, materials: &[Material], precision: Precision, room: Room) -> Self {
        let Room { points, cells } = room;
        let layout = match precision {
            Precision::Single => Layout::Single(Tables::with_capacity(cells, points, materials)),
            Precision::Double => Layout::Double(Tables::with_capacity(cells, points, materials)),
        };
        let is_viscous = materials.iter().any(|m| !m.viscosity.is_zero());
        // There is one spare point more, for the lanes of padding.
        let count = points + 1;
        Self {
            layout,
            grid: DisplacementGrid::of_cells(precision, edge_m),
            instruction_set: Available::best(),
            displacements: vec![Node::default(); count],
            velocities: vec![Node::default(); if is_viscous { count } else { 0 }],
            sums: vec![Sum::default(); count],
        }
    }

    /// Returns the same kernel, held to an instruction set or to the best available below it (for tests and
    /// benchmarks).
    #[must_use]
    pub fn with_instruction_set(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set: Available::at_most(instruction_set), ..self }
    }

    /// Removes all cells.
    pub fn clear(&mut self) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.clear(),
            Layout::Double(blocks) => blocks.clear(),
        }
    }

    /// Starts a run of `cells` cells of one material, without prestrain, to be filled by [`Self::put`]. Does not
    /// allocate within the capacity.
    pub fn start(&mut self, material: u16, cells: usize) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.start(material, cells),
            Layout::Double(blocks) => blocks.start(material, cells),
        }
    }

    /// Returns the number of runs.
    pub fn runs(&self) -> usize {
        match &self.layout {
            Layout::Single(blocks) => blocks.runs.len(),
            Layout::Double(blocks) => blocks.runs.len(),
        }
    }

    /// Sets the prestrain of a cell of a run (from 0), `None` for one without.
    pub fn put_prestrain(&mut self, run: usize, number: usize, prestrain: Option<&CellPrestrain>) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.put_prestrain(run, number, prestrain),
            Layout::Double(blocks) => blocks.put_prestrain(run, number, prestrain),
        }
    }

    /// Sets cell `number` of the last run.
    pub fn put(&mut self, number: usize, points: [u32; 8], rest: &RestCell) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.put(number, points, rest),
            Layout::Double(blocks) => blocks.put(number, points, rest),
        }
    }

    /// Returns whether there are no cells.
    pub fn is_empty(&self) -> bool {
        match &self.layout {
            Layout::Single(blocks) => blocks.blocks.is_empty(),
            Layout::Double(blocks) => blocks.blocks.is_empty(),
        }
    }

    /// Sets the displacements (m) of the points.
    pub fn set_displacements(&mut self, displacements_m: &[DVec3]) {
        for (to, from) in self.displacements.iter_mut().zip(displacements_m) {
            *to = node(self.grid.rounded(*from));
        }
    }

    /// Sets the velocities (m/s) of the points; they are used only where a material is viscous.
    pub fn set_velocities(&mut self, v: &[DVec3]) {
        for (to, from) in self.velocities.iter_mut().zip(v) {
            *to = node(*from);
        }
    }

    /// Sums up the forces (N) of elastic and viscous stress on the first `points` points, with the fraction `left` of
    /// the prestrain.
    pub fn forces(&mut self, points: usize, left: f64) -> Found {
        let Self { layout, instruction_set, displacements, velocities, sums, .. } = self;
        sums[..points].fill(Sum::default());
        match layout {
            Layout::Single(blocks) => blocks.sum_up(*instruction_set, left, displacements, velocities, sums),
            Layout::Double(blocks) => blocks.sum_up(*instruction_set, left, displacements, velocities, sums),
        }
    }

    /// Adds the forces (N) on the points.
    pub fn add_forces_n(&self, forces_n: &mut [DVec3]) {
        for (force, Sum([x, y, z, _])) in forces_n.iter_mut().zip(&self.sums) {
            *force += DVec3::new(*x, *y, *z);
        }
    }
}

impl<T: Scalar, const N: usize> Tables<T, N> {
    fn with_capacity(cells: usize, points: usize, materials: &[Material]) -> Self {
        Self {
            materials: materials.iter().map(Split::of).collect(),
            // Every run may leave one block in part empty.
            blocks: Vec::with_capacity(cells.div_ceil(N) + materials.len()),
            prestrains: Vec::with_capacity(cells.div_ceil(N) + materials.len()),
            runs: Vec::with_capacity(materials.len()),
            spare: points as u32,
        }
    }

    fn clear(&mut self) {
        self.blocks.clear();
        self.prestrains.clear();
        self.runs.clear();
    }

    fn start(&mut self, material: u16, cells: usize) {
        let zero = T::of(0.0);
        let first = self.blocks.len();
        for _ in 0..cells.div_ceil(N) {
            self.blocks.push(CutBlock {
                points: [[self.spare; 8]; N],
                gradients: [[zero; N]; 21],
                modes: [[zero; N]; 28],
                minus_volume: [zero; N],
                minus_kappa: [zero; N],
                growth: [zero; N],
            });
        }
        let nothing = PrestrainBlock { entries: [[zero; N]; ENTRIES], lanes: 0 };
        self.prestrains.resize(self.blocks.len(), nothing);
        self.runs.push(Run { material, blocks: first..self.blocks.len(), cells });
    }

    fn put_prestrain(&mut self, run: usize, number: usize, prestrain: Option<&CellPrestrain>) {
        let run = &self.runs[run];
        let (block, lane) = run.lane::<N>(number);
        let block = &mut self.prestrains[run.blocks.start + block];
        for (lanes, entry) in block.entries.iter_mut().zip(entries(prestrain)) {
            lanes[lane] = T::of(entry);
        }
        block.lanes = block.lanes & !(1 << lane) | u32::from(prestrain.is_some()) << lane;
    }

    fn put(&mut self, number: usize, points: [u32; 8], rest: &RestCell) {
        let Some(run) = self.runs.last() else { return };
        let (block, lane) = run.lane::<N>(number);
        let block = &mut self.blocks[run.blocks.start + block];
        block.points[lane] = points;
        for p in 1..8 {
            for axis in 0..3 {
                block.gradients[3 * (p - 1) + axis][lane] = T::of(rest.gradients_per_m[p][axis]);
            }
            for mode in 0..4 {
                block.modes[7 * mode + p - 1][lane] = T::of(rest.modes[mode][p]);
            }
        }
        block.minus_volume[lane] = T::of(-rest.volume_m3);
        let mu_pa = self.materials[run.material as usize].material.lame.mu_pa;
        block.growth[lane] = T::of(rest.growth_per_m2);
        block.minus_kappa[lane] = T::of(-rest.hourglass_m * mu_pa);
    }

    fn sum_up(
        &self,
        set: Available,
        left: f64,
        displacements: &[Node],
        velocities: &[Node],
        sums: &mut [Sum],
    ) -> Found {
        let mut found = Found::default();
        for run in &self.runs {
            let split = &self.materials[run.material as usize];
            let blocks = &self.blocks[run.blocks.clone()];
            let prestrains = &self.prestrains[run.blocks.clone()];
            let mut pass =
                CutForces { split, blocks, prestrains, left, displacements, velocities, sums, prestrain_j: 0.0 };
            let viscous_w = split.material.run(set, false, &mut pass);
            found += Found { viscous_w, prestrain_j: pass.prestrain_j };
        }
        found
    }
}

impl Run {
    /// Returns block and lane of a cell; neighbours are in different blocks.
    fn lane<const N: usize>(&self, number: usize) -> (usize, usize) {
        let (window, within) = (number / (N * BLOCKS_PER_WINDOW), number % (N * BLOCKS_PER_WINDOW));
        let first = window * BLOCKS_PER_WINDOW;
        let count = (self.cells - first * N).div_ceil(N).min(BLOCKS_PER_WINDOW);
        (first + within % count, within / count)
    }
}

#[cfg(test)]
mod tests {
    use super::{
        testing::{Answer, Question, agrees_with_oracle},
        *,
    };

    #[test]
    fn cut_cells_and_oracle_agree() {
        agrees_with_oracle(false, |question: &Question<'_>| {
            let Question { cells, spacing_m, u, v, material, precision, set, .. } = question;
            let room = Room { points: u.len(), cells: cells.len() };
            let mut kernel = CutCells::with_capacity(*spacing_m, &[*material], *precision, room);
            kernel = kernel.with_instruction_set(*set);
            // Nothing may stay of cells that were there before.
            kernel.start(0, 3);
            (0..3).for_each(|number| kernel.put(number, cells[number].0, &cells[number].1));
            (0..3).for_each(|number| kernel.put_prestrain(0, number, Some(&CellPrestrain::none(0))));
            kernel.clear();
            kernel.start(0, cells.len());
            for (number, (points, rest)) in cells.iter().enumerate() {
                kernel.put(number, *points, rest);
            }
            kernel.set_displacements(u);
            kernel.set_velocities(v);
            let power_w = kernel.forces(u.len(), 0.0).viscous_w;
            let mut forces_n = vec![DVec3::ZERO; u.len()];
            kernel.add_forces_n(&mut forces_n);
            Answer { forces_n, power_w }
        });
    }
}
