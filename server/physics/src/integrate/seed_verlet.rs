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
use super::{
    forces::Tick,
    motion::{drift, kick},
};
use crate::world::{Scratch, State};

/// All substeps of a tick.
pub(super) fn run(tick: &Tick<'_>, state: &mut State, scratch: &mut Scratch) {
    let dt_s = tick.dt_s();
    tick.make_force_current(state, scratch);
    if state.tick == 0 {
        kick(tick.model, state, 0.5 * dt_s);
    }
    for substep in 1..=tick.substeps {
        let fastest_m_per_s = drift(state, dt_s);
        tick.evaluate_after(substep, fastest_m_per_s, state, scratch);
        kick(tick.model, state, dt_s);
    }
}
