//! Explicit total-Lagrangian leapfrog (velocity Verlet), the default integrator.
//!
//! With lumped mass `m`, force `f` and step `dt = T/s` for `s` substeps of the tick `T`:
//! ```text
//! v ← v + ½dt f(x)/m                       first half kick, with the force kept from the last tick
//! s times:  x ← x + dt v                   drift
//!           f ← f(x, v)                    internal, gravity, loads, contact
//!           v ← v + dt f/m                 kick (the last one is a half kick)
//! ```
//! Second order and symplectic without damping; `x` and `v` are synchronous at the end of a tick. Viscous forces see the
//! velocity half a step late, which the step bound of `world::substeps` accounts for.
//!
//! Ledger: the work of a force `g` over a kick of length `h` is exactly its share of the kinetic change,
//! `h g·(v + ½h f/m)`; what viscous stress takes is an estimate ([`ViscousPower`]).
use crate::{
    contact::{Body, SubstepTime, ToolTarget},
    fem::loads::add_load_n,
    health::{Quarantine, first_non_finite},
    world::{Model, PointForce, Scratch, State, StepReport, TickInput},
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
    run_substeps(model, state, scratch, input, &loads);
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

fn is_usable(model: &Model, point: &PointForce) -> bool {
    (point.node as usize) < model.mass_kg().len() && point.force_n.is_finite()
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

fn run_substeps(model: &Model, state: &mut State, scratch: &mut Scratch, input: &TickInput<'_>, loads: &LoadRamp) {
    let substeps = model.substeps();
    let dt_s = model.spec().settings.tick_period_s / f64::from(substeps);
    if !state.force_is_current {
        state.contact.forget_geometry();
        evaluate(model, state, scratch, input, loads, &Instant { fraction: 0.0, dt_s: 0.0, fastest_m_per_s: 0.0 });
    }
    kick(model, state, 0.5 * dt_s);
    for substep in 1..=substeps {
        let fastest_m_per_s = drift(state, dt_s);
        let fraction = f64::from(substep) / f64::from(substeps);
        evaluate(model, state, scratch, input, loads, &Instant { fraction, dt_s, fastest_m_per_s });
        kick(model, state, if substep == substeps { 0.5 * dt_s } else { dt_s });
    }
    loads.finish(state, input);
    model.contact().end_tick(&mut state.tools, &mut state.contact, substeps, &mut scratch.contact);
    for (reaction, (force, inverse_mass)) in
        scratch.reaction_n.iter_mut().zip(state.force_n.iter().zip(model.inverse_mass_per_kg()))
    {
        // The holder supplies what the other forces lack: r = −f on prescribed axes.
        *reaction = DVec3::select(inverse_mass.cmpeq(DVec3::ZERO), -*force, DVec3::ZERO);
    }
}

/// `x ← x + dt v`; returns the largest speed (m/s) of any node.
fn drift(state: &mut State, dt_s: f64) -> f64 {
    // Four running maxima, so that one does not wait for the other.
    let mut most = [0.0_f64; 4];
    for (xs, vs) in state.x.chunks_mut(4).zip(state.v.chunks(4)) {
        for ((x, v), most) in xs.iter_mut().zip(vs).zip(&mut most) {
            *x += *v * dt_s;
            *most = most.max(v.length_squared());
        }
    }
    most.into_iter().fold(0.0, f64::max).sqrt()
}

/// When forces are evaluated.
struct Instant {
    /// Part of the tick that is over.
    fraction: f64,
    /// Step that led here (s); 0 at the start.
    dt_s: f64,
    /// Bound of the speed (m/s) with which any node came here.
    fastest_m_per_s: f64,
}

/// Load factors between the last tick's and this one's.
struct LoadRamp {
    usable: bool,
}

impl LoadRamp {
    fn new(state: &State, input: &TickInput<'_>) -> Self {
        let usable =
            input.load_factors.len() == state.load_factors.len() && input.load_factors.iter().all(|f| f.is_finite());
        Self { usable }
    }

    fn factor(&self, from: f64, input: &TickInput<'_>, load: usize, fraction: f64) -> f64 {
        if self.usable { from + (input.load_factors[load] - from) * fraction } else { from }
    }

    fn finish(&self, state: &mut State, input: &TickInput<'_>) {
        if self.usable {
            state.load_factors.copy_from_slice(input.load_factors);
        }
    }
}

/// Total force at the present positions into `state.force_n`, its external part into `state.external_n`.
fn evaluate(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    input: &TickInput<'_>,
    loads: &LoadRamp,
    now: &Instant,
) {
    let external = &mut state.external_n;
    external.fill(DVec3::ZERO);
    for (index, load) in model.spec().loads.iter().enumerate() {
        let factor = loads.factor(state.load_factors[index], input, index, now.fraction);
        if factor != 0.0 {
            add_load_n(load, factor, model.surface(), (model.rest_positions_m(), &state.x), external);
        }
    }
    for point in input.point_forces {
        if is_usable(model, point) {
            external[point.node as usize] += point.force_n;
        }
    }
    let (x, v) = (&state.x, &state.v);
    if !state.tools.is_empty() {
        let body = Body { x, v, fastest_m_per_s: now.fastest_m_per_s };
        let tick_period_s = model.spec().settings.tick_period_s;
        let time = SubstepTime { fraction: now.fraction, dt_s: now.dt_s, tick_period_s };
        let (tools, contact) = (&mut state.tools, &mut state.contact);
        model.contact().substep(&body, &time, tools, contact, external, &mut scratch.contact);
    }
    let force = &mut state.force_n;
    let viscous_power_w = model.kernel().forces_n(model.rest_positions_m(), x, v, force, &mut scratch.kernel);
    state.viscous.record(viscous_power_w, now.dt_s > 0.0);
    let gravity = model.gravity_m_per_s2();
    for ((force, external), mass) in force.iter_mut().zip(external.iter()).zip(model.mass_kg()) {
        *force += *external + gravity * *mass;
    }
    state.force_is_current = true;
}

/// `v ← (v e^{−c h/2} + h f/m) e^{−c h/2}`, and the ledger's share of it.
fn kick(model: &Model, state: &mut State, h_s: f64) {
    let damping = model.spec().settings.mass_damping_per_s;
    let half = (damping > 0.0).then(|| (-0.5 * damping * h_s).exp());
    if let Some(factor) = half {
        damp(model, state, factor);
    }
    let mut power_w = DVec3::ZERO;
    let external = &state.external_n;
    for (((v, force), inverse_mass), external) in
        state.v.iter_mut().zip(&state.force_n).zip(model.inverse_mass_per_kg()).zip(external)
    {
        let change = *force * *inverse_mass * h_s;
        power_w += *external * (*v + change * 0.5);
        *v += change;
    }
    state.ledger.external_work_j += h_s * (power_w.element_sum() + holders_power_w(model, state));
    state.ledger.dissipated_j += h_s * state.viscous.work_rate_w();
    if let Some(factor) = half {
        damp(model, state, factor);
    }
}

/// Power (W) of the holders' reactions, `−f` on prescribed axes, whose velocity a kick leaves alone.
fn holders_power_w(model: &Model, state: &State) -> f64 {
    let mut power_w = 0.0;
    for set in &model.spec().prescribed {
        let held = DVec3::from(set.axes.map(|axis| f64::from(u8::from(axis))));
        for &node in &set.nodes {
            power_w -= state.force_n[node as usize].dot(held * state.v[node as usize]);
        }
    }
    power_w
}

fn damp(model: &Model, state: &mut State, factor: f64) {
    let mut taken_j = 0.0;
    for ((v, inverse_mass), mass) in state.v.iter_mut().zip(model.inverse_mass_per_kg()).zip(model.mass_kg()) {
        let damped = DVec3::select(inverse_mass.cmpeq(DVec3::ZERO), *v, *v * factor);
        taken_j += 0.5 * mass * (v.length_squared() - damped.length_squared());
        *v = damped;
    }
    state.ledger.dissipated_j += taken_j;
}
