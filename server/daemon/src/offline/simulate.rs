//! `palpated simulate`: a scene headless, as fast as it goes, the same bits every time.
use super::{
    args::{OutputArgs, positive},
    checkpoint::{Checkpoint, Checkpoints},
    exit::{CODES, Untrusted},
    folder,
    frames::Frames,
    interrupt::Interrupt,
    load,
    plan::{FrameCount, FrameRule, Plan, in_ticks},
    probe_rows::{ProbeRows, RowsMark},
    summary::{Ending, PeakNumbers, Percentiles, Summary, TimeNumbers},
    walls::WallNumbers,
};
use crate::{bodies::FirstTouch, progress::Progress, strained::Seen};
use glam::DVec3;
use hdrhistogram::Histogram;
use miette::IntoDiagnostic;
use palpate_physics::{Model, Scratch, State, StepReport, TickInput, contact::ToolTarget, step, world::strained_in};
use palpate_scene::{Probe, Scene, wording::short};
use std::{path::Path, process::ExitCode, time::Instant};

/// Flags of `palpated simulate`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = format!("Examples:\n  \
    palpated simulate ventricle                      print what it did\n  \
    palpated simulate ventricle --out run            and keep probes.csv, frames.pvd (open it in ParaView), summary.json\n  \
    palpated simulate my.toml --out run --frames none --duration-s 10\n  \
    palpated simulate my.toml --out run --resume     go on where that was interrupted, or its machine died\n\n\
    Nothing in a run is random: two runs of one scene give the same bits.\n\n{CODES}"))]
pub struct SimulateArgs {
    #[command(flatten)]
    output: OutputArgs,
    /// Simulated time in seconds, instead of the scene's
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    duration_s: Option<f64>,
    /// Number of frames over the whole run, or "none"; by default the scene's interval decides
    #[arg(long, value_name = "N|none", requires = "out")]
    frames: Option<FrameCount>,
    /// Go on with the run in the folder: with what it wrote until its last checkpoint, and to the same bits as without a break
    #[arg(long, requires = "out", conflicts_with = "force")]
    resume: bool,
    /// Wall time in seconds between checkpoints in the folder, from which --resume goes on; Ctrl-C writes one as well
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = positive)]
    checkpoint_every_s: f64,
}

/// How a run ended that may go on.
const INTERRUPTED: &str = "interrupted";
/// Elements that are inside out, or pressed beyond what their law is made for, are looked for so often (s), wherever a tick
/// had to be repeated, with every sample of a probe that tells of them, and at the end.
const LOOK_EVERY_S: f64 = 0.01;

/// Runs the command.
///
/// # Errors
/// A scene that does not load, or a folder that cannot be written.
pub fn run(args: &SimulateArgs) -> miette::Result<ExitCode> {
    let output = &args.output;
    let mut scene = load::load_with_warnings(&output.scene)?;
    let model = load::build_with_warnings(&mut scene)?;
    let ticks = |time_s: f64| in_ticks(time_s, &model);
    let plan = Plan::new(
        ticks(args.duration_s.unwrap_or(scene.output.duration_s)),
        ticks(scene.output.sample_interval_s),
        ticks(scene.output.frame_interval_s),
        args.frames,
    );
    let mut checkpoints = Checkpoints::new(output, args.checkpoint_every_s);
    let begun = if args.resume { checkpoints.read(&plan, &model)? } else { None };
    let out = match (output.out.as_deref(), &begun) {
        (Some(out), None) => Some(folder::prepare(out, output.force)?),
        (out, _) => out.map(Path::to_path_buf),
    };
    let path = out.as_ref().map(|out| out.join(folder::PROBES));
    let mut rows = match (&path, &begun) {
        (Some(path), Some(begun)) => ProbeRows::resume(&scene.probes, path, &begun.rows)?,
        _ => ProbeRows::new(&scene.probes, path.as_deref())?,
    };
    let mut frames = match (&out, plan.frames) {
        (Some(out), FrameRule::Every(_) | FrameRule::Count(_)) => {
            Some(Frames::new(out, &model, begun.as_ref().map_or(&[], |begun| &begun.frame_times_s))?)
        }
        _ => None,
    };
    let mut run = Run::new(&scene, &model)?;
    let resumed_s = begun.map(|begun| run.go_on(begun));
    let started = Instant::now();
    let ended_by = run.all(&plan, &mut rows, frames.as_mut(), &mut checkpoints)?;
    rows.flush()?;
    let ending = Ending {
        command: "simulate",
        by: ended_by,
        simulated_s: run.state.time_s(&model),
        wall_s: started.elapsed().as_secs_f64(),
        frames: frames.as_ref().map_or(0, Frames::count),
    };
    let mut summary = Summary::new(&scene, &model, &run.state, &rows, &ending);
    summary.time = Some(run.cost());
    summary.resumed_at_s = resumed_s;
    summary.walls = (run.walls.ticks > 0).then_some(run.walls);
    for slipped in run.slipped() {
        eprintln!("warning: {slipped}");
        summary.warnings.push(slipped);
    }
    let peak = |(value, time_s): (f64, f64)| PeakNumbers { value, time_s };
    summary.lowest_volume_ratio = run.seen.lowest().map(peak);
    summary.least_stretch_beyond_law = run.seen.pressed().map(peak);
    summary.warn(run.seen.weakened(&model, true));
    if let Some(out) = &out {
        summary.write(out)?;
    }
    if ended_by != INTERRUPTED {
        checkpoints.remove();
    }
    summary.print(output.json, out.as_deref())?;
    Ok(run.untrusted(summary.min_volume_ratio).map_or(ExitCode::SUCCESS, Untrusted::told))
}

/// A running simulation with its buffers.
pub(super) struct Run<'s> {
    scene: &'s Scene,
    model: &'s Model,
    pub(super) state: State,
    scratch: Scratch,
    targets: Vec<ToolTarget>,
    /// Where the first tool goes instead of where its driver says.
    first_tool: Option<ToolTarget>,
    load_factors: Vec<f64>,
    prescribed_m: Vec<DVec3>,
    tick_wall_ns: Histogram<u64>,
    /// The same of ticks with particles awake.
    awake_wall_ns: Histogram<u64>,
    most_awake: usize,
    repeated_ticks: u64,
    asleep_ticks: u64,
    /// How far (m) each tool slipped from its device at most, and when (s).
    slips: Vec<(f64, f64)>,
    seen: Seen,
    walls: WallNumbers,
    /// The tick that [`Self::all`] begins with.
    next_tick: u64,
}

impl<'s> Run<'s> {
    pub(super) fn new(scene: &'s Scene, model: &'s Model) -> miette::Result<Self> {
        const LONGEST_TICK_NS: u64 = 600_000_000_000;
        Ok(Self {
            scene,
            model,
            state: State::at_rest(model),
            scratch: Scratch::new(model),
            targets: vec![ToolTarget::default(); scene.model.tools.len()],
            first_tool: None,
            load_factors: vec![0.0; scene.model.loads.len()],
            prescribed_m: vec![DVec3::ZERO; scene.model.prescribed.len()],
            tick_wall_ns: Histogram::new_with_bounds(1, LONGEST_TICK_NS, 3).into_diagnostic()?,
            awake_wall_ns: Histogram::new_with_bounds(1, LONGEST_TICK_NS, 3).into_diagnostic()?,
            most_awake: 0,
            repeated_ticks: 0,
            asleep_ticks: 0,
            slips: vec![(0.0, 0.0); scene.model.tools.len()],
            seen: Seen::default(),
            walls: WallNumbers::default(),
            next_tick: 0,
        })
    }

    /// Goes on from a checkpoint; the time (s) of it. What ticks cost is counted from here on.
    fn go_on(&mut self, begun: Checkpoint) -> f64 {
        self.state = begun.state;
        self.next_tick = self.state.mechanical.tick + 1;
        self.most_awake = begun.most_awake;
        self.slips = begun.slips;
        self.seen = begun.seen;
        self.walls = begun.walls;
        self.state.time_s(self.model)
    }

    fn checkpoint(&self, plan: &Plan, rows: RowsMark, frame_times_s: &[f64]) -> Checkpoint {
        Checkpoint {
            plan: plan.clone(),
            state: self.state.clone(),
            rows,
            frame_times_s: frame_times_s.to_vec(),
            most_awake: self.most_awake,
            slips: self.slips.clone(),
            seen: self.seen,
            walls: self.walls,
        }
    }

    /// Runs to the end of the plan, and says what ended it.
    fn all(
        &mut self,
        plan: &Plan,
        rows: &mut ProbeRows<'_>,
        mut frames: Option<&mut Frames>,
        checkpoints: &mut Checkpoints,
    ) -> miette::Result<&'static str> {
        let interrupt = Interrupt::listen();
        let mut bar = Progress::new(&self.scene.name);
        let mut ended_by = "duration";
        let look_every = in_ticks(LOOK_EVERY_S, self.model);
        let samples_tell = self.scene.probes.iter().any(Probe::tells_of_inversion);
        let first = self.next_tick;
        for tick in first..=plan.ticks {
            let repeated = tick > 0 && self.tick().repeated > 0;
            let time_s = self.state.time_s(self.model);
            if self.state.quarantine.is_some() {
                ended_by = "quarantined";
            } else if tick < plan.ticks && interrupt.is_set() {
                ended_by = INTERRUPTED;
            }
            let last = tick == plan.ticks || ended_by != "duration";
            let due = tick.is_multiple_of(plan.sample_every);
            if repeated || last || tick.is_multiple_of(look_every) || (due && samples_tell) {
                self.look(time_s);
            }
            if due {
                rows.sample(time_s, self.model, &self.state, self.scratch.reactions_n())?;
            }
            let written = frames.as_ref().map_or(0, |frames| frames.count() as u64);
            let frame_is_due = plan.frame_is_due(tick, written, false);
            if let (Some(frames), true) = (&mut frames, frame_is_due) {
                frames.write(time_s, self.model, &self.state)?;
            }
            // Before what only the last state of a run that is broken off writes.
            if ended_by == INTERRUPTED || (!last && checkpoints.are_due()) {
                let frame_times_s = frames.as_ref().map_or(&[][..], |frames| frames.times_s());
                checkpoints.write(&self.checkpoint(plan, rows.mark()?, frame_times_s), self.model)?;
            }
            if last && !due {
                rows.sample(time_s, self.model, &self.state, self.scratch.reactions_n())?;
            }
            if let (Some(frames), true) = (&mut frames, last && !frame_is_due && plan.frame_is_due(tick, written, true))
            {
                frames.write(time_s, self.model, &self.state)?;
            }
            if last {
                break;
            }
            bar.show(tick as f64 / plan.ticks as f64, "simulating");
        }
        bar.finish();
        Ok(ended_by)
    }

    /// An error when a tick's result was refused.
    pub(super) fn refuse_quarantined(&self) -> miette::Result<()> {
        match self.state.quarantine {
            Some(what) => Err(Untrusted::Quarantined { what, inverted: String::new() }.into()),
            None => Ok(()),
        }
    }

    /// One tick, after which strained elements are looked for where they are when all is run.
    pub(super) fn tick_and_look(&mut self) {
        let repeated = self.tick().repeated > 0;
        if repeated || self.state.mechanical.tick.is_multiple_of(in_ticks(LOOK_EVERY_S, self.model)) {
            self.look(self.state.time_s(self.model));
        }
    }

    /// Tells where and when elements were inside out in the looks until now.
    pub(super) fn inverted(&self) -> Option<String> {
        self.seen.inverted(self.model)
    }

    /// Looks for strained elements; a body that sleeps is as it was at the look before.
    fn look(&mut self, time_s: f64) {
        if !self.state.sleep.asleep || self.seen.lowest().is_none() {
            self.seen.see(strained_in(self.model, &self.state, &mut self.scratch), time_s);
        }
    }

    /// Why the run is not to be trusted, if so, which ended with this volume ratio.
    fn untrusted(&self, end: f64) -> Option<Untrusted> {
        let least = self.seen.inverted(self.model);
        if let Some(what) = self.state.quarantine {
            let before = |least: String| format!("; before that elements turned inside out: {least}");
            return Some(Untrusted::Quarantined { what, inverted: least.map_or_else(String::new, before) });
        }
        let end = if end > 0.0 {
            format!("they have come back, it is {} at the end", short(end))
        } else {
            format!("it is {} at the end", short(end))
        };
        least.map(|least| Untrusted::Inverted { least, end })
    }

    /// One tick: the inputs at its end, then the step, whose wall time is recorded.
    pub(super) fn tick(&mut self) -> StepReport {
        let time_s = (self.state.mechanical.tick + 1) as f64 * self.model.settings().tick_period_s;
        for (tool, target) in self.targets.iter_mut().enumerate() {
            *target = self.first_tool.filter(|_| tool == 0).unwrap_or_else(|| self.scene.offline_target(tool, time_s));
        }
        self.scene.timeline.fill(time_s, &mut self.load_factors, &mut self.prescribed_m);
        let input = TickInput {
            tools: &self.targets,
            load_factors: &self.load_factors,
            prescribed_displacements_m: &self.prescribed_m,
            point_forces: &[],
        };
        let started = Instant::now();
        let report = step(self.model, &mut self.state, &mut self.scratch, &input);
        self.repeated_ticks += u64::from(report.repeated > 0);
        self.asleep_ticks += u64::from(report.substeps == 0 && self.state.sleep.asleep);
        for (most, tool) in self.slips.iter_mut().zip(&self.state.mechanical.tools) {
            let slip_m = tool.slip_m.length();
            if slip_m > most.0 {
                *most = (slip_m, time_s);
            }
        }
        let wall_ns = started.elapsed().as_nanos() as u64;
        self.walls.add(&self.scratch.meeting_walls());
        self.tick_wall_ns.saturating_record(wall_ns);
        let awake = self.state.awake_particles();
        if awake > 0 {
            self.awake_wall_ns.saturating_record(wall_ns);
            self.most_awake = self.most_awake.max(awake);
        }
        report
    }

    /// What to tell of rigid tools that slipped from their devices.
    fn slipped(&self) -> impl Iterator<Item = String> + '_ {
        let slips = self.scene.model.tools.iter().zip(&self.slips).filter(|(_, (most_m, _))| *most_m > 0.0);
        slips.map(|(tool, (most_m, time_s))| {
            format!(
                "the rigid tool \"{}\" slipped: at {} s it was {} mm behind where its driver says, since it would have gone through \
                 the surface there; press less deep or more slowly, or give it coupling = \"spring\"",
                tool.name,
                short(*time_s),
                short(most_m * 1e3)
            )
        })
    }

    /// Puts the first tool above the body, from where it goes to a light touch and stays. Returns how deep (m) that is.
    pub(super) fn touch(&mut self, touch: &FirstTouch) -> f64 {
        /// In radii of the tool.
        const DEPTH: f64 = 0.1;
        self.start_above(touch);
        self.send_first_tool(touch.at(-DEPTH, DVec3::ZERO));
        DEPTH * touch.radius_m
    }

    /// Puts the first tool above where it touches the body first.
    pub(super) fn start_above(&mut self, touch: &FirstTouch) {
        /// Height above the skin, in radii of the tool.
        const ABOVE: f64 = 0.5;
        self.state.place_tool(0, touch.at(ABOVE, DVec3::ZERO));
    }

    /// From now on the first tool goes there, whatever its driver says.
    pub(super) fn send_first_tool(&mut self, target: ToolTarget) {
        self.first_tool = Some(target);
    }

    /// What the ticks cost.
    pub(super) fn cost(&self) -> TimeNumbers {
        let wall = &self.tick_wall_ns;
        let period_s = self.model.settings().tick_period_s;
        TimeNumbers {
            tick_period_s: period_s,
            ticks: self.state.mechanical.tick,
            substeps_per_tick: self.model.substeps(),
            repeated_ticks: self.repeated_ticks,
            asleep_ticks: self.asleep_ticks,
            tick_wall_us: percentiles_us(wall),
            real_time_factor: if wall.is_empty() { 0.0 } else { period_s * 1e9 / wall.mean() },
        }
    }

    /// What those with particles awake cost, how many they were, and how many particles were awake at most.
    pub(super) fn cost_awake(&self) -> (Percentiles, u64, usize) {
        (percentiles_us(&self.awake_wall_ns), self.awake_wall_ns.len(), self.most_awake)
    }
}

fn percentiles_us(wall_ns: &Histogram<u64>) -> Percentiles {
    let us = |ns: u64| ns as f64 * 1e-3;
    Percentiles {
        mean: wall_ns.mean() * 1e-3,
        p50: us(wall_ns.value_at_quantile(0.5)),
        p99: us(wall_ns.value_at_quantile(0.99)),
        max: us(wall_ns.max()),
    }
}
