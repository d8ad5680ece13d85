//! Measures of strain in lanes, from the displacement gradient `H = F − I`, so that they are accurate relative to the
//! strain.
use super::lane_matrix::{M3, cofactor, cofactor_differential, column_dot, contract, trace};
use crate::lanes::real::Real;

/// `2E = FᵀF − I = H + Hᵀ + HᵀH`.
#[inline(always)]
pub(crate) fn twice_green_strain<T: Real>(h: &M3<T>) -> M3<T> {
    let mut e = *h;
    for i in 0..3 {
        for j in i..3 {
            e[i][j] = h[i][j] + h[j][i] + column_dot(h, i, h, j);
        }
    }
    for i in 0..3 {
        for j in 0..i {
            e[i][j] = e[j][i];
        }
    }
    e
}

/// `2δE = δF + δFᵀ + δFᵀH + HᵀδF`.
#[inline(always)]
pub(crate) fn twice_green_strain_differential<T: Real>(h: &M3<T>, df: &M3<T>) -> M3<T> {
    let mut rate = *df;
    for i in 0..3 {
        for j in 0..3 {
            rate[i][j] = df[i][j] + df[j][i] + (column_dot(df, i, h, j) + column_dot(h, i, df, j));
        }
    }
    rate
}

/// `J − 1 = tr H + tr cof H + det H`.
#[inline(always)]
pub(crate) fn volume_change<T: Real>(h: &M3<T>, cof_h: &M3<T>) -> T {
    let det = h[0][0] * cof_h[0][0] + h[0][1] * cof_h[0][1] + h[0][2] * cof_h[0][2];
    trace(h) + (trace(cof_h) + det)
}

/// `cof(I + H) = (1 + tr H) I − Hᵀ + cof H`.
#[inline(always)]
pub(crate) fn cofactor_of_sum<T: Real>(h: &M3<T>, cof_h: &M3<T>, tr: T) -> M3<T> {
    let mut cof = *h;
    for i in 0..3 {
        for j in 0..3 {
            cof[i][j] = cof_h[i][j] - h[j][i];
        }
        cof[i][i] = cof[i][i] + (T::of(1.0) + tr);
    }
    cof
}

/// `cof F` and `J − 1`.
#[inline(always)]
pub(crate) fn cofactor_and_volume_change<T: Real>(h: &M3<T>) -> (M3<T>, T) {
    let cof_h = cofactor(h);
    (cofactor_of_sum(h, &cof_h, trace(h)), volume_change(h, &cof_h))
}

/// `a (cof F : δF) cof F + b δ(cof F)`, with `δ(cof F) = tr(δF) I − δFᵀ + δ(cof H)`: the differential of `b(J) cof F`
/// where `a = ∂b/∂J`.
#[inline(always)]
pub(crate) fn volumetric_differential<T: Real>(a: T, b: T, h: &M3<T>, cof_f: &M3<T>, df: &M3<T>) -> M3<T> {
    let (rate, tr) = (a * contract(cof_f, df), trace(df));
    let mut sum = cofactor_differential(h, df);
    for i in 0..3 {
        for j in 0..3 {
            sum[i][j] = sum[i][j] - df[j][i];
        }
        sum[i][i] = sum[i][i] + tr;
    }
    for i in 0..3 {
        for j in 0..3 {
            sum[i][j] = rate * cof_f[i][j] + b * sum[i][j];
        }
    }
    sum
}
