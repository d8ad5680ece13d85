//! A body at rest sleeps: nothing of it is computed until something changes.
//!
//! Near an equilibrium `x*` the body obeys `M δẍ + C δẋ + K δx = 0`, `δx = x − x*`, with `C` of viscous stress and mass damping. The energy
//! `½ v·M v + ½ δx·K δx` does not grow, and `K ≥ ω₁² M` with the lowest natural frequency `ω₁`. So with the residual `r = −K δx` on free axes:
//! ```text
//! ω₁² ‖M^½ δx(t)‖² ≤ δx(t)·K δx(t) ≤ ‖M^½ v‖² + r·K⁻¹ r ≤ ‖M^½ v‖² + ‖M^-½ r‖²/ω₁²
//! |δx_i(t)| ≤ (‖M^-½ r‖/ω₁² + ‖M^½ v‖/ω₁)/√m_min         of every node, now and later                           (1)
//! ```
//! The force that is at hand is `f = r − C_v v`, with the viscous stress' part. `C_v ≤ τ K` with the largest ratio `τ` of viscosity to stiffness, so
//! `‖M^-½ r‖ ≤ ‖M^-½ f‖ + τ ω_max² ‖M^½ v‖`: a viscous body that creeps is not taken for one at rest.
//!
//! Where (1) stays below the tolerance over [`CALM_CHECKS`] looks in a row, with no tool near and no input that changes, no node will
//! ever be further from where it is than twice the tolerance, so it is left there. `ω₁` is that of the body at rest; a load that
//! softens it (towards buckling) makes (1) too small by the square of the ratio of frequencies.
//!
//! A sleeping body wakes before a tick in which a load, a prescribed displacement or an injected force differs from the tick before, and
//! before one in which a tool comes within a quarter of its radius of the surface: that tick then runs from its start as if it had not slept.
//! Tools go on moving on their couplings all the while.
//!
//! Ledger: the kinetic energy that is dropped counts as dissipated.
use super::tick::{take_tools, write_reactions};
use crate::{
    contact::{SubstepTime, ToolState},
    health::ViscousPower,
    statics::{SolveError, natural_modes},
    world::{Model, Scratch, State, StepReport, TickInput, relaxation_time_s},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Ticks between two looks at the bound.
const LOOK_EVERY_TICKS: u64 = 10;
/// Looks in a row that must find it kept.
const CALM_CHECKS: u32 = 10;

/// Whether the body sleeps, and what it is woken by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sleep {
    /// Nothing of the body is computed.
    pub asleep: bool,
    /// Looks in a row that found it calm.
    pub calm_checks: u32,
    /// Prescribed displacements (m) of the last tick, one per set.
    pub held_m: Vec<DVec3>,
}

impl Sleep {
    pub(crate) fn at_start(model: &Model) -> Self {
        Self { asleep: false, calm_checks: 0, held_m: vec![DVec3::ZERO; model.spec().prescribed.len()] }
    }

    /// As at the start, in the buffer it has.
    pub(crate) fn reset(&mut self) {
        self.wake();
        self.held_m.fill(DVec3::ZERO);
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        (self.asleep, self.calm_checks) = (other.asleep, other.calm_checks);
        self.held_m.copy_from_slice(&other.held_m);
    }

    /// Of the model's size, and asleep only in a model that ever is.
    pub(crate) fn fits(&self, model: &Model) -> bool {
        self.held_m.len() == model.spec().prescribed.len() && (!self.asleep || model.rest_bound().is_some())
    }

    pub(super) fn wake(&mut self) {
        (self.asleep, self.calm_checks) = (false, 0);
    }

    /// Whether nothing acts in this tick that did not act, in the same measure, at the end of the last one.
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
    /// `τ ω_max²` (1/s).
    viscous_per_s: f64,
    root_of_smallest_mass: f64,
}

impl RestBound {
    /// `None` where the settings let nothing sleep.
    ///
    /// # Errors
    /// A body that is not held, or whose modes are not found.
    pub(crate) fn new(model: &Model) -> Result<Option<Self>, SolveError> {
        let tolerance_m = model.spec().settings.sleep_tolerance_m;
        if tolerance_m == 0.0 {
            return Ok(None);
        }
        let free = |inverse_mass: &&DVec3| **inverse_mass != DVec3::ZERO;
        let largest = model.inverse_mass_per_kg().iter().filter(free).map(|m| m.max_element()).fold(0.0, f64::max);
        // Without a free node there is no mode, and nothing that could move.
        let lowest = natural_modes(model, 1)?.first().map_or(f64::INFINITY, |mode| TAU * mode.frequency_hz);
        let relaxation_s =
            model.spec().regions.iter().map(|region| relaxation_time_s(&region.material)).fold(0.0, f64::max);
        Ok(Some(Self {
            tolerance_m,
            lowest_rad_per_s: lowest,
            viscous_per_s: relaxation_s * model.max_natural_frequency_rad_per_s().powi(2),
            root_of_smallest_mass: largest.sqrt().recip(),
        }))
    }

    /// The right side of (1) (m).
    fn distance_m(&self, model: &Model, state: &State) -> f64 {
        let (mut residual_sq, mut speed_sq) = (0.0, 0.0);
        for (((force, v), mass), inverse_mass) in
            state.force_n.iter().zip(&state.v).zip(model.mass_kg()).zip(model.inverse_mass_per_kg())
        {
            residual_sq += (*force * *force).dot(*inverse_mass);
            speed_sq += mass * v.length_squared();
        }
        let (omega, speed) = (self.lowest_rad_per_s, speed_sq.sqrt());
        let residual = residual_sq.sqrt() + self.viscous_per_s * speed;
        (residual / (omega * omega) + speed / omega) / self.root_of_smallest_mass
    }
}

/// After a tick that was computed: looks whether the body may sleep. `was_quiet` is [`Sleep::is_quiet`] before it.
pub(super) fn consider(model: &Model, state: &mut State, input: &TickInput<'_>, was_quiet: bool) {
    let Some(bound) = model.rest_bound() else { return };
    if !was_quiet {
        state.sleep.calm_checks = 0;
        let given = input.prescribed_displacements_m;
        if given.len() == state.sleep.held_m.len() && given.iter().all(|d| d.is_finite()) {
            state.sleep.held_m.copy_from_slice(given);
        }
        return;
    }
    if !state.tick.is_multiple_of(LOOK_EVERY_TICKS) {
        return;
    }
    let calm = model.contact().is_apart(&state.x, &state.tools, &state.contact)
        && bound.distance_m(model, state) <= bound.tolerance_m;
    state.sleep.calm_checks = if calm { state.sleep.calm_checks + 1 } else { 0 };
    if state.sleep.calm_checks >= CALM_CHECKS {
        let kinetic_j: f64 = state.v.iter().zip(model.mass_kg()).map(|(v, m)| 0.5 * m * v.length_squared()).sum();
        state.ledger.dissipated_j += kinetic_j;
        state.v.fill(DVec3::ZERO);
        state.viscous = ViscousPower::default();
        state.pace.before_is_usable = false;
        state.sleep.asleep = true;
    }
}

/// A tick of a body that sleeps: its tools move, and nothing else. `None`: it is awake now, and the tick is still to be run.
pub(super) fn doze(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    input: &TickInput<'_>,
) -> Option<StepReport> {
    if !state.force_is_current || !state.sleep.is_quiet(&state.load_factors, input) {
        state.sleep.wake();
        return None;
    }
    scratch.last_good.keep_tools(state);
    let inputs_rejected = take_tools(model, state, scratch, input);
    let substeps = state.pace.substeps;
    let tick_period_s = model.spec().settings.tick_period_s;
    let dt_s = tick_period_s / f64::from(substeps);
    let apart = (1..=substeps).all(|number| {
        let time = SubstepTime { fraction: f64::from(number) / f64::from(substeps), dt_s, tick_period_s };
        let (tools, contact) = (&mut state.tools, &mut state.contact);
        model.contact().substep_apart(&state.x, &time, tools, contact, &mut scratch.contact)
    });
    if !apart || !state.tools.iter().all(ToolState::is_finite) {
        scratch.last_good.put_tools_back(state);
        // What the broad phase knows is of tools that are elsewhere.
        state.force_is_current = false;
        state.sleep.wake();
        return None;
    }
    model.contact().end_tick(&mut state.tools, &mut state.contact, substeps, &mut scratch.contact);
    write_reactions(model, state, scratch);
    state.tick = state.tick.saturating_add(1);
    Some(StepReport { substeps: 0, repeated: 0, inputs_rejected, quarantined: None })
}
