//! What a tick changes of a body of any kind, and of its tools.
use super::{Environment, Ledger, ViscousPower};
use crate::contact::{ContactState, ToolState, ToolTarget};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What a tick changes of a body of any kind, and of its tools.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MechanicalState {
    /// Number of ticks since reset.
    pub tick: u64,
    /// Positions (m) of the nodes that always exist, then of awake particles or nodes of springs.
    pub x: Vec<DVec3>,
    /// Velocities (m/s), at the same time as `x`.
    pub v: Vec<DVec3>,
    /// Total force (N) at `x`, which the next half kick uses.
    pub force_n: Vec<DVec3>,
    /// The part of it that loads, tools and injected forces make (N).
    pub external_n: Vec<DVec3>,
    /// Whether `force_n` is up to date; otherwise it must be computed before it is used.
    pub force_is_current: bool,
    /// State of each tool of [`Environment::tools`].
    pub tools: Vec<ToolState>,
    /// State of contact: touched samples, friction springs, and geometry that follows from `x`.
    pub contact: ContactState,
    /// Factor of every load at the end of the last tick.
    pub load_factors: Vec<f64>,
    /// Work and dissipation since reset.
    pub ledger: Ledger,
    /// Power of viscous stress at the last two substeps.
    pub viscous: ViscousPower,
}

impl MechanicalState {
    /// Returns the state at rest at tick 0, with nodes at `x` (m). The capacity of `x` is the largest number of
    /// positions that there will ever be.
    pub(crate) fn at_rest(environment: &Environment, x: Vec<DVec3>) -> Self {
        let zeros = || {
            let mut list = Vec::with_capacity(x.capacity());
            list.resize(x.len(), DVec3::ZERO);
            list
        };
        Self {
            tick: 0,
            v: zeros(),
            force_n: zeros(),
            external_n: zeros(),
            x,
            force_is_current: false,
            tools: environment.tools_at_start(),
            contact: environment.contact.state(),
            load_factors: vec![0.0; environment.loads.len()],
            ledger: Ledger::default(),
            viscous: ViscousPower::default(),
        }
    }

    /// Copies another state of the same model into the buffers it has. Nothing is allocated.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.tick = other.tick;
        self.x.clone_from(&other.x);
        self.v.clone_from(&other.v);
        self.force_n.clone_from(&other.force_n);
        self.external_n.clone_from(&other.external_n);
        self.force_is_current = other.force_is_current;
        self.tools.clone_from_slice(&other.tools);
        self.contact.copy_from(&other.contact);
        self.load_factors.copy_from_slice(&other.load_factors);
        self.ledger = other.ledger;
        self.viscous = other.viscous;
    }

    /// Brings the state back to rest at tick 0, with nodes at `x` (m), in the buffers it has. Nothing is allocated.
    pub(crate) fn reset(&mut self, environment: &Environment, x: impl Iterator<Item = DVec3>) {
        self.tick = 0;
        self.x.clear();
        self.x.extend(x);
        for buffer in [&mut self.v, &mut self.force_n, &mut self.external_n] {
            buffer.clear();
            buffer.resize(self.x.len(), DVec3::ZERO);
        }
        self.force_is_current = false;
        for (tool, spec) in self.tools.iter_mut().zip(&environment.tools) {
            *tool = ToolState::at_start(spec);
        }
        self.contact.clear();
        self.load_factors.fill(0.0);
        self.ledger = Ledger::default();
        self.viscous = ViscousPower::default();
    }

    /// Returns the number of positions for which all lists have room.
    pub(crate) fn room(&self) -> usize {
        [&self.x, &self.v, &self.force_n, &self.external_n].iter().map(|list| list.capacity()).min().unwrap_or_default()
    }

    /// Returns whether the state has the sizes of an environment, and so many positions.
    pub(crate) fn fits(&self, environment: &Environment, positions: usize) -> bool {
        [&self.x, &self.v, &self.force_n, &self.external_n].iter().all(|list| list.len() == positions)
            && self.tools.len() == environment.tools.len()
            && self.load_factors.len() == environment.loads.len()
    }

    /// Returns whether every number of the state is finite.
    pub(crate) fn is_finite(&self) -> bool {
        let sums =
            [self.ledger.external_work_j, self.ledger.dissipated_j, self.viscous.latest_w, self.viscous.before_w];
        [&self.x, &self.v, &self.force_n, &self.external_n].iter().all(|list| list.iter().all(|a| a.is_finite()))
            && self.tools.iter().all(ToolState::is_finite)
            && self.load_factors.iter().chain(&sums).all(|n| n.is_finite())
    }

    /// Puts a tool and its device at rest in a pose, as if they had always been there: the tool neither sweeps what
    /// lies between nor keeps its contact. Where it is put into the surface it presses nothing yet; it resists from
    /// that depth on, and as from the outside once it has left. A pose that is not finite, or a tool that does not
    /// exist, changes nothing. Nothing is allocated.
    pub(crate) fn place_tool(&mut self, tool: usize, pose: ToolTarget) {
        let Some(state) = self.tools.get_mut(tool).filter(|_| pose.is_finite()) else { return };
        state.target = pose.at_rest();
        state.let_go();
        (state.centre_m, state.orientation, state.slip_m) = (pose.position_m, pose.orientation, DVec3::ZERO);
        self.contact.put_tool(tool);
        self.force_is_current = false;
    }
}
