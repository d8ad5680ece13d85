//! The inputs of a tick, and how they are applied to the state.
use super::{Environment, MechanicalState};
use crate::contact::{ContactScratch, ToolTarget};
use glam::DVec3;

/// A force injected on a node for one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointForce {
    /// Node of the surface ([`Environment::surface`]), or any node of a body of tets alone.
    pub node: u32,
    /// Force (N, world).
    pub force_n: DVec3,
}

/// What acts during a tick. Values are those at its end; they are reached linearly from the previous tick's.
#[derive(Debug, Clone, Copy)]
pub struct TickInput<'a> {
    /// Target of each tool.
    pub tools: &'a [ToolTarget],
    /// Factor of each load.
    pub load_factors: &'a [f64],
    /// Displacement (m) from rest of each prescribed set.
    pub prescribed_displacements_m: &'a [DVec3],
    /// Injected forces, which are constant during the tick.
    pub point_forces: &'a [PointForce],
}

impl TickInput<'_> {
    /// Returns the number of injected forces that are left out, because they are not finite or on no node that may have
    /// one.
    pub(crate) fn rejected_points(&self, environment: &Environment) -> u32 {
        self.point_forces.iter().filter(|point| !environment.accepts(point)).count() as u32
    }

    /// Returns the displacement (m) of every prescribed set, or `None` where one is missing or not finite; then all
    /// sets hold still.
    pub(crate) fn usable_displacements_m(&self, environment: &Environment) -> Option<&[DVec3]> {
        let given = self.prescribed_displacements_m;
        (given.len() == environment.prescribed.len() && given.iter().all(|d| d.is_finite())).then_some(given)
    }
}

/// Gives the tools their targets, and starts their tick. Returns how many targets were refused.
pub(crate) fn take_tools(
    environment: &Environment,
    state: &mut MechanicalState,
    scratch: &mut ContactScratch,
    input: &TickInput<'_>,
) -> u32 {
    let mut rejected = 0;
    let tools_ok = input.tools.len() == state.tools.len();
    rejected += u32::from(!tools_ok);
    for (index, tool) in state.tools.iter_mut().enumerate() {
        let target = if tools_ok { input.tools[index] } else { tool.target };
        let finite = target.is_finite();
        rejected += u32::from(!finite);
        tool.previous_target = tool.target;
        tool.target = if finite { target } else { tool.target.at_rest() };
    }
    environment.contact.begin_tick(&mut state.tools, scratch, environment.settings.tick_period_s);
    rejected
}

/// The nodes to which prescribed sets belong.
pub(crate) struct PrescribedNodes<'a> {
    /// Rest positions (m).
    pub(crate) rest_m: &'a [DVec3],
    /// Lumped masses (kg).
    pub(crate) mass_kg: &'a [f64],
}

/// Gives prescribed nodes the constant velocity that takes them to `X + displacement` at the tick's end; without
/// displacements they hold still. The kinetic energy that they get is work done from outside. Returns `Σ m (Δv)²` (kg
/// m²/s²).
pub(crate) fn take_prescribed(
    environment: &Environment,
    nodes: &PrescribedNodes<'_>,
    displacements_m: Option<&[DVec3]>,
    state: &mut MechanicalState,
) -> f64 {
    let period_s = environment.settings.tick_period_s;
    let mut jump = 0.0;
    for (set, spec) in environment.prescribed.iter().enumerate() {
        let displacement_m = displacements_m.map(|given| given[set]);
        let mut jump_of_set = 0.0;
        for node in spec.nodes.iter().map(|&n| n as usize) {
            let before = state.v[node];
            for axis in (0..3).filter(|&axis| spec.axes[axis]) {
                let target = displacement_m.map(|d| nodes.rest_m[node][axis] + d[axis]);
                state.v[node][axis] = target.map_or(0.0, |target| (target - state.x[node][axis]) / period_s);
            }
            let mass_kg = nodes.mass_kg[node];
            state.ledger.external_work_j += 0.5 * mass_kg * (state.v[node].length_squared() - before.length_squared());
            jump_of_set += mass_kg * (state.v[node] - before).length_squared();
        }
        jump += jump_of_set;
    }
    jump
}
