//! A case from its text to its hashes.
use super::{
    case::{Case, Drive, Moment, Source},
    record::{Line, Mark},
};
use glam::DVec3;
use miette::{Context, IntoDiagnostic, Result, ensure};
use palpate_physics::{
    Chain, Energies, Model, Scratch, State, StepReport, TickInput,
    contact::ToolTarget,
    snapshot,
    statics::{Goal, StaticSettings, natural_modes, solve_static},
    step,
};
use palpate_scene::Scene;
use std::ops::ControlFlow;

/// Places in a run at which the hash is kept.
const MARKS: u64 = 10;
/// The one at which the state is saved, and goes on from there beside the run until the next.
const SAVED_AT: u64 = 5;

/// What happened in a scene: whether it is one of what it is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Seen {
    /// Ticks in which a tool pressed.
    pub pressed: u64,
    /// Ticks that were taken back and repeated.
    pub repeated: u64,
    /// Ticks with inputs that were refused.
    pub rejected: u64,
    /// Ticks whose result was refused.
    pub refused: u64,
    /// Ticks of a body that slept.
    pub asleep: u64,
    /// How often it woke.
    pub woken: u64,
    /// Most particles, or refined nodes of springs, that were awake.
    pub most_awake: usize,
    /// Those awake at the end.
    pub awake_at_last: usize,
}

/// A body under way, its hash with it.
struct Run<'a> {
    case: &'a Case,
    scene: &'a Scene,
    model: &'a Model,
    state: State,
    scratch: Scratch,
    drive: Drive,
    chain: Chain,
    /// Ticks done. The state's own count may have been reset.
    done: u64,
    seen: Seen,
}

/// Runs a case.
///
/// # Errors
/// A scene that cannot be loaded, built or solved, or a restored state that does not go on as the one that was saved.
pub(super) fn hashes_of(case: &Case) -> Result<(Line, Seen)> {
    line(case).wrap_err_with(|| format!("in the scene {}", case.name))
}

fn line(case: &Case) -> Result<(Line, Seen)> {
    let scene = case.scene()?;
    let model = Model::build(scene.model.clone()).into_diagnostic()?;
    let all = (scene.output.duration_s / model.settings().tick_period_s).round().max(1.0) as u64;
    let ticks = case.ticks.unwrap_or(all);
    let mut of_model = Chain::default();
    of_model.model(&model);
    let mut marks = vec![Mark::new("model", of_model)];
    let mut run = Run::new(case, &scene, &model);
    let mut restored: Option<Run<'_>> = None;
    for mark in 1..=MARKS {
        run.to(mark * ticks / MARKS);
        if let Some(mut beside) = restored.take() {
            beside.to(run.done);
            ensure!(beside.goes_with(&run), "a state that was saved and restored does not go on with the same bits");
        }
        if mark == SAVED_AT {
            restored = Some(run.restored()?);
        }
        marks.push(Mark::new((mark * ticks / MARKS).to_string(), run.chain));
    }
    if let Some(time_s) = case.rests_at_s {
        marks.push(Mark::new("static", at_rest(&scene, &model, time_s)?));
    }
    if case.modes > 0 {
        let mut chain = Chain::default();
        chain.modes(&natural_modes(&model, case.modes).into_diagnostic()?);
        marks.push(Mark::new("modes", chain));
    }
    let of = if matches!(case.source, Source::File(_)) { all } else { ticks };
    Ok((Line { name: case.name.clone(), ticks, of, marks }, run.seen))
}

impl Seen {
    fn note(&mut self, model: &Model, state: &State, report: &StepReport, slept: bool) {
        self.pressed += u64::from(state.mechanical.tools.iter().any(|tool| tool.contacts > 0));
        self.repeated += u64::from(report.repeated > 0);
        self.rejected += u64::from(report.inputs_rejected > 0);
        self.refused += u64::from(report.quarantined.is_some());
        self.asleep += u64::from(state.sleep.asleep);
        self.woken += u64::from(slept && !state.sleep.asleep);
        let refined = state
            .body
            .as_mass_spring()
            .zip(model.body().as_mass_spring())
            .map(|(springs, body)| springs.refined_nodes(body));
        self.awake_at_last = refined.unwrap_or_else(|| state.awake_particles());
        self.most_awake = self.most_awake.max(self.awake_at_last);
    }
}

impl<'a> Run<'a> {
    fn new(case: &'a Case, scene: &'a Scene, model: &'a Model) -> Self {
        let state = State::at_rest(model);
        let mut chain = Chain::default();
        chain.state(&state);
        let drive = Drive {
            tools: vec![ToolTarget::default(); model.tools().len()],
            load_factors: vec![0.0; model.loads().len()],
            prescribed_m: vec![DVec3::ZERO; model.prescribed().len()],
            point_forces: Vec::new(),
        };
        Self { case, scene, model, state, scratch: Scratch::new(model), drive, chain, done: 0, seen: Seen::default() }
    }

    /// Goes on until so many ticks are done, and adds the energies there.
    fn to(&mut self, ticks: u64) {
        while self.done < ticks {
            self.tick();
        }
        self.chain.energies(&Energies::of(self.model, &self.state));
    }

    fn tick(&mut self) {
        let Self { case, scene, model, state, scratch, drive, chain, done, seen } = self;
        let tick = *done + 1;
        let time_s = tick as f64 * model.settings().tick_period_s;
        // What came before may have made lists longer or shorter.
        drive.tools.clear();
        drive.tools.extend((0..model.tools().len()).map(|tool| scene.offline_target(tool, time_s)));
        drive.load_factors.resize(model.loads().len(), 0.0);
        drive.prescribed_m.resize(model.prescribed().len(), DVec3::ZERO);
        drive.point_forces.clear();
        scene.timeline.fill(time_s, &mut drive.load_factors, &mut drive.prescribed_m);
        (case.act)(&mut Moment { tick, time_s, model, state, scratch, drive });
        let input = TickInput {
            tools: &drive.tools,
            load_factors: &drive.load_factors,
            prescribed_displacements_m: &drive.prescribed_m,
            point_forces: &drive.point_forces,
        };
        let slept = state.sleep.asleep;
        let report = step(model, state, scratch, &input);
        seen.note(model, state, &report, slept);
        chain.tick(state, scratch, &report);
        *done = tick;
    }

    /// Whether the other is where this is, and came there by the same bits: but for the ledger of a hybrid body, whose
    /// transition force of the last tick is not saved, so that their work in the first half kick is missing.
    fn goes_with(&self, other: &Self) -> bool {
        if self.model.body().as_hybrid().is_none() {
            return self.chain == other.chain;
        }
        let (a, b) = (&self.state, &other.state);
        let forces =
            [(&a.mechanical.force_n, &b.mechanical.force_n), (&a.mechanical.external_n, &b.mechanical.external_n)];
        a.mechanical.tick == b.mechanical.tick
            && [(&a.mechanical.x, &b.mechanical.x), (&a.mechanical.v, &b.mechanical.v)]
                .into_iter()
                .chain(forces)
                .all(|(a, b)| a == b)
            && (&a.mechanical.tools, &a.mechanical.contact, &a.pace, &a.mechanical.viscous)
                == (&b.mechanical.tools, &b.mechanical.contact, &b.pace, &b.mechanical.viscous)
            && a.body.active_particles() == b.body.active_particles()
            && self.scratch.reactions_n() == other.scratch.reactions_n()
    }

    /// The same, from a snapshot and with buffers that have seen nothing.
    fn restored(&self) -> Result<Self> {
        let state = snapshot::restore(self.model, &snapshot::save(self.model, &self.state)).into_diagnostic()?;
        ensure!(state == self.state, "a state that was saved is restored as another");
        Ok(Self { state, scratch: Scratch::new(self.model), drive: self.drive.clone(), ..*self })
    }
}

/// The equilibrium at a time (s), where it is finite, or of what all settles to.
fn at_rest(scene: &Scene, model: &Model, time_s: f64) -> Result<Chain> {
    let mut load_factors = vec![0.0; scene.model.loads.len()];
    let mut prescribed_m = vec![DVec3::ZERO; scene.model.prescribed.len()];
    let timeline = &scene.timeline;
    let tools_at_s = if time_s.is_finite() {
        timeline.fill(time_s, &mut load_factors, &mut prescribed_m);
        time_s
    } else {
        timeline.fill_final(&mut load_factors, &mut prescribed_m);
        scene.output.duration_s
    };
    let tools: Vec<ToolTarget> =
        (0..scene.model.tools.len()).map(|tool| scene.offline_target(tool, tools_at_s).at_rest()).collect();
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    let settings = StaticSettings::default();
    let solution = solve_static(
        model,
        &Goal {
            load_factors: &load_factors,
            prescribed_displacements_m: &prescribed_m,
            tools: &tools,
            ..Goal::default()
        },
        &settings,
        go_on,
    )
    .into_diagnostic()?;
    let mut chain = Chain::default();
    chain.solution(&solution);
    let state = solution.state(model, &load_factors);
    chain.state(&state);
    chain.energies(&Energies::of(model, &state));
    Ok(chain)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hashes::{differences, own};

    /// The last bit of one velocity, in the midst of a run.
    fn flips(moment: &mut Moment<'_>) {
        if moment.tick == 47 {
            let v = &mut moment.state.mechanical.v[62].x;
            *v = f64::from_bits(v.to_bits() ^ 1);
        }
    }

    #[test]
    fn one_flipped_bit_is_found_and_told_with_its_ticks() {
        let case = own::cases().into_iter().find(|case| case.name == "block/hangs").unwrap();
        let line = |act: fn(&mut Moment<'_>)| hashes_of(&case.clone().acting(act)).unwrap().0;
        let (kept, again, flipped) = (line(|_| {}), line(|_| {}), line(flips));
        assert_eq!(kept, again);
        let told: Vec<String> = differences(&[kept], &[flipped], true).iter().map(ToString::to_string).collect();
        assert_eq!(told, ["block/hangs: differs from one of the ticks 41 to 50 on"]);
    }

    /// What is saved and restored in mid-run goes on beside it: one that is torn does not go with it.
    #[test]
    fn a_run_that_is_not_the_other_does_not_go_with_it() {
        let case = own::cases().into_iter().find(|case| case.name == "block/hangs").unwrap();
        let scene = case.scene().unwrap();
        let model = Model::build(scene.model.clone()).unwrap();
        let mut run = Run::new(&case, &scene, &model);
        run.to(10);
        let mut torn = run.restored().unwrap();
        assert!(torn.goes_with(&run));
        torn.state.mechanical.v[62].x += 1e-12;
        torn.to(11);
        run.to(11);
        assert!(!torn.goes_with(&run));
    }
}
