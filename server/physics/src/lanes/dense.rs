//! A small matrix's Cholesky factor in lanes, and solving with it for three right-hand sides.
//!
//! It is stored as if it were dense; blocks of eight rows that are zero in a column are passed over, which changes no bit. In an order
//! that keeps neighbours together and separators last ([`crate::linalg::dissection`]) most blocks are.
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
    /// Which blocks of each column are not zero, a bit each.
    filled: Vec<u64>,
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
            filled: Vec::with_capacity(most * words(blocks)),
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
        self.filled.clear();
        self.filled.resize(size * words(blocks), 0);
        self.inverse_pivots.clear();
        for right in &mut self.right {
            right.clear();
            right.resize(blocks, [0.0; LANES]);
        }
        let columns = self.columns.chunks_exact_mut(blocks.max(1));
        for ((number, column), filled) in columns.enumerate().zip(self.filled.chunks_exact_mut(words(blocks).max(1))) {
            let row = &matrix.entries[number * matrix.stride..][..size];
            column.as_flattened_mut()[number..size].copy_from_slice(&row[number..]);
            for block in number / LANES..blocks {
                if block == number / LANES || column[block] != [0.0; LANES] {
                    filled[block / WORD] |= 1 << (block % WORD);
                }
            }
        }
        let Self { columns, filled, inverse_pivots, .. } = self;
        run(Available::best(), Factorise { columns, filled, inverse_pivots, blocks, least });
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
        let Self { columns, filled, inverse_pivots, right } = self;
        run(
            Available::best(),
            Solve { columns, filled, inverse_pivots, right: right.each_mut().map(Vec::as_mut_slice) },
        )
    }
}

/// Number of blocks in a word of [`Cholesky::filled`].
const WORD: usize = u64::BITS as usize;

fn words(blocks: usize) -> usize {
    blocks.div_ceil(WORD)
}

/// The blocks that are filled in any of some columns, of so many words each, from one on.
#[inline(always)]
fn each_filled_of_any(filled: &[u64], words: usize, from: usize) -> impl Iterator<Item = usize> {
    (from / WORD..words).flat_map(move |number| {
        let any = filled.chunks_exact(words).fold(0, |any, column| any | column[number]);
        each_bit(if number == from / WORD { any & (u64::MAX << (from % WORD)) } else { any }, number)
    })
}

/// The numbers of the bits that are set in the word of this number.
#[inline(always)]
fn each_bit(mut left: u64, number: usize) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (left != 0).then(|| left.trailing_zeros() as usize)?;
        left &= left - 1;
        Some(number * WORD + bit)
    })
}

/// Column after column, left-looking from what the ones before leave of it.
struct Factorise<'a> {
    columns: &'a mut [Lanes],
    filled: &'a mut [u64],
    inverse_pivots: &'a mut Vec<f64>,
    blocks: usize,
    least: f64,
}

impl Pass for Factorise<'_> {
    type Scalar = f64;
    type Found = ();

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) {
        let Self { columns, filled, inverse_pivots, blocks, least } = self;
        let words = words(blocks);
        for column in 0..columns.len() / blocks.max(1) {
            let (before, now) = columns.split_at_mut(column * blocks);
            let (first, lane) = (column / LANES, column % LANES);
            let (filled_before, filled_now) = filled.split_at_mut(column * words);
            let now = &mut now[..blocks];
            let least = least * now[first][lane];
            for (earlier, filled) in before.chunks_exact(blocks).zip(filled_before.chunks_exact(words)) {
                let scale = earlier[first][lane];
                if scale != 0.0 {
                    for block in each_filled_of_any(filled, words, first) {
                        take::<V>(&mut now[block], V::of(scale), &earlier[block]);
                        filled_now[block / WORD] |= 1 << (block % WORD);
                    }
                }
            }
            let inverse = now[first][lane].max(least).sqrt().recip();
            for now in &mut now[first..] {
                for lane in 0..LANES {
                    now[lane] *= inverse;
                }
            }
            now[first][..=lane].fill(0.0);
            inverse_pivots.push(inverse);
        }
    }
}

struct Solve<'a> {
    columns: &'a [Lanes],
    filled: &'a [u64],
    inverse_pivots: &'a [f64],
    right: [&'a mut [Lanes]; 3],
}

impl Pass for Solve<'_> {
    type Scalar = f64;
    type Found = f64;

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) -> f64 {
        let Self { columns, filled, inverse_pivots, right: [x, y, z] } = self;
        let blocks = x.len();
        let words = words(blocks);
        // A solve with a right-hand side that is not finite leaves NaN in the lanes beyond the last row, and 0 · NaN spreads.
        let rows_in_last_block = inverse_pivots.len() - blocks.saturating_sub(1) * LANES;
        for last in [&mut *x, &mut *y, &mut *z].into_iter().filter_map(|list| list.last_mut()) {
            last[rows_in_last_block..].fill(0.0);
        }
        let mut size_sq = 0.0;
        // Eight columns at a time, whose pivots are in one block: other blocks are loaded and stored once for all of them.
        let groups = || inverse_pivots.chunks(LANES).zip(columns.chunks(LANES * blocks.max(1))).enumerate();
        let filled_below = |group: usize| {
            let of_group =
                &filled[group * LANES * words..][..(inverse_pivots.len() - group * LANES).min(LANES) * words];
            each_filled_of_any(of_group, words, group + 1)
        };
        // L y = b
        for (group, (inverse_pivots, columns)) in groups() {
            let mut done = [[V::of(0.0); 3]; LANES];
            for (lane, (inverse, column)) in inverse_pivots.iter().zip(columns.chunks_exact(blocks)).enumerate() {
                let of_row = [x[group][lane] * inverse, y[group][lane] * inverse, z[group][lane] * inverse];
                // bᵀ (L Lᵀ)⁻¹ b = yᵀ y
                size_sq += of_row[0] * of_row[0] + of_row[1] * of_row[1] + of_row[2] * of_row[2];
                done[lane] = [V::of(of_row[0]), V::of(of_row[1]), V::of(of_row[2])];
                take::<V>(&mut x[group], done[lane][0], &column[group]);
                take::<V>(&mut y[group], done[lane][1], &column[group]);
                take::<V>(&mut z[group], done[lane][2], &column[group]);
                (x[group][lane], y[group][lane], z[group][lane]) = (of_row[0], of_row[1], of_row[2]);
            }
            for block in filled_below(group) {
                for first in (0..LANES).step_by(V::WIDTH) {
                    let mut left =
                        [V::load(&x[block][first..]), V::load(&y[block][first..]), V::load(&z[block][first..])];
                    for (column, done) in columns.chunks_exact(blocks).zip(&done) {
                        let entries = V::load(&column[block][first..]);
                        left[0] = left[0] - done[0] * entries;
                        left[1] = left[1] - done[1] * entries;
                        left[2] = left[2] - done[2] * entries;
                    }
                    left[0].store(&mut x[block][first..]);
                    left[1].store(&mut y[block][first..]);
                    left[2].store(&mut z[block][first..]);
                }
            }
        }
        // Lᵀ a = y
        for (group, (inverse_pivots, columns)) in groups().rev() {
            let mut sums = [[[V::of(0.0); LANES]; 3]; LANES];
            for block in filled_below(group) {
                add_products::<V>(&mut sums, columns, blocks, block, [&x[block], &y[block], &z[block]]);
            }
            for (lane, (inverse, column)) in inverse_pivots.iter().zip(columns.chunks_exact(blocks)).enumerate().rev() {
                let own = [&x[group], &y[group], &z[group]];
                let mut of_lane = [sums[lane]];
                add_products::<V>(&mut of_lane, column, blocks, group, own);
                let [of_x, of_y, of_z] = of_lane[0].map(total);
                x[group][lane] = (x[group][lane] - of_x) * inverse;
                y[group][lane] = (y[group][lane] - of_y) * inverse;
                z[group][lane] = (z[group][lane] - of_z) * inverse;
            }
        }
        size_sq
    }
}

/// Adds to the sums of each column its products, in a block, with three right-hand sides.
#[inline(always)]
fn add_products<V: Vector<Scalar = f64>>(
    sums: &mut [[[V; LANES]; 3]],
    columns: &[Lanes],
    blocks: usize,
    block: usize,
    right: [&Lanes; 3],
) {
    for (part, first) in (0..LANES).step_by(V::WIDTH).enumerate() {
        let right = [V::load(&right[0][first..]), V::load(&right[1][first..]), V::load(&right[2][first..])];
        for (column, sums) in columns.chunks_exact(blocks).zip(&mut *sums) {
            let entries = V::load(&column[block][first..]);
            sums[0][part] = sums[0][part] + right[0] * entries;
            sums[1][part] = sums[1][part] + right[1] * entries;
            sums[2][part] = sums[2][part] + right[2] * entries;
        }
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
                let Cholesky { columns, filled, inverse_pivots, right: lists } = &mut other;
                run(set, Factorise { columns, filled, inverse_pivots, blocks: size.div_ceil(LANES), least: 1e-12 });
                for list in &mut *lists {
                    list.fill([0.0; LANES]);
                }
                for (row, b) in right.iter().enumerate() {
                    for axis in 0..3 {
                        lists[axis].as_flattened_mut()[row] = b[axis];
                    }
                }
                let right = lists.each_mut().map(Vec::as_mut_slice);
                assert_eq!(
                    run(set, Solve { columns, filled, inverse_pivots, right }).to_bits(),
                    size_sq.to_bits(),
                    "{set:?}"
                );
                assert!((0..size).all(|row| other.get(row) == solved[row]), "{set:?}");
            }
        }
    }

    /// A band and a last row: most blocks are zero and passed over, and solutions are to the last bit those of a factor that passes
    /// over none.
    #[test]
    fn blocks_that_are_zero_change_nothing_and_are_passed_over() {
        let mut random = Random(7);
        let size = 150;
        let mut sparse = vec![0.0; size * size];
        for row in 0..size {
            for column in 0..row {
                let couples = row - column < 4 || row == size - 1 && column % 3 == 0;
                let entry = if couples { random.vector().x } else { 0.0 };
                (sparse[row * size + column], sparse[column * size + row]) = (entry, entry);
            }
            sparse[row * size + row] = 80.0;
        }
        let mut factor = Cholesky::with_room(size);
        factor.factorise(Symmetric { entries: &sparse, stride: size }, size, 1e-12);
        let bits = factor.filled.iter().map(|word| word.count_ones()).sum::<u32>() as usize;
        let blocks = size.div_ceil(LANES);
        println!("{bits} of {} blocks", size * (blocks + 1) / 2);
        assert!(bits < size * 4, "{bits}");
        let right: Vec<DVec3> = (0..size).map(|_| random.vector()).collect();
        let solve = |factor: &mut Cholesky| -> (f64, Vec<DVec3>) {
            right.iter().enumerate().for_each(|(row, b)| factor.put(row, *b));
            (factor.solve(), (0..size).map(|row| factor.get(row)).collect())
        };
        let mut whole = factor.clone();
        let words = words(blocks);
        for (column, filled) in whole.filled.chunks_exact_mut(words).enumerate() {
            (column / LANES..blocks).for_each(|block| filled[block / WORD] |= 1 << (block % WORD));
        }
        assert_eq!(solve(&mut factor), solve(&mut whole));
        let solved = solve(&mut factor).1;
        for (row, b) in right.iter().enumerate() {
            let again: DVec3 = solved.iter().zip(&sparse[row * size..]).map(|(a, entry)| *a * *entry).sum();
            assert!(again.distance(*b) < 1e-12, "{row}: {again} {b}");
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
