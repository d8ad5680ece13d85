//! The change of volume, projected on linear functions in each element: what keeps nearly incompressible bodies from locking.
//!
//! `θ = J − 1`; Πθ is its L2 projection on `span{1, X, Y, Z}` of the element at rest. The energy is
//! `U = Σ_q w_q [Ψ(F_q) − ½κ θ_q²] + ½κ Σ_q w_q (Πθ)_q²`, with κ = λ: what is left of the law where Πθ = 0 is `µ|ε|²` at small
//! strain, which is positive. This is the mixed element of triquadratic displacements and linear discontinuous pressure (Q2/P1), its
//! pressure eliminated, which is stable and of full order at any ν; `θ − Πθ` falls as h², so the limit is the law's. With functions
//! `p_k` that are orthonormal over the element, `Πθ = Σ_k c_k p_k`, `c_k = Σ_q w_q p_k θ_q`, and `½κ ∫(Πθ)² = ½κ Σ_k c_k²`.
use glam::{DMat3, DVec3};
use palpate_physics::material::{Law, Material};

/// Quadrature points of an element.
pub(super) const POINTS: usize = 27;
/// Linear functions of an element.
pub(super) const MODES: usize = 4;

/// κ (Pa). None for St. Venant-Kirchhoff: Newton's method did not bear a sphere on it at any penalty, perhaps because the law softens in
/// compression, where what is left of it would lose its sign.
pub(super) fn modulus_pa(material: &Material) -> f64 {
    match material.law {
        Law::StVenantKirchhoff => 0.0,
        _ => material.lame.lambda_pa,
    }
}

/// Values at the points of `1, X, Y, Z`, made orthonormal over the element (Gram and Schmidt).
pub(super) fn modes(at_m: &[DVec3; POINTS], weights_m3: &[f64; POINTS]) -> [[f64; MODES]; POINTS] {
    let volume: f64 = weights_m3.iter().sum();
    let centre = at_m.iter().zip(weights_m3).map(|(at, w)| *at * w).sum::<DVec3>() / volume;
    let product = |a: &[f64; POINTS], b: &[f64; POINTS]| (0..POINTS).map(|q| weights_m3[q] * a[q] * b[q]).sum::<f64>();
    let mut orthonormal: Vec<[f64; POINTS]> = Vec::with_capacity(MODES);
    for mode in 0..MODES {
        let mut values: [f64; POINTS] =
            std::array::from_fn(|q| if mode == 0 { 1.0 } else { (at_m[q] - centre)[mode - 1] });
        // Twice: once leaves rounding behind in flat elements.
        for earlier in orthonormal.iter().chain(&orthonormal) {
            let share = product(&values, earlier);
            values.iter_mut().zip(earlier).for_each(|(v, e)| *v -= share * e);
        }
        let norm = product(&values, &values).sqrt();
        orthonormal.push(values.map(|v| v / norm));
    }
    std::array::from_fn(|q| std::array::from_fn(|mode| orthonormal[mode][q]))
}

/// An element's change of volume.
pub(super) struct Volume {
    /// `½κ Σ_q w_q [(Πθ)² − θ²]` (J).
    pub(super) energy_j: f64,
    /// `κ(Πθ − θ)` (Pa) at the points: what is added to the law's pressure.
    pub(super) extra_pa: [f64; POINTS],
}

impl Volume {
    pub(super) fn of(
        f: &[DMat3; POINTS],
        weights_m3: &[f64; POINTS],
        modes: &[[f64; MODES]; POINTS],
        modulus_pa: f64,
    ) -> Self {
        let change = f.map(|f| f.determinant() - 1.0);
        let mut shares = [0.0; MODES];
        for q in 0..POINTS {
            for (share, mode) in shares.iter_mut().zip(modes[q]) {
                *share += weights_m3[q] * mode * change[q];
            }
        }
        let projected = |q: usize| modes[q].iter().zip(shares).map(|(mode, share)| mode * share).sum::<f64>();
        let lost: f64 = (0..POINTS).map(|q| weights_m3[q] * change[q] * change[q]).sum();
        Self {
            energy_j: 0.5 * modulus_pa * (shares.iter().map(|c| c * c).sum::<f64>() - lost),
            extra_pa: std::array::from_fn(|q| modulus_pa * (projected(q) - change[q])),
        }
    }
}
