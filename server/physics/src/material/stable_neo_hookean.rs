//! Stable neo-Hookean (Smith, de Goes & Kim 2018, without the rest-state logarithm).
//!
//! `Ψ = ½µ(tr FᵀF − 3) + ½λ̂(J − 1)² − µ(J − 1)` with `λ̂ = λ + µ`, `J = det F`. At `F = I` energy and stress vanish,
//! and `δP = µ(δF + δFᵀ) + (λ̂ − µ) tr(δF) I`: small strain sees exactly λ and µ. Defined for every `F`, inverted ones
//! included. Beyond what tissue can be stretched it stiffens ([`super::stretch_limit`]).
use super::{
    ConstitutiveLaw, Lame,
    constants::Constants,
    lane_matrix::{M3, cofactor as lane_cofactor, plus, scaled, trace},
    lane_strain::{cofactor_and_volume_change, cofactor_of_sum, volume_change, volumetric_differential},
    law::LaneStress,
    stretch_limit,
};
use crate::{
    lanes::real::Real,
    linalg::tensor::{cofactor, cofactor_differential, contract},
};
use glam::DMat3;

/// Resists and recovers from inversion.
#[derive(Debug)]
pub struct StableNeoHookean;

impl ConstitutiveLaw for StableNeoHookean {
    const NAME: &'static str = "stable-neo-hookean";
    const DESCRIPTION: &'static str = "Stable neo-Hookean: resists and recovers from inversion.";

    /// `Ψ = ½µ(tr FᵀF − 3) + ½λ̂(J − 1)² − µ(J − 1)`.
    fn energy_density(lame: Lame, f: &DMat3) -> f64 {
        let volume_change = f.determinant() - 1.0;
        let lambda_hat = lame.lambda_pa + lame.mu_pa;
        0.5 * lame.mu_pa * (contract(f, f) - 3.0)
            + volume_change * (0.5 * lambda_hat * volume_change - lame.mu_pa)
            + stretch_limit::energy_density(lame, f)
    }

    /// `P = µF + (λ̂(J − 1) − µ) cof F`.
    fn piola(lame: Lame, f: &DMat3) -> DMat3 {
        let lambda_hat = lame.lambda_pa + lame.mu_pa;
        *f * lame.mu_pa
            + cofactor(f) * (lambda_hat * (f.determinant() - 1.0) - lame.mu_pa)
            + stretch_limit::piola(lame, f)
    }

    /// `δP = µδF + λ̂ (cof F : δF) cof F + (λ̂(J − 1) − µ) δ(cof F)`.
    fn piola_differential(lame: Lame, f: &DMat3, df: &DMat3) -> DMat3 {
        let lambda_hat = lame.lambda_pa + lame.mu_pa;
        let cof = cofactor(f);
        *df * lame.mu_pa
            + cof * (lambda_hat * contract(&cof, df))
            + cofactor_differential(f, df) * (lambda_hat * (f.determinant() - 1.0) - lame.mu_pa)
            + stretch_limit::piola_differential(lame, f, df)
    }

    /// `µ + (λ + µ)|cof F N|²` with `|cof F N| ≤ s²`; `J` is linear along `n Nᵀ`.
    fn stretched_modulus_pa(lame: Lame, stretch_sq: f64) -> f64 {
        let limited_pa = stretch_limit::stretched_modulus_pa(lame, stretch_sq);
        lame.mu_pa + (lame.lambda_pa + lame.mu_pa) * stretch_sq * stretch_sq + limited_pa
    }

    /// `P = µ(F − cof F) + λ̂(J − 1) cof F`, with `F − cof F = H + Hᵀ − tr(H) I − cof H`.
    #[inline(always)]
    fn lane_piola<T: Real>(c: &Constants<T>, h: &M3<T>) -> LaneStress<T> {
        let cof_h = lane_cofactor(h);
        let tr = trace(h);
        let volume_change = volume_change(h, &cof_h);
        let cof_f = cofactor_of_sum(h, &cof_h, tr);
        let pressure = (c.lambda + c.mu) * volume_change;
        let mut p = *h;
        for i in 0..3 {
            for j in 0..3 {
                let trace_part = if i == j { tr } else { T::of(0.0) };
                p[i][j] = c.mu * (h[i][j] + h[j][i] - trace_part - cof_h[i][j]) + pressure * cof_f[i][j];
            }
        }
        stretch_limit::add_lane_piola(c.mu, h, &mut p);
        LaneStress::everywhere(p)
    }

    /// `δP = µδF + λ̂(cof F : δF) cof F + (λ̂(J − 1) − µ) δ(cof F)`.
    #[inline(always)]
    fn lane_piola_differential<T: Real>(c: &Constants<T>, h: &M3<T>, df: &M3<T>) -> LaneStress<T> {
        let lambda_hat = c.lambda + c.mu;
        let (cof_f, volume_change) = cofactor_and_volume_change(h);
        let pressure = lambda_hat * volume_change - c.mu;
        let volumetric = volumetric_differential(lambda_hat, pressure, h, &cof_f, df);
        let mut dp = plus(&scaled(df, c.mu), &volumetric);
        stretch_limit::add_lane_piola_differential(c.mu, h, df, &mut dp);
        LaneStress::everywhere(dp)
    }
}
