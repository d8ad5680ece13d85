//! Explicit total-Lagrangian leapfrog (velocity Verlet), the default integrator.
//!
//! With lumped mass `m`, force `f` and step `dt = T/s` for `s` substeps of the tick `T`:
//! ```text
//! v ← v + ½dt f(x)/m                       first half kick, with the force kept from the last tick
//! s times:  x ← x + dt v                   drift
//!           f ← f(x, v)                    internal, gravity, loads, contact
//!           v ← v + dt f/m                 kick (the last one is a half kick)
//! ```
//! Second order and symplectic without damping; `x` and `v` are synchronous at the end of a tick. Viscous forces see the
//! velocity half a step late, which the step bound of `world::substeps` accounts for.
//!
//! Ledger: the work of a force `g` over a kick of length `h` is exactly its share of the kinetic change,
//! `h g·(v + ½h f/m)`; what viscous stress takes is an estimate ([`crate::health::ViscousPower`]).
use super::{
    forces::Tick,
    hybrid,
    motion::{self, drift},
    springs,
    stability::is_judged,
};
use crate::world::{Model, Scratch, State};

/// All substeps of a tick.
pub(super) fn run(tick: &Tick<'_>, state: &mut State, scratch: &mut Scratch) {
    let (substeps, dt_s) = (tick.substeps, tick.dt_s());
    tick.make_force_current(state, scratch);
    if let Some(own) = &mut scratch.hybrid {
        own.of_free_j = None;
    }
    kick(tick.model, state, scratch, (0.5 * dt_s, true));
    for substep in 1..=substeps {
        note_long_step(tick, substep - 1, state, scratch);
        let fastest_m_per_s = drift(state, dt_s);
        scratch.history.set_aside(substep, substeps, state);
        tick.evaluate_after(substep, fastest_m_per_s, state, scratch);
        let h_s = if substep == substeps { 0.5 * dt_s } else { dt_s };
        kick(tick.model, state, scratch, (h_s, tick.ends_long_step(substep)));
    }
}

/// After `done` substeps: notes what a long step of a hybrid body's coarse level is judged by, where one begins.
fn note_long_step(tick: &Tick<'_>, done: u32, state: &State, scratch: &mut Scratch) {
    if tick.model.substeps_per_long_step() > 1
        && is_judged(tick.model)
        && tick.ends_long_step(done)
        && let Some(own) = &mut scratch.hybrid
    {
        own.note_long_step(state);
    }
}

fn kick(model: &Model, state: &mut State, scratch: &mut Scratch, (h_s, ends_long_step): (f64, bool)) {
    match (model.hybrid(), &mut scratch.hybrid) {
        (Some(body), Some(own)) => hybrid::kick(model, body, state, own, (h_s, ends_long_step)),
        _ => match &scratch.springs {
            Some(own) => springs::kick(model, state, own, h_s),
            None => motion::kick(model, state, h_s),
        },
    }
}
