//! One tick: inputs, quarantine, the integrator of the model's settings, reactions.
use super::{
    forces::{LoadRamp, Tick, is_usable},
    sleep,
    stability::{is_judged, substeps_for},
};
use crate::{
    health::{Quarantine, first_non_finite},
    world::{Model, Scratch, State, StepReport, TickInput},
};
use glam::DVec3;

/// Most repetitions of a tick.
const MOST_REPETITIONS: u32 = 3;

/// Advances `state` by one tick. Allocates nothing; same arguments, same bits.
///
/// A tick of leapfrog whose step proves too long ([`super::stability`]), or whose result is not finite, is taken back and repeated from
/// its start in more substeps, at most three times; the ticks after it keep to them until fewer would do.
///
/// A result that is not finite even so is refused: the last good state is kept, at rest, and marked as quarantined until it is
/// reset or restored. Inputs that are not finite, or of the wrong length, are replaced by the previous tick's and counted.
pub fn step(model: &Model, state: &mut State, scratch: &mut Scratch, input: &TickInput<'_>) -> StepReport {
    if state.quarantine.is_some() {
        return StepReport { substeps: 0, repeated: 0, inputs_rejected: 0, quarantined: None };
    }
    if state.sleep.asleep
        && let Some(report) = sleep::doze(model, state, scratch, input)
    {
        return report;
    }
    if let (Some(body), Some(own)) = (model.hybrid(), &mut scratch.hybrid) {
        own.prepare(model, body, state);
        scratch.history.fit(state);
    }
    if let (Some(body), Some(own)) = (model.springs(), &mut scratch.springs) {
        own.prepare(model, body, state, input.point_forces);
    }
    let was_quiet = model.rest_bound().is_some() && state.sleep.is_quiet(&state.load_factors, input);
    let judged = is_judged(model);
    scratch.last_good.keep(state);
    if judged {
        scratch.last_good.keep_for_repetition(state);
        if let Some(own) = &mut scratch.hybrid {
            own.keep_long_steps(state);
        }
    }
    let mut repeated = 0;
    loop {
        let substeps = state.pace.substeps;
        state.pace.before_is_usable &= state.force_is_current;
        let loads = LoadRamp::new(state, input);
        let inputs_rejected = take_inputs(model, state, scratch, input) + u32::from(!loads.usable);
        run(&Tick { model, input, loads, substeps }, state, scratch);
        let spoilt = first_non_finite(state);
        if judged {
            let Scratch { history, last_good, hybrid, .. } = &mut *scratch;
            let evidence = history.evidence(model, state, (last_good, hybrid.as_deref_mut()), substeps);
            let unstable =
                spoilt.is_some() || evidence.is_unstable(model, state, (history, hybrid.as_deref_mut()), substeps);
            let quotient = spoilt.is_none().then(|| evidence.quotient());
            let more = substeps_for(model, substeps, quotient).filter(|_| unstable && repeated < MOST_REPETITIONS);
            if let Some(more) = more {
                scratch.last_good.put_all_back(state);
                scratch.history.put_back(state);
                if let Some(own) = &mut scratch.hybrid {
                    own.put_long_steps_back(state);
                }
                state.pace.start_again(more);
                repeated += 1;
                continue;
            }
            if substeps > model.substeps() && !unstable && repeated == 0 {
                state.pace.calm(model, evidence.quotient());
            }
            scratch.history.hand_on(&mut state.pace, substeps);
            if let Some(own) = &mut scratch.hybrid {
                own.hand_on_long_step(state);
            }
        }
        state.tick = state.tick.saturating_add(1);
        let quarantined = spoilt.map(|node| quarantine(model, state, scratch, node));
        if quarantined.is_none() {
            sleep::consider(model, state, input, was_quiet && inputs_rejected == 0);
        }
        return StepReport { substeps, repeated, inputs_rejected, quarantined };
    }
}

/// Puts back the last good tick, at rest: a velocity that led here would lead here again.
fn quarantine(model: &Model, state: &mut State, scratch: &mut Scratch, node: u32) -> Quarantine {
    // Positions of springs are those of awake nodes.
    let awake = state.springs.as_ref().map(|springs| &springs.motion.ids);
    let node = awake.map_or(node, |ids| ids.get(node as usize).copied().unwrap_or(Quarantine::NOT_A_NODE));
    let what = Quarantine { tick: state.tick, node };
    scratch.last_good.put_back(state);
    state.v.fill(DVec3::ZERO);
    state.force_n.fill(DVec3::ZERO);
    state.external_n.fill(DVec3::ZERO);
    state.active.long_steps.forget();
    state.force_is_current = false;
    state.pace.reset(model);
    state.sleep.wake();
    if let Some(seed) = &mut state.seed {
        seed.stop();
    }
    state.contact.clear();
    scratch.reaction_n.fill(DVec3::ZERO);
    for tool in &mut state.tools {
        tool.let_go();
    }
    state.quarantine = Some(what);
    what
}

/// Gives the tools their targets, and starts their tick. Returns how many were refused.
pub(super) fn take_tools(model: &Model, state: &mut State, scratch: &mut Scratch, input: &TickInput<'_>) -> u32 {
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
    let tick_period_s = model.spec().settings.tick_period_s;
    model.contact().begin_tick(&mut state.tools, &mut scratch.contact, tick_period_s);
    rejected
}

/// Checks the inputs, starts the tools' tick, and gives prescribed nodes the velocity that reaches their target at its end.
fn take_inputs(model: &Model, state: &mut State, scratch: &mut Scratch, input: &TickInput<'_>) -> u32 {
    let mut rejected = take_tools(model, state, scratch, input);
    let period_s = model.spec().settings.tick_period_s;
    rejected += input.point_forces.iter().filter(|point| !is_usable(model, point)).count() as u32;
    let prescribed_ok = input.prescribed_displacements_m.len() == model.spec().prescribed.len()
        && input.prescribed_displacements_m.iter().all(|d| d.is_finite());
    rejected += u32::from(!prescribed_ok);
    scratch.history.held_jump = 0.0;
    if model.seed().is_some() || model.springs().is_some() {
        // What it holds stands still.
        let moved = prescribed_ok && input.prescribed_displacements_m.iter().any(|d| *d != DVec3::ZERO);
        return rejected + u32::from(moved);
    }
    let of_held_j = |state: &State, scratch: &Scratch| match (model.hybrid(), &scratch.hybrid) {
        (Some(body), Some(own)) => own.patch.metric().of_held_j(body, &state.v),
        _ => 0.0,
    };
    let before_j = of_held_j(state, scratch);
    for (set, spec) in model.spec().prescribed.iter().enumerate() {
        let displacement = prescribed_ok.then(|| input.prescribed_displacements_m[set]);
        scratch.history.held_jump += aim_prescribed(model, state, &spec.nodes, spec.axes, displacement, period_s);
    }
    state.ledger.external_work_j += of_held_j(state, scratch) - before_j;
    rejected
}

/// Sets the constant velocity, on prescribed axes, that takes nodes to `X + displacement` in one tick (`None`: hold).
/// The kinetic energy this gives is work done from outside. Returns `Σ m (Δv)²`.
fn aim_prescribed(
    model: &Model,
    state: &mut State,
    nodes: &[u32],
    axes: [bool; 3],
    displacement_m: Option<DVec3>,
    period_s: f64,
) -> f64 {
    let mut jump = 0.0;
    for node in nodes.iter().map(|&n| n as usize) {
        let before = state.v[node];
        for axis in (0..3).filter(|&axis| axes[axis]) {
            let target = displacement_m.map(|d| model.rest_positions_m()[node][axis] + d[axis]);
            state.v[node][axis] = target.map_or(0.0, |target| (target - state.x[node][axis]) / period_s);
        }
        state.ledger.external_work_j +=
            0.5 * model.mass_kg()[node] * (state.v[node].length_squared() - before.length_squared());
        jump += model.mass_kg()[node] * (state.v[node] - before).length_squared();
    }
    jump
}

/// All substeps, then what is summed up once a tick.
fn run(tick: &Tick<'_>, state: &mut State, scratch: &mut Scratch) {
    let model = tick.model;
    model.scheme().run(tick, state, scratch);
    tick.loads.finish(state, tick.input);
    model.contact().end_tick(&mut state.tools, &mut state.contact, tick.substeps, &mut scratch.contact);
    write_reactions(model, state, scratch);
}

/// The holder supplies what the other forces lack: `r = −f` on prescribed axes.
pub(super) fn write_reactions(model: &Model, state: &State, scratch: &mut Scratch) {
    for node in model.spec().prescribed.iter().flat_map(|set| &set.nodes).map(|&node| node as usize) {
        if let Some(own) = &scratch.springs {
            scratch.reaction_n[node] = own.place(node as u32).map_or(DVec3::ZERO, |place| -state.force_n[place]);
            continue;
        }
        let held = model.inverse_mass_per_kg()[node].cmpeq(DVec3::ZERO);
        let total_n = state.force_n[node] + state.active.long_steps.beyond_of(node);
        scratch.reaction_n[node] = DVec3::select(held, -total_n, DVec3::ZERO);
    }
}
