//! The cells of a hybrid body's patch (`hybrid::cell`), in blocks of lanes; its oracle is `hybrid::patch`.
//!
//! A full cell has nothing of its own but its particles: its gradient and hourglass amplitudes are sums and differences of their displacements (a
//! Walsh-Hadamard transform of eight), and so are its forces. A cut cell carries its gradients and modes.
//!
//! Displacements are taken as differences to the first particle in f64 and rounded then; forces are summed in f64, that on the first particle
//! as minus the sum of the others.
use super::{
    block::{Lanes, Node, Sum, any_outside},
    dispatch::{self, Available, InstructionSet, Pass},
    laws::{Constants, LaneLaw, M3, columns, plus, rows, viscous},
    real::{Scalar, Vector},
    tangents::LaneTangent,
};
use crate::{
    hybrid::cell::{MODE_WEIGHTS, RestCell},
    material::Material,
    world::Precision,
};
use glam::{DMat3, DVec3};

const LANES_F32: usize = 16;
const LANES_F64: usize = 8;

/// Consecutive cells are spread over the lanes of this many blocks.
const BLOCKS_PER_WINDOW: usize = 16;
/// Blocks that are gathered, computed and scattered together: a wide load waits for the narrow stores it overlaps.
const BATCH: usize = 4;

/// Particles 1 to 3, 4 to 6, and 7 of a block's cells, three components each; what is over stays zero.
type Corners<T, const N: usize> = [Lanes<T, N>; 3];

/// Full cells.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
struct FullBlock<const N: usize> {
    points: [[u32; 8]; N],
}

/// Cut cells. Lanes of padding have the spare point eight times, and zeros.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
struct CutBlock<T, const N: usize> {
    points: [[u32; 8]; N],
    /// `b_p` (1/m) of particles 1 to 7.
    gradients: [[T; N]; 21],
    /// `γ_kp` of modes 0 to 3 and particles 1 to 7: entry `7k + p − 1`.
    modes: [[T; N]; 28],
    /// `−V` (m³).
    minus_volume: [T; N],
    /// `−κ` (N/m).
    minus_kappa: [T; N],
}

/// Cells of one material.
#[derive(Debug, Clone)]
struct Run<T, const N: usize> {
    material: Material,
    constants: Constants<T>,
    full: Vec<FullBlock<N>>,
    cut: Vec<CutBlock<T, N>>,
    /// `1/(4h)` (1/m), `−V` (m³) and `−κ` (N/m) of full cells.
    full_cell: [f64; 3],
}

#[derive(Debug, Clone)]
enum Layout {
    Single(Vec<Run<f32, LANES_F32>>),
    Double(Vec<Run<f64, LANES_F64>>),
}

/// Forces of a patch's cells.
#[derive(Debug, Clone)]
pub struct CellKernel {
    layout: Layout,
    points: usize,
    instruction_set: Available,
}

/// A cell for the kernel.
#[derive(Debug, Clone, Copy)]
pub struct KernelCell<'a> {
    /// Its particles.
    pub points: [u32; 8],
    /// Its rest data.
    pub rest: &'a RestCell,
    /// Whether it is full.
    pub is_full: bool,
    /// Index of its material.
    pub material: u16,
}

/// Buffers of the kernel.
#[derive(Debug, Clone)]
pub struct CellScratch {
    displacements: Vec<Node>,
    velocities: Vec<Node>,
    sums: Vec<Sum>,
}

impl CellKernel {
    /// Lays out cells over `points` particles.
    pub fn build(cells: &[KernelCell<'_>], points: usize, materials: &[Material], precision: Precision) -> Self {
        let layout = match precision {
            Precision::Single => Layout::Single(runs(cells, points, materials)),
            Precision::Double => Layout::Double(runs(cells, points, materials)),
        };
        Self { layout, points, instruction_set: Available::at_most(InstructionSet::best()) }
    }

    /// The same kernel, held to an instruction set or the best below it that there is (for tests and benchmarks).
    #[must_use]
    pub fn with_instruction_set(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set: Available::at_most(instruction_set), ..self }
    }

    /// Buffers for [`Self::forces_n`].
    pub fn scratch(&self) -> CellScratch {
        CellScratch {
            displacements: vec![Node::default(); self.points + 1],
            velocities: vec![Node::default(); self.points + 1],
            sums: vec![Sum::default(); self.points + 1],
        }
    }

    /// Overwrites `forces_n` (N) on the particles with elastic and viscous forces at `displacements_m` from rest and velocities
    /// `v`; returns the power (W) that viscous stress takes.
    pub fn forces_n(
        &self,
        displacements_m: &[DVec3],
        v: &[DVec3],
        forces_n: &mut [DVec3],
        scratch: &mut CellScratch,
    ) -> f64 {
        for (to, from) in scratch.displacements.iter_mut().zip(displacements_m) {
            *to = super::node(*from);
        }
        for (to, from) in scratch.velocities.iter_mut().zip(v) {
            *to = super::node(*from);
        }
        scratch.sums.fill(Sum::default());
        let power_w = match &self.layout {
            Layout::Single(runs) => self.add(runs, scratch),
            Layout::Double(runs) => self.add(runs, scratch),
        };
        for (force, Sum([x, y, z, _])) in forces_n.iter_mut().zip(&scratch.sums) {
            *force = DVec3::new(*x, *y, *z);
        }
        power_w
    }

    fn add<T: Scalar, const N: usize>(&self, runs: &[Run<T, N>], scratch: &mut CellScratch) -> f64 {
        let CellScratch { displacements, velocities, sums } = scratch;
        let mut power_w = 0.0;
        for run in runs {
            let mut pass = CellForces { run, displacements, velocities, sums };
            let law = (run.material.law, !run.material.viscosity.is_zero());
            power_w += dispatch::run(self.instruction_set, law, &mut pass);
        }
        power_w
    }
}

fn runs<T: Scalar, const N: usize>(cells: &[KernelCell<'_>], points: usize, materials: &[Material]) -> Vec<Run<T, N>> {
    let spare = [points as u32; 8];
    let of_material = |(index, material): (usize, &Material)| {
        let select =
            |is_full: bool| cells.iter().filter(move |cell| cell.material as usize == index && cell.is_full == is_full);
        let all_full: Vec<_> = select(true).collect();
        let all_cut: Vec<_> = select(false).collect();
        let full = spread::<_, N>(&all_full).map(|lanes| FullBlock {
            points: std::array::from_fn(|lane| lanes.get(lane).map_or(spare, |cell| cell.points)),
        });
        let mu = material.lame.mu_pa;
        let full_cell = all_full.first().map_or([0.0; 3], |cell| {
            [cell.rest.gradients_per_m[7].x, -cell.rest.volume_m3, -cell.rest.hourglass_m * mu]
        });
        Run {
            material: *material,
            constants: Constants::of(material),
            full: full.collect(),
            cut: spread::<_, N>(&all_cut).map(|lanes| cut_block(&lanes, spare, mu)).collect(),
            full_cell,
        }
    };
    materials.iter().enumerate().map(of_material).collect()
}

/// Neighbours in different blocks: sums of one particle would wait for each other in the scatter.
fn spread<C: Copy, const N: usize>(cells: &[C]) -> impl Iterator<Item = Vec<C>> {
    cells.chunks(N * BLOCKS_PER_WINDOW).flat_map(|window| {
        let count = window.len().div_ceil(N);
        (0..count).map(move |first| window.iter().skip(first).step_by(count).copied().collect())
    })
}

fn cut_block<T: Scalar, const N: usize>(cells: &[&KernelCell<'_>], spare: [u32; 8], mu_pa: f64) -> CutBlock<T, N> {
    let zero = T::of(0.0);
    let mut block = CutBlock {
        points: [spare; N],
        gradients: [[zero; N]; 21],
        modes: [[zero; N]; 28],
        minus_volume: [zero; N],
        minus_kappa: [zero; N],
    };
    for (lane, cell) in cells.iter().enumerate() {
        block.points[lane] = cell.points;
        for p in 1..8 {
            for axis in 0..3 {
                block.gradients[3 * (p - 1) + axis][lane] = T::of(cell.rest.gradients_per_m[p][axis]);
            }
            for mode in 0..4 {
                block.modes[7 * mode + p - 1][lane] = T::of(cell.rest.modes[mode][p]);
            }
        }
        block.minus_volume[lane] = T::of(-cell.rest.volume_m3);
        block.minus_kappa[lane] = T::of(-cell.rest.hourglass_m * mu_pa);
    }
    block
}

/// The pass over the cells of one material.
struct CellForces<'a, T, const N: usize> {
    run: &'a Run<T, N>,
    displacements: &'a [Node],
    velocities: &'a [Node],
    sums: &'a mut [Sum],
}

impl<T: Scalar, const N: usize> Pass<T> for CellForces<'_, T, N> {
    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: LaneTangent, const VISCOUS: bool>(&mut self) -> f64 {
        let mut edges: [Corners<T, N>; BATCH] = [[[[T::of(0.0); N]; 9]; 3]; BATCH];
        let mut rates = edges;
        let mut forces = edges;
        let mut power_w = 0.0;
        for batch in self.run.full.chunks(BATCH) {
            for (index, block) in batch.iter().enumerate() {
                gather::<V, N>(&block.points, self.displacements, &mut edges[index]);
                if VISCOUS {
                    gather::<V, N>(&block.points, self.velocities, &mut rates[index]);
                }
            }
            for index in 0..batch.len() {
                power_w += full::<V, T, L, VISCOUS, N>(self.run, &edges[index], &rates[index], &mut forces[index]);
            }
            for (block, forces) in batch.iter().zip(&forces) {
                scatter(&block.points, forces, self.sums);
            }
        }
        for batch in self.run.cut.chunks(BATCH) {
            for (index, block) in batch.iter().enumerate() {
                gather::<V, N>(&block.points, self.displacements, &mut edges[index]);
                if VISCOUS {
                    gather::<V, N>(&block.points, self.velocities, &mut rates[index]);
                }
            }
            for (index, block) in batch.iter().enumerate() {
                let constants = &self.run.constants;
                power_w +=
                    cut::<V, T, L, VISCOUS, N>(constants, block, &edges[index], &rates[index], &mut forces[index]);
            }
            for (block, forces) in batch.iter().zip(&forces) {
                scatter(&block.points, forces, self.sums);
            }
        }
        power_w
    }
}

/// Sums and differences of eight values along the three axes, the first of which is zero: `x, y, z, yz, zx, xy, xyz`.
#[inline(always)]
pub(super) fn patterns<V: Vector>(v: &[V; 7]) -> [V; 7] {
    let [v1, v2, v3, v4, v5, v6, v7] = *v;
    // Along x: sums and differences of pairs (0 1), (2 3), (4 5), (6 7).
    let (s23, d23) = (v3 + v2, v3 - v2);
    let (s45, d45) = (v5 + v4, v5 - v4);
    let (s67, d67) = (v7 + v6, v7 - v6);
    // Along y.
    let (ss0, sd0, ds0, dd0) = (s23 + v1, s23 - v1, d23 + v1, d23 - v1);
    let (ss1, sd1, ds1, dd1) = (s67 + s45, s67 - s45, d67 + d45, d67 - d45);
    // Along z.
    [ds1 + ds0, sd1 + sd0, ss1 - ss0, sd1 - sd0, ds1 - ds0, dd1 + dd0, dd1 - dd0]
}

/// What the factors of [`patterns`] give particles 1 to 7.
#[inline(always)]
pub(super) fn particles<V: Vector>(c: &[V; 7]) -> [V; 7] {
    let [x, y, z, yz, zx, xy, xyz] = *c;
    // For (y, z) = (−, −), (+, −), (−, +), (+, +): the part that is even in x, and the odd one.
    let even = [yz - y - z, y - z - yz, z - y - yz, y + z + yz];
    let odd = [x - zx - xy + xyz, x - zx + xy - xyz, x + zx - xy - xyz, x + zx + xy + xyz];
    [
        even[0] + odd[0],
        even[1] - odd[1],
        even[1] + odd[1],
        even[2] - odd[2],
        even[2] + odd[2],
        even[3] - odd[3],
        even[3] + odd[3],
    ]
}

/// One axis of particles 1 to 7.
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
fn full<V: Vector<Scalar = T>, T: Scalar, L: LaneLaw, const VISCOUS: bool, const N: usize>(
    run: &Run<T, N>,
    edges: &Corners<T, N>,
    rates: &Corners<T, N>,
    forces: &mut Corners<T, N>,
) -> f64 {
    let [quarter, minus_volume, minus_kappa] = run.full_cell;
    let mut power = [T::of(0.0); N];
    for first in (0..N).step_by(V::WIDTH) {
        let mut h = [[V::of(0.0); 3]; 3];
        let mut modes = [[V::of(0.0); 4]; 3];
        let mut h_dot = h;
        for axis in 0..3 {
            let found = patterns(&load::<V, N>(edges, axis, first));
            for column in 0..3 {
                h[axis][column] = found[column] * V::of(quarter);
            }
            modes[axis].copy_from_slice(&found[3..]);
            if VISCOUS {
                let found = patterns(&load::<V, N>(rates, axis, first));
                for column in 0..3 {
                    h_dot[axis][column] = found[column] * V::of(quarter);
                }
            }
        }
        let (p, density) = stress::<V, T, L, VISCOUS>(&run.constants, &h, &h_dot);
        if VISCOUS {
            (density * V::of(-minus_volume)).store(&mut power[first..]);
        }
        let (of_stress, of_modes) =
            (V::of(minus_volume * quarter), MODE_WEIGHTS.map(|w| V::of(minus_kappa * w / 64.0)));
        for axis in 0..3 {
            let mut c = [V::of(0.0); 7];
            for column in 0..3 {
                c[column] = p[axis][column] * of_stress;
            }
            for mode in 0..4 {
                c[3 + mode] = modes[axis][mode] * of_modes[mode];
            }
            store(&particles(&c), forces, axis, first);
        }
    }
    sum(&power)
}

#[inline(always)]
fn cut<V: Vector<Scalar = T>, T: Scalar, L: LaneLaw, const VISCOUS: bool, const N: usize>(
    constants: &Constants<T>,
    block: &CutBlock<T, N>,
    edges: &Corners<T, N>,
    rates: &Corners<T, N>,
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
        let (p, density) = stress::<V, T, L, VISCOUS>(constants, &h, &h_dot);
        let minus_volume = V::load(&block.minus_volume[first..]);
        if VISCOUS {
            (V::of(0.0) - density * minus_volume).store(&mut power[first..]);
        }
        let minus_kappa = V::load(&block.minus_kappa[first..]);
        for axis in 0..3 {
            let a = load::<V, N>(edges, axis, first);
            let mut f = [V::of(0.0); 7];
            for particle in 0..7 {
                let along = p[axis][0] * b(particle, 0) + p[axis][1] * b(particle, 1) + p[axis][2] * b(particle, 2);
                f[particle] = along * minus_volume;
            }
            for mode in 0..4 {
                let gamma = |particle: usize| V::load(&block.modes[7 * mode + particle][first..]);
                let mut q = V::of(0.0);
                for particle in 0..7 {
                    q = q + a[particle] * gamma(particle);
                }
                let q = q * minus_kappa * V::of(MODE_WEIGHTS[mode]);
                for particle in 0..7 {
                    f[particle] = f[particle] + q * gamma(particle);
                }
            }
            store(&f, forces, axis, first);
        }
    }
    sum(&power)
}

/// Elastic and viscous stress (Pa), and the power density (W/m³) of the latter.
#[inline(always)]
pub(super) fn stress<V: Vector<Scalar = T>, T: Scalar, L: LaneLaw, const VISCOUS: bool>(
    constants: &Constants<T>,
    h: &M3<V>,
    h_dot: &M3<V>,
) -> (M3<V>, V) {
    let c: Constants<V> = constants.converted();
    let (mut p, domain) = L::piola(&c, h);
    if let Some(limit) = L::DOMAIN {
        let mut inside = [T::of(limit); LANES_F32];
        domain.store(&mut inside);
        if any_outside(&inside, L::DOMAIN) {
            redo_outside::<V, T, L>(constants, h, &inside, &mut p);
        }
    }
    if VISCOUS {
        let (viscous_p, density) = viscous(&c, h, h_dot);
        return (plus(&p, &viscous_p), density);
    }
    (p, V::of(0.0))
}

/// Lanes outside the law's domain, once more, in f64.
#[cold]
#[inline(never)]
fn redo_outside<V: Vector<Scalar = T>, T: Scalar, L: LaneLaw>(
    constants: &Constants<T>,
    h: &M3<V>,
    inside: &[T; LANES_F32],
    p: &mut M3<V>,
) {
    let lanes = |m: &M3<V>| {
        let mut stored = [[[T::of(0.0); LANES_F32]; 3]; 3];
        for (row, stored) in m.iter().zip(&mut stored) {
            for (entry, stored) in row.iter().zip(stored) {
                entry.store(stored);
            }
        }
        stored
    };
    let (h, mut redone) = (lanes(h), lanes(p));
    let limit = T::of(L::DOMAIN.unwrap_or(0.0));
    for lane in 0..V::WIDTH {
        if inside[lane] >= limit {
            continue;
        }
        let of_lane: M3<f64> = h.map(|row| row.map(|entry| entry[lane].into()));
        let f = columns(&of_lane) + DMat3::IDENTITY;
        let stress = rows(&L::piola_outside(&constants.converted(), &f));
        for row in 0..3 {
            for column in 0..3 {
                redone[row][column][lane] = T::of(stress[row][column]);
            }
        }
    }
    *p = redone.map(|row| row.map(|entry| V::load(&entry)));
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

/// Adds the particles' forces, lane after lane: the same order, hence the same bits, always.
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

fn sum<T: Scalar, const N: usize>(power: &[T; N]) -> f64 {
    power.iter().fold(0.0, |sum, &p| sum + p.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hybrid::testing::{Random, ball_cells, tissue};

    /// Whatever the law, the precision and the instruction set: the forces of the plain code, and the same bits.
    #[test]
    fn kernel_and_oracle_agree() {
        let (cells, rest) = ball_cells();
        let mut random = Random(21);
        for material in tissue() {
            // Some cells are turned inside out.
            for size in [1e-5, 0.1e-3, 1.5e-3] {
                let u: Vec<DVec3> = rest.iter().map(|_| random.vector() * size).collect();
                let v: Vec<DVec3> = rest.iter().map(|_| random.vector() * 0.1).collect();
                let mut expected = vec![DVec3::ZERO; rest.len()];
                let mut expected_w = 0.0;
                for (points, cell) in &cells {
                    let [y, rate] = [0, 1].map(|what| {
                        points.map(|p| if what == 0 { rest[p as usize] + u[p as usize] } else { v[p as usize] })
                    });
                    let (forces, power) = cell.forces_n(&material, &y, &rate);
                    points.iter().zip(forces).for_each(|(&p, f)| expected[p as usize] += f);
                    expected_w += power;
                }
                let largest = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
                let whole = cells.iter().map(|(_, c)| c.volume_m3).fold(0.0, f64::max) * (1.0 - 1e-12);
                let listed: Vec<KernelCell<'_>> = cells
                    .iter()
                    .map(|(points, rest)| KernelCell {
                        points: *points,
                        rest,
                        is_full: rest.volume_m3 > whole,
                        material: 0,
                    })
                    .collect();
                for (precision, bound) in [(Precision::Double, 1e-11), (Precision::Single, 2e-5)] {
                    let kernel = CellKernel::build(&listed, rest.len(), &[material], precision);
                    let run = |set| {
                        let kernel = kernel.clone().with_instruction_set(set);
                        let mut forces = vec![DVec3::ZERO; rest.len()];
                        let power = kernel.forces_n(&u, &v, &mut forces, &mut kernel.scratch());
                        (forces, power)
                    };
                    let (forces, power) = run(InstructionSet::Baseline);
                    let worst = forces.iter().zip(&expected).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                    assert!(
                        worst < bound * largest,
                        "{:?} {precision:?} {size}: {worst:e} of {largest:e}",
                        material.law
                    );
                    assert!((power / expected_w - 1.0).abs() < 10.0 * bound, "{power} {expected_w}");
                    for set in InstructionSet::available() {
                        assert_eq!(run(set), (forces.clone(), power), "{set:?}");
                    }
                }
            }
        }
    }
}
