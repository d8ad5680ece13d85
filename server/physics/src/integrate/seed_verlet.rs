//! The seeds' position Verlet (hybrid 2006, eq. 33).
//!
//! ```text
//! x_{t+dt} = x_t + (x_t − x_{t−dt}) + dt² F/m                                                             (33)
//! ```
//! With the forward difference `v_t = (x_{t+dt} − x_t)/dt` as the velocity that the state keeps, this is, for every substep:
//! ```text
//! x ← x + dt v          f ← f(x, v)          v ← v + dt f/m
//! ```
//! and a leapfrog that is never brought to the same time: positions are of second order, but `v` is half a step ahead of `x`, so
//! what reads both (kinetic energy, display, viscous heat) is of first order. The stable step is leapfrog's.
//!
//! The paper leaves the first `x_{−dt}` open. Taken as `x_0 − dt v_0 + ½dt² f_0/m`, which makes the first difference
//! `v_0 + ½dt f_0/m`, the order is kept; it is applied at tick 0.
//!
//! Ledger: work and kinetic energy agree exactly, but kinetic and elastic energy are half a step apart: the balance is off by
//! `½dt` times the power between them, an error of first order that comes and goes and does not add up.
use crate::{
    bodies::SteppedBody,
    contact::ContactScratch,
    tick::{MechanicalState, Tick, lumped::drift},
};

/// All substeps of a tick.
pub(super) fn run(
    tick: &Tick<'_>,
    body: &mut SteppedBody<'_>,
    state: &mut MechanicalState,
    contact: &mut ContactScratch,
) {
    let dt_s = tick.dt_s();
    body.make_force_current(tick, state, contact);
    if state.tick == 0 {
        body.kick(tick.environment, state, 0.5 * dt_s, true);
    }
    for substep in 1..=tick.substeps {
        let fastest_m_per_s = drift(state, dt_s);
        body.evaluate(tick, &tick.after_substep(substep, fastest_m_per_s), state, contact);
        body.kick(tick.environment, state, dt_s, true);
    }
}
