//! The papers' viscous stress, for every law: `S_v = φ tr(Ė) I + 2ψĖ`, `Ė = sym(Ḟᵀ F)`; `P_v = F S_v`.
use super::{
    Viscosity,
    constants::Constants,
    lane_matrix::{self, M3, column_dot, plus, product, scaled},
};
use crate::{
    lanes::real::Real,
    linalg::tensor::{contract, trace},
};
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

/// Viscous stress in lanes, and what it takes.
pub(crate) struct LaneViscous<T> {
    /// `P_v = F S_v` (Pa).
    pub(crate) p: M3<T>,
    /// `S_v : Ė` (W/m³).
    pub(crate) power_density: T,
}

/// Viscous stress and its power density, from `H = F − I` and its rate `Ḣ = Ḟ`.
#[inline(always)]
pub(crate) fn lane_viscous<T: Real>(c: &Constants<T>, h: &M3<T>, h_dot: &M3<T>) -> LaneViscous<T> {
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
    let volumetric = c.phi * lane_matrix::trace(&e_dot);
    for i in 0..3 {
        s[i][i] = s[i][i] + volumetric;
    }
    LaneViscous { p: plus(&s, &product(h, &s)), power_density: lane_matrix::contract(&s, &e_dot) }
}
