//! Stress differential `δP = ∂P/∂F : δF` of one lane from `H = F − I` and `δF`; see [`super::laws`].
use super::laws::{
    Constants, FixedCorotated, LaneLaw, M3, Rotation, StVenantKirchhoff, StableNeoHookean, cofactor, cofactor_of_sum,
    column_dot, contract, plus, product, scaled, stretch, trace, twice_green_strain, volume_change,
};
use crate::lanes::real::Real;
use crate::material::{Lame, fixed_corotated};
use glam::DMat3;

/// A law with its differential.
pub(crate) trait LaneTangent: LaneLaw {
    /// `δP` (Pa), and a number that is below [`LaneLaw::DOMAIN`] where the result is not to be used.
    fn differential<T: Real>(c: &Constants<T>, h: &M3<T>, df: &M3<T>) -> (M3<T>, T);
    /// `δP` in f64, for lanes outside the domain.
    fn differential_outside(c: &Constants<f64>, f: &DMat3, df: &DMat3) -> DMat3;
}

/// `δP = δF S + F δS`, `2δE = δF + δFᵀ + δFᵀH + HᵀδF`.
impl LaneTangent for StVenantKirchhoff {
    #[inline(always)]
    fn differential<T: Real>(c: &Constants<T>, h: &M3<T>, df: &M3<T>) -> (M3<T>, T) {
        let s = second_piola(c, &twice_green_strain(h));
        let mut rate = *df;
        for i in 0..3 {
            for j in 0..3 {
                rate[i][j] = df[i][j] + df[j][i] + (column_dot(df, i, h, j) + column_dot(h, i, df, j));
            }
        }
        let ds = second_piola(c, &rate);
        (plus(&product(df, &s), &plus(&ds, &product(h, &ds))), T::of(1.0))
    }
    fn differential_outside(_: &Constants<f64>, _: &DMat3, _: &DMat3) -> DMat3 {
        DMat3::NAN
    }
}

/// `S = µ(2E) + ½λ tr(2E) I`.
#[inline(always)]
fn second_piola<T: Real>(c: &Constants<T>, e2: &M3<T>) -> M3<T> {
    let pressure = c.lambda * T::of(0.5) * trace(e2);
    let mut s = scaled(e2, c.mu);
    for i in 0..3 {
        s[i][i] = s[i][i] + pressure;
    }
    s
}

/// `δP = µδF + λ̂(cof F : δF) cof F + (λ̂(J − 1) − µ) δ(cof F)`.
impl LaneTangent for StableNeoHookean {
    #[inline(always)]
    fn differential<T: Real>(c: &Constants<T>, h: &M3<T>, df: &M3<T>) -> (M3<T>, T) {
        let lambda_hat = c.lambda + c.mu;
        let (cof_f, volume_change) = cofactor_and_volume_change(h);
        let pressure = lambda_hat * volume_change - c.mu;
        (plus(&scaled(df, c.mu), &volumetric(lambda_hat, pressure, h, &cof_f, df)), T::of(1.0))
    }
    fn differential_outside(_: &Constants<f64>, _: &DMat3, _: &DMat3) -> DMat3 {
        DMat3::NAN
    }
}

/// `δP = 2µ(δF − δR) + λ(cof F : δF) cof F + λ(J − 1) δ(cof F)`.
///
/// `δR = R [ω]×` with `B ω = axl(RᵀδF − δFᵀR)`, `B = tr(S) I − S`, `S = RᵀF`; `det B = (σ₁+σ₂)(σ₂+σ₃)(σ₁+σ₃) = ½q`, which is
/// bounded from below in the law's domain.
impl LaneTangent for FixedCorotated {
    #[inline(always)]
    fn differential<T: Real>(c: &Constants<T>, h: &M3<T>, df: &M3<T>) -> (M3<T>, T) {
        let (cof_f, volume_change) = cofactor_and_volume_change(h);
        let Rotation { r, f, q, domain } = Rotation::of(&twice_green_strain(h), &cof_f, volume_change, h);
        // S = I + g
        let g = stretch(&r, &f);
        let spread = T::of(2.0) + trace(&g);
        let mut b = scaled(&g, T::of(-1.0));
        for i in 0..3 {
            b[i][i] = b[i][i] + spread;
        }
        let inverse = cofactor(&b);
        let axial = |i: usize, j: usize| column_dot(&r, i, df, j) - column_dot(&r, j, df, i);
        let a = [axial(2, 1), axial(0, 2), axial(1, 0)];
        let scale = T::of(2.0) / q;
        let mut w = a;
        for i in 0..3 {
            w[i] = scale * (inverse[i][0] * a[0] + inverse[i][1] * a[1] + inverse[i][2] * a[2]);
        }
        let two_mu = T::of(2.0) * c.mu;
        let mut p = volumetric(c.lambda, c.lambda * volume_change, h, &cof_f, df);
        for i in 0..3 {
            // Row i of R [ω]×.
            let turned =
                [r[i][1] * w[2] - r[i][2] * w[1], r[i][2] * w[0] - r[i][0] * w[2], r[i][0] * w[1] - r[i][1] * w[0]];
            for j in 0..3 {
                p[i][j] = p[i][j] + two_mu * (df[i][j] - turned[j]);
            }
        }
        (p, domain)
    }
    fn differential_outside(c: &Constants<f64>, f: &DMat3, df: &DMat3) -> DMat3 {
        fixed_corotated::piola_differential(Lame { lambda_pa: c.lambda, mu_pa: c.mu }, f, df)
    }
}

#[inline(always)]
fn cofactor_and_volume_change<T: Real>(h: &M3<T>) -> (M3<T>, T) {
    let cof_h = cofactor(h);
    (cofactor_of_sum(h, &cof_h, trace(h)), volume_change(h, &cof_h))
}

/// `a (cof F : δF) cof F + b δ(cof F)`, with `δ(cof F) = tr(δF) I − δFᵀ + δ(cof H)`.
#[inline(always)]
fn volumetric<T: Real>(a: T, b: T, h: &M3<T>, cof_f: &M3<T>, df: &M3<T>) -> M3<T> {
    let (rate, tr) = (a * contract(cof_f, df), trace(df));
    let mut sum = cofactor_rate(h, df);
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

/// `δ(cof A)` for a change `δA`.
#[inline(always)]
fn cofactor_rate<T: Real>(a: &M3<T>, da: &M3<T>) -> M3<T> {
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
