//! The cut cells of a hybrid body's patch (`hybrid::cell`), in blocks of lanes; their oracle is `hybrid::cell`.
//!
//! A cut cell carries its gradients and modes, and has its points anywhere. Displacements are taken as differences to the first point in f64 and
//! rounded then; forces are summed in f64, that on the first point as minus the sum of the others.
use super::{
    block::{Lanes, Node, Sum},
    cell_stress::{faded_stress, load_matrix, stress},
    dispatch::{self, Available, InstructionSet, Pass},
    laws::{Constants, LaneLaw, plus},
    node,
    real::{Scalar, Vector},
    tangents::LaneTangent,
};
use crate::{
    hybrid::{
        cell::{MODE_WEIGHTS, RestCell},
        fade::CellFade,
        share,
    },
    material::Material,
    world::Precision,
};
use glam::DVec3;
use std::ops::Range;

const LANES_F32: usize = 16;
const LANES_F64: usize = 8;

/// Consecutive cells are spread over the lanes of this many blocks: sums of one point would wait for each other in the scatter.
const BLOCKS_PER_WINDOW: usize = 16;
/// Tables that are gathered, computed and scattered together: a wide load waits for the narrow stores it overlaps.
const BATCH: usize = 4;

/// Points 1 to 3, 4 to 6, and 7 of a block's cells, three components each; what is over stays zero.
type Corners<T, const N: usize> = [Lanes<T, N>; 3];

/// Lanes of padding have the spare point eight times, and zeros.
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
}

/// What fades in the cells of a block (`hybrid::fade`), entries of matrices row by row.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
struct FadeBlock<T, const N: usize> {
    shape: [[T; N]; 9],
    volume: [[T; N]; 9],
    /// `1 − a`.
    modes: [T; N],
}

/// Cells of one material, all of which fade, or none.
#[derive(Debug, Clone)]
struct Run {
    material: u16,
    blocks: Range<usize>,
    cells: usize,
    /// First of as many blocks of what fades.
    fades: Option<usize>,
}

/// Constants of a material: whole, of its shape and of its volume.
#[derive(Debug, Clone)]
struct Split<T> {
    material: Material,
    whole: Constants<T>,
    shape: Constants<T>,
    volume: Constants<T>,
}

/// Blocks of all materials.
#[derive(Debug, Clone)]
struct Tables<T, const N: usize> {
    materials: Vec<Split<T>>,
    blocks: Vec<CutBlock<T, N>>,
    fades: Vec<FadeBlock<T, N>>,
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
    instruction_set: Available,
    displacements: Vec<Node>,
    /// Empty unless something is viscous.
    velocities: Vec<Node>,
    sums: Vec<Sum>,
}

impl CutCells {
    /// Room for `cells` cells over `points` points.
    pub fn with_capacity(cells: usize, points: usize, materials: &[Material], precision: Precision) -> Self {
        let layout = match precision {
            Precision::Single => Layout::Single(Tables::with_capacity(cells, points, materials)),
            Precision::Double => Layout::Double(Tables::with_capacity(cells, points, materials)),
        };
        let is_viscous = materials.iter().any(|m| !m.viscosity.is_zero());
        // One spare point more, for the lanes of padding.
        let count = points + 1;
        Self {
            layout,
            instruction_set: Available::at_most(InstructionSet::best()),
            displacements: vec![Node::default(); count],
            velocities: vec![Node::default(); if is_viscous { count } else { 0 }],
            sums: vec![Sum::default(); count],
        }
    }

    /// The same, held to an instruction set or the best below it that there is (for tests and benchmarks).
    #[must_use]
    pub fn with_instruction_set(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set: Available::at_most(instruction_set), ..self }
    }

    /// Leaves all cells.
    pub fn clear(&mut self) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.clear(),
            Layout::Double(blocks) => blocks.clear(),
        }
    }

    /// Makes place for `cells` cells of one material, to be filled by [`Self::put`] and, if they are `fading`, [`Self::put_fade`]. Does not allocate
    /// within the capacity.
    pub fn start(&mut self, material: u16, cells: usize, fading: bool) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.start(material, cells, fading),
            Layout::Double(blocks) => blocks.start(material, cells, fading),
        }
    }

    /// Number of [`Self::start`]s since all cells were left.
    pub fn runs(&self) -> usize {
        match &self.layout {
            Layout::Single(blocks) => blocks.runs.len(),
            Layout::Double(blocks) => blocks.runs.len(),
        }
    }

    /// What fades in a cell of a run (from 0) of fading ones.
    pub fn put_fade(&mut self, run: usize, number: usize, fade: &CellFade) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.put_fade(run, number, fade),
            Layout::Double(blocks) => blocks.put_fade(run, number, fade),
        }
    }

    /// Cell `number` of those of the last [`Self::start`].
    pub fn put(&mut self, number: usize, points: [u32; 8], rest: &RestCell) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.put(number, points, rest),
            Layout::Double(blocks) => blocks.put(number, points, rest),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        match &self.layout {
            Layout::Single(blocks) => blocks.blocks.is_empty(),
            Layout::Double(blocks) => blocks.blocks.is_empty(),
        }
    }

    /// Displacements (m) of the points.
    pub fn set_displacements(&mut self, displacements_m: &[DVec3]) {
        for (to, from) in self.displacements.iter_mut().zip(displacements_m) {
            *to = node(*from);
        }
    }

    /// Velocities (m/s) of the points; of use only where a material is viscous.
    pub fn set_velocities(&mut self, v: &[DVec3]) {
        for (to, from) in self.velocities.iter_mut().zip(v) {
            *to = node(*from);
        }
    }

    /// Sums up the forces (N) of elastic and viscous stress on the first `points` points; returns the power (W) that viscous stress takes.
    pub fn forces(&mut self, points: usize) -> f64 {
        let Self { layout, instruction_set, displacements, velocities, sums } = self;
        sums[..points].fill(Sum::default());
        match layout {
            Layout::Single(blocks) => blocks.sum_up(*instruction_set, displacements, velocities, sums),
            Layout::Double(blocks) => blocks.sum_up(*instruction_set, displacements, velocities, sums),
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
            blocks: Vec::with_capacity(cells.div_ceil(N) + 2 * materials.len()),
            fades: Vec::with_capacity(cells.div_ceil(N) + materials.len()),
            runs: Vec::with_capacity(2 * materials.len()),
            spare: points as u32,
        }
    }

    fn clear(&mut self) {
        self.blocks.clear();
        self.fades.clear();
        self.runs.clear();
    }

    fn start(&mut self, material: u16, cells: usize, fading: bool) {
        let zero = T::of(0.0);
        let first = self.blocks.len();
        for _ in 0..cells.div_ceil(N) {
            self.blocks.push(CutBlock {
                points: [[self.spare; 8]; N],
                gradients: [[zero; N]; 21],
                modes: [[zero; N]; 28],
                minus_volume: [zero; N],
                minus_kappa: [zero; N],
            });
        }
        let fades = fading.then_some(self.fades.len());
        if fading {
            let nothing = FadeBlock { shape: [[zero; N]; 9], volume: [[zero; N]; 9], modes: [zero; N] };
            self.fades.extend(std::iter::repeat_n(nothing, cells.div_ceil(N)));
        }
        self.runs.push(Run { material, blocks: first..self.blocks.len(), cells, fades });
    }

    fn put_fade(&mut self, run: usize, number: usize, fade: &CellFade) {
        let run = &self.runs[run];
        let Some(first) = run.fades else { return };
        let (block, lane) = run.lane::<N>(number);
        let block = &mut self.fades[first + block];
        for row in 0..3 {
            for column in 0..3 {
                block.shape[3 * row + column][lane] = T::of(fade.shape.col(column)[row]);
                block.volume[3 * row + column][lane] = T::of(fade.volume.col(column)[row]);
            }
        }
        block.modes[lane] = T::of(1.0 - fade.modes);
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
        block.minus_kappa[lane] = T::of(-rest.hourglass_m * mu_pa);
    }

    fn sum_up(&self, set: Available, displacements: &[Node], velocities: &[Node], sums: &mut [Sum]) -> f64 {
        let mut power_w = 0.0;
        for run in &self.runs {
            let split = &self.materials[run.material as usize];
            let blocks = &self.blocks[run.blocks.clone()];
            let fades = run.fades.map_or(&[][..], |first| &self.fades[first..first + blocks.len()]);
            let mut pass = CutForces { split, blocks, fades, displacements, velocities, sums };
            power_w += dispatch::run(set, (split.material.law, !split.material.viscosity.is_zero()), &mut pass);
        }
        power_w
    }
}

impl Run {
    /// Block and lane of a cell: neighbours go to different blocks.
    fn lane<const N: usize>(&self, number: usize) -> (usize, usize) {
        let (window, within) = (number / (N * BLOCKS_PER_WINDOW), number % (N * BLOCKS_PER_WINDOW));
        let first = window * BLOCKS_PER_WINDOW;
        let count = (self.cells - first * N).div_ceil(N).min(BLOCKS_PER_WINDOW);
        (first + within % count, within / count)
    }
}

impl<T: Scalar> Split<T> {
    fn of(material: &Material) -> Self {
        let (shape, volume) = share::split(material);
        let [whole, shape, volume] = [material, &shape, &volume].map(Constants::of);
        Self { material: *material, whole, shape, volume }
    }
}

/// The pass over the cells of one material.
struct CutForces<'a, T, const N: usize> {
    split: &'a Split<T>,
    blocks: &'a [CutBlock<T, N>],
    /// As many, or none.
    fades: &'a [FadeBlock<T, N>],
    displacements: &'a [Node],
    velocities: &'a [Node],
    sums: &'a mut [Sum],
}

impl<T: Scalar, const N: usize> Pass<T> for CutForces<'_, T, N> {
    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: LaneTangent, const VISCOUS: bool>(&mut self) -> f64 {
        let mut edges: [Corners<T, N>; BATCH] = [[[[T::of(0.0); N]; 9]; 3]; BATCH];
        let mut rates = edges;
        let mut forces = edges;
        let mut power_w = 0.0;
        for (number, batch) in self.blocks.chunks(BATCH).enumerate() {
            for (index, block) in batch.iter().enumerate() {
                gather::<V, N>(&block.points, self.displacements, &mut edges[index]);
                if VISCOUS {
                    gather::<V, N>(&block.points, self.velocities, &mut rates[index]);
                }
            }
            for (index, block) in batch.iter().enumerate() {
                let (of, forces) = ([&edges[index], &rates[index]], &mut forces[index]);
                let fade = self.fades.get(number * BATCH + index);
                power_w += cut::<V, T, L, VISCOUS, N>(self.split, (block, fade), of, forces);
            }
            for (block, forces) in batch.iter().zip(&forces) {
                scatter(&block.points, forces, self.sums);
            }
        }
        power_w
    }
}

/// One axis of points 1 to 7.
#[inline(always)]
fn load<V: Vector, const N: usize>(corners: &Corners<V::Scalar, N>, axis: usize, first: usize) -> [V; 7] {
    let mut loaded = [V::of(0.0); 7];
    for p in 0..7 {
        loaded[p] = V::load(&corners[p / 3][3 * (p % 3) + axis][first..]);
    }
    loaded
}

#[inline(always)]
fn store<V: Vector, const N: usize>(values: &[V; 7], corners: &mut Corners<V::Scalar, N>, axis: usize, first: usize) {
    for p in 0..7 {
        values[p].store(&mut corners[p / 3][3 * (p % 3) + axis][first..]);
    }
}

#[inline(always)]
fn cut<V: Vector<Scalar = T>, T: Scalar, L: LaneLaw, const VISCOUS: bool, const N: usize>(
    split: &Split<T>,
    (block, fade): (&CutBlock<T, N>, Option<&FadeBlock<T, N>>),
    [edges, rates]: [&Corners<T, N>; 2],
    forces: &mut Corners<T, N>,
) -> f64 {
    let mut power = [T::of(0.0); N];
    for first in (0..N).step_by(V::WIDTH) {
        let b = |p: usize, axis: usize| V::load(&block.gradients[3 * p + axis][first..]);
        let gradient = |corners: &Corners<T, N>| {
            let mut h = [[V::of(0.0); 3]; 3];
            for axis in 0..3 {
                let a = load::<V, N>(corners, axis, first);
                for p in 0..7 {
                    for column in 0..3 {
                        h[axis][column] = h[axis][column] + a[p] * b(p, column);
                    }
                }
            }
            h
        };
        let h = gradient(edges);
        let h_dot = if VISCOUS { gradient(rates) } else { h };
        let mut minus_kappa = V::load(&block.minus_kappa[first..]);
        let (p, density) = if let Some(fade) = fade {
            minus_kappa = minus_kappa * V::load(&fade.modes[first..]);
            let of_shape = (&split.shape, &load_matrix::<V, N>(&fade.shape, first));
            let of_volume = (&split.volume, &load_matrix::<V, N>(&fade.volume, first));
            let (shape, density) = faded_stress::<V, T, L, VISCOUS>(of_shape, &h, &h_dot);
            let volume = faded_stress::<V, T, L, false>(of_volume, &h, &h).0;
            (plus(&shape, &volume), density)
        } else {
            stress::<V, T, L, VISCOUS>(&split.whole, &h, &h_dot)
        };
        let minus_volume = V::load(&block.minus_volume[first..]);
        if VISCOUS {
            (V::of(0.0) - density * minus_volume).store(&mut power[first..]);
        }
        for axis in 0..3 {
            let a = load::<V, N>(edges, axis, first);
            let mut f = [V::of(0.0); 7];
            for point in 0..7 {
                let along = p[axis][0] * b(point, 0) + p[axis][1] * b(point, 1) + p[axis][2] * b(point, 2);
                f[point] = along * minus_volume;
            }
            for mode in 0..4 {
                let gamma = |point: usize| V::load(&block.modes[7 * mode + point][first..]);
                let mut q = V::of(0.0);
                for point in 0..7 {
                    q = q + a[point] * gamma(point);
                }
                let q = q * minus_kappa * V::of(MODE_WEIGHTS[mode]);
                for point in 0..7 {
                    f[point] = f[point] + q * gamma(point);
                }
            }
            store(&f, forces, axis, first);
        }
    }
    power.iter().fold(0.0, |sum, &p| sum + p.into())
}

/// `a_p − a_0` of all lanes.
#[inline(always)]
fn gather<V: Vector, const N: usize>(points: &[[u32; 8]; N], values: &[Node], edges: &mut Corners<V::Scalar, N>) {
    for first in (0..N).step_by(4) {
        for group in 0..3 {
            let mut corners = [[&values[0]; 4]; 4];
            for cell in 0..4 {
                corners[cell][0] = &values[points[first + cell][0] as usize];
                for edge in 1..4 {
                    if 3 * group + edge < 8 {
                        corners[cell][edge] = &values[points[first + cell][3 * group + edge] as usize];
                    }
                }
            }
            V::edges_to_lanes(&corners, &mut edges[group], first);
        }
    }
}

/// Adds the points' forces, lane after lane: the same order, hence the same bits, always.
#[inline(always)]
fn scatter<T: Scalar, const N: usize>(points: &[[u32; 8]; N], forces: &Corners<T, N>, sums: &mut [Sum]) {
    for first in (0..N).step_by(4) {
        let mut total = [[0.0; 4]; 4];
        for group in 0..3 {
            let rows = T::lanes_to_rows(&forces[group], first);
            for cell in 0..4 {
                for corner in 0..3 {
                    if 3 * group + corner < 7 {
                        let sum = &mut sums[points[first + cell][3 * group + corner + 1] as usize].0;
                        for axis in 0..4 {
                            let component: f64 = rows[cell][corner][axis].into();
                            total[cell][axis] += component;
                            sum[axis] += component;
                        }
                    }
                }
            }
        }
        for cell in 0..4 {
            let sum = &mut sums[points[first + cell][0] as usize].0;
            for axis in 0..4 {
                sum[axis] -= total[cell][axis];
            }
        }
    }
}

#[cfg(test)]
pub(super) mod testing {
    //! Cells and their oracle, for both kernels.
    use super::*;
    use crate::hybrid::testing::{Random, ball_cells, tissue};

    /// Cells, and how their points moved.
    pub(in crate::simd) struct Question<'a> {
        pub(in crate::simd) cells: &'a [([u32; 8], RestCell)],
        pub(in crate::simd) spacing_m: f64,
        pub(in crate::simd) handed: f64,
        pub(in crate::simd) u: &'a [DVec3],
        pub(in crate::simd) v: &'a [DVec3],
        pub(in crate::simd) material: Material,
        pub(in crate::simd) precision: Precision,
        pub(in crate::simd) set: InstructionSet,
    }

    /// Forces of all points.
    #[derive(Debug, PartialEq)]
    pub(in crate::simd) struct Answer {
        pub(in crate::simd) forces_n: Vec<DVec3>,
        pub(in crate::simd) power_w: f64,
    }

    /// Whatever the law, the precision and the instruction set: the forces of the plain code, and the same bits. Of the cells of a ball, all or
    /// the full ones; the largest displacements turn some inside out.
    pub(in crate::simd) fn agrees_with_oracle(only_full: bool, kernel: impl Fn(&Question<'_>) -> Answer) {
        let (mut cells, rest) = ball_cells();
        let whole = cells.iter().map(|(_, c)| c.volume_m3).fold(0.0, f64::max) * (1.0 - 1e-12);
        cells.retain(|(_, cell)| !only_full || cell.volume_m3 > whole);
        let mut random = Random(21);
        for material in tissue() {
            for size in [1e-5, 0.1e-3, 1.5e-3] {
                let u: Vec<DVec3> = rest.iter().map(|_| random.vector() * size).collect();
                let v: Vec<DVec3> = rest.iter().map(|_| random.vector() * 0.1).collect();
                let mut expected = vec![DVec3::ZERO; rest.len()];
                let mut expected_w = 0.0;
                for (points, cell) in &cells {
                    let y = points.map(|p| rest[p as usize] + u[p as usize]);
                    let (forces, power) = cell.forces_n(&material, &y, &points.map(|p| v[p as usize]));
                    points.iter().zip(forces).for_each(|(&p, f)| expected[p as usize] += f);
                    expected_w += power;
                }
                let largest = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
                for (precision, bound) in [(Precision::Double, 1e-11), (Precision::Single, 2e-5)] {
                    let (spacing_m, handed) = (1.1e-3, 0.98);
                    let (cells, u, v) = (&cells[..], &u[..], &v[..]);
                    let run = |set| kernel(&Question { cells, spacing_m, handed, u, v, material, precision, set });
                    let baseline = run(InstructionSet::Baseline);
                    let pairs = baseline.forces_n.iter().zip(&expected);
                    let worst = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                    let law = material.law;
                    assert!(worst < bound * largest, "{law:?} {precision:?} {size}: {worst:e} of {largest:e}");
                    assert!((baseline.power_w / expected_w - 1.0).abs() < 10.0 * bound);
                    for set in InstructionSet::available() {
                        assert_eq!(run(set), baseline, "{set:?}");
                    }
                }
            }
        }
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
            let Question { cells, u, v, material, precision, set, .. } = question;
            let mut kernel = CutCells::with_capacity(cells.len(), u.len(), &[*material], *precision);
            kernel = kernel.with_instruction_set(*set);
            // Others before: nothing of them may stay.
            kernel.start(0, 3, true);
            (0..3).for_each(|number| kernel.put(number, cells[number].0, &cells[number].1));
            kernel.clear();
            kernel.start(0, cells.len(), false);
            for (number, (points, rest)) in cells.iter().enumerate() {
                kernel.put(number, *points, rest);
            }
            kernel.set_displacements(u);
            kernel.set_velocities(v);
            let power_w = kernel.forces(u.len());
            let mut forces_n = vec![DVec3::ZERO; u.len()];
            kernel.add_forces_n(&mut forces_n);
            Answer { forces_n, power_w }
        });
    }
}
