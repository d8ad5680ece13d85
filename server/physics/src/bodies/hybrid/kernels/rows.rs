//! The full cells of a hybrid body's patch, row by row along x; their oracle is `hybrid::cell`.
//!
//! Points (the particles of awake cells) are numbered by their sites, x first, so the particles of neighbouring cells
//! of a row are neighbours in memory: the eight of a lane are eight shifted loads, and nothing is gathered or
//! scattered. Lanes past a row's end are given no strain and weight 0. Forces on the particles on the left and on the
//! right of cells are summed apart, so that loads never overlap a store just made, and added at the end:
//! `f_i = l_i + r_{i−1}`.
use super::{
    cell_stress::{particles, patterns, stress},
    prestrains::{ENTRIES, Found, Split, add_lanes, entries, prestrained_cell_stress, scaled},
    row_lanes::{LANES, add, differences, first_lanes, matrix},
};
use crate::{
    bodies::hybrid::{
        cell::{HOURGLASS, MODE_WEIGHTS},
        hourglass_growth::{GROWTH, energy_factor, force_factor},
        prestrain::CellPrestrain,
    },
    lanes::{
        Available, InstructionSet,
        grid::DisplacementGrid,
        real::{Scalar, Vector},
    },
    material::{ConstitutiveLaw, LawPass, Material},
    settings::Precision,
};
use glam::DVec3;

/// Full cells, one after the other along x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellRow {
    /// The first cell's points 0, 2, 4 and 6; the others follow them.
    pub points: [u32; 4],
    /// Number of cells.
    pub cells: u32,
    /// Index of their material.
    pub material: u16,
    /// Number of the first cell when the cells of all rows are counted one after the other.
    pub first: u32,
    /// Whether any of the cells has prestrain ([`RowKernel::put_prestrain`]).
    pub prestrained: bool,
}

/// Full cells, of the lattice's spacing or twice that: their materials, and displacements, velocities and forces of
/// their points.
#[derive(Debug, Clone)]
pub struct RowKernel {
    layout: Layout,
    grid: DisplacementGrid,
    instruction_set: Available,
}

/// How many points and cells a kernel has buffers for.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    /// Number of points.
    pub points: usize,
    /// Number of cells.
    pub cells: usize,
}

#[derive(Debug, Clone)]
enum Layout {
    Single(Rows<f32>),
    Double(Rows<f64>),
}

#[derive(Debug, Clone)]
struct Rows<T> {
    materials: Vec<CellMaterial<T>>,
    arrays: Arrays<T>,
}

#[derive(Debug, Clone)]
struct CellMaterial<T> {
    split: Split<T>,
    /// `1/(4h)` (1/m), `−V` (m³), `−κ` (N/m) and `β/(8h)²` (1/m²).
    cell: [f64; 4],
}

#[derive(Debug, Clone)]
struct Arrays<T> {
    displacements: [Vec<T>; 3],
    /// Empty unless some material is viscous.
    velocities: [Vec<T>; 3],
    left: [Vec<T>; 3],
    right: [Vec<T>; 3],
    /// Prestrain of every cell, entry by entry.
    prestrains: [Vec<T>; ENTRIES],
}

impl<T: Scalar> Arrays<T> {
    fn new(points: usize, cells: usize, is_viscous: bool) -> Self {
        // There is one entry before the first point, as its left neighbour, which adds nothing to it.
        let zeros = |count: usize| std::array::from_fn(|_| vec![T::of(0.0); count]);
        let entries = 1 + points + LANES;
        Self {
            displacements: zeros(entries),
            velocities: zeros(if is_viscous { entries } else { 0 }),
            left: zeros(entries),
            right: zeros(entries),
            prestrains: std::array::from_fn(|_| vec![T::of(0.0); cells + LANES]),
        }
    }
}

impl<T: Scalar> Rows<T> {
    fn new(materials: &[Material], edge_m: f64, fraction: f64, room: Room) -> Self {
        let is_viscous = materials.iter().any(|m| !m.viscosity.is_zero());
        Self {
            materials: of_materials(materials, edge_m, fraction),
            arrays: Arrays::new(room.points, room.cells, is_viscous),
        }
    }

    fn sum_up(&mut self, set: Available, rows: &[CellRow], points: usize, left: f64) -> Found {
        let Self { materials, arrays } = self;
        for sums in arrays.left.iter_mut().chain(&mut arrays.right) {
            sums[..1 + points + LANES].fill(T::of(0.0));
        }
        // Lanes beyond the last point count 0 times; what is not finite there, of more points before, would spread all the same.
        for values in arrays.displacements.iter_mut().chain(&mut arrays.velocities).filter(|list| !list.is_empty()) {
            values[1 + points..1 + points + LANES].fill(T::of(0.0));
        }
        let mut found = Found::default();
        for same in rows.chunk_by(|a, b| a.material == b.material) {
            let material = &materials[same[0].material as usize];
            let mut pass = RowForces { material, rows: same, arrays, left, prestrain_j: 0.0 };
            let viscous_w = material.split.material.run(set, false, &mut pass);
            found += Found { viscous_w, prestrain_j: pass.prestrain_j };
        }
        found
    }
}

impl RowKernel {
    /// Makes the kernel for cells of edge `h` (m) that answer for `fraction` of their volume, and for those of twice
    /// the edge, whose materials are numbered after theirs. Its points are at rest.
    pub fn new(edge_m: f64, fraction: f64, materials: &[Material], precision: Precision, room: Room) -> Self {
        let layout = match precision {
            Precision::Single => Layout::Single(Rows::new(materials, edge_m, fraction, room)),
            Precision::Double => Layout::Double(Rows::new(materials, edge_m, fraction, room)),
        };
        let grid = DisplacementGrid::of_cells(precision, edge_m);
        Self { layout, grid, instruction_set: Available::best() }
    }

    /// Returns the same kernel, held to an instruction set or to the best available below it (for tests and
    /// benchmarks).
    #[must_use]
    pub fn with_instruction_set(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set: Available::at_most(instruction_set), ..self }
    }

    /// Sums up the forces (N) of elastic and viscous stress on the first `points` points, with the fraction `left` of
    /// the prestrain.
    pub fn forces(&mut self, rows: &[CellRow], points: usize, left: f64) -> Found {
        match &mut self.layout {
            Layout::Single(of) => of.sum_up(self.instruction_set, rows, points, left),
            Layout::Double(of) => of.sum_up(self.instruction_set, rows, points, left),
        }
    }

    /// Sets the displacements (m) of the points.
    pub fn set_displacements(&mut self, displacements_m: &[DVec3]) {
        let rounded = displacements_m.iter().map(|u| self.grid.rounded(*u));
        match &mut self.layout {
            Layout::Single(Rows { arrays, .. }) => put(&mut arrays.displacements, rounded),
            Layout::Double(Rows { arrays, .. }) => put(&mut arrays.displacements, rounded),
        }
    }

    /// Sets the velocities (m/s) of the points; they are used only where a material is viscous.
    pub fn set_velocities(&mut self, v: &[DVec3]) {
        match &mut self.layout {
            Layout::Single(Rows { arrays, .. }) if !arrays.velocities[0].is_empty() => {
                put(&mut arrays.velocities, v.iter().copied());
            }
            Layout::Double(Rows { arrays, .. }) if !arrays.velocities[0].is_empty() => {
                put(&mut arrays.velocities, v.iter().copied());
            }
            Layout::Single(_) | Layout::Double(_) => {}
        }
    }

    /// Sets the prestrain of a cell, `None` for one without.
    pub fn put_prestrain(&mut self, cell: u32, prestrain: Option<&CellPrestrain>) {
        match &mut self.layout {
            Layout::Single(Rows { arrays, .. }) => put_prestrain(&mut arrays.prestrains, cell, prestrain),
            Layout::Double(Rows { arrays, .. }) => put_prestrain(&mut arrays.prestrains, cell, prestrain),
        }
    }

    /// Overwrites `forces_n` (N) with those on the points.
    pub fn forces_n(&self, forces_n: &mut [DVec3]) {
        match &self.layout {
            Layout::Single(Rows { arrays, .. }) => totals(arrays, forces_n),
            Layout::Double(Rows { arrays, .. }) => totals(arrays, forces_n),
        }
    }
}

fn of_materials<T: Scalar>(materials: &[Material], edge_m: f64, fraction: f64) -> Vec<CellMaterial<T>> {
    let of = |(material, edge_m): (&Material, f64)| {
        let volume_m3 = fraction * edge_m.powi(3);
        let kappa = HOURGLASS * 4.0 / 3.0 * material.lame.mu_pa * volume_m3 / (edge_m * edge_m);
        CellMaterial {
            split: Split::of(material),
            cell: [0.25 / edge_m, -volume_m3, -kappa, GROWTH / (64.0 * edge_m * edge_m)],
        }
    };
    [edge_m, 2.0 * edge_m].into_iter().flat_map(|edge_m| materials.iter().map(move |m| of((m, edge_m)))).collect()
}

fn put<T: Scalar>([x, y, z]: &mut [Vec<T>; 3], list: impl Iterator<Item = DVec3>) {
    for (((x, y), z), a) in x[1..].iter_mut().zip(&mut y[1..]).zip(&mut z[1..]).zip(list) {
        (*x, *y, *z) = (T::of(a.x), T::of(a.y), T::of(a.z));
    }
}

fn put_prestrain<T: Scalar>(prestrains: &mut [Vec<T>; ENTRIES], cell: u32, prestrain: Option<&CellPrestrain>) {
    for (list, entry) in prestrains.iter_mut().zip(entries(prestrain)) {
        list[cell as usize] = T::of(entry);
    }
}

fn totals<T: Scalar>(arrays: &Arrays<T>, forces_n: &mut [DVec3]) {
    for axis in 0..3 {
        let sums = arrays.left[axis][1..].iter().zip(&arrays.right[axis]);
        for (force, (left, right)) in forces_n.iter_mut().zip(sums) {
            let (left, right): (f64, f64) = ((*left).into(), (*right).into());
            force[axis] = left + right;
        }
    }
}

/// The pass over the rows of one material.
struct RowForces<'a, T> {
    material: &'a CellMaterial<T>,
    rows: &'a [CellRow],
    arrays: &'a mut Arrays<T>,
    left: f64,
    prestrain_j: f64,
}

impl<T: Scalar> LawPass for RowForces<'_, T> {
    type Scalar = T;

    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: ConstitutiveLaw, const VISCOUS: bool>(&mut self) -> f64 {
        let mut power_w = 0.0;
        for row in self.rows {
            let mut first = 0;
            while first < row.cells as usize {
                let at = row.points.map(|point| 1 + point as usize + first);
                let first_prestrain = row.prestrained.then_some(row.first as usize + first);
                let left = row.cells as usize - first;
                if left > V::Narrow::WIDTH {
                    self.lanes::<V, L, VISCOUS>(at, left, first_prestrain, &mut power_w);
                    first += V::WIDTH;
                } else {
                    self.lanes::<V::Narrow, L, VISCOUS>(at, left, first_prestrain, &mut power_w);
                    first += V::Narrow::WIDTH;
                }
            }
        }
        power_w
    }
}

impl<T: Scalar> RowForces<'_, T> {
    /// Computes a vector of cells, the first of which has its points 0, 2, 4, 6 at the entries `at`; there are `cells`
    /// of them, or more than lanes. Their prestrains, if any, start at `first_prestrain`.
    #[inline(always)]
    fn lanes<V: Vector<Scalar = T>, L: ConstitutiveLaw, const VISCOUS: bool>(
        &mut self,
        at: [usize; 4],
        cells: usize,
        first_prestrain: Option<usize>,
        power_w: &mut f64,
    ) {
        let [quarter, minus_volume, minus_kappa, growth] = self.material.cell;
        let weight = first_lanes::<V>(cells);
        let of_strain = weight * V::of(quarter);
        let mut h = [[V::of(0.0); 3]; 3];
        let mut modes = [[V::of(0.0); 4]; 3];
        let mut h_dot = h;
        for axis in 0..3 {
            let found = patterns(&differences::<V>(&self.arrays.displacements[axis], at));
            for column in 0..3 {
                h[axis][column] = found[column] * of_strain;
            }
            modes[axis].copy_from_slice(&found[3..]);
            if VISCOUS {
                let found = patterns(&differences::<V>(&self.arrays.velocities[axis], at));
                for column in 0..3 {
                    h_dot[axis][column] = found[column] * of_strain;
                }
            }
        }
        let mut squares = V::of(0.0);
        for axis in 0..3 {
            for mode in 0..4 {
                squares = squares + modes[axis][mode] * modes[axis][mode] * V::of(MODE_WEIGHTS[mode]);
            }
        }
        let grown = squares * V::of(growth);
        let mut kept_modes = weight;
        let (p, density) = if let Some(first) = first_prestrain {
            let (left, entries) = (V::of(self.left), &self.arrays.prestrains);
            let of_shape = scaled(&matrix::<V>(&entries[..9], first), left);
            let of_volume = scaled(&matrix::<V>(&entries[9..18], first), left);
            let gone = V::load(&entries[18][first..]) * left;
            kept_modes = weight * (V::of(1.0) - gone);
            let (p, density, along) =
                prestrained_cell_stress::<V, T, L, VISCOUS>(&self.material.split, &[of_shape, of_volume], &h, &h_dot);
            // s ∂U/∂s = V P̃ : F A − ½ κ a Q ε
            let of_modes = squares * energy_factor(grown) * gone * V::of(minus_kappa / 128.0);
            add_lanes(weight * (along * V::of(-minus_volume) + of_modes), &mut self.prestrain_j);
            (p, density)
        } else {
            stress::<V, T, L, VISCOUS>(&self.material.split.whole, &h, &h_dot)
        };
        let of_stress = weight * V::of(minus_volume * quarter);
        let factor = force_factor(grown);
        let mut of_modes = [kept_modes; 4];
        for mode in 0..4 {
            of_modes[mode] = kept_modes * factor * V::of(minus_kappa * MODE_WEIGHTS[mode] / 64.0);
        }
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
            let (on_left, on_right) = ([f0, f2, f4, f6], [f1, f3, f5, f7]);
            for row in 0..4 {
                add(&mut left[at[row]..at[row] + V::WIDTH], on_left[row]);
                add(&mut right[at[row]..at[row] + V::WIDTH], on_right[row]);
            }
        }
        if VISCOUS {
            add_lanes(density * weight * V::of(-minus_volume), power_w);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::kernels::cells::testing::{Answer, Question, agrees_with_oracle};

    #[test]
    fn rows_and_oracle_agree() {
        agrees_with_oracle(true, |question: &Question<'_>| {
            let Question { cells, u, v, material, precision, set, spacing_m, fraction } = question;
            // Points are numbered along x, as the ball's particles are.
            let mut rows: Vec<CellRow> = Vec::new();
            for (points, _) in *cells {
                match rows.last_mut() {
                    Some(row) if row.points[0] + row.cells == points[0] && row.points[3] + row.cells == points[6] => {
                        row.cells += 1;
                    }
                    _ => {
                        let points = [points[0], points[2], points[4], points[6]];
                        let first = rows.last().map_or(0, |row| row.first + row.cells);
                        rows.push(CellRow { points, cells: 1, material: 0, first, prestrained: false });
                    }
                }
            }
            assert!(rows.len() < cells.len() / 4);
            let room = Room { points: u.len(), cells: cells.len() };
            let kernel = RowKernel::new(*spacing_m, *fraction, &[*material], *precision, room);
            let mut kernel = kernel.with_instruction_set(*set);
            kernel.set_displacements(u);
            kernel.set_velocities(v);
            let power_w = kernel.forces(&rows, u.len(), 0.0).viscous_w;
            let mut forces_n = vec![DVec3::NAN; u.len()];
            kernel.forces_n(&mut forces_n);
            Answer { forces_n, power_w }
        });
    }
}
