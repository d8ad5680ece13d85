//! 3×3 matrices of numbers, or of vectors of numbers that all do the same (`lanes::real`).
use crate::lanes::real::Real;
use glam::DMat3;

/// A 3×3 matrix, `m[row][column]`.
pub(crate) type M3<T> = [[T; 3]; 3];

/// `cof A`.
#[inline(always)]
pub(crate) fn cofactor<T: Real>(a: &M3<T>) -> M3<T> {
    [
        [minor(a, [1, 2], [1, 2]), minor(a, [1, 2], [2, 0]), minor(a, [1, 2], [0, 1])],
        [minor(a, [2, 0], [1, 2]), minor(a, [2, 0], [2, 0]), minor(a, [2, 0], [0, 1])],
        [minor(a, [0, 1], [1, 2]), minor(a, [0, 1], [2, 0]), minor(a, [0, 1], [0, 1])],
    ]
}

/// `a_ij a_kl − a_il a_kj` for rows `i, k` and columns `j, l`.
#[inline(always)]
fn minor<T: Real>(a: &M3<T>, [i, k]: [usize; 2], [j, l]: [usize; 2]) -> T {
    a[i][j] * a[k][l] - a[i][l] * a[k][j]
}

/// `δ(cof A)` for a change `δA`.
#[inline(always)]
pub(crate) fn cofactor_differential<T: Real>(a: &M3<T>, da: &M3<T>) -> M3<T> {
    let mut rate = *a;
    for i in 0..3 {
        let (k, l) = ((i + 1) % 3, (i + 2) % 3);
        for j in 0..3 {
            let (m, n) = ((j + 1) % 3, (j + 2) % 3);
            // cof_ij = a_km a_ln − a_kn a_lm
            rate[i][j] = (da[k][m] * a[l][n] + a[k][m] * da[l][n]) - (da[k][n] * a[l][m] + a[k][n] * da[l][m]);
        }
    }
    rate
}

/// `A + I`.
#[inline(always)]
pub(crate) fn plus_identity<T: Real>(a: &M3<T>) -> M3<T> {
    let mut sum = *a;
    for i in 0..3 {
        sum[i][i] = sum[i][i] + T::of(1.0);
    }
    sum
}

/// `tr A`.
#[inline(always)]
pub(crate) fn trace<T: Real>(a: &M3<T>) -> T {
    a[0][0] + a[1][1] + a[2][2]
}

/// `A:B`.
#[inline(always)]
pub(crate) fn contract<T: Real>(a: &M3<T>, b: &M3<T>) -> T {
    let mut sum = T::of(0.0);
    for i in 0..3 {
        sum = sum + (a[i][0] * b[i][0] + a[i][1] * b[i][1] + a[i][2] * b[i][2]);
    }
    sum
}

/// `(AᵀB)_ij`.
#[inline(always)]
pub(crate) fn column_dot<T: Real>(a: &M3<T>, i: usize, b: &M3<T>, j: usize) -> T {
    a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j]
}

/// `s A`.
#[inline(always)]
pub(crate) fn scaled<T: Real>(a: &M3<T>, s: T) -> M3<T> {
    let mut product = *a;
    for i in 0..3 {
        for j in 0..3 {
            product[i][j] = a[i][j] * s;
        }
    }
    product
}

/// `A + B`.
#[inline(always)]
pub(crate) fn plus<T: Real>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    let mut sum = *a;
    for i in 0..3 {
        for j in 0..3 {
            sum[i][j] = a[i][j] + b[i][j];
        }
    }
    sum
}

/// `A B`.
#[inline(always)]
pub(crate) fn product<T: Real>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    let mut ab = *a;
    for i in 0..3 {
        for j in 0..3 {
            ab[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
        }
    }
    ab
}

/// A matrix of rows in f64 as glam's matrix of columns.
pub(crate) fn columns(a: &M3<f64>) -> DMat3 {
    DMat3::from_cols_array_2d(a).transpose()
}

/// glam's matrix of columns as a matrix of rows.
pub(crate) fn rows(a: &DMat3) -> M3<f64> {
    a.transpose().to_cols_array_2d()
}

/// `GG` of a symmetric `G`.
#[inline(always)]
pub(crate) fn symmetric_square<T: Real>(g: &M3<T>) -> M3<T> {
    let mut square = *g;
    for i in 0..3 {
        for j in i..3 {
            square[i][j] = column_dot(g, i, g, j);
        }
    }
    for i in 0..3 {
        for j in 0..i {
            square[i][j] = square[j][i];
        }
    }
    square
}
