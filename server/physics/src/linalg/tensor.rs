//! Operations on 3×3 matrices that glam has not.
use glam::{DMat3, DVec3};

/// `tr(A)`.
pub fn trace(a: &DMat3) -> f64 {
    a.x_axis.x + a.y_axis.y + a.z_axis.z
}

/// `A:B = Σ A_ij B_ij`.
pub fn contract(a: &DMat3, b: &DMat3) -> f64 {
    a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
}

/// `a bᵀ`.
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Largest eigenvalue of a symmetric positive semi-definite 3×3 matrix, in closed form: with `q = tr A/3`,
/// `p = √(|A − qI|²/6)`, `B = (A − qI)/p`: `λ_max = q + 2p cos(⅓ arccos(½ det B))`.
pub fn largest_eigenvalue(a: &DMat3) -> f64 {
    let q = trace(a) / 3.0;
    let deviator = *a - DMat3::from_diagonal(DVec3::splat(q));
    let p = (contract(&deviator, &deviator) / 6.0).sqrt();
    if p == 0.0 {
        return q;
    }
    let half_det = (deviator * (1.0 / p)).determinant() * 0.5;
    q + 2.0 * p * (half_det.clamp(-1.0, 1.0).acos() / 3.0).cos()
}

/// `cof F = ∂J/∂F = [f₁×f₂, f₂×f₀, f₀×f₁]`, with the columns `f_i` of `F`; it is defined for singular `F` too.
pub fn cofactor(f: &DMat3) -> DMat3 {
    DMat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis))
}

/// `δ(cof F)` for a change `δF`.
pub fn cofactor_differential(f: &DMat3, df: &DMat3) -> DMat3 {
    DMat3::from_cols(
        df.y_axis.cross(f.z_axis) + f.y_axis.cross(df.z_axis),
        df.z_axis.cross(f.x_axis) + f.z_axis.cross(df.x_axis),
        df.x_axis.cross(f.y_axis) + f.x_axis.cross(df.y_axis),
    )
}
