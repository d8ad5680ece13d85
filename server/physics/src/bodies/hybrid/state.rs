//! The state of a hybrid body beside positions and velocities: which particles are active, their prestrain, and the
//! transition force.
use super::{body::HybridBody, long_steps::LongSteps, prestrain::PrestrainDecay, spec::Waking, switching::Ball};
use crate::{
    contact::ToolSpec,
    hash::Chain,
    tick::{Environment, KindState, MechanicalState},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What a tick changes of a hybrid body beside its [`MechanicalState`], whose lists `x` and `v` have the values of the
/// coarse nodes first, then those of the active particles.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct HybridState {
    /// Active particles, ascending.
    ids: Vec<u32>,
    /// Particles that are to be active next; others than `ids` while a switch is being prepared.
    pub(super) next: Vec<u32>,
    /// Particles that are wanted awake. Where some have to fall asleep and others to wake, `next` first has those that
    /// stay awake, and then all of these.
    pub(super) wanted: Vec<u32>,
    /// The ball of every axis sample of every tool.
    pub(super) balls: Vec<Option<Ball>>,
    pub(crate) prestrain: PrestrainDecay,
    /// The transition force (N), of as many entries as there are positions, or none.
    pub(super) transition_force_n: Vec<DVec3>,
    /// The same as it was taken away at the last evaluation, before it decayed.
    pub(super) transition_taken_n: Vec<DVec3>,
    /// Energy (J) that decaying prestrain and the transition force gave lately, beyond what they and switches took.
    pub(crate) given_j: f64,
    /// Largest elastic energy (J) of what any recent switch changed.
    pub(super) switched_j: f64,
    pub(crate) long_steps: LongSteps,
    /// Ticks until particles may be woken at once again.
    pub(super) ticks_to_at_once: u32,
    /// Whether a load or an injected force acted on sleeping skin in the tick before.
    pub(super) acts_on_sleeping_skin: bool,
}

impl HybridState {
    /// Returns the active particles, ascending.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Returns the prestrain of cells that woke, and of coarse tets, while they were strained.
    pub fn prestrain(&self) -> &PrestrainDecay {
        &self.prestrain
    }

    /// Returns the number of active particles.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Sets the wanted particles. Where particles are active that are not wanted, those that are both come next.
    pub(super) fn want(&mut self, wanted: &[u32]) {
        self.wanted.clear();
        self.wanted.extend_from_slice(wanted);
        let Self { ids, next, wanted, .. } = self;
        let is_wanted = |id: &&u32| wanted.binary_search(id).is_ok();
        next.clear();
        if ids.iter().all(|id| is_wanted(&id)) {
            next.extend_from_slice(wanted);
        } else {
            next.extend(ids.iter().filter(is_wanted));
        }
    }

    /// Returns whether all particles sleep, none is about to wake, and nothing has prestrain. A transition force may be fading.
    pub(super) fn is_settled(&self) -> bool {
        self.ids.is_empty() && self.next.is_empty() && self.wanted.is_empty() && self.prestrain.is_empty()
    }

    pub(super) fn is_switching(&self) -> bool {
        self.next != self.ids
    }

    /// Returns whether all particles sleep.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Returns whether a cell has an active particle.
    fn touches(&self, body: &HybridBody, cell: u32) -> bool {
        let is_active = |particle: &u32| self.ids.binary_search(particle).is_ok();
        (cell as usize) < body.partition.cells().len() && body.partition.corners(cell as usize).iter().any(is_active)
    }

    /// Switches to the particles that are to be active next: what wakes starts where, and as fast as, it followed.
    /// `moved` is a buffer. Allocates nothing where there is room.
    pub(super) fn switch(&mut self, body: &HybridBody, state: &mut MechanicalState, moved: &mut Vec<DVec3>) {
        let nodes = body.node_count();
        for list in [&mut state.x, &mut state.v] {
            moved.clear();
            let (of_nodes, of_particles) = list.split_at(nodes);
            moved.extend(self.next.iter().map(|id| match self.ids.binary_search(id) {
                Ok(number) => of_particles[number],
                Err(_) => body.partition().anchor(*id).of(of_nodes),
            }));
            list.truncate(nodes);
            list.extend_from_slice(moved);
        }
        for list in [&mut state.force_n, &mut state.external_n] {
            list.resize(nodes + self.next.len(), DVec3::ZERO);
        }
        self.ids.clone_from(&self.next);
        self.transition_force_n.clear();
        self.transition_taken_n.clear();
        self.long_steps.forget();
        state.force_is_current = false;
    }
}

impl KindState for HybridState {
    type Body = HybridBody;

    /// Makes the state of a body whose particles all sleep.
    fn at_rest(body: &HybridBody, environment: &Environment) -> Self {
        let (most, positions) = (body.particles.most_active, body.most_positions());
        Self {
            ids: Vec::with_capacity(most),
            next: Vec::with_capacity(most),
            wanted: Vec::with_capacity(most),
            balls: vec![None; axis_sample_counts(body, &environment.tools).sum()],
            prestrain: PrestrainDecay::with_room(
                room_for_cells(body, body.particles.most_active),
                body.partition.residual_elements().len(),
            ),
            transition_force_n: Vec::with_capacity(positions),
            transition_taken_n: Vec::with_capacity(positions),
            given_j: 0.0,
            switched_j: 0.0,
            long_steps: LongSteps::with_room(body.node_count(), positions),
            ticks_to_at_once: 0,
            acts_on_sleeping_skin: false,
        }
    }

    /// Lets all particles sleep.
    fn reset(&mut self, _: &HybridBody) {
        self.ids.clear();
        self.next.clear();
        self.wanted.clear();
        self.balls.fill(None);
        self.prestrain.clear();
        self.transition_force_n.clear();
        self.transition_taken_n.clear();
        self.given_j = 0.0;
        self.switched_j = 0.0;
        self.long_steps.forget();
        self.ticks_to_at_once = 0;
        self.acts_on_sleeping_skin = false;
    }

    fn copy_from(&mut self, other: &Self) {
        self.ids.clone_from(&other.ids);
        self.next.clone_from(&other.next);
        self.wanted.clone_from(&other.wanted);
        self.balls.clone_from(&other.balls);
        self.prestrain.copy_from(&other.prestrain);
        self.transition_force_n.clone_from(&other.transition_force_n);
        self.transition_taken_n.clone_from(&other.transition_taken_n);
        self.given_j = other.given_j;
        self.switched_j = other.switched_j;
        self.long_steps.copy_from(&other.long_steps);
        self.ticks_to_at_once = other.ticks_to_at_once;
        self.acts_on_sleeping_skin = other.acts_on_sleeping_skin;
    }

    /// Particles have to be ascending, may wake and have room, and all numbers are finite.
    fn fits(&self, body: &HybridBody, environment: &Environment, _: &MechanicalState) -> bool {
        let (nodes, positions) = (body.node_count(), body.node_count() + self.ids.len());
        let may_wake = |id: &u32| body.may_wake(*id);
        let finite = |ball: &Ball| ball.rest_m.is_finite();
        self.balls.len() == axis_sample_counts(body, &environment.tools).sum::<usize>()
            && self.balls.iter().flatten().all(finite)
            && self.prestrain.is_finite()
            && [&self.transition_force_n, &self.transition_taken_n]
                .into_iter()
                .all(|list| [0, positions].contains(&list.len()) && list.iter().all(|force| force.is_finite()))
            && self.given_j.is_finite()
            && self.switched_j.is_finite()
            && self.long_steps.fit(nodes, positions)
            && self.prestrain.is_sorted()
            && self.prestrain.cells.iter().all(|prestrain| self.touches(body, prestrain.cell))
            && self.prestrain.tets.iter().all(|prestrain| (prestrain.tet as usize) < body.coarse().tets().len())
            && [&self.ids, &self.next, &self.wanted].into_iter().all(|list| {
                list.len() <= body.particles.most_active && list.is_sorted_by(|a, b| a < b) && list.iter().all(may_wake)
            })
    }

    fn chain(&self, chain: &mut Chain) {
        for list in [&self.ids, &self.next, &self.wanted] {
            chain.wholes(list);
        }
        chain.list(&self.balls, |chain, ball| {
            chain.maybe(ball.as_ref(), |chain, ball| {
                chain.vector(ball.rest_m);
                chain.whole(u64::from(ball.away_ticks));
            });
        });
        self.prestrain.chain(chain);
        chain.vectors(&self.transition_force_n);
        chain.vectors(&self.transition_taken_n);
        chain.real(self.given_j);
        chain.real(self.switched_j);
        self.long_steps.chain(chain);
        chain.whole(u64::from(self.ticks_to_at_once));
        chain.whole(u64::from(self.acts_on_sleeping_skin));
    }

    fn active_particles(&self) -> &[u32] {
        &self.ids
    }

    fn wake_at_rest(&mut self, ids: &[u32], middles_m: &[Option<DVec3>], state: &mut MechanicalState) {
        for (ball, middle_m) in self.balls.iter_mut().zip(middles_m) {
            *ball = middle_m.map(|rest_m| Ball { rest_m, away_ticks: 0 });
        }
        self.ids.clear();
        self.ids.extend_from_slice(ids);
        self.next.clone_from(&self.ids);
        self.wanted.clone_from(&self.ids);
        for list in [&mut state.x, &mut state.v, &mut state.force_n, &mut state.external_n] {
            list.resize(list.len() + ids.len(), DVec3::ZERO);
        }
    }
}

/// Returns the largest number of cells that are awake while no more than `most_active` particles are active.
pub(super) fn room_for_cells(body: &HybridBody, most_active: usize) -> usize {
    (body.partition().most_cells_at() * most_active).min(body.partition().cells().len())
}

/// Returns the number of axis samples of each tool that may keep particles awake: they are so near to one another that
/// the balls about them overlap.
pub(super) fn axis_sample_counts(body: &HybridBody, tools: &[ToolSpec]) -> impl Iterator<Item = usize> + Clone {
    let apart_m = match body.particles.waking {
        Waking::ByTools { reach_m } => reach_m,
        Waking::ByHand => f64::INFINITY,
    };
    tools.iter().map(move |tool| tool.axis_sample_count(apart_m))
}
