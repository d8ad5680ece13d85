//! Loads and stores of the lanes of rows of cells.
use crate::{
    lanes::real::{Real, Vector},
    material::lane_matrix::M3,
};

/// Number of lanes of the widest vector; arrays end on so many entries that belong to no point.
pub(super) const LANES: usize = 16;

/// Loads a matrix from lists of its nine entries, row by row.
#[inline(always)]
pub(super) fn matrix<V: Vector>(entries: &[Vec<V::Scalar>], first: usize) -> M3<V> {
    let mut m = [[V::of(0.0); 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            m[row][column] = V::load(&entries[3 * row + column][first..]);
        }
    }
    m
}

/// Adds a vector to sums in memory.
#[inline(always)]
pub(super) fn add<V: Vector>(sums: &mut [V::Scalar], a: V) {
    (V::load(sums) + a).store(sums);
}

/// Returns 1 in the first lanes, 0 in the others.
#[inline(always)]
pub(super) fn first_lanes<V: Vector>(count: usize) -> V {
    let mut lanes = [V::Scalar::of(0.0); LANES];
    for lane in 0..LANES {
        if lane < count {
            lanes[lane] = V::Scalar::of(1.0);
        }
    }
    V::load(&lanes)
}

/// Returns `a_p − a_0` of points 1 to 7.
#[inline(always)]
pub(super) fn differences<V: Vector>(values: &[V::Scalar], at: [usize; 4]) -> [V; 7] {
    let zero = V::load(&values[at[0]..]);
    let mut found = [V::of(0.0); 7];
    for row in 0..4 {
        let values = &values[at[row]..=at[row] + V::WIDTH];
        if row > 0 {
            found[2 * row - 1] = V::load(values) - zero;
        }
        found[2 * row] = V::load(&values[1..]) - zero;
    }
    found
}
