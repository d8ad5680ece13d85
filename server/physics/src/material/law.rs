//! What a constitutive law is: the trait that each file of a law implements once.
use super::{Lame, constants::Constants, lane_matrix::M3};
use crate::lanes::real::{Real, Scalar};
use glam::DMat3;

/// An isotropic hyperelastic law, twice: in f64, easy to believe, and in lanes, fast. Tests compare the two.
///
/// A law is linear in λ and µ, and small strain sees exactly these: `δP = λ tr(δF) I + µ(δF + δFᵀ)` at `F = I`.
///
/// The functions in lanes are given the displacement gradient `H = F − I`. Written in `H`, a law is accurate relative
/// to the strain however small it is: `F` in f32 knows strain to 1e-7 at best, `H` keeps seven digits of it. They work
/// on numbers and on vectors of numbers alike (`lanes::real`), so they have no branches, and they are
/// `#[inline(always)]`, because a vector type is only fast where it is inlined into a function compiled for its
/// instruction set.
pub(crate) trait ConstitutiveLaw {
    /// The name that a scene file gives the law.
    const NAME: &'static str;
    /// One sentence for the user who chooses a law.
    const DESCRIPTION: &'static str;

    /// Energy density `Ψ(F)` (J/m³), zero at `F = I`.
    fn energy_density(lame: Lame, f: &DMat3) -> f64;
    /// First Piola-Kirchhoff stress `P = ∂Ψ/∂F` (Pa).
    fn piola(lame: Lame, f: &DMat3) -> DMat3;
    /// Differential `δP = ∂P/∂F : δF` (Pa).
    fn piola_differential(lame: Lame, f: &DMat3, df: &DMat3) -> DMat3;
    /// The largest P-wave modulus `n·(δP N)` (Pa), `δF = n Nᵀ` with unit `n` and `N`, where no principal stretch
    /// exceeds `s ≥ 1`, of which the square is given; λ is not negative here.
    fn stretched_modulus_pa(lame: Lame, stretch_sq: f64) -> f64;

    /// The principal stretch below which it bears less the more it is compressed; `None` where a law bears more with more
    /// compression.
    const WEAKENS_BELOW: Option<f64> = None;
    /// Where [`LaneStress::domain`] is below this, the lane is computed once more in f64; `None` where a law in lanes
    /// is good for every `F`.
    const DOMAIN: Option<f64> = None;
    /// `P(I + H)` (Pa).
    fn lane_piola<T: Real>(c: &Constants<T>, h: &M3<T>) -> LaneStress<T>;
    /// `δP(I + H; δF)` (Pa).
    fn lane_piola_differential<T: Real>(c: &Constants<T>, h: &M3<T>, df: &M3<T>) -> LaneStress<T>;
}

/// A stress or its differential, in lanes.
pub(crate) struct LaneStress<T> {
    /// The stress (Pa).
    pub(crate) p: M3<T>,
    /// A number that is below [`ConstitutiveLaw::DOMAIN`], or NaN, where the stress is not to be used.
    pub(crate) domain: T,
}

impl<T: Real> LaneStress<T> {
    /// A stress that is good for every `F`.
    #[inline(always)]
    pub(crate) fn everywhere(p: M3<T>) -> Self {
        Self { p, domain: T::of(1.0) }
    }
}

/// Whether any lane is outside the domain of law `L`, if it has one. NaN is outside.
#[inline(always)]
pub(crate) fn any_outside<L: ConstitutiveLaw, T: Scalar, const N: usize>(domain: &[T; N]) -> bool {
    let Some(limit) = L::DOMAIN.map(T::of) else { return false };
    // Counted without an early exit: this is a vector loop.
    domain.iter().map(|&domain| u32::from(domain >= limit)).sum::<u32>() < N as u32
}
