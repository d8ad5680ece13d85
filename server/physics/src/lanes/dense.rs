//! A small dense matrix's Cholesky factor in lanes, and solving with it for three right-hand sides.
use super::{
    dispatch::{Available, Pass, run},
    real::Vector,
    vector_operations::{LANES, total},
};
use glam::DVec3;

type Lanes = [f64; LANES];

/// A symmetric matrix by its rows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Symmetric<'a> {
    pub(crate) entries: &'a [f64],
    /// Entries from the start of a row to that of the next.
    pub(crate) stride: usize,
}

/// `A = L Lᵀ`, with L by columns. Every column starts with the block of eight rows that its pivot is in, with zeros up
/// to the pivot, which is kept apart.
#[derive(Debug, Clone)]
pub(crate) struct Cholesky {
    columns: Vec<Lanes>,
    inverse_pivots: Vec<f64>,
    /// By axis.
    right: [Vec<Lanes>; 3],
}

impl Cholesky {
    /// Of nothing, with room for so many rows.
    pub(crate) fn with_room(most: usize) -> Self {
        let blocks = most.div_ceil(LANES);
        Self {
            columns: Vec::with_capacity(most * blocks),
            inverse_pivots: Vec::with_capacity(most),
            right: std::array::from_fn(|_| Vec::with_capacity(blocks)),
        }
    }

    /// Factorises the first `size` rows and columns of a matrix. Pivots that are less than `least` of the diagonal,
    /// which of a positive definite matrix rounding alone can make them, are raised to that. Allocates nothing.
    pub(crate) fn factorise(&mut self, matrix: Symmetric<'_>, size: usize, least: f64) {
        let blocks = size.div_ceil(LANES);
        self.columns.clear();
        self.columns.resize(size * blocks, [0.0; LANES]);
        self.inverse_pivots.clear();
        for right in &mut self.right {
            right.clear();
            right.resize(blocks, [0.0; LANES]);
        }
        for (number, column) in self.columns.chunks_exact_mut(blocks.max(1)).enumerate() {
            for (row, entry) in column.as_flattened_mut().iter_mut().enumerate().take(size).skip(number) {
                *entry = matrix.entries[number * matrix.stride + row];
            }
        }
        let Self { columns, inverse_pivots, .. } = self;
        run(Available::best(), Factorise { columns, inverse_pivots, blocks, least });
    }

    /// Row `row` of the right-hand sides.
    pub(crate) fn put(&mut self, row: usize, right: DVec3) {
        for (list, entry) in self.right.iter_mut().zip(right.to_array()) {
            list.as_flattened_mut()[row] = entry;
        }
    }

    /// Row `row` of the solution.
    pub(crate) fn get(&self, row: usize) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|axis| self.right[axis].as_flattened()[row]))
    }

    /// Solves in place of the right-hand sides `b`; returns `Σ bᵀ A⁻¹ b`.
    pub(crate) fn solve(&mut self) -> f64 {
        let Self { columns, inverse_pivots, right, .. } = self;
        run(Available::best(), Solve { columns, inverse_pivots, right: right.each_mut().map(Vec::as_mut_slice) })
    }
}

/// Column after column, left-looking from what the ones before leave of it.
struct Factorise<'a> {
    columns: &'a mut [Lanes],
    inverse_pivots: &'a mut Vec<f64>,
    blocks: usize,
    least: f64,
}

impl Pass for Factorise<'_> {
    type Scalar = f64;
    type Found = ();

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) {
        let Self { columns, inverse_pivots, blocks, least } = self;
        for column in 0..columns.len() / blocks.max(1) {
            let (before, now) = columns.split_at_mut(column * blocks);
            let (first, lane) = (column / LANES, column % LANES);
            let now = &mut now[first..blocks];
            let least = least * now[0][lane];
            for earlier in before.chunks_exact(blocks) {
                let earlier = &earlier[first..];
                let scale = earlier[0][lane];
                if scale != 0.0 {
                    for (now, earlier) in now.iter_mut().zip(earlier) {
                        take::<V>(now, V::of(scale), earlier);
                    }
                }
            }
            let inverse = now[0][lane].max(least).sqrt().recip();
            for now in &mut *now {
                for lane in 0..LANES {
                    now[lane] *= inverse;
                }
            }
            now[0][..=lane].fill(0.0);
            inverse_pivots.push(inverse);
        }
    }
}

struct Solve<'a> {
    columns: &'a [Lanes],
    inverse_pivots: &'a [f64],
    right: [&'a mut [Lanes]; 3],
}

impl Pass for Solve<'_> {
    type Scalar = f64;
    type Found = f64;

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) -> f64 {
        let Self { columns, inverse_pivots, right: [x, y, z] } = self;
        let blocks = x.len();
        // A solve with a right-hand side that is not finite leaves NaN in the lanes beyond the last row, and 0 · NaN spreads.
        let rows_in_last_block = inverse_pivots.len() - blocks.saturating_sub(1) * LANES;
        for last in [&mut *x, &mut *y, &mut *z].into_iter().filter_map(|list| list.last_mut()) {
            last[rows_in_last_block..].fill(0.0);
        }
        let mut size_sq = 0.0;
        // L y = b
        for (column, inverse) in inverse_pivots.iter().enumerate() {
            let (first, lane) = (column / LANES, column % LANES);
            let entries = &columns[column * blocks + first..(column + 1) * blocks];
            let (x, y, z) = (&mut x[first..], &mut y[first..], &mut z[first..]);
            let done = [x[0][lane] * inverse, y[0][lane] * inverse, z[0][lane] * inverse];
            // bᵀ (L Lᵀ)⁻¹ b = yᵀ y
            size_sq += done[0] * done[0] + done[1] * done[1] + done[2] * done[2];
            for (((x, y), z), entries) in x.iter_mut().zip(&mut *y).zip(&mut *z).zip(entries) {
                take::<V>(x, V::of(done[0]), entries);
                take::<V>(y, V::of(done[1]), entries);
                take::<V>(z, V::of(done[2]), entries);
            }
            (x[0][lane], y[0][lane], z[0][lane]) = (done[0], done[1], done[2]);
        }
        // Lᵀ a = y
        for (column, inverse) in inverse_pivots.iter().enumerate().rev() {
            let (first, lane) = (column / LANES, column % LANES);
            let entries = &columns[column * blocks + first..(column + 1) * blocks];
            let (x, y, z) = (&mut x[first..], &mut y[first..], &mut z[first..]);
            let mut sums = [[V::of(0.0); LANES]; 3];
            for (((x, y), z), entries) in x.iter().zip(&*y).zip(&*z).zip(entries) {
                for (part, first) in (0..LANES).step_by(V::WIDTH).enumerate() {
                    let entries = V::load(&entries[first..]);
                    sums[0][part] = sums[0][part] + V::load(&x[first..]) * entries;
                    sums[1][part] = sums[1][part] + V::load(&y[first..]) * entries;
                    sums[2][part] = sums[2][part] + V::load(&z[first..]) * entries;
                }
            }
            let [of_x, of_y, of_z] = sums.map(total);
            x[0][lane] = (x[0][lane] - of_x) * inverse;
            y[0][lane] = (y[0][lane] - of_y) * inverse;
            z[0][lane] = (z[0][lane] - of_z) * inverse;
        }
        size_sq
    }
}

/// `a −= scale b`.
#[inline(always)]
fn take<V: Vector<Scalar = f64>>(a: &mut Lanes, scale: V, b: &Lanes) {
    for first in (0..LANES).step_by(V::WIDTH) {
        (V::load(&a[first..]) - scale * V::load(&b[first..])).store(&mut a[first..]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{lanes::InstructionSet, testing::Random};

    /// A symmetric matrix of so many rows, larger on its diagonal than all else of a row, with some zeros; its rows
    /// have three entries more.
    fn matrix(size: usize, random: &mut Random) -> (Vec<f64>, usize) {
        let stride = size + 3;
        let mut matrix = vec![f64::NAN; size * stride];
        for row in 0..size {
            for column in 0..=row {
                let entry = if (row + column) % 5 == 1 { 0.0 } else { random.vector().x };
                matrix[row * stride + column] = entry;
                matrix[column * stride + row] = entry;
            }
            matrix[row * stride + row] = 2.0 + size as f64;
        }
        (matrix, stride)
    }

    #[test]
    fn what_is_solved_gives_the_right_hand_side_again_on_every_instruction_set() {
        let mut random = Random(5);
        let mut factor = Cholesky::with_room(41);
        for size in [0, 1, 7, 8, 9, 16, 23, 41] {
            let (matrix, stride) = matrix(size, &mut random);
            let right: Vec<DVec3> = (0..size).map(|_| random.vector()).collect();
            factor.factorise(Symmetric { entries: &matrix, stride }, size, 1e-12);
            right.iter().enumerate().for_each(|(row, b)| factor.put(row, *b));
            let size_sq = factor.solve();
            let solved: Vec<DVec3> = (0..size).map(|row| factor.get(row)).collect();
            let mut expected_sq = 0.0;
            for (row, b) in right.iter().enumerate() {
                let again: DVec3 = solved.iter().zip(&matrix[row * stride..]).map(|(a, entry)| *a * *entry).sum();
                assert!(again.distance(*b) < 1e-13, "{size} {row}: {again} {b}");
                expected_sq += b.dot(solved[row]);
            }
            assert!((size_sq - expected_sq).abs() <= 1e-13 * expected_sq, "{size}: {size_sq} {expected_sq}");
            for set in InstructionSet::available() {
                let set = Available::at_most(set);
                let mut other = factor.clone();
                other.inverse_pivots.clear();
                for (number, column) in other.columns.chunks_exact_mut(size.div_ceil(LANES).max(1)).enumerate() {
                    let entries = column.as_flattened_mut();
                    entries.fill(0.0);
                    entries[number..size].copy_from_slice(&matrix[number * stride + number..number * stride + size]);
                }
                let Cholesky { columns, inverse_pivots, right: lists, .. } = &mut other;
                run(set, Factorise { columns, inverse_pivots, blocks: size.div_ceil(LANES), least: 1e-12 });
                for list in &mut *lists {
                    list.fill([0.0; LANES]);
                }
                for (row, b) in right.iter().enumerate() {
                    for axis in 0..3 {
                        lists[axis].as_flattened_mut()[row] = b[axis];
                    }
                }
                let right = lists.each_mut().map(Vec::as_mut_slice);
                assert_eq!(run(set, Solve { columns, inverse_pivots, right }).to_bits(), size_sq.to_bits(), "{set:?}");
                assert!((0..size).all(|row| other.get(row) == solved[row]), "{set:?}");
            }
        }
    }

    /// A press that went wrong once could not be repeated in smaller steps: NaN of the first attempt stayed in the lanes behind the last
    /// row and made every later solution NaN.
    #[test]
    fn a_solve_does_not_remember_an_earlier_one_that_was_not_finite() {
        let mut random = Random(9);
        let mut factor = Cholesky::with_room(41);
        for size in [1, 7, 8, 9, 23, 41] {
            let (matrix, stride) = matrix(size, &mut random);
            factor.factorise(Symmetric { entries: &matrix, stride }, size, 1e-12);
            let right: Vec<DVec3> = (0..size).map(|_| random.vector()).collect();
            let solve = |factor: &mut Cholesky| -> Vec<u64> {
                right.iter().enumerate().for_each(|(row, b)| factor.put(row, *b));
                factor.solve();
                (0..size).flat_map(|row| factor.get(row).to_array()).map(f64::to_bits).collect()
            };
            let expected = solve(&mut factor);
            for bad in [f64::NAN, f64::INFINITY, f64::MAX] {
                (0..size).for_each(|row| factor.put(row, DVec3::splat(bad)));
                factor.solve();
                assert_eq!(solve(&mut factor), expected, "{size} {bad}");
            }
        }
    }
}
