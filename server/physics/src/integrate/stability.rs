//! The test of whether leapfrog's step was too long, from the forces that the tick evaluates anyway.
//!
//! With lumped mass `M`, internal force `g` (elastic and viscous), the force `f` of everything, and positions at three
//! instants one step `dt` apart, leapfrog gives `y = x₊ − 2x + x₋ = dt² M⁻¹ f`, whatever the loads. Only stress answers
//! to `y`:
//! ```text
//! Δ²g = g₊ − 2g + g₋ = −K y − (C/dt)(y − y₋)
//! ‖Δ²g‖ ≤ q max(‖f‖, ‖f₋‖)        ‖a‖² = Σ aᵀ M⁻¹ a over free axes,  q = dt² λ_max(M⁻¹K) + 2 dt λ_max(M⁻¹C)       (1)
//! ```
//! The step is stable while `k + 2d ≤ 4` in every mode, `k = dt²κ/m`, `d = dt c/m` (`tick::substeps`). So
//! `Q = ‖Δ²g‖/max(‖f‖, ‖f₋‖)` above 4 proves that it is too long, for a body that is linear between the three instants
//! and whose stiffest mode is its most viscous one. A mode that grows as `z = −|z|` has `Q = 2 + |z| + 1/|z| > 4`
//! exactly.
//!
//! With mass damping `c`, `e = e^{−c dt}`, leapfrog gives `y = √e dt² M⁻¹ f − (1 − e)(x − x₋)` and is stable while
//! `k ≤ 2 (1 + e)/√e`. Then
//! ```text
//! ‖Δ²g‖ ≤ 2 (1 + e) max(‖f‖, ‖f₋‖) + (1 − e) ‖g − g₋‖                                                            (2)
//! ```
//! which is the 4 of (1) again where `‖g − g₋‖ ≤ 2 max(‖f‖, ‖f₋‖)`. Loads may make `‖g − g₋‖` larger, and the excess
//! raises the limit.
//!
//! Rigid and slow motion is filtered out twice: a mode counts with `ω⁸` in the numerator and `ω⁴` in the denominator,
//! so that a small oscillation at the limit is seen beside a large motion. The effect of contact, loads and tools is in
//! `f`, not in `g`: it cannot cause an alarm, and a step that is too long for contact alone is not detected. On held
//! axes that change their speed between ticks `y` is not zero; `m Δv/dt` stands for the force there, and `λ_max` in (1)
//! is then that of the body without holders.
//!
//! A tick of two or more substeps is judged by its last three instants; one of a single step by its own two and the one
//! before ([`Pace::before`]). Compare Park & Underwood 1980 and Bergan & Mollestad 1985, who choose steps by the
//! quotient `Δxᵀ Δg/Δxᵀ M Δx`, which has neither filter.
//!
//! What a blow drives on may turn a cell inside out within a substep that is stable by (1). So particles may not move far
//! in one either ([`Judged::strides`]).
use super::pace::{InstantForces, Pace, most_substeps};
use crate::{
    settings::Integrator,
    tick::{Environment, Judged, MechanicalState, StepEvidence, StepForcesNow, StifferContact},
};
use glam::DVec3;

/// `Q` above this counts as unstable. The limit 4 at a step of 0.975 of the longest one gives this value.
const LIMIT: f64 = 3.8;
/// `(k h ω)²` of long steps above this counts as unstable. It is half of the limit of linear bodies, as long steps are
/// few, and a body that is strained by half in one of them is far from linear.
const LONG_STEP_LIMIT: f64 = 2.0;
/// Fraction of the stable step at which a repetition aims.
const SAFETY: f64 = 0.9;
/// Factor on the substeps of a tick that is repeated because its result was not finite.
const TIMES_IF_NOT_FINITE: u32 = 4;
/// Largest number of repetitions of a tick.
const MOST_REPETITIONS: u32 = 3;
/// Number of substeps that contact needed, over those of the tick, above which the tick is repeated: a tool came so fast that
/// contact grew stiff within it.
const HIT: f64 = 1.5;

/// Returns whether the ticks of a body are judged, given whether its steps can be. Only those of leapfrog are: the
/// seeds' schemes run as their authors describe them, and backward Euler needs no judgement.
pub(crate) fn is_judged(environment: &Environment, can_be: bool) -> bool {
    let settings = &environment.settings;
    settings.subcycle_unstable && settings.integrator == Integrator::Leapfrog && can_be
}

/// Forces at those instants of a tick at which they are needed again.
#[derive(Debug, Clone, Default)]
pub(crate) struct ForceHistory {
    /// Whether ticks are judged; there are no forces otherwise.
    is_kept: bool,
    start: InstantForces,
    two_before: InstantForces,
    one_before: InstantForces,
    /// Sum `Σ m (Δv)²` (kg m²/s²) of held axes at the tick's start.
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

/// The outcome of a tick that was run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Attempt {
    /// Whether its result is not finite.
    pub(crate) is_spoilt: bool,
    /// Number of times that it had been repeated before.
    pub(crate) repeated: u32,
    /// How much stiffer contact was than the model's substeps are made for.
    pub(crate) stiffened: StifferContact,
}

/// The verdict on a tick that was run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The tick is accepted.
    Accept,
    /// The tick is to be taken back and repeated in [`Pace::substeps`].
    Repeat,
}

impl ForceHistory {
    /// Returns a history for ticks that are judged, of a body with so many nodes, whose lists have room for
    /// `most_positions`.
    pub(crate) fn new(nodes: usize, most_positions: usize) -> Self {
        let forces = || InstantForces::zero(nodes.min(most_positions), most_positions);
        Self { is_kept: true, start: forces(), two_before: forces(), one_before: forces(), held_jump: 0.0 }
    }

    /// Returns whether ticks are judged by this history.
    pub(crate) fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Makes all lists as long as the state's positions before a tick, as there may be more or fewer of these than
    /// before. What the lists held is then of no use, which [`MechanicalState::force_is_current`] tells.
    pub(crate) fn fit(&mut self, environment: &Environment, positions: usize, pace: &mut Pace) {
        if !self.is_kept {
            return;
        }
        // The state's list is fitted on its own: the state may have been reset or restored since the last tick.
        if environment.steps.substeps == 1 {
            pace.before.resize(positions);
        }
        if self.start.total_n.len() == positions {
            return;
        }
        for forces in [&mut self.start, &mut self.one_before, &mut self.two_before] {
            forces.resize(positions);
        }
    }

    /// Sets the state's forces aside if they are needed again, before forces are evaluated at the end of substep
    /// `number` of `substeps`. The state gets a buffer that is then overwritten.
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

    /// Puts the forces at the start of a tick that was run back into the state.
    pub(crate) fn put_back(&mut self, state: &mut MechanicalState) {
        self.start.swap(state);
    }

    /// Judges a tick that was run in [`Pace::substeps`] from `start`. Afterwards the pace is that of the repetition, or
    /// of the next tick.
    pub(crate) fn judge(
        &mut self,
        environment: &Environment,
        body: &mut dyn Judged,
        state: &MechanicalState,
        start: StartOfTick<'_>,
        pace: &mut Pace,
        attempt: Attempt,
    ) -> Verdict {
        let Attempt { is_spoilt, repeated, stiffened } = attempt;
        let substeps = pace.substeps;
        let evidence = self.evidence(environment, body, state, pace, start);
        let unstable = is_spoilt || self.is_unstable(&evidence, environment, body, state, pace);
        let found = (!is_spoilt).then(|| quotient(&evidence));
        let least = environment.steps.with_stiffer_contact(stiffened).min(most_substeps(environment));
        let is_hit = environment.steps.needed_by_contact(stiffened) > HIT * f64::from(substeps);
        let strides = body.strides(state, environment.settings.tick_period_s / f64::from(substeps));
        let more = if unstable {
            substeps_for(environment, body.is_viscous(), substeps, found)
        } else {
            let of_hit = if is_hit { least } else { 0 };
            let of_strides = if strides > 1.0 { times_as_many(environment, substeps, strides) } else { 0 };
            Some(of_hit.max(of_strides)).filter(|more| *more > substeps)
        };
        if let Some(more) = more.filter(|_| repeated < MOST_REPETITIONS) {
            pace.start_again(more);
            if unstable {
                pace.too_few = pace.too_few.max(substeps);
            }
            return Verdict::Repeat;
        }
        if !unstable {
            // Of what falls with dt², as the pace takes it.
            let part = (quotient(&evidence) / (SAFETY * LIMIT)).max((strides / SAFETY).powi(2));
            pace.settle(least, environment.steps.substeps_per_long_step, part);
        }
        self.hand_on(pace, substeps);
        body.accept();
        Verdict::Accept
    }

    /// Returns the evidence of the tick that was run.
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
        // Scaled so that it has the limit of `Q`.
        StepEvidence { long_step: LIMIT / LONG_STEP_LIMIT * found.long_step, ..found }
    }

    /// Returns the forces one and two steps before the end of the tick that was run, if they are known.
    fn before_the_end<'a>(&'a self, pace: &'a Pace) -> Option<[StepForcesNow<'a>; 2]> {
        match pace.substeps {
            1 => pace.before_is_usable.then_some([self.start.now(), pace.before.now()]),
            2 => Some([self.one_before.now(), self.start.now()]),
            _ => Some([self.one_before.now(), self.two_before.now()]),
        }
    }

    /// Keeps the forces of a tick that was accepted by which the next one is judged.
    fn hand_on(&mut self, pace: &mut Pace, substeps: u32) {
        pace.before_is_usable = substeps == 1;
        if pace.before_is_usable {
            std::mem::swap(&mut pace.before, &mut self.start);
        }
    }

    /// Returns whether `Q` is above the limit, and not because of mass damping or rounding: the second difference must
    /// exceed the last digits of the internal forces themselves.
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
        // ‖g − g₋‖ of the two instants before the tick's end, or 0 in a tick without two such instants.
        let last_change = self.before_the_end(pace).map_or(0.0, |[one, two]| body.change(one, two));
        let beyond = (last_change - 0.5 * LIMIT * cause).max(0.0);
        if evidence.answer_sq.sqrt() <= LIMIT * cause + damped * beyond {
            return false;
        }
        let digits = settings.precision.relative_rounding();
        // Reactions of held nodes are included: between them a body may be stretched without a force on any other node.
        evidence.answer_sq > digits * digits * body.internal_sq(environment, state)
    }
}

/// Returns `Q`, which is not finite where forces are not.
fn quotient(evidence: &StepEvidence) -> f64 {
    let StepEvidence { answer_sq, cause_sq, long_step } = *evidence;
    let of_step = if answer_sq == 0.0 { 0.0 } else { (answer_sq / cause_sq).sqrt() };
    if of_step.is_finite() { of_step.max(long_step) } else { of_step }
}

/// Returns the number of substeps in which to repeat a tick that proved unstable in `substeps`, or `None` if no larger
/// number is tried.
///
/// The part of `Q` by elastic stress falls with dt², that by viscous stress with dt.
fn substeps_for(environment: &Environment, is_viscous: bool, substeps: u32, quotient: Option<f64>) -> Option<u32> {
    let most = most_substeps(environment);
    let wanted = match quotient.filter(|q| q.is_finite()) {
        None => substeps.saturating_mul(TIMES_IF_NOT_FINITE),
        Some(quotient) => {
            times_as_many(environment, substeps, if is_viscous { 0.25 * quotient } else { (0.25 * quotient).sqrt() })
        }
    };
    let every = environment.steps.substeps_per_long_step;
    (substeps < most).then(|| wanted.clamp(substeps + 1, most).next_multiple_of(every))
}

/// Returns so many times as many substeps, and some more to be safe, up to the largest number that is tried.
fn times_as_many(environment: &Environment, substeps: u32, times: f64) -> u32 {
    let most = most_substeps(environment);
    let wanted = (f64::from(substeps) * times / SAFETY).ceil().min(f64::from(most)) as u32;
    wanted.next_multiple_of(environment.steps.substeps_per_long_step)
}
