//! The step of a model by one tick.
use super::{
    Model, Quarantine, Scratch, State,
    quarantine::{enter_quarantine, first_non_finite_of},
    sleep,
};
use crate::{
    bodies::SteppedBody,
    contact::ContactScratch,
    integrate::{Attempt, ForceHistory, Scheme, Verdict},
    tick::{Environment, LoadRamp, MechanicalState, StifferContact, Tick, TickInput, take_prescribed, take_tools},
};
use glam::DVec3;

/// The report of a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepReport {
    /// Number of substeps in which the tick was taken; 0 while the state is quarantined or the body asleep.
    pub substeps: u32,
    /// Number of times that the tick was taken back and repeated in more substeps, because it proved unstable.
    pub repeated: u32,
    /// Number of inputs that were not finite or of the wrong length, and so were replaced by the previous tick's.
    pub inputs_rejected: u32,
    /// The quarantine, where this tick's result was refused.
    pub quarantined: Option<Quarantine>,
}

impl StepReport {
    /// Report of a tick in which nothing was done.
    const NOTHING: Self = Self { substeps: 0, repeated: 0, inputs_rejected: 0, quarantined: None };
}

/// Advances `state` by one tick. Nothing is allocated, and the same arguments give the same bits.
///
/// A tick of leapfrog whose step proves too long (`integrate::stability`), or whose result is not finite, is taken back
/// and repeated from its start in more substeps, at most three times. The ticks after it are taken in as many until
/// fewer suffice.
///
/// A result that is still not finite is refused: the last good state is kept, at rest, and marked as quarantined until
/// it is reset or restored. Inputs that are not finite, or of the wrong length, are replaced by the previous tick's and
/// counted.
///
/// A state or scratch of another kind of body is left as it is.
pub fn step(model: &Model, state: &mut State, scratch: &mut Scratch, input: &TickInput<'_>) -> StepReport {
    if state.quarantine.is_some() {
        return StepReport::NOTHING;
    }
    let environment = model.environment();
    let State { mechanical, body: own, pace, sleep, quarantine, .. } = state;
    let Scratch { reaction_n, last_good, history, contact, body: buffers } = scratch;
    let Some(mut body) = SteppedBody::of(model.body(), own, buffers) else { return StepReport::NOTHING };

    body.prepare(environment, mechanical, input.point_forces);
    if sleep.asleep {
        let substeps = pace.substeps;
        let (body, state) = (&mut body, &mut *mechanical);
        let dozing = sleep::Dozing { body, state, sleep, substeps, last_good, contact, reaction_n };
        if let Some(report) = sleep::doze(environment, dozing, input) {
            return report;
        }
    }
    history.fit(environment, mechanical.x.len(), pace);
    let was_quiet = model.sleep_bound().is_some() && sleep.is_quiet(&mechanical.load_factors, input);
    last_good.keep(mechanical);
    body.keep_last_good();
    if let Some(judged) = body.judged().filter(|_| history.is_kept()) {
        last_good.keep_for_repetition(mechanical);
        judged.keep(mechanical);
    }
    let mut report = StepReport { substeps: pace.substeps, ..StepReport::NOTHING };
    let spoilt = loop {
        report.substeps = pace.substeps;
        pace.before_is_usable &= mechanical.force_is_current;
        let loads = LoadRamp::new(mechanical, input);
        let tick = Tick { environment, input, loads, substeps: pace.substeps };
        report.inputs_rejected = take_inputs(&tick, &body, mechanical, contact, history);
        run(model.scheme(), &tick, &mut body, mechanical, contact, history);
        let spoilt = first_non_finite_of(mechanical, body.is_finite());
        let Some(judged) = body.judged().filter(|_| history.is_kept()) else { break spoilt };
        let start = last_good.start_of_tick();
        let is_spoilt = spoilt.is_some();
        let stiffened = StifferContact { times: contact.most_stiffened(), walls_sq: contact.most_of_walls() };
        match history.judge(
            environment,
            judged,
            mechanical,
            start,
            pace,
            Attempt { is_spoilt, repeated: report.repeated, stiffened },
        ) {
            Verdict::Accept => break spoilt,
            Verdict::Repeat => {
                last_good.put_all_back(mechanical);
                history.put_back(mechanical);
                judged.put_back();
                report.repeated += 1;
            }
        }
    };
    write_reactions(environment, &body, mechanical, reaction_n);
    mechanical.tick = mechanical.tick.saturating_add(1);
    if let Some(place) = spoilt {
        last_good.put_back(mechanical);
        let entered = enter_quarantine(environment, place, &mut body, mechanical, pace, history.is_kept());
        reaction_n.fill(DVec3::ZERO);
        sleep.wake();
        *quarantine = Some(entered);
        report.quarantined = Some(entered);
        return report;
    }
    let was_quiet = was_quiet && report.inputs_rejected == 0;
    if sleep::is_to_be_considered(model, mechanical.tick, sleep, input, was_quiet) {
        let is_apart = body.is_apart(environment, mechanical);
        sleep::consider(model, own, mechanical, sleep, pace, is_apart);
    }
    report
}

/// Checks the inputs, starts the tools' tick, and gives prescribed nodes the velocity that reaches their target at the
/// tick's end. Returns how many inputs were refused.
fn take_inputs(
    tick: &Tick<'_>,
    body: &SteppedBody<'_>,
    state: &mut MechanicalState,
    contact: &mut ContactScratch,
    history: &mut ForceHistory,
) -> u32 {
    let Tick { environment, input, loads, .. } = tick;
    let mut rejected = take_tools(environment, state, contact, input) + input.rejected_points(environment);
    let displacements_m = input.usable_displacements_m(environment);
    rejected += u32::from(displacements_m.is_none()) + u32::from(!loads.usable);
    history.held_jump = 0.0;
    match body.prescribed_nodes() {
        Some(nodes) => {
            let before_j = body.held_kinetic_j(state);
            history.held_jump = take_prescribed(environment, &nodes, displacements_m, state);
            state.ledger.external_work_j += body.held_kinetic_j(state) - before_j;
            rejected
        }
        // Nodes that such a body holds stand still.
        None => rejected + u32::from(displacements_m.is_some_and(|given| given.iter().any(|d| *d != DVec3::ZERO))),
    }
}

/// Takes all substeps, then ends the tick of loads and contact.
fn run(
    scheme: &Scheme,
    tick: &Tick<'_>,
    body: &mut SteppedBody<'_>,
    state: &mut MechanicalState,
    contact: &mut ContactScratch,
    history: &mut ForceHistory,
) {
    scheme.run(tick, body, state, contact, history);
    tick.loads.finish(state, tick.input);
    tick.environment.contact.end_tick(&mut state.tools, &mut state.contact, tick.substeps, contact);
}

/// Writes the holders' reactions `r = −f` on prescribed axes, which balance the other forces.
pub(super) fn write_reactions(
    environment: &Environment,
    body: &SteppedBody<'_>,
    state: &MechanicalState,
    reaction_n: &mut [DVec3],
) {
    for node in environment.prescribed.iter().flat_map(|set| &set.nodes).map(|&node| node as usize) {
        reaction_n[node] = body.reaction_n(node, state);
    }
    body.move_reactions_to_faces(reaction_n);
}
