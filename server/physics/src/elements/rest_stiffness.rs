//! The largest natural frequency of a discrete body, which bounds the step of explicit integration: `dt < 2/ω_max`.
//!
//! `K φ = ω² M φ` with lumped `M`, on the free degrees of freedom, is the symmetric problem `A y = ω² y` with
//! `A = M^{-½} K M^{-½}`. Lanczos' three-term recurrence builds the tridiagonal `T_m`; its largest eigenvalue θ
//! approaches ω²_max from below, the last component `s` of its eigenvector gives the residual `r = β_m |s|`, and an
//! eigenvalue of `A` lies within `r` of θ (Parlett 1998, §13.2). No reorthogonalisation: rounding only makes copies of
//! converged eigenvalues, and the largest one is all that is asked for.
//!
//! `K` is applied point by point of integration, with the linear elasticity that every law shares at rest:
//! `f_i = −V σ b_i`, `σ = λ tr(G) I + µ(G + Gᵀ)`, `G = Σ_j a_j b_jᵀ`.
use super::integration_points::{IntegrationPoint, IntegrationPoints};
use crate::linalg::lanczos::lanczos;
use crate::linalg::lanczos::telling;
use crate::linalg::tensor::largest_eigenvalue;
use crate::{
    linalg::tensor::{outer, trace},
    material::Lame,
};
use glam::{DMat3, DVec3};

/// `K` of a body at rest, and the springs that hold its nodes from outside, applied without being assembled.
#[derive(Debug, Clone, Copy)]
pub struct RestStiffness<'a> {
    /// The body.
    pub points: &'a IntegrationPoints,
    /// `k_i ≥ 0` (N/m, in all directions), one per node, or none: `K + diag(k_i)`.
    pub springs_n_per_m: &'a [f64],
}

/// ω_max (rad/s) of `K φ = ω² M φ` at rest, on the free degrees of freedom (`inverse_mass_per_kg` is zero on fixed
/// ones); zero if none is free.
///
/// A safe estimate: `√(θ + r)`, the upper end of the interval that holds the eigenvalue found, but never more than the
/// provable `√(ω_e² + max k_i/m_i)` with ω_e of [`element_bound_rad_per_s`]. With `r ≤ 1e-4 θ` it exceeds that
/// eigenfrequency by at most 1e-4. What remains is the chance that the pseudo-random start vector misses the top of the
/// spectrum; `Settings::step_safety` is there for it.
pub fn max_natural_frequency_rad_per_s(stiffness: &RestStiffness<'_>, inverse_mass_per_kg: &[DVec3]) -> f64 {
    max_natural_frequency_with(stiffness, inverse_mass_per_kg, &mut |_| {})
}

/// The same; `progress` is told the part done.
pub(crate) fn max_natural_frequency_with(
    stiffness: &RestStiffness<'_>,
    inverse_mass_per_kg: &[DVec3],
    progress: &mut dyn FnMut(f64),
) -> f64 {
    let root_inverse_mass: Vec<DVec3> = inverse_mass_per_kg.iter().map(|m| m.map(f64::sqrt)).collect();
    let mut apply = telling(progress, |a, out| stiffness.apply(a, out));
    let (theta, residual) = lanczos(&mut apply, &root_inverse_mass);
    let bound = element_bound_rad_per_s(stiffness, inverse_mass_per_kg);
    let springs = stiffness.springs_n_per_m.iter().zip(inverse_mass_per_kg);
    let spring_bound_sq = springs.map(|(k, inverse_mass)| k * inverse_mass.max_element()).fold(0.0, f64::max);
    (theta + residual).min(bound * bound + spring_bound_sq).sqrt()
}

/// `√(Σ_layers max_q ω_q²) ≥ ω_max` (rad/s): the frequency bound of single points of integration, each with its part
/// `m_i V_q/Σ_{p∋i} V_p` of its nodes' masses (Irons & Treharne 1971: by Rayleigh's quotient no assembly of elements is
/// faster than the fastest of them). Layers that each fill the body share its masses, so their quotients add up.
///
/// Per point `aᵀK_q a = V(λ tr²G + ½µ|G + Gᵀ|²) ≤ V(3λ⁺ + 2µ)|G|²` and `|G|² ≤ λ_max(Σ_i b_i b_iᵀ/m_i) aᵀM_q a`.
///
/// The springs are left out.
pub fn element_bound_rad_per_s(stiffness: &RestStiffness<'_>, inverse_mass_per_kg: &[DVec3]) -> f64 {
    stiffness.points.layers().map(|layer| layer_bound_sq(layer, inverse_mass_per_kg)).sum::<f64>().sqrt()
}

/// `max_q ω_q²` over the points of a layer.
fn layer_bound_sq<'a>(layer: impl Iterator<Item = IntegrationPoint<'a>> + Clone, inverse_mass_per_kg: &[DVec3]) -> f64 {
    let mut volume_of_node = vec![0.0; inverse_mass_per_kg.len()];
    for point in layer.clone() {
        for &node in point.nodes {
            volume_of_node[node as usize] += point.volume_m3;
        }
    }
    let omega_sq = |point: IntegrationPoint<'_>| {
        let Lame { lambda_pa, mu_pa } = point.material.lame;
        let gram = point.nodes.iter().zip(point.gradients_per_m).fold(DMat3::ZERO, |sum, (&node, b)| {
            let part = point.volume_m3 / volume_of_node[node as usize];
            sum + outer(*b, *b) * (inverse_mass_per_kg[node as usize].max_element() / part)
        });
        let modulus = 3.0 * lambda_pa.max(0.0) + 2.0 * mu_pa;
        point.volume_m3 * modulus * largest_eigenvalue(&gram)
    };
    layer.map(omega_sq).fold(0.0, f64::max)
}

impl RestStiffness<'_> {
    /// `out ← K a`.
    fn apply(&self, a: &[DVec3], out: &mut [DVec3]) {
        out.fill(DVec3::ZERO);
        for point in self.points.iter() {
            let Lame { lambda_pa, mu_pa } = point.material.lame;
            let g = point.gradient_of(a);
            let sigma = (g + g.transpose()) * mu_pa + DMat3::from_diagonal(DVec3::splat(lambda_pa * trace(&g)));
            point.add_forces_n(&-sigma, out);
        }
        for ((out, a), spring) in out.iter_mut().zip(a).zip(self.springs_n_per_m) {
            *out += *a * *spring;
        }
    }
}

/// `D_i = Σ_{q∋i} −∂f_i/∂x_i` (N/m) of each of so many nodes at rest: the block diagonal of `K`, symmetric and positive
/// definite.
pub fn nodal_stiffness_n_per_m(points: &IntegrationPoints, nodes: usize) -> Vec<DMat3> {
    let mut nodal = vec![DMat3::ZERO; nodes];
    for point in points.iter() {
        for (number, &node) in point.nodes.iter().enumerate() {
            nodal[node as usize] -= point.stiffness_block(&DMat3::IDENTITY, number, number);
        }
    }
    nodal
}
