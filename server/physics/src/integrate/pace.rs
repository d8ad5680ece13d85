//! The pace: in how many substeps ticks are taken, more than the model's where those proved too few or contact became
//! stiffer.
use crate::{
    settings::MAX_SUBSTEPS,
    tick::{Environment, MechanicalState, StepForcesNow},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Largest number of substeps that is tried, over the model's.
const MOST_TIMES: u32 = 64;
/// Number of ticks in a row that must show that fewer substeps suffice before fewer are tried, as long as these are far
/// more than what proved too few.
const SETTLED_TICKS: u32 = 4;
/// The same number where these are near to what proved too few.
const NEAR_SETTLED_TICKS: u32 = 100;
/// Number of substeps, over what proved too few, below which a number of substeps is near.
const NEAR: f64 = 1.5;

/// The number of substeps in which ticks are taken, and the forces by which a tick of one step is judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pace {
    /// Number of substeps of the next tick, which is the model's unless a tick proved unstable.
    pub substeps: u32,
    /// Number of ticks in a row that were accepted at once, since the number of substeps last changed.
    pub settled_ticks: u32,
    /// Largest part of these ticks that `Q` was of what a tick may have.
    pub settled_quotient: f64,
    /// Number of substeps that last proved too few, 0 where this is long ago.
    pub too_few: u32,
    /// Forces one step before those of the state; empty unless the model takes one step per tick.
    pub before: InstantForces,
    /// Whether `before` has those forces, and nothing was put elsewhere in between.
    pub before_is_usable: bool,
}

impl Pace {
    /// Returns the pace before the first tick of a body with so many nodes, whose lists have room for `most_positions`.
    pub(crate) fn at_start(environment: &Environment, is_judged: bool, nodes: usize, most_positions: usize) -> Self {
        let substeps = environment.steps.substeps;
        let before = if is_judged && substeps == 1 {
            InstantForces::zero(nodes, most_positions)
        } else {
            InstantForces::default()
        };
        Self { substeps, settled_ticks: 0, settled_quotient: 0.0, too_few: 0, before, before_is_usable: false }
    }

    /// Makes the pace as at the start, of a body with so many positions, in the buffers it has.
    pub(crate) fn reset(&mut self, environment: &Environment, is_judged: bool, positions: usize) {
        self.start_again(environment.steps.substeps);
        self.too_few = 0;
        self.before.resize(0);
        if is_judged && environment.steps.substeps == 1 {
            self.before.resize(positions);
        }
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.before.total_n.clone_from(&other.before.total_n);
        self.before.external_n.clone_from(&other.before.external_n);
        (self.substeps, self.settled_ticks) = (other.substeps, other.settled_ticks);
        (self.settled_quotient, self.too_few) = (other.settled_quotient, other.too_few);
        self.before_is_usable = other.before_is_usable;
    }

    /// Returns whether the pace has lists of so many positions, and a number of substeps that the model may have.
    pub(crate) fn fits(&self, environment: &Environment, is_judged: bool, positions: usize) -> bool {
        let steps = environment.steps;
        let nodes = if is_judged && steps.substeps == 1 { positions } else { 0 };
        let most = if is_judged { most_substeps(environment) } else { steps.substeps };
        [&self.before.total_n, &self.before.external_n].iter().all(|list| list.len() == nodes)
            && (steps.substeps..=most).contains(&self.substeps)
            && self.substeps.is_multiple_of(steps.substeps_per_long_step)
            && self.settled_quotient.is_finite()
    }

    /// Returns all vectors, for a check that they are finite.
    pub(crate) fn vectors(&self) -> impl Iterator<Item = &DVec3> {
        self.before.total_n.iter().chain(&self.before.external_n)
    }

    /// Notes that the tick is repeated in `substeps` substeps.
    pub(super) fn start_again(&mut self, substeps: u32) {
        (self.substeps, self.settled_ticks, self.before_is_usable) = (substeps, 0, false);
        self.settled_quotient = 0.0;
    }

    /// Notes a tick in `self.substeps` substeps that was accepted; `quotient` is the part that `Q` was of what a tick may
    /// have. Takes as many as `least` at once where these are more;
    /// takes fewer, but at least half as many, once some ticks in a row have shown that they suffice.
    pub(super) fn settle(&mut self, least: u32, every: u32, quotient: f64) {
        if least > self.substeps {
            return self.start_again(least);
        }
        self.settled_ticks += 1;
        self.settled_quotient = self.settled_quotient.max(quotient);
        let near = (NEAR * f64::from(self.too_few)).ceil() as u32;
        let is_near = self.substeps <= near.next_multiple_of(every);
        if self.settled_ticks < if is_near { NEAR_SETTLED_TICKS } else { SETTLED_TICKS } {
            return;
        }
        // Q grows at most with dt².
        let times = self.settled_quotient.sqrt().clamp(0.5, 1.0);
        let fewer = (f64::from(self.substeps) * times).ceil() as u32;
        let fewer = if is_near { fewer } else { fewer.max(near) };
        let fewer = fewer.max(least).next_multiple_of(every);
        if fewer < self.substeps {
            self.substeps = fewer;
        }
        if is_near {
            self.too_few = 0;
        }
        (self.settled_ticks, self.settled_quotient) = (0, 0.0);
    }
}

/// Returns the largest number of substeps that is tried.
pub(super) fn most_substeps(environment: &Environment) -> u32 {
    let steps = environment.steps;
    let most = steps.substeps.saturating_mul(MOST_TIMES).min(MAX_SUBSTEPS.max(steps.substeps));
    most - most % steps.substeps_per_long_step
}

/// Forces at an instant.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct InstantForces {
    /// Total force (N) on each node.
    pub total_n: Vec<DVec3>,
    /// The part of it that loads, tools and injected forces make (N).
    pub external_n: Vec<DVec3>,
}

impl InstantForces {
    pub(super) fn zero(nodes: usize, most_positions: usize) -> Self {
        let zeros = || {
            let mut list = Vec::with_capacity(most_positions.max(nodes));
            list.resize(nodes, DVec3::ZERO);
            list
        };
        Self { total_n: zeros(), external_n: zeros() }
    }

    pub(super) fn resize(&mut self, positions: usize) {
        self.total_n.resize(positions, DVec3::ZERO);
        self.external_n.resize(positions, DVec3::ZERO);
    }

    pub(super) fn now(&self) -> StepForcesNow<'_> {
        StepForcesNow { total_n: &self.total_n, external_n: &self.external_n }
    }

    pub(super) fn swap(&mut self, state: &mut MechanicalState) {
        std::mem::swap(&mut self.total_n, &mut state.force_n);
        std::mem::swap(&mut self.external_n, &mut state.external_n);
    }
}
