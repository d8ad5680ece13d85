//! Sleep of a body at rest: nothing of it is computed until something changes.
//!
//! [`RestBound`] bounds how far any node is from rest, now and later. Where the bound stays below the tolerance over
//! [`STILL_CHECKS`] checks in a row, with no tool near and no input that changes, no node will ever be further from its
//! present position than twice the tolerance, so the body is left as it is.
//!
//! A sleeping body wakes before a tick in which a load, a prescribed displacement or an injected force differs from the
//! tick before, and before one in which a tool comes within a quarter of its radius of the surface: that tick then runs
//! from its start as if it had not slept. Tools go on moving on their couplings all the while.
//!
//! Ledger: the kinetic energy that is dropped counts as dissipated.
use super::{
    Model, Scratch, State,
    step::{StepReport, write_reactions},
};
use crate::{
    bodies::{
        Body, SteppedBody,
        tet::{ModesError, RestBound},
    },
    contact::{ContactScratch, SubstepTime, ToolState},
    tick::{Environment, MechanicalState, TickInput, ViscousPower, take_tools},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Number of ticks between two checks of the bound.
const CHECK_EVERY_TICKS: u64 = 10;
/// Number of checks in a row that must find the bound kept.
const STILL_CHECKS: u32 = 10;

/// Whether the body sleeps, and the inputs whose change wakes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sleep {
    /// Whether the body sleeps, so that nothing of it is computed.
    pub asleep: bool,
    /// Number of checks in a row that found the body still.
    pub still_checks: u32,
    /// Prescribed displacements (m) of the last tick, one per set.
    pub held_m: Vec<DVec3>,
}

impl Sleep {
    pub(super) fn at_start(environment: &Environment) -> Self {
        Self { asleep: false, still_checks: 0, held_m: vec![DVec3::ZERO; environment.prescribed.len()] }
    }

    /// Wakes the body as at the start, in the buffer it has.
    pub(crate) fn reset(&mut self) {
        self.wake();
        self.held_m.fill(DVec3::ZERO);
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        (self.asleep, self.still_checks) = (other.asleep, other.still_checks);
        self.held_m.copy_from_slice(&other.held_m);
    }

    /// Returns whether this has the model's size, and is asleep only where the model's body may sleep.
    pub(crate) fn fits(&self, model: &Model) -> bool {
        self.held_m.len() == model.prescribed().len() && (!self.asleep || model.sleep_bound().is_some())
    }

    pub(super) fn wake(&mut self) {
        (self.asleep, self.still_checks) = (false, 0);
    }

    /// Returns whether the inputs of this tick are the same as those at the end of the last one.
    pub(super) fn is_quiet(&self, load_factors: &[f64], input: &TickInput<'_>) -> bool {
        input.point_forces.is_empty()
            && input.load_factors == load_factors
            && input.prescribed_displacements_m == self.held_m
    }
}

/// The bound of a body, and what it is to stay below.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SleepBound {
    tolerance_m: f64,
    bound: RestBound,
}

impl SleepBound {
    /// Returns the bound, or `None` where the settings let nothing sleep.
    ///
    /// # Errors
    /// The body is not held, or its modes are not found.
    pub(super) fn new(environment: &Environment, body: &Body) -> Result<Option<Self>, ModesError> {
        let tolerance_m = environment.settings.sleep_tolerance_m;
        if tolerance_m <= 0.0 {
            return Ok(None);
        }
        // Bodies without a bound refuse to sleep as they are built.
        Ok(body.rest_bound(environment)?.map(|bound| Self { tolerance_m, bound }))
    }
}

/// Checks after a tick that was computed whether the body may sleep. `was_quiet` is [`Sleep::is_quiet`] before the
/// tick.
pub(super) fn consider(model: &Model, state: &mut State, input: &TickInput<'_>, was_quiet: bool) {
    let Some(SleepBound { tolerance_m, bound }) = model.sleep_bound() else { return };
    let State { mechanical, sleep, pace, .. } = state;
    if !was_quiet {
        sleep.still_checks = 0;
        let given = input.prescribed_displacements_m;
        if given.len() == sleep.held_m.len() && given.iter().all(|d| d.is_finite()) {
            sleep.held_m.copy_from_slice(given);
        }
        return;
    }
    if !mechanical.tick.is_multiple_of(CHECK_EVERY_TICKS) {
        return;
    }
    let is_still = model.contact().is_apart(&mechanical.x, &mechanical.tools, &mechanical.contact)
        && model.body().distance_from_rest_m(bound, mechanical) <= *tolerance_m;
    sleep.still_checks = if is_still { sleep.still_checks + 1 } else { 0 };
    if sleep.still_checks >= STILL_CHECKS {
        let kinetic_j: f64 =
            mechanical.v.iter().zip(model.body().mass_kg()).map(|(v, m)| 0.5 * m * v.length_squared()).sum();
        mechanical.ledger.dissipated_j += kinetic_j;
        mechanical.v.fill(DVec3::ZERO);
        mechanical.viscous = ViscousPower::default();
        pace.before_is_usable = false;
        sleep.asleep = true;
    }
}

/// Takes a tick of a sleeping body, in which only its tools move. Returns `None` where the body woke, and the tick is
/// still to be run.
pub(super) fn doze(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    input: &TickInput<'_>,
) -> Option<StepReport> {
    let environment = model.environment();
    let State { mechanical, body: own, pace, sleep, .. } = state;
    if !mechanical.force_is_current || !sleep.is_quiet(&mechanical.load_factors, input) {
        sleep.wake();
        return None;
    }
    let Scratch { last_good, contact, body: buffers, reaction_n, .. } = scratch;
    last_good.keep_tools(mechanical);
    let inputs_rejected = take_tools(environment, mechanical, contact, input);
    if !stays_apart(environment, mechanical, contact, pace.substeps) {
        last_good.put_tools_back(mechanical);
        // The broad phase's lists belong to tools at other positions.
        mechanical.force_is_current = false;
        sleep.wake();
        return None;
    }
    environment.contact.end_tick(&mut mechanical.tools, &mut mechanical.contact, pace.substeps, contact);
    if let Some(body) = SteppedBody::of(model.body(), own, buffers) {
        write_reactions(environment, &body, mechanical, reaction_n);
    }
    mechanical.tick = mechanical.tick.saturating_add(1);
    Some(StepReport { substeps: 0, repeated: 0, inputs_rejected, quarantined: None })
}

/// Moves the tools through a tick. Returns whether none of them came near the surface.
fn stays_apart(
    environment: &Environment,
    state: &mut MechanicalState,
    scratch: &mut ContactScratch,
    substeps: u32,
) -> bool {
    let tick_period_s = environment.settings.tick_period_s;
    let dt_s = tick_period_s / f64::from(substeps);
    let apart = (1..=substeps).all(|number| {
        let time = SubstepTime { fraction: f64::from(number) / f64::from(substeps), dt_s, tick_period_s };
        let (tools, contact) = (&mut state.tools, &mut state.contact);
        environment.contact.substep_apart(&state.x, &time, tools, contact, scratch)
    });
    apart && state.tools.iter().all(ToolState::is_finite)
}
