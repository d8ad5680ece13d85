//! Stable neo-Hookean (Smith, de Goes & Kim 2018, without the rest-state logarithm).
//!
//! `Ψ = ½µ(tr FᵀF − 3) + ½λ̂(J − 1)² − µ(J − 1)` with `λ̂ = λ + µ`, `J = det F`. At `F = I` energy and stress vanish, and
//! `δP = µ(δF + δFᵀ) + (λ̂ − µ) tr(δF) I`: small strain sees exactly λ and µ. Defined for every `F`, inverted ones included.
use super::Lame;
use crate::linalg::tensor::contract;
use glam::DMat3;

/// `Ψ` (J/m³).
pub fn energy_density(lame: Lame, f: &DMat3) -> f64 {
    let volume_change = f.determinant() - 1.0;
    let lambda_hat = lame.lambda_pa + lame.mu_pa;
    0.5 * lame.mu_pa * (contract(f, f) - 3.0) + volume_change * (0.5 * lambda_hat * volume_change - lame.mu_pa)
}

/// `P = µF + (λ̂(J − 1) − µ) cof F` (Pa).
pub fn piola(lame: Lame, f: &DMat3) -> DMat3 {
    let lambda_hat = lame.lambda_pa + lame.mu_pa;
    *f * lame.mu_pa + cofactor(f) * (lambda_hat * (f.determinant() - 1.0) - lame.mu_pa)
}

/// `δP = µδF + λ̂ (cof F : δF) cof F + (λ̂(J − 1) − µ) δ(cof F)` (Pa).
pub fn piola_differential(lame: Lame, f: &DMat3, df: &DMat3) -> DMat3 {
    let lambda_hat = lame.lambda_pa + lame.mu_pa;
    let cof = cofactor(f);
    *df * lame.mu_pa
        + cof * (lambda_hat * contract(&cof, df))
        + cofactor_differential(f, df) * (lambda_hat * (f.determinant() - 1.0) - lame.mu_pa)
}

/// `cof F = ∂J/∂F = [f₁×f₂, f₂×f₀, f₀×f₁]`, with the columns `f_i` of `F`; defined for singular `F` too.
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
