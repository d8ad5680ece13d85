//! Whether leapfrog's step was too long, read from the forces that the tick evaluates anyway.
//!
//! With lumped mass `M`, internal force `g` (elastic and viscous), the force `f` of everything, and positions at three instants
//! one step `dt` apart, leapfrog gives `y = x₊ − 2x + x₋ = dt² M⁻¹ f`, whatever the loads. Stress answers `y` alone,
//! ```text
//! Δ²g = g₊ − 2g + g₋ = −K y − (C/dt)(y − y₋)
//! ‖Δ²g‖ ≤ q max(‖f‖, ‖f₋‖)        ‖a‖² = Σ aᵀ M⁻¹ a over free axes,  q = dt² λ_max(M⁻¹K) + 2 dt λ_max(M⁻¹C)       (1)
//! ```
//! The step is stable while `k + 2d ≤ 4` in every mode, `k = dt²κ/m`, `d = dt c/m` (`tick::substeps`). So
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
    settings::{Integrator, MAX_SUBSTEPS},
    tick::{Environment, Judged, MechanicalState, StepEvidence, StepForcesNow},
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
/// Most repetitions of a tick.
const MOST_REPETITIONS: u32 = 3;
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
    /// Before the first tick of a body with so many nodes, whose lists have room for `most_positions`.
    pub(crate) fn at_start(environment: &Environment, is_judged: bool, nodes: usize, most_positions: usize) -> Self {
        let substeps = environment.steps.substeps;
        let before = if is_judged && substeps == 1 {
            InstantForces::zero(nodes, most_positions)
        } else {
            InstantForces::default()
        };
        Self { substeps, calm_ticks: 0, before, before_is_usable: false }
    }

    /// As at the start, in the buffers it has.
    pub(crate) fn reset(&mut self, environment: &Environment) {
        (self.substeps, self.calm_ticks, self.before_is_usable) = (environment.steps.substeps, 0, false);
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
    pub(crate) fn fits(&self, environment: &Environment, is_judged: bool, positions: usize) -> bool {
        let steps = environment.steps;
        let nodes = if is_judged && steps.substeps == 1 { positions } else { 0 };
        let most = if is_judged { most_substeps(environment) } else { steps.substeps };
        [&self.before.total_n, &self.before.external_n].iter().all(|list| list.len() == nodes)
            && (steps.substeps..=most).contains(&self.substeps)
            && self.substeps.is_multiple_of(steps.substeps_per_long_step)
    }

    /// The vectors of it, for a look whether they are finite.
    pub(crate) fn vectors(&self) -> impl Iterator<Item = &DVec3> {
        self.before.total_n.iter().chain(&self.before.external_n)
    }

    /// The tick is repeated in `substeps`.
    fn start_again(&mut self, substeps: u32) {
        (self.substeps, self.calm_ticks, self.before_is_usable) = (substeps, 0, false);
    }

    /// Takes note of a tick of `self.substeps` that was accepted at once.
    fn calm(&mut self, environment: &Environment, quotient: f64) {
        let steps = environment.steps;
        let fewer = (self.substeps - (self.substeps / 8).max(1)).max(steps.substeps);
        let fewer = fewer.next_multiple_of(steps.substeps_per_long_step).min(self.substeps);
        // Q grows at most with dt².
        let then = quotient * (f64::from(self.substeps) / f64::from(fewer)).powi(2);
        self.calm_ticks = if then <= SAFETY * LIMIT { self.calm_ticks + 1 } else { 0 };
        if self.calm_ticks >= CALM_TICKS {
            (self.substeps, self.calm_ticks) = (fewer, 0);
        }
    }
}

/// Whether ticks of a body whose steps can be judged are: only leapfrog's. The seeds' schemes run as their authors describe them,
/// backward Euler needs none.
pub(crate) fn is_judged(environment: &Environment, can_be: bool) -> bool {
    let settings = &environment.settings;
    settings.subcycle_unstable && settings.integrator == Integrator::Leapfrog && can_be
}

/// The most substeps that are tried.
fn most_substeps(environment: &Environment) -> u32 {
    let steps = environment.steps;
    let most = steps.substeps.saturating_mul(MOST_TIMES).min(MAX_SUBSTEPS.max(steps.substeps));
    most - most % steps.substeps_per_long_step
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
    fn zero(nodes: usize, most_positions: usize) -> Self {
        let zeros = || {
            let mut list = Vec::with_capacity(most_positions.max(nodes));
            list.resize(nodes, DVec3::ZERO);
            list
        };
        Self { total_n: zeros(), external_n: zeros() }
    }

    fn resize(&mut self, positions: usize) {
        self.total_n.resize(positions, DVec3::ZERO);
        self.external_n.resize(positions, DVec3::ZERO);
    }

    fn now(&self) -> StepForcesNow<'_> {
        StepForcesNow { total_n: &self.total_n, external_n: &self.external_n }
    }

    fn swap(&mut self, state: &mut MechanicalState) {
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
    pub(crate) held_jump: f64,
}

/// The state at the start of a tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StartOfTick<'a> {
    /// Positions (m).
    pub(crate) x: &'a [DVec3],
    /// Velocities (m/s).
    pub(crate) v: &'a [DVec3],
}

/// How a tick went that was run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Attempt {
    /// Its result is not finite.
    pub(crate) is_spoilt: bool,
    /// How often it had been repeated before.
    pub(crate) repeated: u32,
}

/// What is to be done with a tick that was run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It stands.
    Accept,
    /// It is to be taken back and repeated in [`Pace::substeps`].
    Repeat,
}

impl ForceHistory {
    /// Of ticks that are judged, of a body with so many nodes, whose lists have room for `most_positions`.
    pub(crate) fn new(nodes: usize, most_positions: usize) -> Self {
        let forces = || InstantForces::zero(nodes, most_positions);
        Self { start: forces(), two_before: forces(), one_before: forces(), held_jump: 0.0 }
    }

    /// Whether ticks are judged by it.
    pub(crate) fn is_kept(&self) -> bool {
        !self.start.total_n.is_empty()
    }

    /// Before a tick: makes everything as long as the state's positions, of which there may be more or fewer than before. What was held is then of
    /// no use, which [`MechanicalState::force_is_current`] tells.
    pub(crate) fn fit(&mut self, positions: usize, pace: &mut Pace) {
        if !self.is_kept() || self.start.total_n.len() == positions {
            return;
        }
        for forces in [&mut self.start, &mut self.one_before, &mut self.two_before] {
            forces.resize(positions);
        }
        if !pace.before.total_n.is_empty() {
            pace.before.resize(positions);
        }
    }

    /// Before forces are evaluated at the end of substep `number` of `substeps`: what the state holds is set aside if it is wanted
    /// again. The state is given a buffer to be overwritten.
    pub(super) fn set_aside(&mut self, number: u32, substeps: u32, state: &mut MechanicalState) {
        if !self.is_kept() {
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
    pub(crate) fn put_back(&mut self, state: &mut MechanicalState) {
        self.start.swap(state);
    }

    /// Judges a tick that was run in [`Pace::substeps`] from `start`. The pace is that of the repetition, or of the next tick, then.
    pub(crate) fn judge(
        &mut self,
        environment: &Environment,
        body: &mut dyn Judged,
        state: &MechanicalState,
        start: StartOfTick<'_>,
        pace: &mut Pace,
        attempt: Attempt,
    ) -> Verdict {
        let Attempt { is_spoilt, repeated } = attempt;
        let substeps = pace.substeps;
        let evidence = self.evidence(environment, body, state, pace, start);
        let unstable = is_spoilt || self.is_unstable(&evidence, environment, body, state, pace);
        let found = (!is_spoilt).then(|| quotient(&evidence));
        let more = substeps_for(environment, body.is_viscous(), substeps, found);
        if let Some(more) = more.filter(|_| unstable && repeated < MOST_REPETITIONS) {
            pace.start_again(more);
            return Verdict::Repeat;
        }
        if substeps > environment.steps.substeps && !unstable && repeated == 0 {
            pace.calm(environment, quotient(&evidence));
        }
        self.hand_on(pace, substeps);
        body.accept();
        Verdict::Accept
    }

    /// What the tick shows.
    fn evidence(
        &self,
        environment: &Environment,
        body: &mut dyn Judged,
        state: &MechanicalState,
        pace: &Pace,
        start: StartOfTick<'_>,
    ) -> StepEvidence {
        let substeps = pace.substeps;
        let Some(older) = self.before_the_end(pace) else {
            return body.evidence_of_first_step(environment, state, self.start.now(), start.x, start.v);
        };
        let period_s = environment.settings.tick_period_s;
        let held_sq = if substeps == 1 { self.held_jump / (period_s * period_s) } else { 0.0 };
        let found = body.evidence(environment, state, older, held_sq, substeps);
        // As large as to have the limit of `Q`.
        StepEvidence { long_step: LIMIT / LONG_STEP_LIMIT * found.long_step, ..found }
    }

    /// Forces one and two steps before the end of the tick that was run.
    fn before_the_end<'a>(&'a self, pace: &'a Pace) -> Option<[StepForcesNow<'a>; 2]> {
        match pace.substeps {
            1 => pace.before_is_usable.then_some([self.start.now(), pace.before.now()]),
            2 => Some([self.one_before.now(), self.start.now()]),
            _ => Some([self.one_before.now(), self.two_before.now()]),
        }
    }

    /// After a tick that was accepted: what the next one is judged by.
    fn hand_on(&mut self, pace: &mut Pace, substeps: u32) {
        pace.before_is_usable = substeps == 1 && !pace.before.total_n.is_empty();
        if pace.before_is_usable {
            std::mem::swap(&mut pace.before, &mut self.start);
        }
    }

    /// `Q` is above the limit, and not by mass damping or by rounding: the answer stands above the last digits of the internal forces
    /// themselves.
    fn is_unstable(
        &self,
        evidence: &StepEvidence,
        environment: &Environment,
        body: &mut dyn Judged,
        state: &MechanicalState,
        pace: &Pace,
    ) -> bool {
        if evidence.long_step > LIMIT {
            return true;
        }
        if evidence.answer_sq <= LIMIT * LIMIT * evidence.cause_sq {
            return false;
        }
        let settings = &environment.settings;
        let damped = -(-settings.mass_damping_per_s * settings.tick_period_s / f64::from(pace.substeps)).exp_m1();
        let cause = evidence.cause_sq.sqrt();
        // ‖g − g₋‖ of the two instants before the tick's end; 0 in a tick that has no such two.
        let last_change = self.before_the_end(pace).map_or(0.0, |[one, two]| body.change(one, two));
        let beyond = (last_change - 0.5 * LIMIT * cause).max(0.0);
        if evidence.answer_sq.sqrt() <= LIMIT * cause + damped * beyond {
            return false;
        }
        let digits = settings.precision.relative_rounding();
        // Reactions of held nodes included: between them a body may be stretched without a force on any other node.
        evidence.answer_sq > digits * digits * body.internal_sq(environment, state)
    }
}

/// `Q`; not finite where forces are not.
fn quotient(evidence: &StepEvidence) -> f64 {
    let StepEvidence { answer_sq, cause_sq, long_step } = *evidence;
    let of_step = if answer_sq == 0.0 { 0.0 } else { (answer_sq / cause_sq).sqrt() };
    if of_step.is_finite() { of_step.max(long_step) } else { of_step }
}

/// With how many substeps to repeat a tick that proved unstable in `substeps`; `None` if no more are tried.
///
/// Stress's part of `Q` falls with dt², viscosity's with dt.
fn substeps_for(environment: &Environment, is_viscous: bool, substeps: u32, quotient: Option<f64>) -> Option<u32> {
    let most = most_substeps(environment);
    let wanted = match quotient.filter(|q| q.is_finite()) {
        None => substeps.saturating_mul(TIMES_IF_NOT_FINITE),
        Some(quotient) => {
            let times = if is_viscous { 0.25 * quotient } else { (0.25 * quotient).sqrt() };
            (f64::from(substeps) * times / SAFETY).ceil().min(f64::from(most)) as u32
        }
    };
    let every = environment.steps.substeps_per_long_step;
    (substeps < most).then(|| wanted.clamp(substeps + 1, most).next_multiple_of(every))
}
