//! St. Venant-Kirchhoff: `Ψ = µ E:E + ½λ tr²(E)` with Green's strain `E = ½(FᵀF − I)`.
use super::{
    ConstitutiveLaw, Lame,
    constants::Constants,
    lane_matrix::{M3, plus, product, scaled, trace as lane_trace},
    lane_strain::{twice_green_strain, twice_green_strain_differential},
    law::LaneStress,
};
use crate::{
    lanes::real::Real,
    linalg::tensor::{contract, trace},
};
use glam::{DMat3, DVec3};

/// The papers' law: it softens in compression and does not resist inversion.
#[derive(Debug)]
pub struct StVenantKirchhoff;

impl ConstitutiveLaw for StVenantKirchhoff {
    const NAME: &'static str = "stvk";
    const DESCRIPTION: &'static str =
        "St. Venant-Kirchhoff, the papers' law: softens in compression and does not resist inversion.";

    /// `Ψ = µ E:E + ½λ tr²(E)`.
    fn energy_density(lame: Lame, f: &DMat3) -> f64 {
        let e = green_strain(f);
        lame.mu_pa * contract(&e, &e) + 0.5 * lame.lambda_pa * trace(&e).powi(2)
    }

    /// `P = F S`, `S = λ tr(E) I + 2µE`.
    fn piola(lame: Lame, f: &DMat3) -> DMat3 {
        *f * second_piola(lame, &green_strain(f))
    }

    /// `δP = δF S + F δS`, `δE = sym(Fᵀ δF)`.
    fn piola_differential(lame: Lame, f: &DMat3, df: &DMat3) -> DMat3 {
        let ft_df = f.transpose() * *df;
        let de = (ft_df + ft_df.transpose()) * 0.5;
        *df * second_piola(lame, &green_strain(f)) + *f * second_piola(lame, &de)
    }

    /// `N·S N + (λ + 2µ) s²`, where `N·S N ≤ (3λ + 2µ)(s² − 1)/2`, which equal stretch along all axes reaches.
    fn stretched_modulus_pa(lame: Lame, stretch_sq: f64) -> f64 {
        let Lame { lambda_pa, mu_pa } = lame;
        (1.5 * lambda_pa + mu_pa) * (stretch_sq - 1.0) + (lambda_pa + 2.0 * mu_pa) * stretch_sq
    }

    /// `P = S + H S`.
    #[inline(always)]
    fn lane_piola<T: Real>(c: &Constants<T>, h: &M3<T>) -> LaneStress<T> {
        let s = lane_second_piola(c, &twice_green_strain(h));
        LaneStress::everywhere(plus(&s, &product(h, &s)))
    }

    /// `δP = δF S + δS + H δS`.
    #[inline(always)]
    fn lane_piola_differential<T: Real>(c: &Constants<T>, h: &M3<T>, df: &M3<T>) -> LaneStress<T> {
        let s = lane_second_piola(c, &twice_green_strain(h));
        let ds = lane_second_piola(c, &twice_green_strain_differential(h, df));
        LaneStress::everywhere(plus(&product(df, &s), &plus(&ds, &product(h, &ds))))
    }
}

/// Green's strain `E = ½(FᵀF − I)`.
pub fn green_strain(f: &DMat3) -> DMat3 {
    (f.transpose() * *f - DMat3::IDENTITY) * 0.5
}

/// `S = λ tr(E) I + 2µE` (Pa).
fn second_piola(lame: Lame, e: &DMat3) -> DMat3 {
    DMat3::from_diagonal(DVec3::splat(lame.lambda_pa * trace(e))) + *e * (2.0 * lame.mu_pa)
}

/// `S = µ(2E) + ½λ tr(2E) I` (Pa), from `2E`.
#[inline(always)]
fn lane_second_piola<T: Real>(c: &Constants<T>, e2: &M3<T>) -> M3<T> {
    let pressure = c.lambda * T::of(0.5) * lane_trace(e2);
    let mut s = scaled(e2, c.mu);
    for i in 0..3 {
        s[i][i] = s[i][i] + pressure;
    }
    s
}
