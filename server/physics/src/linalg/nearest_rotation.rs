//! The rotation nearest to a 3×3 matrix, and how it changes with the matrix.
//!
//! `R` maximises `tr(RᵀF)` over rotations, so it exists for every `F`, singular and inverted ones included, and
//! `F = R S` with `S` symmetric; of its eigenvalues `σ₁ ≥ σ₂ ≥ |σ₃|` the last carries the sign of `det F`. `R` is
//! unique, and smooth in `F`, where `σ₂ + σ₃ > 0`. On the rest (rank ≤ 1, or inverted with `σ₃ = −σ₂`) one maximiser is
//! taken.
use super::tensor::trace;
use glam::{DMat3, DQuat, DVec3, DVec4};

/// The rotation `R` nearest to `F` in the Frobenius norm.
///
/// With `R(q)` of a unit quaternion `q`, `tr(RᵀF) = qᵀ B q` for a symmetric traceless 4×4 matrix `B(F)` (Davenport's;
/// Horn 1987): the eigenvector of its largest eigenvalue is `q`. Jacobi's rotations find it to rounding for any `F`.
pub(crate) fn nearest_rotation(f: &DMat3) -> DMat3 {
    let (c0, c1, c2) = (f.x_axis, f.y_axis, f.z_axis);
    let axial = DVec3::new(c1.z - c2.y, c2.x - c0.z, c0.y - c1.x);
    let b = [
        [c0.x + c1.y + c2.z, axial.x, axial.y, axial.z],
        [axial.x, c0.x - c1.y - c2.z, c0.y + c1.x, c0.z + c2.x],
        [axial.y, c0.y + c1.x, c1.y - c0.x - c2.z, c1.z + c2.y],
        [axial.z, c0.z + c2.x, c1.z + c2.y, c2.z - c0.x - c1.y],
    ];
    let q = dominant_eigenvector(b);
    DMat3::from_quat(DQuat::from_xyzw(q.y, q.z, q.w, q.x).normalize())
}

/// Unit eigenvector of the largest eigenvalue of a symmetric 4×4 matrix, found by cyclic Jacobi rotations.
fn dominant_eigenvector(mut b: [[f64; 4]; 4]) -> DVec4 {
    // Rows of `vectors` become the eigenvectors.
    let mut vectors = [DVec4::X, DVec4::Y, DVec4::Z, DVec4::W];
    // Convergence is quadratic: five or six rounds reach rounding, and the bound only ends the loop for NaN.
    for _round in 0..12 {
        let mut off = 0.0;
        let mut diagonal = 0.0;
        for i in 0..4 {
            diagonal += b[i][i].powi(2);
            for j in i + 1..4 {
                off += b[i][j].powi(2);
            }
        }
        if off <= 1e-34 * diagonal {
            break;
        }
        for i in 0..4 {
            for j in i + 1..4 {
                rotate(&mut b, &mut vectors, i, j);
            }
        }
    }
    let largest = (1..4).fold(0, |best, i| if b[i][i] > b[best][best] { i } else { best });
    vectors[largest]
}

/// One Jacobi rotation that makes `b_ij` zero: `tan θ = t`, `t² + 2τt − 1 = 0`, `τ = (b_jj − b_ii)/(2 b_ij)`.
fn rotate(b: &mut [[f64; 4]; 4], vectors: &mut [DVec4; 4], i: usize, j: usize) {
    if b[i][j] == 0.0 {
        return;
    }
    let tau = (b[j][j] - b[i][i]) / (2.0 * b[i][j]);
    let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
    let cos = 1.0 / (1.0 + t * t).sqrt();
    let sin = t * cos;
    for k in 0..4 {
        (b[k][i], b[k][j]) = (cos * b[k][i] - sin * b[k][j], sin * b[k][i] + cos * b[k][j]);
    }
    for k in 0..4 {
        (b[i][k], b[j][k]) = (cos * b[i][k] - sin * b[j][k], sin * b[i][k] + cos * b[j][k]);
    }
    (vectors[i], vectors[j]) = (vectors[i] * cos - vectors[j] * sin, vectors[i] * sin + vectors[j] * cos);
}

/// Fraction of `tr S` below which `σ₂ + σ₃` counts as zero in [`rotation_differential`].
const SINGULAR: f64 = 1e-9;

/// `δR = R [ω]×`, where `S = RᵀF` staying symmetric demands `(tr(S) I − S) ω = axl(RᵀδF − δFᵀR)`.
///
/// The matrix has the eigenvalues `σ₁+σ₂`, `σ₁+σ₃`, `σ₂+σ₃`. Where the last vanishes `R` jumps and has no differential:
/// zero is returned, which is finite.
pub(crate) fn rotation_differential(f: &DMat3, df: &DMat3) -> DMat3 {
    let r = nearest_rotation(f);
    let s = r.transpose() * *f;
    let a = r.transpose() * *df;
    let axial = DVec3::new(a.y_axis.z - a.z_axis.y, a.z_axis.x - a.x_axis.z, a.x_axis.y - a.y_axis.x);
    let matrix = DMat3::from_diagonal(DVec3::splat(trace(&s))) - s;
    if matrix.determinant() <= SINGULAR * trace(&s).powi(3) {
        return DMat3::ZERO;
    }
    let w = matrix.inverse() * axial;
    let cross = DMat3::from_cols(DVec3::new(0.0, w.z, -w.y), DVec3::new(-w.z, 0.0, w.x), DVec3::new(w.y, -w.x, 0.0));
    r * cross
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(axis: DVec3, angle: f64) -> DMat3 {
        DMat3::from_axis_angle(axis.normalize(), angle)
    }

    #[test]
    fn the_rotation_is_found_for_stretched_flattened_and_inverted_gradients() {
        let r = turned(DVec3::new(1.0, -2.0, 0.5), 2.9);
        let frame = turned(DVec3::new(0.3, 0.7, -1.0), 0.8);
        for sigma in [[1.0, 1.0, 1.0], [3.0, 1.0, 0.2], [1.0, 1.0, 1e-9], [1.2, 1.0, 0.0], [1.0, 0.9, -0.5]] {
            let s = frame * DMat3::from_diagonal(DVec3::from(sigma)) * frame.transpose();
            let found = nearest_rotation(&(r * s));
            assert!((found - r).to_cols_array().iter().all(|d| d.abs() < 1e-13), "{sigma:?}: {found} not {r}");
        }
    }

    #[test]
    fn the_result_is_a_rotation_even_where_it_is_not_unique() {
        let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        let line = crate::linalg::tensor::outer(DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 2.0));
        for f in [DMat3::ZERO, mirror, line, -DMat3::IDENTITY] {
            let r = nearest_rotation(&f);
            assert!((r.determinant() - 1.0).abs() < 1e-13);
            assert!((r * r.transpose() - DMat3::IDENTITY).to_cols_array().iter().all(|d| d.abs() < 1e-13));
            assert!(rotation_differential(&f, &turned(DVec3::X, 0.3)).is_finite());
        }
    }
}
