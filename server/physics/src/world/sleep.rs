//! Sleep of a body at rest: nothing of it is computed until something changes.
//!
//! Near an equilibrium `x*` the body obeys `M δẍ + C δẋ + K δx = 0`, `δx = x − x*`, with `C` of viscous stress and mass
//! damping. The energy `½ v·M v + ½ δx·K δx` does not grow, and `K ≥ ω₁² M` with the lowest natural frequency `ω₁`. So
//! with the residual `r = −K δx` on free axes:
//! ```text
//! ω₁² ‖M^½ δx(t)‖² ≤ δx(t)·K δx(t) ≤ ‖M^½ v‖² + r·K⁻¹ r ≤ ‖M^½ v‖² + ‖M^-½ r‖²/ω₁²
//! |δx_i(t)| ≤ (‖M^-½ r‖/ω₁² + ‖M^½ v‖/ω₁)/√m_min         of every node, now and later                           (1)
//! ```
//! The known force is `f = r − C_v v`, with the part of viscous stress. As `C_v ≤ τ K` with the largest ratio `τ` of
//! viscosity to stiffness, `‖M^-½ r‖ ≤ ‖M^-½ f‖ + τ ω_max² ‖M^½ v‖`: a viscous body that creeps is not taken for one at
//! rest.
//!
//! Where (1) stays below the tolerance over [`STILL_CHECKS`] checks in a row, with no tool near and no input that
//! changes, no node will ever be further from its present position than twice the tolerance, so the body is left as it
//! is. `ω₁` is that of the body at rest; a load that softens it (towards buckling) makes (1) too small by the square of
//! the ratio of frequencies.
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
        tet::{ModesError, TetBody, natural_modes},
    },
    contact::{ContactScratch, SubstepTime, ToolState},
    tick::{Environment, MechanicalState, TickInput, ViscousPower, relaxation_time_s, take_tools},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

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
        self.held_m.len() == model.prescribed().len() && (!self.asleep || model.rest_bound().is_some())
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

/// The constants of (1).
#[derive(Debug, Clone, Copy)]
pub(crate) struct RestBound {
    tolerance_m: f64,
    lowest_rad_per_s: f64,
    /// Constant `τ ω_max²` (1/s).
    viscous_per_s: f64,
    root_of_smallest_mass: f64,
}

impl RestBound {
    /// Returns the constants, or `None` where the settings let nothing sleep.
    ///
    /// # Errors
    /// The body is not held, or its modes are not found.
    pub(super) fn new(environment: &Environment, body: &Body) -> Result<Option<Self>, ModesError> {
        let tolerance_m = environment.settings.sleep_tolerance_m;
        // Other bodies refuse to sleep as a whole as they are built.
        let Some(body) = body.as_tet().filter(|_| tolerance_m > 0.0) else { return Ok(None) };
        let free = |inverse_mass: &&DVec3| **inverse_mass != DVec3::ZERO;
        let largest = body.inverse_mass_per_kg().iter().filter(free).map(|m| m.max_element()).fold(0.0, f64::max);
        // Without a free node there is no mode, and nothing that could move.
        let lowest =
            natural_modes(body, &environment.surface, 1)?.first().map_or(f64::INFINITY, |mode| TAU * mode.frequency_hz);
        let relaxation_s = body.materials().iter().map(relaxation_time_s).fold(0.0, f64::max);
        Ok(Some(Self {
            tolerance_m,
            lowest_rad_per_s: lowest,
            viscous_per_s: relaxation_s * body.max_natural_frequency_rad_per_s().powi(2),
            root_of_smallest_mass: largest.sqrt().recip(),
        }))
    }

    /// Returns the right side of (1) (m).
    fn distance_m(&self, body: &TetBody, state: &MechanicalState) -> f64 {
        let (mut residual_sq, mut speed_sq) = (0.0, 0.0);
        for (((force, v), mass), inverse_mass) in
            state.force_n.iter().zip(&state.v).zip(body.mass_kg()).zip(body.inverse_mass_per_kg())
        {
            residual_sq += (*force * *force).dot(*inverse_mass);
            speed_sq += mass * v.length_squared();
        }
        let (omega, speed) = (self.lowest_rad_per_s, speed_sq.sqrt());
        let residual = residual_sq.sqrt() + self.viscous_per_s * speed;
        (residual / (omega * omega) + speed / omega) / self.root_of_smallest_mass
    }
}

/// Checks after a tick that was computed whether the body may sleep. `was_quiet` is [`Sleep::is_quiet`] before the
/// tick.
pub(super) fn consider(model: &Model, state: &mut State, input: &TickInput<'_>, was_quiet: bool) {
    let (Some(bound), Some(body)) = (model.rest_bound(), model.body().as_tet()) else { return };
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
        && bound.distance_m(body, mechanical) <= bound.tolerance_m;
    sleep.still_checks = if is_still { sleep.still_checks + 1 } else { 0 };
    if sleep.still_checks >= STILL_CHECKS {
        let kinetic_j: f64 = mechanical.v.iter().zip(body.mass_kg()).map(|(v, m)| 0.5 * m * v.length_squared()).sum();
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
