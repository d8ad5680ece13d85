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

    /// `1/√3`. Along an axis the stress is `P = c s (s² − 1)/2`, with `c = λ + 2µ` where the sides are held, Young's modulus
    /// where they are free (`S = 0` across then), and `3λ + 2µ` where all axes are pressed alike. In compression it is largest
    /// where `dP/ds = c (3s² − 1)/2 = 0`.
    const WEAKENS_BELOW: Option<f64> = Some(0.577_350_269_189_625_8);

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

/// Returns the stretch along an axis whose sides are held, below which the law gives way sideways: a shear of planes across
/// the axis is then resisted by nothing. For `δF = m Nᵀ` with `N` along the axis and `m` across it,
/// ```text
/// m·(δP N) = N·S N + µ = ½ (λ + 2µ)(s² − 1) + µ > 0   for s² > λ/(λ + 2µ) = ν/(1 − ν)
/// ```
/// With free sides `N·S N + µ s_t² = µ s²` is positive always, `s_t² = 1 − ν (s² − 1)` being the square of the stretch across.
pub fn gives_way_sideways_below(lame: Lame) -> f64 {
    (lame.lambda_pa.max(0.0) / lame.p_wave_modulus_pa()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::tensor::outer;

    const POISSON_RATIOS: [f64; 5] = [-0.2, 0.0, 0.3, 0.45, 0.49];

    fn lame(nu: f64) -> Lame {
        Lame::from_young_poisson(10e3, nu).unwrap()
    }

    /// Stretch `s` along x and `across` along y and z.
    fn stretched(s: f64, across: f64) -> DMat3 {
        DMat3::from_diagonal(DVec3::new(s, across, across))
    }

    /// The stretch at which the compressive stress along x is largest, by bisection of the slope of `P_xx` along `path`.
    fn peak(lame: Lame, path: impl Fn(f64) -> DMat3) -> f64 {
        let along = |s: f64| StVenantKirchhoff::piola(lame, &path(s)).x_axis.x;
        let slope = |s: f64| along(s + 1e-5) - along(s - 1e-5);
        let (mut low, mut high) = (0.05, 0.99);
        assert!(slope(low) < 0.0 && slope(high) > 0.0);
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            if slope(middle) < 0.0 { low = middle } else { high = middle }
        }
        f64::midpoint(low, high)
    }

    #[test]
    fn it_weakens_below_the_same_stretch_whether_its_sides_are_held_free_or_pressed_alike() {
        let limit = StVenantKirchhoff::WEAKENS_BELOW.unwrap();
        for nu in POISSON_RATIOS {
            let free_across = |s: f64| (1.0 - nu * (s * s - 1.0)).sqrt();
            let free = StVenantKirchhoff::piola(lame(nu), &stretched(0.6, free_across(0.6)));
            assert!(free.y_axis.y.abs() < 1e-9 * free.x_axis.x.abs(), "free sides have no stress: {free}");
            for (how, found) in [
                ("held", peak(lame(nu), |s| stretched(s, 1.0))),
                ("free", peak(lame(nu), |s| stretched(s, free_across(s)))),
                ("all round", peak(lame(nu), |s| stretched(s, s))),
            ] {
                assert!((found - limit).abs() < 1e-6, "{how}, nu {nu}: {found}");
            }
        }
    }

    #[test]
    fn it_gives_way_sideways_where_that_is_said_and_with_free_sides_nowhere() {
        for nu in POISSON_RATIOS {
            let sideways =
                |f: &DMat3| StVenantKirchhoff::piola_differential(lame(nu), f, &outer(DVec3::Y, DVec3::X)).x_axis.y;
            let limit = gives_way_sideways_below(lame(nu));
            assert!(sideways(&stretched(limit + 1e-4, 1.0)) > 0.0, "nu {nu}");
            if nu > 0.0 {
                assert!(sideways(&stretched(limit - 1e-4, 1.0)) < 0.0, "nu {nu}");
                assert!((limit * limit - nu / (1.0 - nu)).abs() < 1e-12, "nu {nu}: {limit}");
            }
            for s in [0.1, 0.5, 0.9, 1.0] {
                let across = (1.0 - nu * (s * s - 1.0)).sqrt();
                assert!(sideways(&stretched(s, across)) > 0.0, "nu {nu}, stretch {s}");
            }
        }
    }
}
