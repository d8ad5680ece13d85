//! The full cells of a patch as a dense window of the lattice: rows of particles along x, one array a component.
//!
//! Lanes are neighbouring cells, so their eight particles are eight shifted loads and nothing is gathered or scattered. A cell that is none of
//! the window's has weight 0. What cells give their particles on the left and on the right is summed apart, that loads never overlap
//! a store just made, and put together at the end: `f_i = l_i + r_{i−1}`.
use super::{
    cells::{particles, patterns, stress},
    dispatch::{self, Available, InstructionSet, Pass},
    laws::Constants,
    real::{Scalar, Vector},
    tangents::LaneTangent,
};
use crate::{
    hybrid::cell::{HOURGLASS, MODE_WEIGHTS},
    material::Material,
    world::Precision,
};
use glam::DVec3;

/// Rows are multiples of this long, and end on so many particles of no cell: the widest vector, twice.
const LANES: usize = 16;

/// A window, and which of its cells are there.
#[derive(Debug, Clone)]
pub struct CellWindow {
    grid: Grid,
    layout: Layout,
    instruction_set: Available,
}

/// Places in the window's arrays.
#[derive(Debug, Clone, Copy)]
struct Grid {
    cells: [usize; 3],
    /// Entries of a row.
    stride: usize,
}

#[derive(Debug, Clone)]
enum Layout {
    Single(Vec<Run<f32>>),
    Double(Vec<Run<f64>>),
}

/// Cells of one material.
#[derive(Debug, Clone)]
struct Run<T> {
    material: Material,
    constants: Constants<T>,
    /// 1 where the cell is there, else 0; placed as its first particle.
    weights: Vec<T>,
    /// `1/(4h)` (1/m), `−V` (m³) and `−κ` (N/m).
    cell: [f64; 3],
}

/// Buffers of a window.
#[derive(Debug, Clone)]
pub struct WindowScratch {
    values: Values,
}

#[derive(Debug, Clone)]
enum Values {
    Single(Arrays<f32>),
    Double(Arrays<f64>),
}

#[derive(Debug, Clone)]
struct Arrays<T> {
    displacements: [Vec<T>; 3],
    velocities: [Vec<T>; 3],
    left: [Vec<T>; 3],
    right: [Vec<T>; 3],
}

impl<T: Scalar> Arrays<T> {
    fn new(entries: usize) -> Self {
        let zeros = || std::array::from_fn(|_| vec![T::of(0.0); entries]);
        Self { displacements: zeros(), velocities: zeros(), left: zeros(), right: zeros() }
    }
}

impl Grid {
    fn entries(&self) -> usize {
        self.stride * (self.cells[1] + 1) * (self.cells[2] + 1) + LANES
    }

    /// Rows of particles start on an entry of their own, behind one of no cell.
    fn place(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * (self.cells[1] + 1) + j) * self.stride + 1 + i
    }
}

impl CellWindow {
    /// A window of `cells` along each axis, of spacing `h` (m). `full` lists the cells that are there, by their places, with their materials; each
    /// answers for the share `handed` of its volume.
    pub fn build(
        cells: [usize; 3],
        spacing_m: f64,
        handed: f64,
        full: &[([usize; 3], u16)],
        materials: &[Material],
        precision: Precision,
    ) -> Self {
        let grid = Grid { cells, stride: (cells[0] + 2).next_multiple_of(LANES) };
        let cell = |material: &Material| {
            let volume_m3 = handed * spacing_m.powi(3);
            let kappa = HOURGLASS * 4.0 / 3.0 * material.lame.mu_pa * volume_m3 / (spacing_m * spacing_m);
            [0.25 / spacing_m, -volume_m3, -kappa]
        };
        let layout = match precision {
            Precision::Single => Layout::Single(runs(&grid, full, materials, cell)),
            Precision::Double => Layout::Double(runs(&grid, full, materials, cell)),
        };
        Self { grid, layout, instruction_set: Available::at_most(InstructionSet::best()) }
    }

    /// The same window, held to an instruction set or the best below it that there is (for tests and benchmarks).
    #[must_use]
    pub fn with_instruction_set(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set: Available::at_most(instruction_set), ..self }
    }

    /// Number of a particle in the window's arrays, from its place.
    pub fn particle(&self, place: [usize; 3]) -> usize {
        self.grid.place(place)
    }

    /// Buffers, at rest.
    pub fn scratch(&self) -> WindowScratch {
        let entries = self.grid.entries();
        let values = match &self.layout {
            Layout::Single(_) => Values::Single(Arrays::new(entries)),
            Layout::Double(_) => Values::Double(Arrays::new(entries)),
        };
        WindowScratch { values }
    }

    /// Sums up forces (N) of elastic and viscous stress at what [`WindowScratch::set`] was told; returns the power (W) that viscous stress takes.
    pub fn add_forces(&self, scratch: &mut WindowScratch) -> f64 {
        match (&self.layout, &mut scratch.values) {
            (Layout::Single(runs), Values::Single(arrays)) => self.add(runs, arrays),
            (Layout::Double(runs), Values::Double(arrays)) => self.add(runs, arrays),
            _ => 0.0,
        }
    }

    fn add<T: Scalar>(&self, runs: &[Run<T>], arrays: &mut Arrays<T>) -> f64 {
        for sums in arrays.left.iter_mut().chain(&mut arrays.right) {
            sums.fill(T::of(0.0));
        }
        let mut power_w = 0.0;
        for run in runs {
            let law = (run.material.law, !run.material.viscosity.is_zero());
            power_w += dispatch::run(self.instruction_set, law, &mut WindowForces { grid: &self.grid, run, arrays });
        }
        power_w
    }
}

fn runs<T: Scalar>(
    grid: &Grid,
    full: &[([usize; 3], u16)],
    materials: &[Material],
    cell: impl Fn(&Material) -> [f64; 3],
) -> Vec<Run<T>> {
    let of_material = |(index, material): (usize, &Material)| {
        let mut weights = vec![T::of(0.0); grid.entries()];
        for &(place, _) in full.iter().filter(|(_, of)| *of as usize == index) {
            weights[grid.place(place)] = T::of(1.0);
        }
        Run { material: *material, constants: Constants::of(material), weights, cell: cell(material) }
    };
    materials.iter().enumerate().map(of_material).collect()
}

impl WindowScratch {
    /// Displacement (m) and velocity (m/s) of a particle.
    pub fn set(&mut self, particle: usize, displacement_m: DVec3, v: DVec3) {
        fn put<T: Scalar>(arrays: &mut Arrays<T>, particle: usize, u: DVec3, v: DVec3) {
            for axis in 0..3 {
                arrays.displacements[axis][particle] = T::of(u[axis]);
                arrays.velocities[axis][particle] = T::of(v[axis]);
            }
        }
        match &mut self.values {
            Values::Single(arrays) => put(arrays, particle, displacement_m, v),
            Values::Double(arrays) => put(arrays, particle, displacement_m, v),
        }
    }

    /// Force (N) on a particle.
    pub fn force_n(&self, particle: usize) -> DVec3 {
        fn get<T: Scalar>(arrays: &Arrays<T>, particle: usize) -> DVec3 {
            let sum = |axis: usize| -> f64 {
                let (left, right): (f64, f64) =
                    (arrays.left[axis][particle].into(), arrays.right[axis][particle - 1].into());
                left + right
            };
            DVec3::new(sum(0), sum(1), sum(2))
        }
        match &self.values {
            Values::Single(arrays) => get(arrays, particle),
            Values::Double(arrays) => get(arrays, particle),
        }
    }
}

/// The pass over the cells of one material.
struct WindowForces<'a, T> {
    grid: &'a Grid,
    run: &'a Run<T>,
    arrays: &'a mut Arrays<T>,
}

impl<T: Scalar> Pass<T> for WindowForces<'_, T> {
    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: LaneTangent, const VISCOUS: bool>(&mut self) -> f64 {
        let Grid { cells: [nx, ny, nz], .. } = *self.grid;
        let mut power_w = 0.0;
        for k in 0..nz {
            for j in 0..ny {
                // The rows at (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1).
                let rows = [[j, k], [j + 1, k], [j, k + 1], [j + 1, k + 1]].map(|[j, k]| self.grid.place([0, j, k]));
                for first in (0..nx).step_by(V::WIDTH) {
                    self.lanes::<V, L, VISCOUS>(rows.map(|row| row + first), &mut power_w);
                }
            }
        }
        power_w
    }
}

impl<T: Scalar> WindowForces<'_, T> {
    /// Cells whose first particles are at `rows[0]` and what follows.
    #[inline(always)]
    fn lanes<V: Vector<Scalar = T>, L: LaneTangent, const VISCOUS: bool>(
        &mut self,
        rows: [usize; 4],
        power_w: &mut f64,
    ) {
        let [quarter, minus_volume, minus_kappa] = self.run.cell;
        let mut h = [[V::of(0.0); 3]; 3];
        let mut modes = [[V::of(0.0); 4]; 3];
        let mut h_dot = h;
        for axis in 0..3 {
            let found = patterns(&differences::<V>(&self.arrays.displacements[axis], rows));
            for column in 0..3 {
                h[axis][column] = found[column] * V::of(quarter);
            }
            modes[axis].copy_from_slice(&found[3..]);
            if VISCOUS {
                let found = patterns(&differences::<V>(&self.arrays.velocities[axis], rows));
                for column in 0..3 {
                    h_dot[axis][column] = found[column] * V::of(quarter);
                }
            }
        }
        let (p, density) = stress::<V, T, L, VISCOUS>(&self.run.constants, &h, &h_dot);
        let weight = V::load(&self.run.weights[rows[0]..]);
        let of_stress = weight * V::of(minus_volume * quarter);
        let of_modes = MODE_WEIGHTS.map(|w| weight * V::of(minus_kappa * w / 64.0));
        for axis in 0..3 {
            let mut c = [V::of(0.0); 7];
            for column in 0..3 {
                c[column] = p[axis][column] * of_stress;
            }
            for mode in 0..4 {
                c[3 + mode] = modes[axis][mode] * of_modes[mode];
            }
            let [f1, f2, f3, f4, f5, f6, f7] = particles(&c);
            let f0 = V::of(0.0) - ((f1 + f2) + (f3 + f4) + ((f5 + f6) + f7));
            let (left, right) = (&mut self.arrays.left[axis], &mut self.arrays.right[axis]);
            for (row, (on_left, on_right)) in rows.into_iter().zip([(f0, f1), (f2, f3), (f4, f5), (f6, f7)]) {
                (V::load(&left[row..]) + on_left).store(&mut left[row..]);
                (V::load(&right[row..]) + on_right).store(&mut right[row..]);
            }
        }
        if VISCOUS {
            let mut power = [T::of(0.0); LANES];
            (density * weight * V::of(-minus_volume)).store(&mut power);
            // One after the other, so that the width of the vectors does not show.
            for &lane in &power[..V::WIDTH] {
                *power_w += lane.into();
            }
        }
    }
}

/// `a_p − a_0` of particles 1 to 7.
#[inline(always)]
fn differences<V: Vector>(values: &[V::Scalar], rows: [usize; 4]) -> [V; 7] {
    let zero = V::load(&values[rows[0]..]);
    let mut found = [V::of(0.0); 7];
    for p in 1..8 {
        found[p - 1] = V::load(&values[rows[p >> 1] + (p & 1)..]) - zero;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hybrid::testing::{Random, ball_cells, tissue};

    /// Whatever the law, the precision and the instruction set: the forces of the plain code, and the same bits.
    #[test]
    fn window_and_oracle_agree() {
        let (cells, rest) = ball_cells();
        let spacing_m = 1.1e-3;
        let low = rest.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let place = |p: u32| ((rest[p as usize] - low) / spacing_m).round().to_array().map(|n| n as usize);
        let most =
            (0..rest.len() as u32).map(place).fold([0; 3], |most, at| std::array::from_fn(|a| most[a].max(at[a])));
        let whole = cells.iter().map(|(_, c)| c.volume_m3).fold(0.0, f64::max) * (1.0 - 1e-12);
        let full: Vec<_> = cells.iter().filter(|(_, cell)| cell.volume_m3 > whole).collect();
        let listed: Vec<([usize; 3], u16)> = full.iter().map(|(points, _)| (place(points[0]), 0)).collect();
        let mut random = Random(22);
        for material in tissue() {
            for size in [1e-5, 0.1e-3, 1.5e-3] {
                let u: Vec<DVec3> = rest.iter().map(|_| random.vector() * size).collect();
                let v: Vec<DVec3> = rest.iter().map(|_| random.vector() * 0.1).collect();
                let mut expected = vec![DVec3::ZERO; rest.len()];
                let mut expected_w = 0.0;
                for (points, cell) in &full {
                    let y = points.map(|p| rest[p as usize] + u[p as usize]);
                    let (forces, power) = cell.forces_n(&material, &y, &points.map(|p| v[p as usize]));
                    points.iter().zip(forces).for_each(|(&p, f)| expected[p as usize] += f);
                    expected_w += power;
                }
                let largest = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
                for (precision, bound) in [(Precision::Double, 1e-11), (Precision::Single, 2e-5)] {
                    let run = |set| {
                        let window = CellWindow::build(most, spacing_m, 0.98, &listed, &[material], precision);
                        let window = window.with_instruction_set(set);
                        let mut scratch = window.scratch();
                        let number = |p: usize| window.particle(place(p as u32));
                        (0..rest.len()).for_each(|p| scratch.set(number(p), u[p], v[p]));
                        let power = window.add_forces(&mut scratch);
                        let forces: Vec<DVec3> = (0..rest.len()).map(|p| scratch.force_n(number(p))).collect();
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
