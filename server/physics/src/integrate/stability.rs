//! Whether leapfrog's step was too long, read from the forces that the tick evaluates anyway.
//!
//! With lumped mass `M`, internal force `g` (elastic and viscous), the force `f` of everything, and positions at three instants
//! one step `dt` apart, leapfrog gives `y = x₊ − 2x + x₋ = dt² M⁻¹ f`, whatever the loads. Stress answers `y` alone,
//! ```text
//! Δ²g = g₊ − 2g + g₋ = −K y − (C/dt)(y − y₋)
//! ‖Δ²g‖ ≤ q max(‖f‖, ‖f₋‖)        ‖a‖² = Σ aᵀ M⁻¹ a over free axes,  q = dt² λ_max(M⁻¹K) + 2 dt λ_max(M⁻¹C)       (1)
//! ```
//! The step is stable while `k + 2d ≤ 4` in every mode, `k = dt²κ/m`, `d = dt c/m` (`world::substeps`). So
//! `Q = ‖Δ²g‖/max(‖f‖, ‖f₋‖)` above 4 proves that it is too long, for a body that is linear between the three instants and whose
//! stiffest mode is its most viscous one. A mode that grows as `z = −|z|` has `Q = 2 + |z| + 1/|z| > 4` exactly.
//!
//! With mass damping `c`, `e = e^{−c dt}`, leapfrog gives `y = √e dt² M⁻¹ f − (1 − e)(x − x₋)` and is stable while `k ≤ 2 (1 + e)/√e`. Then
//! ```text
//! ‖Δ²g‖ ≤ 2 (1 + e) max(‖f‖, ‖f₋‖) + (1 − e) ‖g − g₋‖                                                            (2)
//! ```
//! which is (1)'s 4 again where `‖g − g₋‖ ≤ 2 max(‖f‖, ‖f₋‖)`. Loads may make it larger: what it is above that raises the limit.
//!
//! Rigid and slow motion is filtered out twice: a mode counts with `ω⁸` above and `ω⁴` below the line, so that a small
//! tremble at the limit is seen beside a large motion. What contact, loads and tools do is in `f`, not in `g`: it cannot alarm, and a
//! step that is too long for contact alone is not seen. On held axes that change their speed between ticks `y` is not zero;
//! `m Δv/dt` stands for the force there, and `λ_max` in (1) is then that of the body not held.
//!
//! A tick of two or more substeps is judged by its last three instants; one of a single step by its own two and the one
//! before ([`Pace::before`]). Compare Park & Underwood 1980 and Bergan & Mollestad 1985, who choose steps by the quotient
//! `Δxᵀ Δg/Δxᵀ M Δx`, which has neither filter.
use crate::{
    bodies::hybrid::HybridScratch,
    health::LastGood,
    lanes::StepForces,
    settings::{Integrator, MAX_SUBSTEPS, Precision},
    world::{Model, State, with_room},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// `Q` above this is unstable: the limit 4 at a step of 0.975 of the longest.
const LIMIT: f64 = 3.8;
/// `(k h ω)²` of long steps above this is taken for unstable, half of what would be for linear bodies: they are few, and what a body does that is strained by
/// half in one of them is far from linear.
const LONG_STEP_LIMIT: f64 = 2.0;
/// Part of the stable step that a repetition aims at.
const SAFETY: f64 = 0.9;
/// More substeps than this many times the model's are not tried.
const MOST_TIMES: u32 = 64;
/// A tick whose result is not finite is repeated with so many times its substeps.
const TIMES_IF_NOT_FINITE: u32 = 4;
/// So many ticks must show that fewer substeps would do before fewer are tried.
const CALM_TICKS: u32 = 100;

/// In how many substeps ticks are taken, and what a tick of one step is judged by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pace {
    /// Substeps of the next tick; the model's unless a tick proved unstable.
    pub substeps: u32,
    /// Ticks in a row in which fewer would have done.
    pub calm_ticks: u32,
    /// Forces one step before those of the state; empty unless the model takes one step per tick.
    pub before: InstantForces,
    /// `before` is that, with nothing put elsewhere in between.
    pub before_is_usable: bool,
}

impl Pace {
    pub(crate) fn at_start(model: &Model) -> Self {
        let before = if judges_across_ticks(model) { InstantForces::zero(model) } else { InstantForces::default() };
        Self { substeps: model.substeps(), calm_ticks: 0, before, before_is_usable: false }
    }

    /// As at the start, in the buffers it has.
    pub(crate) fn reset(&mut self, model: &Model) {
        (self.substeps, self.calm_ticks, self.before_is_usable) = (model.substeps(), 0, false);
        self.before.total_n.fill(DVec3::ZERO);
        self.before.external_n.fill(DVec3::ZERO);
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.before.total_n.clone_from(&other.before.total_n);
        self.before.external_n.clone_from(&other.before.external_n);
        (self.substeps, self.calm_ticks) = (other.substeps, other.calm_ticks);
        self.before_is_usable = other.before_is_usable;
    }

    /// For so many positions, and in a range of substeps that the model may have.
    pub(crate) fn fits(&self, model: &Model, positions: usize) -> bool {
        let nodes = if judges_across_ticks(model) { positions } else { 0 };
        let most = if is_judged(model) { most_substeps(model) } else { model.substeps() };
        [&self.before.total_n, &self.before.external_n].iter().all(|list| list.len() == nodes)
            && (model.substeps()..=most).contains(&self.substeps)
            && self.substeps.is_multiple_of(model.substeps_per_long_step())
    }

    /// The tick is repeated in `substeps`.
    pub(super) fn start_again(&mut self, substeps: u32) {
        (self.substeps, self.calm_ticks, self.before_is_usable) = (substeps, 0, false);
    }

    /// Takes note of a tick of `self.substeps` that was accepted at once.
    pub(super) fn calm(&mut self, model: &Model, quotient: f64) {
        let fewer = (self.substeps - (self.substeps / 8).max(1)).max(model.substeps());
        let fewer = fewer.next_multiple_of(model.substeps_per_long_step()).min(self.substeps);
        // Q grows at most with dt².
        let then = quotient * (f64::from(self.substeps) / f64::from(fewer)).powi(2);
        self.calm_ticks = if then <= SAFETY * LIMIT { self.calm_ticks + 1 } else { 0 };
        if self.calm_ticks >= CALM_TICKS {
            (self.substeps, self.calm_ticks) = (fewer, 0);
        }
    }
}

/// Only leapfrog's ticks are judged and repeated: the seeds' schemes run as their authors describe them, backward Euler needs none.
pub(crate) fn is_judged(model: &Model) -> bool {
    let settings = &model.spec().settings;
    // The step of springs is stable at any stretch (`spring::model`).
    let may_be_too_long = model.seed().is_none() && model.springs().is_none();
    settings.subcycle_unstable && settings.integrator == Integrator::Leapfrog && may_be_too_long
}

fn judges_across_ticks(model: &Model) -> bool {
    is_judged(model) && model.substeps() == 1
}

/// The most substeps that are tried.
fn most_substeps(model: &Model) -> u32 {
    let most = model.substeps().saturating_mul(MOST_TIMES).min(MAX_SUBSTEPS.max(model.substeps()));
    most - most % model.substeps_per_long_step()
}

/// Forces at an instant.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct InstantForces {
    /// All of it (N), one per node.
    pub total_n: Vec<DVec3>,
    /// The part of loads, tools and injected forces (N).
    pub external_n: Vec<DVec3>,
}

impl InstantForces {
    fn zero(model: &Model) -> Self {
        let zeros = || with_room(model, std::iter::repeat_n(DVec3::ZERO, model.mass_kg().len()));
        Self { total_n: zeros(), external_n: zeros() }
    }

    fn resize(&mut self, positions: usize) {
        self.total_n.resize(positions, DVec3::ZERO);
        self.external_n.resize(positions, DVec3::ZERO);
    }

    fn internal_n(&self) -> impl Iterator<Item = DVec3> {
        self.total_n.iter().zip(&self.external_n).map(|(force, external)| *force - *external)
    }

    fn swap(&mut self, state: &mut State) {
        std::mem::swap(&mut self.total_n, &mut state.force_n);
        std::mem::swap(&mut self.external_n, &mut state.external_n);
    }
}

/// Forces at the instants of a tick that are wanted again; empty unless ticks are judged.
#[derive(Debug, Clone, Default)]
pub(crate) struct ForceHistory {
    start: InstantForces,
    two_before: InstantForces,
    one_before: InstantForces,
    /// `Σ m (Δv)²` of held axes at the tick's start (kg m²/s²).
    pub(super) held_jump: f64,
}

impl ForceHistory {
    pub(crate) fn new(model: &Model) -> Self {
        if !is_judged(model) {
            return Self::default();
        }
        let forces = || InstantForces::zero(model);
        Self { start: forces(), two_before: forces(), one_before: forces(), held_jump: 0.0 }
    }

    /// Before a tick: makes everything as long as the state's positions, of which there may be more or fewer than before. What was held is then of
    /// no use, which [`State::force_is_current`] tells.
    pub(super) fn fit(&mut self, state: &mut State) {
        let positions = state.x.len();
        if self.start.total_n.is_empty() || self.start.total_n.len() == positions {
            return;
        }
        for forces in [&mut self.start, &mut self.one_before, &mut self.two_before] {
            forces.resize(positions);
        }
        if !state.pace.before.total_n.is_empty() {
            state.pace.before.resize(positions);
        }
    }

    /// Before forces are evaluated at the end of substep `number` of `substeps`: what the state holds is set aside if it is wanted
    /// again. The state is given a buffer to be overwritten.
    pub(super) fn set_aside(&mut self, number: u32, substeps: u32, state: &mut State) {
        if self.start.total_n.is_empty() {
            return;
        }
        if number == 1 {
            self.start.swap(state);
        } else if number == substeps {
            self.one_before.swap(state);
        } else if number + 1 == substeps {
            self.two_before.swap(state);
        }
    }

    /// Puts back the forces at the start of a tick that was run.
    pub(super) fn put_back(&mut self, state: &mut State) {
        self.start.swap(state);
    }

    /// What the tick that was run in `substeps` shows. `start` is the state at its start.
    pub(super) fn evidence(
        &self,
        model: &Model,
        state: &State,
        (start, own): (&LastGood, Option<&mut HybridScratch>),
        substeps: u32,
    ) -> Evidence {
        let Some((one, two)) = self.before_the_end(state, substeps) else {
            return self.evidence_of_first_step(model, state, start, own);
        };
        let period_s = model.spec().settings.tick_period_s;
        let held_sq = if substeps == 1 { self.held_jump / (period_s * period_s) } else { 0.0 };
        if let Some(own) = own {
            let now = state.force_n.iter().zip(&state.external_n).map(|(force, external)| *force - *external);
            let second = now.zip(one.internal_n()).zip(two.internal_n()).map(|((g0, g1), g2)| g0 - g1 * 2.0 + g2);
            let answer_sq = own.size_sq(second);
            let [one_sq, two_sq] = if substeps == 1 {
                [one, two].map(|forces| own.size_sq(forces.total_n.iter().copied()))
            } else {
                let [_, one_sq, two_sq] = own.kick_sq;
                [one_sq, two_sq]
            };
            let long_step = long_step_quotient(model, state, own, substeps);
            return Evidence { answer_sq, cause_sq: one_sq.max(two_sq) + held_sq, long_step };
        }
        let forces = StepForces {
            total_n: [&state.force_n, &one.total_n, &two.total_n],
            external_n: [&state.external_n, &one.external_n, &two.external_n],
            inverse_mass_per_kg: model.inverse_mass_per_kg(),
        };
        let [answer_sq, one_sq, two_sq] = forces.sums();
        Evidence { answer_sq, cause_sq: one_sq.max(two_sq) + held_sq, long_step: 0.0 }
    }

    /// `‖g − g₋‖` of the two instants before the tick's end; 0 in a tick that has no such two.
    fn last_change(&self, model: &Model, state: &State, own: Option<&mut HybridScratch>, substeps: u32) -> f64 {
        let Some((one, two)) = self.before_the_end(state, substeps) else { return 0.0 };
        if let Some(own) = own {
            return own.size_sq(one.internal_n().zip(two.internal_n()).map(|(g, before)| g - before)).sqrt();
        }
        let internal = |forces: &InstantForces, node: usize| forces.total_n[node] - forces.external_n[node];
        let change_sq = |(node, inverse_mass): (usize, &DVec3)| {
            let change = internal(one, node) - internal(two, node);
            (change * change).dot(*inverse_mass)
        };
        model.inverse_mass_per_kg().iter().enumerate().map(change_sq).sum::<f64>().sqrt()
    }

    /// Forces one and two steps before the end of a tick that was run.
    fn before_the_end<'a>(&'a self, state: &'a State, substeps: u32) -> Option<(&'a InstantForces, &'a InstantForces)> {
        match substeps {
            1 => state.pace.before_is_usable.then_some((&self.start, &state.pace.before)),
            2 => Some((&self.one_before, &self.start)),
            _ => Some((&self.one_before, &self.two_before)),
        }
    }

    /// After a tick that was accepted: what the next one is judged by.
    pub(super) fn hand_on(&mut self, pace: &mut Pace, substeps: u32) {
        pace.before_is_usable = substeps == 1 && !pace.before.total_n.is_empty();
        if pace.before_is_usable {
            std::mem::swap(&mut pace.before, &mut self.start);
        }
    }

    /// Without a force before: `‖Δg‖ ≤ q max(‖M Δx‖, dt ‖M v‖)/dt²`, which slow motion hides more.
    fn evidence_of_first_step(
        &self,
        model: &Model,
        state: &State,
        start: &LastGood,
        own: Option<&mut HybridScratch>,
    ) -> Evidence {
        let dt_s = model.spec().settings.tick_period_s;
        if let (Some(own), Some(body)) = (own, model.hybrid()) {
            let now = state.force_n.iter().zip(&state.external_n).map(|(force, external)| *force - *external);
            let answer_sq = own.size_sq(now.zip(self.start.internal_n()).map(|(g, before)| g - before));
            let moved_sq = own.twice_kinetic(body, state.x.iter().zip(start.x()).map(|(x, before)| *x - *before));
            let speed_sq = own.twice_kinetic(body, start.v().iter().copied());
            let cause_sq = (moved_sq / (dt_s * dt_s)).max(speed_sq) / (dt_s * dt_s);
            return Evidence { answer_sq, cause_sq, long_step: 0.0 };
        }
        let (mut change_sq, mut moved_sq, mut speed_sq) = (0.0, 0.0, 0.0);
        for node in 0..state.x.len() {
            let now = state.force_n[node] - state.external_n[node];
            let change = now - (self.start.total_n[node] - self.start.external_n[node]);
            change_sq += (change * change * model.inverse_mass_per_kg()[node]).element_sum();
            moved_sq += model.mass_kg()[node] * state.x[node].distance_squared(start.x()[node]);
            speed_sq += model.mass_kg()[node] * start.v()[node].length_squared();
        }
        let cause_sq = (moved_sq / (dt_s * dt_s)).max(speed_sq) / (dt_s * dt_s);
        Evidence { answer_sq: change_sq, cause_sq, long_step: 0.0 }
    }
}

/// `(k h ω)²` of the coarse level's long steps, as far as a tick shows it, as large as to have [`LIMIT`]; 0 where there are none.
fn long_step_quotient(model: &Model, state: &State, own: &mut HybridScratch, substeps: u32) -> f64 {
    let every = model.substeps_per_long_step();
    if every == 1 {
        return 0.0;
    }
    let long_step_s = model.spec().settings.tick_period_s * f64::from(every) / f64::from(substeps);
    LIMIT / LONG_STEP_LIMIT * own.long_step_quotient(model, state, (long_step_s, digits(model)))
}

/// To how many digits internal forces are known.
fn digits(model: &Model) -> f64 {
    match model.spec().settings.precision {
        Precision::Single => 1e-5,
        Precision::Double => 1e-12,
    }
}

/// Both sides of (1), squared (N²/kg).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Evidence {
    answer_sq: f64,
    cause_sq: f64,
    /// What long steps of a coarse level have for `Q`, from another quotient (`hybrid::long_steps`).
    long_step: f64,
}

impl Evidence {
    /// `Q`; not finite where forces are not.
    pub(super) fn quotient(&self) -> f64 {
        let of_step = if self.answer_sq == 0.0 { 0.0 } else { (self.answer_sq / self.cause_sq).sqrt() };
        if of_step.is_finite() { of_step.max(self.long_step) } else { of_step }
    }

    /// `Q` is above the limit, and not by mass damping or by rounding: the answer stands above the last digits of the internal forces
    /// themselves.
    pub(super) fn is_unstable(
        &self,
        model: &Model,
        state: &State,
        (history, mut own): (&ForceHistory, Option<&mut HybridScratch>),
        substeps: u32,
    ) -> bool {
        if self.long_step > LIMIT {
            return true;
        }
        if self.answer_sq <= LIMIT * LIMIT * self.cause_sq {
            return false;
        }
        let settings = &model.spec().settings;
        let damped = -(-settings.mass_damping_per_s * settings.tick_period_s / f64::from(substeps)).exp_m1();
        let cause = self.cause_sq.sqrt();
        let last_change = history.last_change(model, state, own.as_deref_mut(), substeps);
        let beyond = (last_change - 0.5 * LIMIT * cause).max(0.0);
        if self.answer_sq.sqrt() <= LIMIT * cause + damped * beyond {
            return false;
        }
        let digits = digits(model);
        let mut internal_sq = 0.0;
        let particle_kg = own.as_deref().map_or(&[][..], HybridScratch::particle_kg);
        let masses = model.mass_kg().iter().chain(particle_kg);
        let nodes = state.force_n.iter().zip(&state.external_n).zip(masses);
        // Coarse nodes that nothing follows have no mass.
        for ((force, external), mass) in nodes.filter(|(_, mass)| **mass > 0.0) {
            // Reactions of held nodes included: between them a body may be stretched without a force on any other node.
            internal_sq += (*force - *external - model.gravity_m_per_s2() * *mass).length_squared() / mass;
        }
        self.answer_sq > digits * digits * internal_sq
    }
}

/// With how many substeps to repeat a tick that proved unstable in `substeps`; `None` if no more are tried.
///
/// Stress's part of `Q` falls with dt², viscosity's with dt.
pub(super) fn substeps_for(model: &Model, substeps: u32, quotient: Option<f64>) -> Option<u32> {
    let most = most_substeps(model);
    let wanted = match quotient.filter(|q| q.is_finite()) {
        None => substeps.saturating_mul(TIMES_IF_NOT_FINITE),
        Some(quotient) => {
            let times = if model.kernel().is_viscous() { 0.25 * quotient } else { (0.25 * quotient).sqrt() };
            (f64::from(substeps) * times / SAFETY).ceil().min(f64::from(most)) as u32
        }
    };
    let every = model.substeps_per_long_step();
    (substeps < most).then(|| wanted.clamp(substeps + 1, most).next_multiple_of(every))
}
