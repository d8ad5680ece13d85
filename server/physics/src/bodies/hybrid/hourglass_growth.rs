//! How hourglasses stiffen with their amplitude.
//!
//! Hourglasses of constant stiffness let the surface tear open under a tool: the cells hardly see it. So the energy of a
//! cell's amplitudes, `½ κ Q` with `Q = Σ_k w_k |q_k|²` (`hybrid::cell`), grows faster than `Q`, and beyond an amplitude of
//! 0.4 edges faster still. With `G = β Q/h²`,
//! ```text
//! U = ½ κ Q ε(G)      ε = 1 + ½ G + ½ c b²/G      b = max(0, G − G₀)
//! ∂U/∂Q = ½ κ φ(G)    φ = d(G ε)/dG = 1 + G + c b
//! ```
//! `φ` has no jump, so forces have none. The functions work on numbers and on lanes alike.
// A vector type is only fast where it is inlined into a function compiled for its instruction set.
#![allow(clippy::inline_always)]
use crate::lanes::real::Real;

/// `β`, how fast hourglasses stiffen with their amplitude.
pub(crate) const GROWTH: f64 = 20.0;
/// `G₀`, where they come to stiffen faster: `|q| = 0.4 h` in one of the first three modes.
const FASTER_BEYOND: f64 = 3.2;
/// `c`.
const FASTER: f64 = 3.0;

/// Returns `φ`, by which forces are larger than those of constant stiffness.
#[inline(always)]
pub(crate) fn force_factor<T: Real>(g: T) -> T {
    T::of(1.0) + g + T::of(FASTER) * beyond(g)
}

/// Returns `dφ/dG`.
pub(super) fn slope(g: f64) -> f64 {
    if g > FASTER_BEYOND { 1.0 + FASTER } else { 1.0 }
}

/// Returns `ε`, by which the energy is larger than that of constant stiffness.
#[inline(always)]
pub(crate) fn energy_factor<T: Real>(g: T) -> T {
    let b = beyond(g);
    // G > G₀ > 1 wherever b is not zero, and it may be zero elsewhere.
    T::of(1.0) + T::of(0.5) * g + T::of(0.5 * FASTER) * b * b / g.max(T::of(1.0))
}

#[inline(always)]
fn beyond<T: Real>(g: T) -> T {
    (g - T::of(FASTER_BEYOND)).max(T::of(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_is_the_energys_derivative_and_has_no_jump() {
        for g in [0.0, 0.3, 1.0, 3.1, 3.3, 8.0, 60.0] {
            let step = 1e-6 * (1.0 + g);
            let energy = |g: f64| g * energy_factor(g);
            let difference = (energy(g + step) - energy(g - step)) / (2.0 * step);
            assert!((difference - force_factor(g)).abs() < 1e-7 * force_factor(g), "{g}: {difference}");
            let difference = (force_factor(g + step) - force_factor(g - step)) / (2.0 * step);
            assert!((difference - slope(g)).abs() < 1e-7, "{g}: {difference}");
        }
        let jump = force_factor(FASTER_BEYOND + 1e-12) - force_factor(FASTER_BEYOND - 1e-12);
        assert!(jump.abs() < 1e-10);
    }
}
