//! What a tick changes.
use super::Model;
use crate::{
    bodies::{hybrid::ActiveParticles, mass_spring::SpringState, seed::SeedMotion},
    contact::{ContactState, ToolState, ToolTarget},
    health::{Ledger, Quarantine, ViscousPower},
    integrate::{Pace, Sleep},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What a tick changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Ticks done since reset.
    pub tick: u64,
    /// Positions (m), one per node, and then one per active particle; of springs, one per awake node.
    pub x: Vec<DVec3>,
    /// Velocities (m/s), at the same time as `x`.
    pub v: Vec<DVec3>,
    /// Active particles.
    pub active: ActiveParticles,
    /// Total force (N) at `x`: what the next half kick uses.
    pub force_n: Vec<DVec3>,
    /// The part of it that loads, tools and injected forces make (N).
    pub external_n: Vec<DVec3>,
    /// False: `force_n` must be computed anew before it is used.
    pub force_is_current: bool,
    /// Tools, one per [`ModelSpec::tools`].
    pub tools: Vec<ToolState>,
    /// What contact remembers: samples touched, friction springs, and geometry that follows from `x`.
    pub contact: ContactState,
    /// Factor of every load at the end of the last tick.
    pub load_factors: Vec<f64>,
    /// Work and dissipation since reset.
    pub ledger: Ledger,
    /// Power of viscous stress at the last two substeps.
    pub viscous: ViscousPower,
    /// In how many substeps ticks are taken.
    pub pace: Pace,
    /// Whether the body sleeps.
    pub sleep: Sleep,
    /// Of a seed body: all that its steps change. `x` and `v` are copies of its nodes'.
    pub seed: Option<SeedMotion>,
    /// Of springs: which nodes are awake, and what is refined.
    pub springs: Option<SpringState>,
    /// Set when a tick's result was not finite.
    pub quarantine: Option<Quarantine>,
}

impl State {
    /// At rest, at tick 0.
    pub fn at_rest(model: &Model) -> Self {
        let springs = model.springs().map(SpringState::at_rest);
        let awake: &[u32] = springs.as_ref().map_or(&[], |springs| &springs.motion.ids);
        let nodes = model.always_awake_m().len() + awake.len();
        let zeros = || with_room(model, std::iter::repeat_n(DVec3::ZERO, nodes));
        let mut x = with_room(model, model.always_awake_m().iter().copied());
        x.extend(awake.iter().map(|&node| model.rest_positions_m()[node as usize]));
        Self {
            tick: 0,
            x,
            v: zeros(),
            active: ActiveParticles::none(model),
            force_n: zeros(),
            external_n: zeros(),
            force_is_current: false,
            tools: model.tools_at_start(),
            contact: model.contact().state(),
            load_factors: vec![0.0; model.spec().loads.len()],
            ledger: Ledger::default(),
            viscous: ViscousPower::default(),
            pace: Pace::at_start(model),
            sleep: Sleep::at_start(model),
            seed: model.seed().map(SeedMotion::at_rest),
            springs,
            quarantine: None,
        }
    }

    /// Copies another state of the same model into the buffers it has: allocates nothing.
    pub fn copy_from(&mut self, other: &Self) {
        self.tick = other.tick;
        self.x.clone_from(&other.x);
        self.v.clone_from(&other.v);
        self.active.copy_from(&other.active);
        self.force_n.clone_from(&other.force_n);
        self.external_n.clone_from(&other.external_n);
        self.force_is_current = other.force_is_current;
        self.tools.clone_from_slice(&other.tools);
        self.contact.copy_from(&other.contact);
        self.load_factors.copy_from_slice(&other.load_factors);
        self.ledger = other.ledger;
        self.viscous = other.viscous;
        self.pace.copy_from(&other.pace);
        self.sleep.copy_from(&other.sleep);
        if let (Some(own), Some(other)) = (&mut self.seed, &other.seed) {
            own.copy_from(other);
        }
        if let (Some(own), Some(other)) = (&mut self.springs, &other.springs) {
            own.copy_from(other);
        }
        self.quarantine = other.quarantine;
    }

    /// Back to rest at tick 0, as [`Self::at_rest`], in the buffers it has: allocates nothing.
    pub fn reset(&mut self, model: &Model) {
        self.tick = 0;
        if let (Some(own), Some(body)) = (&mut self.springs, model.springs()) {
            own.reset(body);
        }
        let awake: &[u32] = self.springs.as_ref().map_or(&[], |springs| &springs.motion.ids);
        self.x.clear();
        self.x.extend_from_slice(model.always_awake_m());
        self.x.extend(awake.iter().map(|&node| model.rest_positions_m()[node as usize]));
        for buffer in [&mut self.v, &mut self.force_n, &mut self.external_n] {
            buffer.clear();
            buffer.resize(self.x.len(), DVec3::ZERO);
        }
        self.active.clear();
        self.force_is_current = false;
        for (tool, spec) in self.tools.iter_mut().zip(&model.spec().tools) {
            *tool = ToolState::at_start(spec);
        }
        self.contact.clear();
        self.load_factors.fill(0.0);
        self.ledger = Ledger::default();
        self.viscous = ViscousPower::default();
        self.pace.reset(model);
        self.sleep.reset();
        if let (Some(own), Some(seed)) = (&mut self.seed, model.seed()) {
            own.reset(seed);
        }
        self.quarantine = None;
    }

    /// Puts a tool and its device at rest in a pose, as if it had always been there: it neither sweeps what
    /// lies between nor keeps its contact. Where it is put into the surface it presses nothing yet: it resists from that depth
    /// on, and as from the outside once it has left. A pose that is not finite, or a tool that is not there, changes nothing.
    /// Allocates nothing.
    pub fn place_tool(&mut self, tool: usize, pose: ToolTarget) {
        let Some(state) = self.tools.get_mut(tool).filter(|_| pose.is_finite()) else { return };
        state.target = pose.at_rest();
        state.let_go();
        (state.centre_m, state.orientation) = (pose.position_m, pose.orientation);
        self.contact.put_tool(tool);
        self.force_is_current = false;
    }

    /// Particles that are awake.
    pub fn awake_particles(&self) -> usize {
        self.seed.as_ref().map_or(self.active.len(), |seed| seed.awake as usize)
    }

    /// Positions (m) of the awake particles.
    pub fn awake_particles_m(&self) -> &[DVec3] {
        let of_hybrid = &self.x[self.x.len() - self.active.len()..];
        self.seed.as_ref().map_or(of_hybrid, |seed| &seed.now.particles.x[..seed.awake as usize])
    }

    /// Simulated time (s) since reset.
    pub fn time_s(&self, model: &Model) -> f64 {
        self.tick as f64 * model.spec().settings.tick_period_s
    }
}

/// A list for nodes with room for active particles, or for all springs' nodes that may be awake: it never grows beyond.
pub(crate) fn with_room(model: &Model, of_nodes: impl ExactSizeIterator<Item = DVec3>) -> Vec<DVec3> {
    let of_particles = model.spec().particles.as_ref().map_or(0, |particles| particles.most_active);
    let of_springs = model.springs().map_or(0, |body| body.model().most_nodes());
    let mut list = Vec::with_capacity((of_nodes.len() + of_particles).max(of_springs));
    list.extend(of_nodes);
    list
}
