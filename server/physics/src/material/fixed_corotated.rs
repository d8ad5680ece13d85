//! Fixed corotated elasticity (Stomakhin, Howes, Schroeder & Teran 2012): `Ψ = µ|F − R|² + ½λ(J − 1)²`, where `R` is
//! the rotation nearest to `F` and `J = det F`.
//!
//! In lanes the rotation has a closed form. `t = tr(RᵀF) = σ₁ + σ₂ + σ₃` is the largest root of
//! `p(t) = t⁴ − 2I t² − 8J t + 2|C|² − I²`, with `C = FᵀF`, `I = tr C` (the characteristic polynomial of Davenport's
//! matrix, whose roots are all real), and since `R = ∂t/∂F`, differentiating `p(t(F), F) = 0` gives
//! `R = ((t² + I) F + 2t cof F − 2FC)/q`, `q = t³ − I t − 2J = 2(σ₁+σ₂)(σ₂+σ₃)(σ₁+σ₃)`.
//! Halley's iteration falls monotonically onto the largest root from `√(3I) ≥ t`.
//!
//! Beyond what tissue can be stretched it stiffens ([`super::stretch_limit`]).
use super::{
    ConstitutiveLaw, Lame,
    constants::Constants,
    lane_matrix::{
        M3, cofactor as lane_cofactor, column_dot, contract as lane_contract, plus_identity, product, scaled,
        symmetric_square, trace,
    },
    lane_strain::{cofactor_and_volume_change, twice_green_strain, volumetric_differential},
    law::LaneStress,
    stretch_limit,
};
use crate::{
    lanes::real::Real,
    linalg::{
        nearest_rotation::{nearest_rotation, rotation_differential},
        tensor::{cofactor, cofactor_differential, contract},
    },
};
use glam::DMat3;

/// Linear about the rotated rest state.
#[derive(Debug)]
pub struct FixedCorotated;

impl ConstitutiveLaw for FixedCorotated {
    const NAME: &'static str = "fixed-corotated";
    const DESCRIPTION: &'static str = "Fixed corotated: linear about the rotated rest state.";

    /// `Ψ = µ|F − R|² + ½λ(J − 1)²`.
    fn energy_density(lame: Lame, f: &DMat3) -> f64 {
        let stretch = *f - nearest_rotation(f);
        lame.mu_pa * contract(&stretch, &stretch)
            + 0.5 * lame.lambda_pa * (f.determinant() - 1.0).powi(2)
            + stretch_limit::energy_density(lame, f)
    }

    /// `P = 2µ(F − R) + λ(J − 1) cof F`: `R` is stationary, so its change does no work.
    fn piola(lame: Lame, f: &DMat3) -> DMat3 {
        (*f - nearest_rotation(f)) * (2.0 * lame.mu_pa)
            + cofactor(f) * (lame.lambda_pa * (f.determinant() - 1.0))
            + stretch_limit::piola(lame, f)
    }

    /// `δP = 2µ(δF − δR) + λ(cof F : δF) cof F + λ(J − 1) δ(cof F)`.
    fn piola_differential(lame: Lame, f: &DMat3, df: &DMat3) -> DMat3 {
        let cof = cofactor(f);
        (*df - rotation_differential(f, df)) * (2.0 * lame.mu_pa)
            + cof * (lame.lambda_pa * contract(&cof, df))
            + cofactor_differential(f, df) * (lame.lambda_pa * (f.determinant() - 1.0))
            + stretch_limit::piola_differential(lame, f, df)
    }

    /// `2µ + λ|cof F N|²` at most, with `|cof F N| ≤ s²`.
    fn stretched_modulus_pa(lame: Lame, stretch_sq: f64) -> f64 {
        let limited_pa = stretch_limit::stretched_modulus_pa(lame, stretch_sq);
        2.0 * lame.mu_pa + lame.lambda_pa * stretch_sq * stretch_sq + limited_pa
    }

    /// `q ≥ 0.2 max(t³, 1)` (16 against 5.4 at rest, 1 against 0.68 for σ = (1, 1, −½)): outside, `R` is close to
    /// ambiguous or the tet nearly gone.
    const DOMAIN: Option<f64> = Some(0.2);

    /// `P = R µ(2E − G²) + λ(J − 1) cof F`.
    ///
    /// `F − R = R G`, `G = √C − I`, and from `(I + G)² = I + 2E`: `G = E − ½G²`. A first `G₀ = sym(RᵀF) − I`, which
    /// knows strain only to the rounding of `R`, put into the right side, gives it relative to itself.
    #[inline(always)]
    fn lane_piola<T: Real>(c: &Constants<T>, h: &M3<T>) -> LaneStress<T> {
        let (cof_f, volume_change) = cofactor_and_volume_change(h);
        let e2 = twice_green_strain(h);
        let Rotation { r, f, domain, .. } = Rotation::of(&e2, &cof_f, volume_change, h);
        let g = stretch(&r, &f);
        let g2 = symmetric_square(&g);
        let mut doubled = e2;
        for a in 0..3 {
            for b in 0..3 {
                doubled[a][b] = c.mu * (e2[a][b] - g2[a][b]);
            }
        }
        let mut p = product(&r, &doubled);
        let pressure = c.lambda * volume_change;
        for a in 0..3 {
            for b in 0..3 {
                p[a][b] = p[a][b] + pressure * cof_f[a][b];
            }
        }
        stretch_limit::add_lane_piola(c.mu, h, &mut p);
        LaneStress { p, domain }
    }

    /// `δP = 2µ(δF − δR) + λ(cof F : δF) cof F + λ(J − 1) δ(cof F)`.
    ///
    /// `δR = R [ω]×` with `B ω = axl(RᵀδF − δFᵀR)`, `B = tr(S) I − S`, `S = RᵀF`; `det B = (σ₁+σ₂)(σ₂+σ₃)(σ₁+σ₃) = ½q`,
    /// which is bounded from below in the law's domain.
    #[inline(always)]
    fn lane_piola_differential<T: Real>(c: &Constants<T>, h: &M3<T>, df: &M3<T>) -> LaneStress<T> {
        let (cof_f, volume_change) = cofactor_and_volume_change(h);
        let Rotation { r, f, q, domain } = Rotation::of(&twice_green_strain(h), &cof_f, volume_change, h);
        // S = I + g
        let g = stretch(&r, &f);
        let spread = T::of(2.0) + trace(&g);
        let mut b = scaled(&g, T::of(-1.0));
        for i in 0..3 {
            b[i][i] = b[i][i] + spread;
        }
        let inverse = lane_cofactor(&b);
        let axial = |i: usize, j: usize| column_dot(&r, i, df, j) - column_dot(&r, j, df, i);
        let a = [axial(2, 1), axial(0, 2), axial(1, 0)];
        let scale = T::of(2.0) / q;
        let mut w = a;
        for i in 0..3 {
            w[i] = scale * (inverse[i][0] * a[0] + inverse[i][1] * a[1] + inverse[i][2] * a[2]);
        }
        let two_mu = T::of(2.0) * c.mu;
        let mut p = volumetric_differential(c.lambda, c.lambda * volume_change, h, &cof_f, df);
        for i in 0..3 {
            // Row i of R [ω]×.
            let turned =
                [r[i][1] * w[2] - r[i][2] * w[1], r[i][2] * w[0] - r[i][0] * w[2], r[i][0] * w[1] - r[i][1] * w[0]];
            for j in 0..3 {
                p[i][j] = p[i][j] + two_mu * (df[i][j] - turned[j]);
            }
        }
        stretch_limit::add_lane_piola_differential(c.mu, h, df, &mut p);
        LaneStress { p, domain }
    }
}

/// The rotation nearest to `F`, in lanes.
struct Rotation<T> {
    /// `R`.
    r: M3<T>,
    /// `F`.
    f: M3<T>,
    /// `(σ₁+σ₂)(σ₂+σ₃)(σ₁+σ₃)`, doubled.
    q: T,
    /// What the law's domain bounds from below.
    domain: T,
}

impl<T: Real> Rotation<T> {
    /// Steps of Halley's iteration that reach the precision of `T`.
    const STEPS: usize = if T::MANTISSA_DIGITS > f32::MANTISSA_DIGITS { 6 } else { 5 };

    /// From `2E`, `cof F`, `J − 1` and `H`.
    #[inline(always)]
    fn of(e2: &M3<T>, cof_f: &M3<T>, volume_change: T, h: &M3<T>) -> Self {
        let one = T::of(1.0);
        let two = T::of(2.0);
        let (f, cg) = (plus_identity(h), plus_identity(e2));
        let i1 = T::of(3.0) + trace(e2);
        let j = one + volume_change;
        let constant = two * lane_contract(&cg, &cg) - i1 * i1;
        let mut t = (T::of(3.0) * i1).sqrt();
        for _ in 0..Self::STEPS {
            let t2 = t * t;
            // p, p'/4 and p''/8: t ← t − p p'/(p'² − ½ p p'')
            let p = t2 * (t2 - two * i1) - T::of(8.0) * j * t + constant;
            let q = t * (t2 - i1) - two * j;
            let curvature = T::of(1.5) * t2 - T::of(0.5) * i1;
            t = t - p * q / (T::of(4.0) * q * q - p * curvature);
        }
        let q = t * (t * t - i1) - two * j;
        let (linear, cubic, inverse) = (t * t + i1, product(&f, &cg), one / q);
        let mut r = f;
        for a in 0..3 {
            for b in 0..3 {
                r[a][b] = (linear * f[a][b] + two * (t * cof_f[a][b] - cubic[a][b])) * inverse;
            }
        }
        Self { r, f, q, domain: q / (t * t * t).max(one) }
    }
}

/// `sym(RᵀF) − I`.
#[inline(always)]
fn stretch<T: Real>(r: &M3<T>, f: &M3<T>) -> M3<T> {
    let mut g = *f;
    for i in 0..3 {
        for j in i..3 {
            g[i][j] = T::of(0.5) * (column_dot(r, i, f, j) + column_dot(r, j, f, i));
            g[j][i] = g[i][j];
        }
        g[i][i] = g[i][i] - T::of(1.0);
    }
    g
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::tensor::outer;
    use glam::DVec3;

    #[test]
    fn energy_and_differential_are_finite_where_the_rotation_is_not_unique() {
        let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        let line = outer(DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 2.0));
        let lame = Lame { lambda_pa: 2.0, mu_pa: 1.0 };
        let change = DMat3::from_axis_angle(DVec3::X, 0.3);
        for f in [DMat3::ZERO, mirror, line, -DMat3::IDENTITY] {
            assert!(FixedCorotated::piola_differential(lame, &f, &change).is_finite());
        }
        // |F − R|² = Σ(σ − 1)² with σ = (1, 1, −1): 4.
        let energy = FixedCorotated::energy_density(Lame { lambda_pa: 0.0, mu_pa: 1.0 }, &mirror);
        assert!((energy - 4.0).abs() < 1e-13);
    }
}
