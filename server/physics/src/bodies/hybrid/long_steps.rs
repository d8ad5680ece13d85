//! Long steps: the coarse level takes longer steps than the awake cells do.
//!
//! Its forces `f_c` are much of the work and change slowly beside those of awake cells and of contact, `f_a`. So they
//! are evaluated only every `k` substeps of length `h`, and weigh `k` times then (Tuckerman, Berne & Martyna 1992):
//! ```text
//! v ← v + ½h M'⁻¹ (f_a + b + k (f_c − b))       at both ends of k substeps
//! v ← v + h M'⁻¹ (f_a + b)                      between
//! b ← b + (1 − e^{−T/τ}) (f_c − b)              after every tick
//! ```
//! While the steady part `b` does not change, the step is symplectic, whatever `b` is. With `b = 0`, forces that
//! balance at rest, `f_a = −f_c`, would push at one time and pull at another, and the body would come to rest
//! elsewhere, by some `(k h ω)²/24` of those forces (a dent by 4 % at two substeps, by 9 % at three). With `b = f_c` a
//! body at rest stays at rest in every substep. Where a body is held nowhere, `b` must have no torque as the body
//! turns: the torque is taken from it at every evaluation (`transition_force`).
//!
//! `k h` is stable for the coarse level alone, `h` for the whole. That does not prove that both are stable together:
//! modes of the fine level with `ω k h` near `nπ` resonate with what they feel of the coarse one. `docs/adr/hybrid.md`
//! has what was measured.
use super::kernels::Found;
use super::{body::HybridBody, scratch::HybridScratch, state::HybridState, transition_force::without_torque};
use crate::hash::Chain;
use crate::{
    lanes::vector_operations::Answer,
    tick::{Environment, MechanicalState},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Time constant (s) with which `b` follows `f_c`.
const TIME_CONSTANT_S: f64 = 0.02;

/// Forces of the coarse level, one per coarse node; empty where it is evaluated in every substep.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct LongSteps {
    /// `b` (N). It is also empty after it was forgotten, until forces are evaluated next.
    steady_n: Vec<DVec3>,
    /// `f_c − b` (N) when it was evaluated last.
    beyond_n: Vec<DVec3>,
    /// One tick before the state; known only for a body whose tick is one long step.
    before: Instant,
}

impl LongSteps {
    pub(super) fn with_room(nodes: usize, entries: usize) -> Self {
        Self {
            steady_n: Vec::with_capacity(nodes),
            beyond_n: Vec::with_capacity(nodes),
            before: Instant::with_room(nodes, entries),
        }
    }

    /// Adds the forces of the last evaluation, and the instant before, to a hash.
    pub(super) fn chain(&self, chain: &mut Chain) {
        let Self { steady_n, beyond_n, before } = self;
        for list in [steady_n, beyond_n, &before.forces_n, &before.x] {
            chain.vectors(list);
        }
    }

    /// Forgets all forces: as particles wake or fall asleep, they will be others.
    pub(crate) fn forget(&mut self) {
        self.steady_n.clear();
        self.beyond_n.clear();
        self.before.forget();
    }

    pub(super) fn copy_from(&mut self, other: &Self) {
        self.steady_n.clone_from(&other.steady_n);
        self.beyond_n.clone_from(&other.beyond_n);
        self.before.copy_from(&other.before);
    }

    /// Returns whether the lists have as many entries as there are coarse nodes and positions, and are finite.
    pub(super) fn fit(&self, nodes: usize, entries: usize) -> bool {
        let Self { steady_n, beyond_n, before } = self;
        let lists = [(steady_n, nodes), (beyond_n, nodes), (&before.forces_n, nodes), (&before.x, entries)];
        let fits = |(list, count): (&Vec<DVec3>, usize)| {
            [0, count].contains(&list.len()) && list.iter().all(|entry| entry.is_finite())
        };
        lists.into_iter().all(fits)
            && steady_n.len() == beyond_n.len()
            && before.x.is_empty() == before.forces_n.is_empty()
    }

    /// Takes the torque at positions `x` (m) from `b` of a body that is held nowhere.
    pub(crate) fn turn_with(&mut self, body: &HybridBody, x: &[DVec3]) {
        if body.is_free {
            without_torque(body, x, &mut self.steady_n);
        }
    }

    /// Evaluates `f_c`, which `add_forces_n` adds to zeros; returns what that returns.
    pub(crate) fn evaluate(&mut self, nodes: usize, add_forces_n: impl FnOnce(&mut [DVec3]) -> Found) -> Found {
        self.beyond_n.clear();
        self.beyond_n.resize(nodes, DVec3::ZERO);
        let found = add_forces_n(&mut self.beyond_n);
        if self.steady_n.is_empty() {
            std::mem::swap(&mut self.steady_n, &mut self.beyond_n);
            self.beyond_n.resize(nodes, DVec3::ZERO);
        } else {
            for (beyond, steady) in self.beyond_n.iter_mut().zip(&self.steady_n) {
                *beyond -= *steady;
            }
        }
        found
    }

    /// Overwrites the forces (N) with `b` on the coarse nodes and zero on the particles; with zero on all where there
    /// is no `b`.
    pub(crate) fn start_with_steady_n(&self, forces_n: &mut [DVec3]) {
        let (of_nodes, others) = forces_n.split_at_mut(self.steady_n.len());
        of_nodes.copy_from_slice(&self.steady_n);
        others.fill(DVec3::ZERO);
    }

    /// Adds `factor (f_c − b)` to forces (N).
    pub(crate) fn add_beyond_n(&self, factor: f64, forces_n: &mut [DVec3]) {
        for (force, beyond) in forces_n.iter_mut().zip(&self.beyond_n) {
            *force += *beyond * factor;
        }
    }

    /// Returns `f_c − b` (N) of a coarse node; zero where the coarse level takes no long steps.
    pub(crate) fn beyond_of(&self, node: usize) -> DVec3 {
        self.beyond_n.get(node).copied().unwrap_or_default()
    }

    /// Returns `f_c` (N) of every coarse node.
    fn forces_n(&self) -> impl Iterator<Item = DVec3> {
        self.steady_n.iter().zip(&self.beyond_n).map(|(steady, beyond)| *steady + *beyond)
    }
}

impl LongSteps {
    /// Moves a part of `f_c − b` to `b`, after a tick of `period_s`, and so to the forces (N) of every substep.
    pub(super) fn follow_coarse_forces(&mut self, period_s: f64, forces_n: &mut [DVec3]) {
        let part = -(-period_s / TIME_CONSTANT_S).exp_m1();
        let Self { steady_n, beyond_n, .. } = self;
        for ((steady, beyond), force) in steady_n.iter_mut().zip(beyond_n).zip(forces_n) {
            let goes_over = *beyond * part;
            *steady += goes_over;
            *beyond -= goes_over;
            *force += goes_over;
        }
    }
}

/// Positions (m) of coarse nodes and active particles, and `f_c` (N), where a long step began; empty where not known.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct Instant {
    x: Vec<DVec3>,
    forces_n: Vec<DVec3>,
}

impl Instant {
    fn with_room(nodes: usize, entries: usize) -> Self {
        Self { x: Vec::with_capacity(entries), forces_n: Vec::with_capacity(nodes) }
    }

    fn forget(&mut self) {
        self.x.clear();
        self.forces_n.clear();
    }

    fn copy_from(&mut self, other: &Self) {
        self.x.clone_from(&other.x);
        self.forces_n.clone_from(&other.forces_n);
    }

    fn is_known_of(&self, state: &MechanicalState) -> bool {
        self.x.len() == state.x.len()
    }
}

/// The long steps that a tick's length is judged by, and the state that the tick began with.
#[derive(Debug, Clone)]
pub(super) struct LongStepHistory {
    /// The instants at which the last long step of the tick began, and the one before it.
    recent: [Instant; 2],
    /// Number of the tick's long steps that have begun.
    begun: u32,
    at_start: LongSteps,
}

impl LongStepHistory {
    pub(super) fn with_room(nodes: usize, entries: usize) -> Self {
        let instant = || Instant::with_room(nodes, entries);
        Self { recent: [instant(), instant()], begun: 0, at_start: LongSteps::with_room(nodes, entries) }
    }
}

impl HybridScratch {
    /// Keeps the state of the long steps before a tick that may be repeated.
    pub(crate) fn keep_long_steps(&mut self, own: &mut HybridState, state: &MechanicalState) {
        let LongStepHistory { begun, at_start, .. } = &mut self.long_steps;
        *begun = 0;
        at_start.steady_n.clone_from(&own.long_steps.steady_n);
        at_start.beyond_n.clone_from(&own.long_steps.beyond_n);
        if !state.force_is_current {
            own.long_steps.before.forget();
        }
    }

    /// Restores what [`Self::keep_long_steps`] kept, so that the tick can be taken again in more long steps.
    pub(crate) fn put_long_steps_back(&mut self, own: &mut HybridState) {
        let LongStepHistory { begun, at_start, .. } = &mut self.long_steps;
        *begun = 0;
        own.long_steps.steady_n.clone_from(&at_start.steady_n);
        own.long_steps.beyond_n.clone_from(&at_start.beyond_n);
        own.long_steps.before.forget();
    }

    /// Records where a long step begins.
    pub(crate) fn note_long_step(&mut self, own: &HybridState, state: &MechanicalState) {
        let LongStepHistory { recent, begun, .. } = &mut self.long_steps;
        recent.swap(0, 1);
        recent[0].x.clone_from(&state.x);
        recent[0].forces_n.clear();
        recent[0].forces_n.extend(own.long_steps.forces_n());
        *begun += 1;
    }

    /// Passes on, after a tick that was accepted, where its long step began: the next tick is judged by it, if it is
    /// one long step again.
    pub(crate) fn pass_on_long_step(&mut self, own: &mut HybridState) {
        let LongStepHistory { recent, begun, .. } = &mut self.long_steps;
        if *begun == 1 {
            std::mem::swap(&mut own.long_steps.before, &mut recent[0]);
        } else {
            own.long_steps.before.forget();
        }
    }

    /// Returns, at the tick's end, an estimate from below of the coarse level's largest `(k h ω)²`, from the last two
    /// long steps, or from the last one where no more is known,
    /// ```text
    /// −Δ²f_c·Δ²x / (Δ²x·M' Δ²x/(k h)²)        since Δ²f_c = −K_c Δ²x
    /// ```
    /// less what rounding of `f_c` may have done to it. It is 0 where the coarse level takes no longer steps.
    pub(crate) fn long_step_quotient(
        &mut self,
        body: &HybridBody,
        own: &HybridState,
        environment: &Environment,
        state: &MechanicalState,
        substeps: u32,
    ) -> f64 {
        let every = environment.steps.substeps_per_long_step;
        if every == 1 {
            return 0.0;
        }
        let long_step_s = environment.settings.tick_period_s * f64::from(every) / f64::from(substeps);
        let digits = environment.settings.precision.relative_rounding();
        let begun = self.long_steps.begun;
        let [one, two] = std::mem::take(&mut self.long_steps.recent);
        let before = if begun > 1 { &two } else { &own.long_steps.before };
        // Where the step before is not known it counts as no step: the second differences are then first ones.
        let before = if before.is_known_of(state) { before } else { &one };
        let LongSteps { steady_n, beyond_n, .. } = &own.long_steps;
        let nodes = body.node_count();
        let moved_of_nodes = [&state.x[..nodes], &one.x[..nodes], &before.x[..nodes]];
        let sums = Answer { steady_n, beyond_n, forces_n: [&one.forces_n, &before.forces_n], x: moved_of_nodes }.sums();
        let answer = sums.answer - digits * (sums.force_sq * sums.moved_sq).sqrt();
        let mut quotient = 0.0;
        if answer > 0.0 {
            let difference = |((now, one), two): ((&DVec3, &DVec3), &DVec3)| (*now - *one) - (*one - *two);
            let moved = state.x.iter().zip(&one.x).zip(&before.x).map(difference);
            quotient = answer * (long_step_s * long_step_s) / self.twice_kinetic(body, moved);
        }
        self.long_steps.recent = [one, two];
        quotient
    }
}
