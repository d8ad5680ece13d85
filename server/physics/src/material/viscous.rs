//! The papers' viscous stress, for every law: `S_v = φ tr(Ė) I + 2ψĖ`, `Ė = sym(Ḟᵀ F)`; `P_v = F S_v`.
use super::Viscosity;
use crate::linalg::tensor::{contract, trace};
use glam::{DMat3, DVec3};

/// `Ė = sym(Ḟᵀ F)` (1/s), the rate of Green's strain.
pub fn strain_rate(f: &DMat3, f_dot: &DMat3) -> DMat3 {
    let a = f_dot.transpose() * *f;
    (a + a.transpose()) * 0.5
}

/// Second Piola-Kirchhoff viscous stress `S_v` (Pa).
pub fn second_piola(viscosity: Viscosity, e_dot: &DMat3) -> DMat3 {
    DMat3::from_diagonal(DVec3::splat(viscosity.phi_pa_s * trace(e_dot))) + *e_dot * (2.0 * viscosity.psi_pa_s)
}

/// First Piola-Kirchhoff viscous stress `P_v = F S_v` (Pa).
pub fn piola(viscosity: Viscosity, f: &DMat3, f_dot: &DMat3) -> DMat3 {
    *f * second_piola(viscosity, &strain_rate(f, f_dot))
}

/// Power density `S_v : Ė` (W/m³ ≥ 0) that viscous stress takes.
pub fn power_density(viscosity: Viscosity, f: &DMat3, f_dot: &DMat3) -> f64 {
    let e_dot = strain_rate(f, f_dot);
    contract(&second_piola(viscosity, &e_dot), &e_dot)
}
