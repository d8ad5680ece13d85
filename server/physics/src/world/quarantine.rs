//! Quarantine of a state that became non-finite.
use super::State;
use crate::{
    bodies::SteppedBody,
    contact::ToolState,
    integrate::Pace,
    tick::{Environment, MechanicalState},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A state that became non-finite: it was put back to the last good tick, and stays there until reset or restore.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quarantine {
    /// Tick whose result was refused.
    pub tick: u64,
    /// The first node that was not finite, or [`Quarantine::NOT_A_NODE`].
    pub node: u32,
}

impl Quarantine {
    /// Stands in the place of a node where a tool, a load's work, a sum or a seed body's particle was not finite.
    pub const NOT_A_NODE: u32 = u32::MAX;
}

impl fmt::Display for Quarantine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.node {
            Self::NOT_A_NODE => {
                write!(f, "tick {} was refused: a tool, a sum or a particle became non-finite", self.tick)
            }
            node => write!(f, "tick {} was refused: node {node} became non-finite", self.tick),
        }
    }
}

/// Brings the last good state, which was put back, to rest, because a velocity that led to the quarantine would lead to
/// it again. `place` is where the state was not finite.
pub(super) fn enter_quarantine(
    environment: &Environment,
    place: u32,
    body: &mut SteppedBody<'_>,
    state: &mut MechanicalState,
    pace: &mut Pace,
    is_judged: bool,
) -> Quarantine {
    let node = body.node_at(place).unwrap_or(Quarantine::NOT_A_NODE);
    let tick = state.tick;
    body.stop_at_last_good();
    state.v.fill(DVec3::ZERO);
    state.force_n.fill(DVec3::ZERO);
    state.external_n.fill(DVec3::ZERO);
    state.force_is_current = false;
    state.contact.clear();
    for tool in &mut state.tools {
        tool.let_go();
    }
    pace.reset(environment, is_judged, state.x.len());
    Quarantine { tick, node }
}

/// Returns what in a state is not finite, if anything: the first node whose position or velocity is not, or
/// [`Quarantine::NOT_A_NODE`].
pub fn first_non_finite(state: &State) -> Option<u32> {
    first_non_finite_of(&state.mechanical, state.body.is_finite())
}

/// Returns the same for the state that every kind of body has; `own_is_finite` tells whether the state of this kind is
/// finite.
pub(super) fn first_non_finite_of(state: &MechanicalState, own_is_finite: bool) -> Option<u32> {
    // One pass of additions: a sum is finite only if every term is (overflow of finite terms is caught as well).
    let sum: DVec3 = state.x.iter().zip(&state.v).map(|(x, v)| *x + *v).sum();
    let of_tool = |tool: &ToolState| {
        let turning = tool.orientation.xyz() + tool.angular_velocity_rad_per_s + tool.device_torque_nm;
        tool.centre_m + tool.velocity_m_per_s + tool.device_force_n + turning
    };
    let tools: DVec3 = state.tools.iter().map(of_tool).sum();
    let work = state.ledger.external_work_j + state.ledger.dissipated_j;
    if sum.is_finite() && tools.is_finite() && work.is_finite() && own_is_finite {
        return None;
    }
    let node = state.x.iter().zip(&state.v).position(|(x, v)| !x.is_finite() || !v.is_finite());
    Some(node.map_or(Quarantine::NOT_A_NODE, |node| node as u32))
}
