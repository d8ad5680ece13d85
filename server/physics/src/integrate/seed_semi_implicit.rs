//! The seeds' semi-implicit Euler with one constant Jacobian per node (hybrid 2006, eq. 34).
//!
//! ```text
//! ṽ = v + dt F/m
//! v ← (I − (dt²/m) J_F)⁻¹ ṽ                                                                              (34)
//! x ← x + dt v
//! ```
//! Here `J_F = −D_i = ∂F_i/∂x_i` of each node at rest with its neighbours held: a constant 3×3 matrix that is inverted
//! at load. So with the block diagonal `D` of the stiffness `K` the step is `v' = (M + dt² D)⁻¹ (M v + dt F)`.
//!
//! The scheme has defects, as `D` is not `K`, whose rows sum to zero:
//! - A body that moves as a whole is dragged as if every node hung on the resting frame by a damper `dt D`. At E = 10
//!   kPa, ν = 0.45 and h = 5 mm one step of 1 ms takes about three quarters of its momentum.
//! - It is not unconditionally stable. For a mode with `k = dt²κ/m`, `d = dt²δ/m`: `(1 + d)z² − (2 + d − k)z + 1 = 0`,
//!   so `|z| ≤ 1` needs `k ≤ 4 + 2d`: any step only where λ_max(D⁻¹K) ≤ 2, and a block of tets has 2.02, 2.08 and 2.80
//!   at ν = 0, 0.3 and 0.45. Leapfrog's condition `k ≤ 4` always suffices, and measured substeps keep it; the paper
//!   runs `Substeps::Fixed(1)`.
//! - It is of first order in time, and a force that pushes during a step acts in the next one.
//!
//! On a held axis the velocity is given, and its coupling to the node's other axes is left out. Forces other than the
//! body's own (contact, viscous stress) are explicit.
//!
//! Ledger: the change of momentum is `dt F − dt² D v'`, so beside viscous stress the fictitious damper takes
//! `dt² v'·D ½(v + v')`, which is counted as dissipated. The work of elastic forces is counted along `dt ½(v + v')`,
//! but the nodes move by `dt v'`: the balance has an error of first order.
use crate::{
    bodies::tet::{SteppedTet, TetBody},
    contact::ContactScratch,
    tick::{Environment, Evaluation, MechanicalState, Stepped, Tick, lumped::drift},
};
use glam::{DMat3, DVec3};

/// The matrices of the scheme, which the rest state fixes.
#[derive(Debug, Clone)]
pub(crate) struct NodalImplicit {
    /// Stiffness `D_i` (N/m) with zero rows and columns for held axes.
    stiffness_n_per_m: Vec<DMat3>,
    /// Matrices `(m_i I + dt² D_i)⁻¹` (1/kg) with zero rows and columns for held axes.
    inverse_per_kg: Vec<DMat3>,
}

impl NodalImplicit {
    /// Returns the matrices for steps of `dt_s` (s), with a further matrix `dt C_i` inside the inverse where a scheme
    /// has one.
    pub(super) fn new(nodal_n_per_m: &[DMat3], viscous_n_s_per_m: Option<&[DMat3]>, body: &TetBody, dt_s: f64) -> Self {
        let (inverse_mass_per_kg, mass_kg) = (body.inverse_mass_per_kg(), body.mass_kg());
        let free = |inverse_mass: DVec3| {
            DMat3::from_diagonal(DVec3::select(inverse_mass.cmpeq(DVec3::ZERO), DVec3::ZERO, DVec3::ONE))
        };
        let on_free = |blocks: &[DMat3]| -> Vec<DMat3> {
            blocks.iter().zip(inverse_mass_per_kg).map(|(block, m)| free(*m) * *block * free(*m)).collect()
        };
        let stiffness_n_per_m = on_free(nodal_n_per_m);
        let viscous = viscous_n_s_per_m.map(on_free);
        let inverse_of = |node: usize| {
            let viscous = viscous.as_ref().map_or(DMat3::ZERO, |viscous| viscous[node]);
            let matrix =
                DMat3::from_diagonal(DVec3::splat(mass_kg[node])) + (stiffness_n_per_m[node] * dt_s + viscous) * dt_s;
            matrix.inverse() * free(inverse_mass_per_kg[node])
        };
        let inverse_per_kg = (0..mass_kg.len()).map(inverse_of).collect();
        Self { stiffness_n_per_m, inverse_per_kg }
    }

    /// Returns `(M + dt² D + dt C)⁻¹` (1/kg) of every node.
    pub(super) fn inverse_per_kg(&self) -> &[DMat3] {
        &self.inverse_per_kg
    }
}

/// Takes all substeps of a tick.
pub(super) fn run(
    tick: &Tick<'_>,
    nodal: &NodalImplicit,
    body: &mut SteppedTet<'_>,
    state: &mut MechanicalState,
    contact: &mut ContactScratch,
) {
    let dt_s = tick.dt_s();
    if !state.force_is_current {
        state.contact.forget_untracked_geometry();
        body.evaluate(tick, &Evaluation::at_start(), state, contact);
    }
    for substep in 1..=tick.substeps {
        kick(tick.environment, body.body, nodal, state, dt_s);
        let fastest_m_per_s = drift(state, dt_s);
        body.evaluate(tick, &tick.after_substep(substep, fastest_m_per_s), state, contact);
    }
}

/// Gives the kick `v ← (M + dt²D)⁻¹(M v + dt F)`, computed as `v + (M + dt²D)⁻¹ dt (F − dt D v)`, and adds its work and
/// dissipation to the ledger.
fn kick(environment: &Environment, body: &TetBody, nodal: &NodalImplicit, state: &mut MechanicalState, dt_s: f64) {
    let (damping, masses) = (environment.settings.mass_damping_per_s, body.lumped_mass(environment));
    if damping > 0.0 {
        masses.damp(state, (-damping * dt_s).exp());
    }
    let (mut external_w, mut drag_w) = (0.0, 0.0);
    for (node, v) in state.v.iter_mut().enumerate() {
        let stiffness = nodal.stiffness_n_per_m[node];
        let change = nodal.inverse_per_kg[node] * ((state.force_n[node] - stiffness * *v * dt_s) * dt_s);
        let mean = *v + change * 0.5;
        *v += change;
        external_w += state.external_n[node].dot(mean);
        drag_w += dt_s * (stiffness * *v).dot(mean);
    }
    state.ledger.external_work_j += dt_s * (external_w + masses.holders_power_w(&state.force_n, &state.v));
    state.ledger.dissipated_j += dt_s * (drag_w + state.viscous.latest_w);
}
