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
    Model,
    rollback::LastGood,
    step::{StepReport, write_reactions},
};
use crate::{
    bodies::{Body, BodyState, SteppedBody},
    contact::{ContactScratch, SubstepTime, ToolState},
    elements::natural_modes::ModesError,
    integrate::Pace,
    tick::{Environment, MechanicalState, RestBound, TickInput, ViscousPower, take_tools},
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
#[derive(Debug, Clone)]
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
        // Kinds without a bound refuse to sleep as they are built.
        Ok(body.rest_bound(environment)?.map(|bound| Self { tolerance_m, bound }))
    }
}

/// Notes the inputs of a tick that was computed, and returns whether it is time to look whether the body may sleep. `was_quiet` is
/// [`Sleep::is_quiet`] before the tick.
pub(super) fn is_to_be_considered(
    model: &Model,
    tick: u64,
    sleep: &mut Sleep,
    input: &TickInput<'_>,
    was_quiet: bool,
) -> bool {
    if model.sleep_bound().is_none() {
        return false;
    }
    if !was_quiet {
        sleep.still_checks = 0;
        let given = input.prescribed_displacements_m;
        if given.len() == sleep.held_m.len() && given.iter().all(|d| d.is_finite()) {
            sleep.held_m.copy_from_slice(given);
        }
    }
    was_quiet && tick.is_multiple_of(CHECK_EVERY_TICKS)
}

/// Looks whether the body may sleep; `is_apart` tells that no tool is near it.
pub(super) fn consider(
    model: &Model,
    own: &BodyState,
    state: &mut MechanicalState,
    sleep: &mut Sleep,
    pace: &mut Pace,
    is_apart: bool,
) {
    let Some(SleepBound { tolerance_m, bound }) = model.sleep_bound() else { return };
    let is_still = is_apart && model.body().distance_from_rest_m(bound, own, state) <= *tolerance_m;
    sleep.still_checks = if is_still { sleep.still_checks + 1 } else { 0 };
    if sleep.still_checks >= STILL_CHECKS {
        let kinetic_j: f64 =
            state.v.iter().zip(model.body().mass_kg()).map(|(v, m)| 0.5 * m * v.length_squared()).sum();
        state.ledger.dissipated_j += kinetic_j;
        state.v.fill(DVec3::ZERO);
        state.viscous = ViscousPower::default();
        pace.before_is_usable = false;
        sleep.asleep = true;
    }
}

/// What a sleeping body's tick changes.
pub(super) struct Dozing<'a, 'b> {
    pub(super) body: &'a mut SteppedBody<'b>,
    pub(super) state: &'a mut MechanicalState,
    pub(super) sleep: &'a mut Sleep,
    pub(super) substeps: u32,
    pub(super) last_good: &'a mut LastGood,
    pub(super) contact: &'a mut ContactScratch,
    pub(super) reaction_n: &'a mut [DVec3],
}

/// Takes a tick of a sleeping body, in which only its tools move. Returns `None` where the body woke, and the tick is
/// still to be run.
pub(super) fn doze(environment: &Environment, dozing: Dozing<'_, '_>, input: &TickInput<'_>) -> Option<StepReport> {
    let Dozing { body, state, sleep, substeps, last_good, contact, reaction_n } = dozing;
    if !state.force_is_current || !sleep.is_quiet(&state.load_factors, input) || !body.sleeps_on() {
        sleep.wake();
        return None;
    }
    last_good.keep_tools(state);
    let inputs_rejected = take_tools(environment, state, contact, input);
    if !stay_apart(environment, body, state, contact, substeps) {
        last_good.put_tools_back(state);
        // The broad phase's lists belong to tools at other positions.
        state.force_is_current = false;
        sleep.wake();
        return None;
    }
    environment.contact.end_tick(&mut state.tools, &mut state.contact, substeps, contact);
    write_reactions(environment, body, state, reaction_n);
    state.tick = state.tick.saturating_add(1);
    Some(StepReport { substeps: 0, repeated: 0, inputs_rejected, quarantined: None })
}

/// Moves the tools through a tick. Returns whether none of them came near the surface.
fn stay_apart(
    environment: &Environment,
    body: &mut SteppedBody<'_>,
    state: &mut MechanicalState,
    scratch: &mut ContactScratch,
    substeps: u32,
) -> bool {
    let tick_period_s = environment.settings.tick_period_s;
    let dt_s = tick_period_s / f64::from(substeps);
    let apart = (1..=substeps).all(|number| {
        let time = SubstepTime { fraction: f64::from(number) / f64::from(substeps), dt_s, tick_period_s };
        body.tools_stay_apart(environment, &time, state, scratch)
    });
    apart && state.tools.iter().all(ToolState::is_finite)
}
