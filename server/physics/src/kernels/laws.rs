//! Stress of one lane from its displacement gradient `H = F − I`.
//!
//! Written in `H`, every law is accurate relative to the strain however small it is: `F` in f32 knows strain to 1e-7 at
//! best, `H` keeps seven digits of it. They work on numbers and on vectors of numbers alike (`real.rs`), so they have no branches.
use crate::lanes::real::{Real, Scalar};
use crate::material::{Material, fixed_corotated};
use glam::DMat3;

/// A 3×3 matrix, `m[row][column]`.
pub(crate) type M3<T> = [[T; 3]; 3];

/// A material's constants in the kernel's precision.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Constants<T> {
    pub(crate) lambda: T,
    pub(crate) mu: T,
    pub(crate) phi: T,
    pub(crate) two_psi: T,
}

impl<T: Scalar> Constants<T> {
    pub(crate) fn of(material: &Material) -> Self {
        Self {
            lambda: T::of(material.lame.lambda_pa),
            mu: T::of(material.lame.mu_pa),
            phi: T::of(material.viscosity.phi_pa_s),
            two_psi: T::of(2.0 * material.viscosity.psi_pa_s),
        }
    }

    /// The same in every lane of `V`, or in f64 (both exact).
    #[inline(always)]
    pub(crate) fn converted<V: Real>(&self) -> Constants<V> {
        Constants {
            lambda: V::of(self.lambda.into()),
            mu: V::of(self.mu.into()),
            phi: V::of(self.phi.into()),
            two_psi: V::of(self.two_psi.into()),
        }
    }
}

/// First Piola-Kirchhoff stress of a law, lane by lane.
pub(crate) trait LaneLaw {
    /// `P(I + H)` (Pa), and a number that is below [`Self::DOMAIN`] where the result is not to be used.
    fn piola<T: Real>(c: &Constants<T>, h: &M3<T>) -> (M3<T>, T);
    /// See [`Self::piola`]; `None` where the law has no such place.
    const DOMAIN: Option<f64>;
    /// `P` in f64, for lanes outside the domain.
    fn piola_outside(c: &Constants<f64>, f: &DMat3) -> DMat3;
}

/// `P = F S`, `S = λ tr(E) I + 2µE`, `2E = H + Hᵀ + HᵀH`.
pub(crate) struct StVenantKirchhoff;

impl LaneLaw for StVenantKirchhoff {
    const DOMAIN: Option<f64> = None;
    #[inline(always)]
    fn piola<T: Real>(c: &Constants<T>, h: &M3<T>) -> (M3<T>, T) {
        let e2 = twice_green_strain(h);
        let pressure = c.lambda * T::of(0.5) * trace(&e2);
        let mut s = scaled(&e2, c.mu);
        for i in 0..3 {
            s[i][i] = s[i][i] + pressure;
        }
        (plus(&s, &product(h, &s)), T::of(1.0))
    }
    fn piola_outside(_: &Constants<f64>, _: &DMat3) -> DMat3 {
        DMat3::NAN
    }
}

/// `P = µ(F − cof F) + λ̂(J − 1) cof F`, `λ̂ = λ + µ`, with `F − cof F = H + Hᵀ − tr(H) I − cof H`.
pub(crate) struct StableNeoHookean;

impl LaneLaw for StableNeoHookean {
    const DOMAIN: Option<f64> = None;
    #[inline(always)]
    fn piola<T: Real>(c: &Constants<T>, h: &M3<T>) -> (M3<T>, T) {
        let cof_h = cofactor(h);
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
        (p, T::of(1.0))
    }
    fn piola_outside(_: &Constants<f64>, _: &DMat3) -> DMat3 {
        DMat3::NAN
    }
}

/// `P = 2µ(F − R) + λ(J − 1) cof F`.
///
/// `t = tr(RᵀF) = σ₁ + σ₂ + σ₃` is the largest root of
/// `p(t) = t⁴ − 2I t² − 8J t + 2|C|² − I²`, with `C = FᵀF`, `I = tr C` (the characteristic polynomial of Davenport's matrix, whose
/// roots are all real), and since `R = ∂t/∂F`, differentiating `p(t(F), F) = 0` gives it in closed form:
/// `R = ((t² + I) F + 2t cof F − 2FC)/q`, `q = t³ − I t − 2J = 2(σ₁+σ₂)(σ₂+σ₃)(σ₁+σ₃)`.
/// Halley's iteration falls monotonically onto the largest root from `√(3I) ≥ t`.
///
/// `F − R = R G`, `G = √C − I`, and from `(I + G)² = I + 2E`: `G = E − ½G²`. A first `G₀ = sym(RᵀF) − I`, which knows strain
/// only to the rounding of `R`, put into the right side, gives it relative to itself.
///
/// The domain is `q ≥ 0.2 max(t³, 1)` (16 against 5.4 at rest, 1 against 0.68 for σ = (1, 1, −½)): outside, `R` is close to
/// ambiguous or the tet nearly gone.
pub(crate) struct FixedCorotated;

impl LaneLaw for FixedCorotated {
    const DOMAIN: Option<f64> = Some(0.2);
    #[inline(always)]
    fn piola<T: Real>(c: &Constants<T>, h: &M3<T>) -> (M3<T>, T) {
        let cof_h = cofactor(h);
        let volume_change = volume_change(h, &cof_h);
        let cof_f = cofactor_of_sum(h, &cof_h, trace(h));
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
        (p, domain)
    }
    fn piola_outside(c: &Constants<f64>, f: &DMat3) -> DMat3 {
        fixed_corotated::piola(crate::material::Lame { lambda_pa: c.lambda, mu_pa: c.mu }, f)
    }
}

/// The rotation nearest to `F`, as [`FixedCorotated`] finds it.
pub(crate) struct Rotation<T> {
    /// `R`.
    pub(crate) r: M3<T>,
    /// `F`.
    pub(crate) f: M3<T>,
    /// `(σ₁+σ₂)(σ₂+σ₃)(σ₁+σ₃)`, doubled.
    pub(crate) q: T,
    /// What the law's domain bounds from below.
    pub(crate) domain: T,
}

impl<T: Real> Rotation<T> {
    /// From `2E`, `cof F`, `J − 1` and `H`.
    #[inline(always)]
    pub(crate) fn of(e2: &M3<T>, cof_f: &M3<T>, volume_change: T, h: &M3<T>) -> Self {
        let one = T::of(1.0);
        let two = T::of(2.0);
        let (f, cg) = (plus_identity(h), plus_identity(e2));
        let i1 = T::of(3.0) + trace(e2);
        let j = one + volume_change;
        let constant = two * contract(&cg, &cg) - i1 * i1;
        let mut t = (T::of(3.0) * i1).sqrt();
        for _ in 0..T::ROTATION_STEPS {
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

/// Viscous stress `P_v = F S_v` (Pa) and the power density `S_v : Ė` (W/m³), from `H` and its rate `Ḣ = Ḟ`:
/// `S_v = φ tr(Ė) I + 2ψĖ`, `Ė = sym(Ḟᵀ F)`.
#[inline(always)]
pub(crate) fn viscous<T: Real>(c: &Constants<T>, h: &M3<T>, h_dot: &M3<T>) -> (M3<T>, T) {
    let mut e_dot = [[T::of(0.0); 3]; 3];
    for i in 0..3 {
        for j in i..3 {
            let a = h_dot[j][i] + h_dot[i][j];
            let ab = column_dot(h_dot, i, h, j) + column_dot(h_dot, j, h, i);
            e_dot[i][j] = T::of(0.5) * (a + ab);
            e_dot[j][i] = e_dot[i][j];
        }
    }
    let mut s = scaled(&e_dot, c.two_psi);
    let volumetric = c.phi * trace(&e_dot);
    for i in 0..3 {
        s[i][i] = s[i][i] + volumetric;
    }
    (plus(&s, &product(h, &s)), contract(&s, &e_dot))
}

/// `H + Hᵀ + HᵀH`.
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

/// `sym(RᵀF) − I`.
#[inline(always)]
pub(crate) fn stretch<T: Real>(r: &M3<T>, f: &M3<T>) -> M3<T> {
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

/// `GG` of a symmetric `G`.
#[inline(always)]
fn symmetric_square<T: Real>(g: &M3<T>) -> M3<T> {
    let mut square = *g;
    for i in 0..3 {
        for j in i..3 {
            square[i][j] = column_dot(g, i, g, j);
        }
    }
    for i in 0..3 {
        for j in 0..i {
            square[i][j] = square[j][i];
        }
    }
    square
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

#[inline(always)]
pub(crate) fn cofactor<T: Real>(a: &M3<T>) -> M3<T> {
    [
        [minor(a, [1, 2], [1, 2]), minor(a, [1, 2], [2, 0]), minor(a, [1, 2], [0, 1])],
        [minor(a, [2, 0], [1, 2]), minor(a, [2, 0], [2, 0]), minor(a, [2, 0], [0, 1])],
        [minor(a, [0, 1], [1, 2]), minor(a, [0, 1], [2, 0]), minor(a, [0, 1], [0, 1])],
    ]
}

/// `a_ij a_kl − a_il a_kj` for rows `i, k` and columns `j, l`.
#[inline(always)]
pub(crate) fn minor<T: Real>(a: &M3<T>, [i, k]: [usize; 2], [j, l]: [usize; 2]) -> T {
    a[i][j] * a[k][l] - a[i][l] * a[k][j]
}

#[inline(always)]
pub(crate) fn plus_identity<T: Real>(a: &M3<T>) -> M3<T> {
    let mut sum = *a;
    for i in 0..3 {
        sum[i][i] = sum[i][i] + T::of(1.0);
    }
    sum
}

#[inline(always)]
pub(crate) fn trace<T: Real>(a: &M3<T>) -> T {
    a[0][0] + a[1][1] + a[2][2]
}

/// `A:B`.
#[inline(always)]
pub(crate) fn contract<T: Real>(a: &M3<T>, b: &M3<T>) -> T {
    let mut sum = T::of(0.0);
    for i in 0..3 {
        sum = sum + (a[i][0] * b[i][0] + a[i][1] * b[i][1] + a[i][2] * b[i][2]);
    }
    sum
}

/// `(AᵀB)_ij`.
#[inline(always)]
pub(crate) fn column_dot<T: Real>(a: &M3<T>, i: usize, b: &M3<T>, j: usize) -> T {
    a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j]
}

#[inline(always)]
pub(crate) fn scaled<T: Real>(a: &M3<T>, s: T) -> M3<T> {
    let mut product = *a;
    for i in 0..3 {
        for j in 0..3 {
            product[i][j] = a[i][j] * s;
        }
    }
    product
}

#[inline(always)]
pub(crate) fn plus<T: Real>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    let mut sum = *a;
    for i in 0..3 {
        for j in 0..3 {
            sum[i][j] = a[i][j] + b[i][j];
        }
    }
    sum
}

#[inline(always)]
pub(crate) fn product<T: Real>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    let mut ab = *a;
    for i in 0..3 {
        for j in 0..3 {
            ab[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
        }
    }
    ab
}

/// As glam's columns.
pub(crate) fn columns(a: &M3<f64>) -> DMat3 {
    DMat3::from_cols_array_2d(a).transpose()
}

/// And back.
pub(crate) fn rows(a: &DMat3) -> M3<f64> {
    a.transpose().to_cols_array_2d()
}
