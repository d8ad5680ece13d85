//! Backward Euler, linearised: one Newton step per substep, solved by preconditioned conjugate gradients.
//!
//! `M Δv = dt f(x + dt v', v')`, `v' = v + Δv`, with `f` expanded at the start of the substep:
//! ```text
//! (M + dt² K + dt C) Δv = dt (f(x, v) − dt K v)          v ← v + Δv          x ← x + dt v          f ← f(x, v)
//! ```
//! (Baraff & Witkin 1998). `K` is the tangent of elastic stress and, in positive part, of contact (`contact::tangent`), whose force takes
//! part as the tool's motion will change it. `C` is the matrix of viscous stress. Products are matrix-free
//! through the force kernel. The iteration starts at the velocity there is (`Δv = 0`), so a body at rest or in steady motion
//! costs nothing, and nothing but the state decides where it ends. Loads are those at the end of the substep, forces are evaluated at both
//! of its ends.
//!
//! First order; stable for any step where `K ≥ 0`, by damping what the step cannot resolve. Follower loads and the tools' own
//! motion on their couplings stay explicit: measured substeps are those that the couplings need.
//!
//! Ledger: forces work along the path `dt v'` and are known at both of its ends, so external work is `½dt (g_n + g_{n+1})·v'`, and what the
//! scheme takes is what is left, `½dt (f_n + f_{n+1})·v' − ΔT`, with the viscous part `−C v` of `f` put back,
//! `dt (¼q_n + ¾q_{n+1})`. The balance is of second order; the dissipation holds viscous stress and the scheme's own damping.
use super::{
    forces::Tick,
    motion::{damp, drift, holders_power_w},
    seed_semi_implicit::NodalImplicit,
};
use crate::linalg::pcg::{self, Stop};
use crate::{
    contact::StepAhead,
    world::{Model, Scratch, State},
};
use glam::DVec3;

/// All substeps of a tick. `nodal` is the block diagonal of `M + dt² K + dt C` at rest.
pub(super) fn run(tick: &Tick<'_>, nodal: &NodalImplicit, state: &mut State, scratch: &mut Scratch) {
    let (model, dt_s) = (tick.model, tick.dt_s());
    let damping = model.spec().settings.mass_damping_per_s;
    for substep in 1..=tick.substeps {
        if damping > 0.0 {
            damp(model, state, (-damping * dt_s).exp());
        }
        tick.evaluate_before(substep, state, scratch);
        solve(model, nodal, dt_s, state, scratch);
        let mut taken_j = -kick(model, state, &scratch.implicit.pcg.solution);
        let (mut external_j, mut work_j) = half_work_j(model, state, dt_s);
        let fastest_m_per_s = drift(state, dt_s);
        tick.evaluate_after(substep, fastest_m_per_s, state, scratch);
        let (external_after_j, work_after_j) = half_work_j(model, state, dt_s);
        external_j += external_after_j;
        work_j += work_after_j;
        taken_j += work_j + dt_s * (0.25 * state.viscous.before_w + 0.75 * state.viscous.latest_w);
        state.ledger.external_work_j += external_j;
        state.ledger.dissipated_j += taken_j;
    }
}

/// `Δv` into the solver's solution.
fn solve(model: &Model, nodal: &NodalImplicit, dt_s: f64, state: &State, scratch: &mut Scratch) {
    let Scratch { implicit, kernel: kernel_scratch, .. } = scratch;
    let (settings, kernel) = (&model.spec().settings, model.kernel());
    let (tangents, inverse_mass) = (&mut implicit.tangents, model.inverse_mass_per_kg());
    let (x, tools, contact) = (&state.x, &state.tools, &state.contact);
    let step = StepAhead { dt_s, tick_period_s: settings.tick_period_s };
    model.contact().take_tangents(x, tools, contact, step, tangents);
    kernel.linearise_at(model.rest_positions_m(), x, kernel_scratch);
    // r = dt f − dt² K v
    let residual = &mut implicit.pcg.residual;
    kernel.products_n([dt_s * dt_s, 0.0], &state.v, residual, kernel_scratch);
    tangents.add_products(-dt_s * dt_s, &state.v, residual);
    tangents.add_changes(dt_s, residual);
    for ((r, force), inverse_mass) in residual.iter_mut().zip(&state.force_n).zip(inverse_mass) {
        *r = on_free(*r + *force * dt_s, *inverse_mass);
    }
    let stop = Stop { iterations: settings.solver_iterations, tolerance: settings.solver_tolerance };
    let apply = |a: &[DVec3], out: &mut [DVec3]| {
        kernel.products_n([-dt_s * dt_s, -dt_s], a, out, kernel_scratch);
        tangents.add_products(dt_s * dt_s, a, out);
        for (((out, a), mass), inverse_mass) in out.iter_mut().zip(a).zip(model.mass_kg()).zip(inverse_mass) {
            *out = on_free(*out + *a * *mass, *inverse_mass);
        }
    };
    implicit.products += u64::from(pcg::solve(apply, nodal.inverse_per_kg(), stop, &mut implicit.pcg));
}

/// `v ← v + Δv`; returns the change of kinetic energy (J).
fn kick(model: &Model, state: &mut State, change: &[DVec3]) -> f64 {
    let mut gained_j = 0.0;
    for ((v, change), mass) in state.v.iter_mut().zip(change).zip(model.mass_kg()) {
        gained_j += mass * change.dot(*v + *change * 0.5);
        *v += *change;
    }
    gained_j
}

/// Half a substep's work (J) along `dt v` of external forces, holders' included, and of all forces on free axes.
fn half_work_j(model: &Model, state: &State, dt_s: f64) -> (f64, f64) {
    let (mut external_w, mut total_w) = (holders_power_w(model, &state.force_n, &state.v), 0.0);
    for (((v, force), external), inverse_mass) in
        state.v.iter().zip(&state.force_n).zip(&state.external_n).zip(model.inverse_mass_per_kg())
    {
        external_w += external.dot(*v);
        total_w += on_free(*force, *inverse_mass).dot(*v);
    }
    (0.5 * dt_s * external_w, 0.5 * dt_s * total_w)
}

/// Without the components on held axes.
fn on_free(a: DVec3, inverse_mass_per_kg: DVec3) -> DVec3 {
    DVec3::select(inverse_mass_per_kg.cmpeq(DVec3::ZERO), DVec3::ZERO, a)
}
