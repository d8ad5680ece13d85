//! One tick: inputs, quarantine, the integrator of the model's settings, reactions.
use super::forces::{LoadRamp, Tick, is_usable};
use crate::{
    contact::ToolTarget,
    health::{Quarantine, first_non_finite},
    world::{Model, Scratch, State, StepReport, TickInput},
};
use glam::DVec3;

/// Advances `state` by one tick. Allocates nothing; same arguments, same bits.
///
/// A result that is not finite is refused: the last good state is kept, at rest, and marked as quarantined until it is
/// reset or restored. Inputs that are not finite, or of the wrong length, are replaced by the previous tick's and counted.
pub fn step(model: &Model, state: &mut State, scratch: &mut Scratch, input: &TickInput<'_>) -> StepReport {
    if state.quarantine.is_some() {
        return StepReport { substeps: 0, inputs_rejected: 0, quarantined: None };
    }
    scratch.last_good.keep(state);
    let loads = LoadRamp::new(state, input);
    let inputs_rejected = take_inputs(model, state, scratch, input) + u32::from(!loads.usable);
    run(&Tick { model, input, loads }, state, scratch);
    state.tick = state.tick.saturating_add(1);
    let quarantined = first_non_finite(state).map(|node| quarantine(state, scratch, node));
    StepReport { substeps: model.substeps(), inputs_rejected, quarantined }
}

/// Puts back the last good tick, at rest: a velocity that led here would lead here again.
fn quarantine(state: &mut State, scratch: &mut Scratch, node: u32) -> Quarantine {
    let what = Quarantine { tick: state.tick, node };
    scratch.last_good.put_back(state);
    state.v.fill(DVec3::ZERO);
    state.force_n.fill(DVec3::ZERO);
    state.external_n.fill(DVec3::ZERO);
    state.force_is_current = false;
    state.contact.clear();
    scratch.reaction_n.fill(DVec3::ZERO);
    for tool in &mut state.tools {
        tool.let_go();
    }
    state.quarantine = Some(what);
    what
}

/// Checks the inputs, starts the tools' tick, and gives prescribed nodes the velocity that reaches their target at its end.
fn take_inputs(model: &Model, state: &mut State, scratch: &mut Scratch, input: &TickInput<'_>) -> u32 {
    let mut rejected = 0;
    let period_s = model.spec().settings.tick_period_s;
    let tools_ok = input.tools.len() == state.tools.len();
    rejected += u32::from(!tools_ok);
    for (index, tool) in state.tools.iter_mut().enumerate() {
        let target = if tools_ok { input.tools[index] } else { tool.target };
        let finite = target.position_m.is_finite() && target.velocity_m_per_s.is_finite();
        rejected += u32::from(!finite);
        tool.previous_target = tool.target;
        tool.target = if finite { target } else { ToolTarget { velocity_m_per_s: DVec3::ZERO, ..tool.target } };
    }
    model.contact().begin_tick(&mut state.tools, &mut scratch.contact);
    rejected += input.point_forces.iter().filter(|point| !is_usable(model, point)).count() as u32;
    let prescribed_ok = input.prescribed_displacements_m.len() == model.spec().prescribed.len()
        && input.prescribed_displacements_m.iter().all(|d| d.is_finite());
    rejected += u32::from(!prescribed_ok);
    for (set, spec) in model.spec().prescribed.iter().enumerate() {
        let displacement = prescribed_ok.then(|| input.prescribed_displacements_m[set]);
        aim_prescribed(model, state, &spec.nodes, spec.axes, displacement, period_s);
    }
    rejected
}

/// Sets the constant velocity, on prescribed axes, that takes nodes to `X + displacement` in one tick (`None`: hold).
/// The kinetic energy this gives is work done from outside.
fn aim_prescribed(
    model: &Model,
    state: &mut State,
    nodes: &[u32],
    axes: [bool; 3],
    displacement_m: Option<DVec3>,
    period_s: f64,
) {
    for node in nodes.iter().map(|&n| n as usize) {
        let before = state.v[node].length_squared();
        for axis in (0..3).filter(|&axis| axes[axis]) {
            let target = displacement_m.map(|d| model.rest_positions_m()[node][axis] + d[axis]);
            state.v[node][axis] = target.map_or(0.0, |target| (target - state.x[node][axis]) / period_s);
        }
        state.ledger.external_work_j += 0.5 * model.mass_kg()[node] * (state.v[node].length_squared() - before);
    }
}

/// All substeps, then what is summed up once a tick.
fn run(tick: &Tick<'_>, state: &mut State, scratch: &mut Scratch) {
    let model = tick.model;
    model.scheme().run(tick, state, scratch);
    tick.loads.finish(state, tick.input);
    model.contact().end_tick(&mut state.tools, &mut state.contact, model.substeps(), &mut scratch.contact);
    for (reaction, (force, inverse_mass)) in
        scratch.reaction_n.iter_mut().zip(state.force_n.iter().zip(model.inverse_mass_per_kg()))
    {
        // The holder supplies what the other forces lack: r = −f on prescribed axes.
        *reaction = DVec3::select(inverse_mass.cmpeq(DVec3::ZERO), -*force, DVec3::ZERO);
    }
}
