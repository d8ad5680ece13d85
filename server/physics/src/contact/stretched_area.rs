//! How the foundation counts the area of a triangle that is stretched.
//!
//! A foundation whose stiffness belonged to the area at rest would give way under the middle of a tool that is pressed
//! deep: the surface stretches there, as much force is spread over more and more of it, the tool sinks in and stretches
//! it further, and past some depth the axial force falls. So the foundation's energy density belongs to the current area
//! where this is larger than at rest. With the area ratio `r = A/A₀` of a triangle,
//! ```text
//! Φ = φ(r) W        W = Σ_s k_f a_s E(g_s)        (E: [`super::depth`])
//! φ = 1                          r ≤ 1
//!     1 + (r − 1)²/2δ            1 < r < 1 + δ
//!     r − δ/2                    r ≥ 1 + δ
//! f_i = −φ ∂W/∂x_i − φ' W/A₀ ∂A/∂x_i        ∂A/∂x_i = ½ N̂ × e_i
//! ```
//! with the unit normal `N̂` and the edge `e_i` opposite to corner i, from the next corner to the one after. The second
//! part is a tension in the pressed surface; it has no resultant and no moment. `φ` has no kink, so forces are continuous,
//! and small strains leave the foundation as it is.
//!
//! With `n = a × b + b × c + c × a`, `A = ½ |n|` and `∂n/∂x_i = [e_i]×`,
//! ```text
//! ∂²A/∂x_i∂x_j = ½ ([e_i]×ᵀ (I − N̂N̂ᵀ) [e_j]×/|n| − s_ij [N̂]×)        s_ab = s_bc = s_ca = 1, s_ij = −s_ji
//! ```
use crate::linalg::tensor::outer;
use glam::{DMat3, DVec3};

/// `δ`, over which the area comes to count.
const BLEND: f64 = 0.5;

/// `φ` of an area ratio and its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AreaFactor {
    /// `φ`.
    pub(super) factor: f64,
    /// `dφ/dr`.
    pub(super) slope: f64,
    /// `d²φ/dr²`.
    pub(super) curvature: f64,
}

impl AreaFactor {
    /// Of a triangle at rest.
    pub(super) const AT_REST: Self = Self { factor: 1.0, slope: 0.0, curvature: 0.0 };

    /// Returns those of an area ratio `r`.
    pub(super) fn of(ratio: f64) -> Self {
        let beyond = ratio - 1.0;
        if beyond <= 0.0 {
            Self::AT_REST
        } else if beyond < BLEND {
            Self { factor: 1.0 + 0.5 * beyond * beyond / BLEND, slope: beyond / BLEND, curvature: 1.0 / BLEND }
        } else {
            Self { factor: ratio - 0.5 * BLEND, slope: 1.0, curvature: 0.0 }
        }
    }
}

/// Returns `∂A/∂x_i` (m) of the corners; the triangle has the unit normal `N̂`.
pub(super) fn area_gradients_m([a, b, c]: [DVec3; 3], normal: DVec3) -> [DVec3; 3] {
    [c - b, a - c, b - a].map(|edge| normal.cross(edge) * 0.5)
}

/// How the area of a triangle counts, and how it changes with the corners.
#[derive(Debug, Clone, Copy)]
pub(super) struct TriangleArea {
    /// `φ` and its derivatives.
    pub(super) factor: AreaFactor,
    /// `∂r/∂x_i` (1/m) of the corners.
    pub(super) gradients_per_m: [DVec3; 3],
    /// `e_i` (m).
    edges_m: [DVec3; 3],
    normal: DVec3,
    doubled_m2: f64,
    rest_m2: f64,
}

impl TriangleArea {
    /// Returns that of a triangle whose area was `rest_m2` (m²) at rest. One without area has no direction in which it
    /// grows.
    pub(super) fn of(corners: [DVec3; 3], rest_m2: f64) -> Self {
        let [a, b, c] = corners;
        let doubled = (b - a).cross(c - a);
        let doubled_m2 = doubled.length();
        let normal = doubled / doubled_m2.max(f64::MIN_POSITIVE);
        Self {
            factor: AreaFactor::of(0.5 * doubled_m2 / rest_m2),
            gradients_per_m: area_gradients_m(corners, normal).map(|gradient_m| gradient_m / rest_m2),
            edges_m: [c - b, a - c, b - a],
            normal,
            doubled_m2,
            rest_m2,
        }
    }

    /// Returns `∂²r/∂x_i∂x_j` (1/m²) of two corners, `i ≤ j`; only its part that is never negative where `definite`.
    pub(super) fn hessian_per_m2(&self, i: usize, j: usize, definite: bool) -> DMat3 {
        let across = DMat3::IDENTITY - outer(self.normal, self.normal);
        let gram = cross_matrix(self.edges_m[i]).transpose() * across * cross_matrix(self.edges_m[j]);
        let mut hessian = gram * (1.0 / self.doubled_m2.max(f64::MIN_POSITIVE));
        if !definite && i != j {
            let sign = if (i, j) == (0, 2) { -1.0 } else { 1.0 };
            hessian -= cross_matrix(self.normal) * sign;
        }
        hessian * (0.5 / self.rest_m2)
    }
}

/// Returns `[a]×`, with `[a]× b = a × b`.
fn cross_matrix(a: DVec3) -> DMat3 {
    DMat3::from_cols(a.cross(DVec3::X), a.cross(DVec3::Y), a.cross(DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_factor_is_one_at_rest_and_has_no_kink() {
        for ratio in [0.2, 0.999, 1.0, 1.001, 1.2, 1.499, 1.5, 1.501, 4.0] {
            let step = 1e-6;
            let (low, here, high) = (AreaFactor::of(ratio - step), AreaFactor::of(ratio), AreaFactor::of(ratio + step));
            assert!(((high.factor - low.factor) / (2.0 * step) - here.slope).abs() < 2e-6, "{ratio}");
            assert!(high.slope >= low.slope && here.factor >= 1.0 && here.factor <= ratio.max(1.0), "{ratio}");
        }
        assert_eq!(AreaFactor::of(1.0), AreaFactor::AT_REST);
    }

    proptest! {
        #[test]
        fn derivatives_of_the_area_are_those_of_differences(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0..1.0_f64)),
            change in prop::array::uniform3(prop::array::uniform3(-1.0..1.0_f64)),
        ) {
            let (corners, change) = (corners.map(DVec3::from), change.map(DVec3::from));
            let rest_m2 = 0.7;
            let at = |s: f64| TriangleArea::of(std::array::from_fn(|i| corners[i] + change[i] * s), rest_m2);
            prop_assume!(at(0.0).doubled_m2 > 0.1);
            let (step, here) = (1e-5, at(0.0));
            let slope = (at(step).doubled_m2 - at(-step).doubled_m2) / (4.0 * step * rest_m2);
            let along: f64 = here.gradients_per_m.iter().zip(change).map(|(g, d)| g.dot(d)).sum();
            prop_assert!((slope - along).abs() < 1e-6 * (1.0 + slope.abs()), "{slope} {along}");
            for i in 0..3 {
                let slope = (at(step).gradients_per_m[i] - at(-step).gradients_per_m[i]) / (2.0 * step);
                let along: DVec3 = (0..3).map(|j| {
                    let block = here.hessian_per_m2(i.min(j), i.max(j), false);
                    if i <= j { block * change[j] } else { block.transpose() * change[j] }
                }).sum();
                prop_assert!(slope.distance(along) < 1e-5 * (1.0 + slope.length()), "{slope} {along}");
            }
        }
    }
}
