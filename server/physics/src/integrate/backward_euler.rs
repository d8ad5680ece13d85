//! Backward Euler, linearised: one Newton step per substep, solved by preconditioned conjugate gradients.
//!
//! `M Δv = dt f(x + dt v', v')`, `v' = v + Δv`, with `f` expanded at the start of the substep:
//! ```text
//! (M + dt² K + dt C) Δv = dt (f(x, v) − dt K v)          v ← v + Δv          x ← x + dt v          f ← f(x, v)
//! ```
//! (Baraff & Witkin 1998). `K` is the tangent of elastic stress and the positive part of that of contact
//! (`contact::tangent`), whose force includes its change by the tool's motion. `C` is the matrix of viscous stress.
//! Products are matrix-free through the force kernel. The iteration starts at the present velocity (`Δv = 0`), so that
//! a body at rest or in steady motion costs nothing, and only the state decides where it ends. Loads are those at the
//! end of the substep; forces are evaluated at both of its ends.
//!
//! The scheme is of first order, and stable for any step where `K ≥ 0`, as it damps what the step cannot resolve.
//! Follower loads and the tools' own motion on their couplings stay explicit: measured substeps are those that the
//! couplings need.
//!
//! Ledger: forces work along the path `dt v'` and are known at both of its ends, so external work is
//! `½dt (g_n + g_{n+1})·v'`. The scheme takes the remaining part, `½dt (f_n + f_{n+1})·v' − ΔT`, where the viscous part
//! `−C v` of `f` is put back, `dt (¼q_n + ¾q_{n+1})`. The balance is of second order; the dissipation includes viscous
//! stress and the scheme's own damping.
use super::seed_semi_implicit::NodalImplicit;
use crate::{
    bodies::tet::{SteppedTet, TetBody, TetScratch},
    contact::{ContactScratch, StepAhead},
    linalg::pcg::{self, Stop},
    tick::{
        Environment, Evaluation, MechanicalState, Stepped, Tick,
        lumped::{LumpedMass, drift},
    },
};
use glam::DVec3;

/// Takes all substeps of a tick. `nodal` is the block diagonal of `M + dt² K + dt C` at rest.
pub(super) fn run(
    tick: &Tick<'_>,
    nodal: &NodalImplicit,
    stepped: &mut SteppedTet<'_>,
    state: &mut MechanicalState,
    contact: &mut ContactScratch,
) {
    let (environment, dt_s) = (tick.environment, tick.dt_s());
    let masses = stepped.body.lumped_mass(environment);
    let damping = environment.settings.mass_damping_per_s;
    for substep in 1..=tick.substeps {
        if damping > 0.0 {
            masses.damp(state, (-damping * dt_s).exp());
        }
        evaluate_before(tick, substep, stepped, state, contact);
        solve(environment, stepped.body, nodal, dt_s, state, stepped.scratch);
        let mut taken_j = -kick(&masses, state, &stepped.scratch.pcg.solution);
        let (mut external_j, mut work_j) = half_work_j(&masses, state, dt_s);
        let fastest_m_per_s = drift(state, dt_s);
        stepped.evaluate(tick, &tick.after_substep(substep, fastest_m_per_s), state, contact);
        let (external_after_j, work_after_j) = half_work_j(&masses, state, dt_s);
        external_j += external_after_j;
        work_j += work_after_j;
        taken_j += work_j + dt_s * (0.25 * state.viscous.before_w + 0.75 * state.viscous.latest_w);
        state.ledger.external_work_j += external_j;
        state.ledger.dissipated_j += taken_j;
    }
}

/// Evaluates forces at the start of a substep, with loads as at its end.
fn evaluate_before(
    tick: &Tick<'_>,
    substep: u32,
    stepped: &mut SteppedTet<'_>,
    state: &mut MechanicalState,
    contact: &mut ContactScratch,
) {
    if !state.force_is_current {
        state.contact.forget_untracked_geometry();
    }
    let now: Evaluation = tick.before_substep(substep);
    stepped.evaluate(tick, &now, state, contact);
}

/// Solves for `Δv`, which is then the solver's solution.
fn solve(
    environment: &Environment,
    body: &TetBody,
    nodal: &NodalImplicit,
    dt_s: f64,
    state: &MechanicalState,
    scratch: &mut TetScratch,
) {
    let TetScratch { kernel: kernel_scratch, pcg: vectors, tangents } = scratch;
    let (settings, kernel) = (&environment.settings, body.kernel());
    let inverse_mass = body.inverse_mass_per_kg();
    let (x, tools, contact) = (&state.x, &state.tools, &state.contact);
    let step = StepAhead { dt_s, tick_period_s: settings.tick_period_s };
    environment.contact.take_tangents(x, tools, contact, step, tangents);
    kernel.linearise_at(body.rest_positions_m(), x, kernel_scratch);
    // r = dt f − dt² K v
    let residual = &mut vectors.residual;
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
        for (((out, a), mass), inverse_mass) in out.iter_mut().zip(a).zip(body.mass_kg()).zip(inverse_mass) {
            *out = on_free(*out + *a * *mass, *inverse_mass);
        }
    };
    pcg::solve(apply, nodal.inverse_per_kg(), stop, vectors);
}

/// Gives the kick `v ← v + Δv`. Returns the change of the kinetic energy (J).
fn kick(masses: &LumpedMass<'_>, state: &mut MechanicalState, change: &[DVec3]) -> f64 {
    let mut gained_j = 0.0;
    for ((v, change), mass) in state.v.iter_mut().zip(change).zip(masses.mass_kg) {
        gained_j += mass * change.dot(*v + *change * 0.5);
        *v += *change;
    }
    gained_j
}

/// Returns the work (J) of half a substep along `dt v`: of external forces including those of holders, and of all
/// forces on free axes.
fn half_work_j(masses: &LumpedMass<'_>, state: &MechanicalState, dt_s: f64) -> (f64, f64) {
    let (mut external_w, mut total_w) = (masses.holders_power_w(&state.force_n, &state.v), 0.0);
    for (((v, force), external), inverse_mass) in
        state.v.iter().zip(&state.force_n).zip(&state.external_n).zip(masses.inverse_mass_per_kg)
    {
        external_w += external.dot(*v);
        total_w += on_free(*force, *inverse_mass).dot(*v);
    }
    (0.5 * dt_s * external_w, 0.5 * dt_s * total_w)
}

/// Returns a vector without its components on held axes.
fn on_free(a: DVec3, inverse_mass_per_kg: DVec3) -> DVec3 {
    DVec3::select(inverse_mass_per_kg.cmpeq(DVec3::ZERO), DVec3::ZERO, a)
}
