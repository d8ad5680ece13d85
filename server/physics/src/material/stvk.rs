//! St. Venant-Kirchhoff: `Ψ = µ E:E + ½λ tr²(E)`, `E = ½(FᵀF − I)`.
use super::Lame;
use crate::linalg::tensor::contract;
use crate::linalg::tensor::trace;
use glam::DMat3;

/// Green's strain `E = ½(FᵀF − I)`.
pub fn green_strain(f: &DMat3) -> DMat3 {
    (f.transpose() * *f - DMat3::IDENTITY) * 0.5
}

/// `Ψ = µ E:E + ½λ tr²(E)` (J/m³).
pub fn energy_density(lame: Lame, f: &DMat3) -> f64 {
    let e = green_strain(f);
    lame.mu_pa * contract(&e, &e) + 0.5 * lame.lambda_pa * trace(&e).powi(2)
}

/// `P = F S`, `S = λ tr(E) I + 2µE` (Pa).
pub fn piola(lame: Lame, f: &DMat3) -> DMat3 {
    *f * second_piola(lame, &green_strain(f))
}

/// `δP = δF S + F δS`, `δE = sym(Fᵀ δF)` (Pa).
pub fn piola_differential(lame: Lame, f: &DMat3, df: &DMat3) -> DMat3 {
    let ft_df = f.transpose() * *df;
    let de = (ft_df + ft_df.transpose()) * 0.5;
    *df * second_piola(lame, &green_strain(f)) + *f * second_piola(lame, &de)
}

/// `S = λ tr(E) I + 2µE` (Pa).
fn second_piola(lame: Lame, e: &DMat3) -> DMat3 {
    DMat3::from_diagonal(glam::DVec3::splat(lame.lambda_pa * trace(e))) + *e * (2.0 * lame.mu_pa)
}
