//! Explicit total-Lagrangian leapfrog (velocity Verlet), the default integrator.
//!
//! With lumped mass `m`, force `f` and step `dt = T/s` for `s` substeps of the tick `T`:
//! ```text
//! v ← v + ½dt f(x)/m                       first half kick, with the force kept from the last tick
//! s times:  x ← x + dt v                   drift
//!           f ← f(x, v)                    internal, gravity, loads, contact
//!           v ← v + dt f/m                 kick (the last one is a half kick)
//! ```
//! The scheme is of second order, and symplectic without damping; `x` and `v` belong to the same time at the end of a
//! tick. Viscous forces see the velocity half a step late, which the step bound of `tick::substeps` takes into account.
//!
//! Ledger: the work of a force `g` over a kick of length `h` is exactly its part of the change of kinetic energy,
//! `h g·(v + ½h f/m)`; what viscous stress takes is estimated ([`crate::tick::ViscousPower`]).
use super::ForceHistory;
use crate::{
    bodies::SteppedBody,
    contact::ContactScratch,
    tick::{MechanicalState, Tick, lumped::drift},
};

/// Takes all substeps of a tick. `history` keeps the forces by which the step is judged, where it is judged.
pub(super) fn run(
    tick: &Tick<'_>,
    body: &mut SteppedBody<'_>,
    state: &mut MechanicalState,
    contact: &mut ContactScratch,
    history: &mut ForceHistory,
) {
    let (substeps, dt_s) = (tick.substeps, tick.dt_s());
    body.make_force_current(tick, state, contact);
    body.begin_kicks();
    body.kick(tick.environment, state, 0.5 * dt_s, true);
    for substep in 1..=substeps {
        if history.is_kept()
            && tick.begins_long_step(substep)
            && let Some(judged) = body.judged()
        {
            judged.note_long_step(state);
        }
        let fastest_m_per_s = drift(state, dt_s);
        history.set_aside(substep, substeps, state);
        body.evaluate(tick, &tick.after_substep(substep, fastest_m_per_s), state, contact);
        let h_s = if substep == substeps { 0.5 * dt_s } else { dt_s };
        body.kick(tick.environment, state, h_s, tick.ends_long_step(substep));
    }
}
