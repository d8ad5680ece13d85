//! The largest natural frequency of a discrete body, which bounds the step of explicit integration: `dt < 2/ω_max`.
//!
//! `K φ = ω² M φ` with lumped `M`, on the free degrees of freedom, is the symmetric problem `A y = ω² y` with
//! `A = M^{-½} K M^{-½}`. Lanczos' three-term recurrence builds the tridiagonal `T_m`; its largest eigenvalue θ
//! approaches ω²_max from below, the last component `s` of its eigenvector gives the residual `r = β_m |s|`, and an
//! eigenvalue of `A` lies within `r` of θ (Parlett 1998, §13.2). No reorthogonalisation: rounding only makes copies of
//! converged eigenvalues, and the largest one is all that is asked for.
//!
//! `K` is applied tet by tet, with the linear elasticity that every law shares at rest:
//! `f_i = −V σ b_i`, `σ = λ tr(G) I + µ(G + Gᵀ)`, `G = Σ_j a_j b_jᵀ`.
use super::linear_tet::RestTet;
use crate::linalg::lanczos::lanczos;
use crate::linalg::lanczos::telling;
use crate::linalg::tensor::largest_eigenvalue;
use crate::{
    linalg::tensor::{outer, trace},
    material::{Lame, Material},
    mesh::TetMesh,
};
use glam::{DMat3, DVec3};

/// `K` of a body at rest, and the springs that hold its nodes from outside, applied without being assembled.
#[derive(Debug, Clone, Copy)]
pub struct RestStiffness<'a> {
    /// The body.
    pub mesh: &'a TetMesh,
    /// Rest data of its tets.
    pub rest_tets: &'a [RestTet],
    /// Index into `materials`, one per tet.
    pub tet_material: &'a [u16],
    /// Materials.
    pub materials: &'a [Material],
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

/// `max_e ω_e ≥ ω_max` (rad/s): the frequency bound of single tets, each with its part `m_i V_e/Σ_{t∋i} V_t` of its
/// nodes' masses (Irons & Treharne 1971: by Rayleigh's quotient no assembly of elements is faster than the fastest of
/// them).
///
/// Per tet `aᵀK_e a = V(λ tr²G + ½µ|G + Gᵀ|²) ≤ V(3λ⁺ + 2µ)|G|²` and `|G|² ≤ λ_max(Σ_i b_i b_iᵀ/m_i) aᵀM_e a`.
///
/// The springs are left out.
pub fn element_bound_rad_per_s(stiffness: &RestStiffness<'_>, inverse_mass_per_kg: &[DVec3]) -> f64 {
    let RestStiffness { mesh, rest_tets, tet_material, materials, .. } = *stiffness;
    let mut volume_of_node = vec![0.0; inverse_mass_per_kg.len()];
    for (nodes, rest) in mesh.tets().iter().zip(rest_tets) {
        for &node in nodes {
            volume_of_node[node as usize] += rest.volume_m3;
        }
    }
    let mut largest_sq = 0.0_f64;
    for ((nodes, rest), &material) in mesh.tets().iter().zip(rest_tets).zip(tet_material) {
        let Lame { lambda_pa, mu_pa } = materials[material as usize].lame;
        let gram = nodes.iter().zip(rest.gradients_per_m).fold(DMat3::ZERO, |sum, (&node, b)| {
            let part = rest.volume_m3 / volume_of_node[node as usize];
            sum + outer(b, b) * (inverse_mass_per_kg[node as usize].max_element() / part)
        });
        let modulus = 3.0 * lambda_pa.max(0.0) + 2.0 * mu_pa;
        largest_sq = largest_sq.max(rest.volume_m3 * modulus * largest_eigenvalue(&gram));
    }
    largest_sq.sqrt()
}

impl RestStiffness<'_> {
    /// `out ← K a`.
    fn apply(&self, a: &[DVec3], out: &mut [DVec3]) {
        out.fill(DVec3::ZERO);
        for ((nodes, rest), &material) in self.mesh.tets().iter().zip(self.rest_tets).zip(self.tet_material) {
            let Lame { lambda_pa, mu_pa } = self.materials[material as usize].lame;
            let g = rest.gradient_of(&nodes.map(|n| a[n as usize]));
            let sigma = (g + g.transpose()) * mu_pa + DMat3::from_diagonal(DVec3::splat(lambda_pa * trace(&g)));
            for (&node, force) in nodes.iter().zip(rest.corner_forces_n(&sigma)) {
                out[node as usize] -= force;
            }
        }
        for ((out, a), spring) in out.iter_mut().zip(a).zip(self.springs_n_per_m) {
            *out += *a * *spring;
        }
    }
}

/// `D_i = Σ_{t∋i} −∂f_i/∂x_i` (N/m) of every node at rest: the block diagonal of `K`, symmetric and positive definite.
pub fn nodal_stiffness_n_per_m(body: &RestStiffness<'_>) -> Vec<DMat3> {
    let mut nodal = vec![DMat3::ZERO; body.mesh.positions_m().len()];
    for ((nodes, rest), &material) in body.mesh.tets().iter().zip(body.rest_tets).zip(body.tet_material) {
        for (corner, &node) in nodes.iter().enumerate() {
            let material = &body.materials[material as usize];
            nodal[node as usize] -= rest.stiffness_block(material, &DMat3::IDENTITY, corner, corner);
        }
    }
    nodal
}
