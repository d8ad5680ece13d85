//! The seeds' position Verlet (hybrid 2006, eq. 33).
//!
//! ```text
//! x_{t+dt} = x_t + (x_t − x_{t−dt}) + dt² F/m                                                             (33)
//! ```
//! With the forward difference `v_t = (x_{t+dt} − x_t)/dt` as the velocity that the state keeps, this is, for every
//! substep:
//! ```text
//! x ← x + dt v          f ← f(x, v)          v ← v + dt f/m
//! ```
//! This is a leapfrog whose positions and velocities are never brought to the same time: positions are of second order,
//! but `v` is half a step ahead of `x`, so that what depends on both (kinetic energy, display, viscous heat) is of
//! first order. The stable step is leapfrog's.
//!
//! The paper leaves the first `x_{−dt}` open. It is taken as `x_0 − dt v_0 + ½dt² f_0/m` at tick 0, which makes the
//! first difference `v_0 + ½dt f_0/m` and keeps the order.
//!
//! Ledger: work and kinetic energy agree exactly, but kinetic and elastic energy are half a step apart. The balance has
//! an error of `½dt` times the power between them, which is of first order, oscillates and does not add up.
use crate::{
    bodies::SteppedBody,
    contact::ContactScratch,
    tick::{MechanicalState, Tick, lumped::drift},
};

/// Takes all substeps of a tick.
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
