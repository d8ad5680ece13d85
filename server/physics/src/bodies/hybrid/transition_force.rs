//! The transition force keeps accelerations from jumping where particles wake or fall asleep under load; it decays.
//!
//! A particle that wakes under load is not in balance: forces that the coarse nodes bore now act on the particle. At a
//! switch, everything is to accelerate as it did. So a force `c` is taken away, with the new matrix `M''` and the
//! accelerations `a` before, those of what wakes following the nodes,
//! ```text
//! c = f − (M'' a + Σ_{p asleep now} ζ_p (1 − ε) m_p (a_p − ζ_pᵀ a))       f ← f − c       c ← e^{−T/τ} c every tick
//! ```
//! `Σ c = 0`, since neither momentum nor external force changes. The torque of `c` is zero at first; as a body that is
//! held nowhere moves on, its torque is cancelled by forces `M_i α × (x_i − x̄)` on the coarse nodes. The work of `c`
//! is booked in the ledger.
//!
//! It is a dead load: on a body that swings while regions are switched it may do work without end, as may decaying
//! prestrain (`prestrain`); and what wakes in an impact flees the tool while the load that kept it there pushes on. The
//! energy that both gave lately, beyond what they and switches took, is kept; in the substep in which it is more than
//! [`MOST_GIVEN`] of the elastic energy that switches lately changed, the transition force ends, and accelerations jump.
use super::{body::HybridBody, patch::KEPT, prestrain, running::RunningMassMatrix, state::HybridState};
use crate::tick::MechanicalState;
use glam::{BVec3, DMat3, DVec3};

/// `τ` (s), the time constant of the decay: less than that of prestrain, since a force that goes on pushing what swings
/// may feed it.
const DECAY_S: f64 = 0.02;
/// Time constant (s) with which the energy that the decay gave is forgotten.
const FORGETTING_S: f64 = 1.0;
/// Largest energy given by the decay, over the elastic energy that a switch lately changed, with which there is a
/// transition force.
const MOST_GIVEN: f64 = 0.07;
/// A transition force smaller than this, over the largest force, is left out.
const NOTHING: f64 = 1e-9;

/// Buffers for the transition force.
#[derive(Debug, Clone, Default)]
pub(crate) struct TransitionForce {
    /// Accelerations (m/s²) before a switch.
    before: Vec<DVec3>,
    /// Forces (N) with which accelerations do not jump; empty unless the next evaluation has to find the transition
    /// force.
    due_n: Vec<DVec3>,
    /// The tick in which they are due: another state that these buffers are used for has none.
    due_at_tick: u64,
    /// A buffer of accelerations (m/s²).
    accelerations: Vec<DVec3>,
    /// The transition force (N) before a tick's first kick, as it is and as it was taken.
    at_start_n: [Vec<DVec3>; 2],
}

impl TransitionForce {
    pub(super) fn with_room(entries: usize) -> Self {
        let list = || Vec::with_capacity(entries);
        Self { before: list(), due_n: list(), due_at_tick: 0, accelerations: list(), at_start_n: [list(), list()] }
    }

    /// Keeps the transition force before a tick's first kick: a tick that is repeated has it again, though it ended within the tick.
    pub(super) fn keep(&mut self, own: &HybridState) {
        let [force_n, taken_n] = &mut self.at_start_n;
        force_n.clone_from(&own.transition_force_n);
        taken_n.clone_from(&own.transition_taken_n);
    }

    /// Puts back what [`Self::keep`] kept.
    pub(super) fn put_back(&self, own: &mut HybridState) {
        let [force_n, taken_n] = &self.at_start_n;
        own.transition_force_n.clone_from(force_n);
        own.transition_taken_n.clone_from(taken_n);
    }

    /// Forgets what the next evaluation was to find, since another state is to be stepped.
    pub(super) fn forget_due(&mut self) {
        self.due_n.clear();
    }

    /// Records the accelerations before a switch.
    pub(super) fn take(&mut self, mass_matrix: &mut RunningMassMatrix, own: &HybridState, state: &MechanicalState) {
        self.before.clear();
        if state.force_is_current {
            self.before.extend_from_slice(&state.force_n);
            own.long_steps.add_beyond_n(1.0, &mut self.before);
            mass_matrix.accelerate(&mut self.before);
        }
    }

    /// Adds to `forces_n` the forces (N) on coarse nodes that stand for a particle which falls asleep, the `number`th
    /// active one before the switch.
    pub(super) fn transfer(&self, body: &HybridBody, number: usize, particle: u32, forces_n: &mut [DVec3]) {
        if self.before.is_empty() {
            return;
        }
        let anchor = body.partition.anchor(particle);
        let mass_kg = (1.0 - KEPT) * body.masses.particle_kg[particle as usize];
        let own = self.before[body.node_count() + number];
        anchor.push((own - anchor.of(&self.before)) * mass_kg, forces_n);
    }

    /// Finds, after a switch from the active particles `before` to those `after`, what the forces (N) have to be at the
    /// next evaluation, which is in this tick. `transferred_n` comes from [`Self::transfer`].
    pub(super) fn demand(
        &mut self,
        body: &HybridBody,
        mass_matrix: &mut RunningMassMatrix,
        before: &[u32],
        after: &[u32],
        transferred_n: &[DVec3],
        tick: u64,
    ) {
        self.due_at_tick = tick;
        self.due_n.clear();
        if self.before.is_empty() {
            return;
        }
        let nodes = body.node_count();
        self.accelerations.clear();
        self.accelerations.extend_from_slice(&self.before[..nodes]);
        let of = |id: &u32| {
            let number = before.binary_search(id).ok();
            number.map_or_else(|| body.partition.anchor(*id).of(&self.before), |number| self.before[nodes + number])
        };
        self.accelerations.extend(after.iter().map(of));
        self.due_n.resize(self.accelerations.len(), DVec3::ZERO);
        mass_matrix.momenta(body, &self.accelerations, &mut self.due_n);
        for (due, transferred) in self.due_n.iter_mut().zip(transferred_n) {
            *due += *transferred;
        }
    }

    /// Takes the transition force away from the total forces at an evaluation; computes it first after a switch.
    pub(crate) fn apply(&mut self, body: &HybridBody, own: &mut HybridState, state: &mut MechanicalState) {
        let MechanicalState { x, force_n, tick: at_tick, .. } = state;
        let may_be = own.may_use_transition_force();
        let HybridState { transition_force_n, transition_taken_n, .. } = own;
        if self.due_n.len() == force_n.len() && self.due_at_tick == *at_tick {
            transition_force_n.clear();
            transition_force_n.extend(force_n.iter().zip(&self.due_n).map(|(force, due)| *force - *due));
            for (force, free) in transition_force_n.iter_mut().zip(&body.free) {
                *force = DVec3::select(*free, *force, DVec3::ZERO);
            }
        }
        self.due_n.clear();
        transition_taken_n.clear();
        if transition_force_n.len() != force_n.len() {
            transition_force_n.clear();
            return;
        }
        if !may_be || largest(transition_force_n) <= NOTHING * largest(force_n) {
            transition_force_n.clear();
            return;
        }
        transition_taken_n.extend_from_slice(transition_force_n);
        if body.is_free {
            without_torque(body, x, transition_taken_n);
        }
        for (force, taken) in force_n.iter_mut().zip(&*transition_taken_n) {
            *force -= *taken;
        }
    }
}

impl HybridState {
    /// Returns the work (J) that the body does against the transition force over a kick of length `h_s`, with
    /// velocities `v` times a factor on free axes, and accelerations (m/s²).
    pub(super) fn transition_work_j(&self, v: &[DVec3], factor: f64, accelerations: &[DVec3], h_s: f64) -> f64 {
        let power = |((taken, v), a): ((&DVec3, &DVec3), &DVec3)| taken.dot(*v * factor + *a * (0.5 * h_s));
        h_s * self.transition_taken_n.iter().zip(v).zip(accelerations).map(power).sum::<f64>()
    }

    /// Ends the transition force.
    pub(super) fn forget_transition_force(&mut self) {
        self.transition_force_n.clear();
        self.transition_taken_n.clear();
    }

    /// Returns whether the decay gave little energy beside the elastic energy that switches changed lately.
    pub(super) fn may_use_transition_force(&self) -> bool {
        self.given_j <= MOST_GIVEN * self.switched_j
    }

    /// Lets the transition force, and the energies by which it is judged, decay over a tick.
    pub(super) fn decay_transition_force(&mut self, period_s: f64) {
        let forgotten = prestrain::factor(period_s, FORGETTING_S);
        self.given_j *= forgotten;
        self.switched_j *= forgotten;
        let factor = prestrain::factor(period_s, DECAY_S);
        self.transition_force_n.iter_mut().for_each(|force| *force *= factor);
    }
}

/// Takes the torque of forces (N) at positions `x` away, by forces on the coarse nodes whose sum is zero.
pub(super) fn without_torque(body: &HybridBody, x: &[DVec3], forces_n: &mut [DVec3]) {
    let torque: DVec3 = x.iter().zip(&*forces_n).map(|(x, force)| x.cross(*force)).sum();
    let turn = turn_of(&body.masses.node_kg, x, torque);
    for ((force, mass), x) in forces_n.iter_mut().zip(&body.masses.node_kg).zip(x) {
        *force -= turn.turn.cross(*x - turn.middle) * *mass;
    }
}

fn largest(list: &[DVec3]) -> f64 {
    list.iter().map(|a| a.length_squared()).fold(0.0, f64::max).sqrt()
}

/// An angular acceleration or velocity about a middle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn {
    pub(super) turn: DVec3,
    pub(super) middle: DVec3,
}

/// Returns `α` and `x̄` with which `Σ_i W_i (x_i − x̄) × (α × (x_i − x̄))` is the given moment; zero where the points
/// of positive weight lie on a line.
pub(super) fn turn_of(weights: &[f64], x: &[DVec3], moment: DVec3) -> Turn {
    let weighty = || weights.iter().zip(x).filter(|(weight, _)| **weight > 0.0);
    let total: f64 = weighty().map(|(weight, _)| weight).sum();
    let middle = weighty().map(|(weight, x)| *x * *weight).sum::<DVec3>() / total;
    // Σ W (|r|² I − r rᵀ)
    let inertia = weighty().fold(DMat3::ZERO, |sum, (weight, x)| {
        let r = *x - middle;
        let outer = DMat3::from_cols(r * r.x, r * r.y, r * r.z);
        sum + (DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer) * *weight
    });
    let turn = inertia.inverse() * moment;
    if turn.is_finite() { Turn { turn, middle } } else { Turn { turn: DVec3::ZERO, middle: DVec3::ZERO } }
}

/// Returns whether a body is held nowhere.
pub(super) fn is_free(node_kg: &[f64], free: &[BVec3]) -> bool {
    node_kg.iter().zip(free).all(|(mass, free)| *mass == 0.0 || *free == BVec3::TRUE)
}
