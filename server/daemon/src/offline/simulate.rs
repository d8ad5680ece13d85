//! `palpated simulate`: a scene headless, as fast as it goes, the same bits every time.
use super::{
    args::{OutputArgs, positive},
    exit::{CODES, Untrusted},
    folder,
    frames::Frames,
    interrupt::Interrupt,
    load,
    probe_rows::ProbeRows,
    summary::{Ending, PeakNumbers, Percentiles, Summary, TimeNumbers},
    walls::WallNumbers,
};
use crate::{bodies::FirstTouch, progress::Progress, strained::Seen};
use glam::DVec3;
use hdrhistogram::Histogram;
use miette::IntoDiagnostic;
use palpate_physics::{Model, Scratch, State, StepReport, TickInput, contact::ToolTarget, step, world::strained_in};
use palpate_scene::{Probe, Scene, wording::short};
use std::{process::ExitCode, time::Instant};

/// Flags of `palpated simulate`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = format!("Examples:\n  \
    palpated simulate ventricle                      print what it did\n  \
    palpated simulate ventricle --out run            and keep probes.csv, frames.pvd (open it in ParaView), summary.json\n  \
    palpated simulate my.toml --out run --frames none --duration-s 10\n\n\
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
}

/// Elements that are inside out, or pressed beyond what their law is made for, are looked for so often (s), wherever a tick
/// had to be repeated, with every sample of a probe that tells of them, and at the end.
const LOOK_EVERY_S: f64 = 0.01;

/// How many frames a run writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameCount {
    /// None at all.
    None,
    /// This many, evenly over the run, from its start to its end.
    Some(u32),
}

impl std::str::FromStr for FrameCount {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self::None),
            _ => match text.parse() {
                Ok(count) if count > 1 => Ok(Self::Some(count)),
                _ => Err("give a whole number of frames, 2 or more, or \"none\"".into()),
            },
        }
    }
}

/// Runs the command.
///
/// # Errors
/// A scene that does not load, or a folder that cannot be written.
pub fn run(args: &SimulateArgs) -> miette::Result<ExitCode> {
    let output = &args.output;
    let mut scene = load::load_with_warnings(&output.scene)?;
    let model = load::build_with_warnings(&mut scene)?;
    let out = output.out.as_deref().map(|out| folder::prepare(out, output.force)).transpose()?;
    let ticks = |time_s: f64| in_ticks(time_s, &model);
    let plan = Plan::new(
        ticks(args.duration_s.unwrap_or(scene.output.duration_s)),
        ticks(scene.output.sample_interval_s),
        ticks(scene.output.frame_interval_s),
        args.frames,
    );
    let mut rows = ProbeRows::new(&scene.probes, out.as_ref().map(|out| out.join(folder::PROBES)).as_deref())?;
    let mut frames = match (&out, plan.frames) {
        (Some(out), FrameRule::Every(_) | FrameRule::Count(_)) => Some(Frames::new(out, &model)?),
        _ => None,
    };
    let mut run = Run::new(&scene, &model)?;
    let started = Instant::now();
    let ended_by = run.all(&plan, &mut rows, frames.as_mut())?;
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
    summary.print(output.json, out.as_deref())?;
    Ok(run.untrusted(summary.min_volume_ratio).map_or(ExitCode::SUCCESS, Untrusted::told))
}

/// What to do at which tick.
struct Plan {
    ticks: u64,
    sample_every: u64,
    frames: FrameRule,
}

/// When a frame is due.
#[derive(Debug, Clone, Copy, PartialEq)]
enum FrameRule {
    Never,
    Every(u64),
    /// This many over the run, at least 2.
    Count(u64),
}

/// Ticks in a time, at least one.
fn in_ticks(time_s: f64, model: &Model) -> u64 {
    ((time_s / model.settings().tick_period_s).round() as u64).max(1)
}

impl Plan {
    fn new(ticks: u64, sample_every: u64, frame_every: u64, frames: Option<FrameCount>) -> Self {
        let frames = match frames {
            Some(FrameCount::None) => FrameRule::Never,
            // There are no more states than ticks and the start.
            Some(FrameCount::Some(count)) => FrameRule::Count(u64::from(count).min(ticks.saturating_add(1))),
            None => FrameRule::Every(frame_every),
        };
        Self { ticks, sample_every, frames }
    }

    /// Whether the state after a tick is a frame, `written` being there already. The last state always is.
    fn frame_is_due(&self, tick: u64, written: u64, last: bool) -> bool {
        match self.frames {
            FrameRule::Never => false,
            FrameRule::Every(ticks) => last || tick.is_multiple_of(ticks),
            FrameRule::Count(count) => {
                last || tick as u128 >= u128::from(written) * u128::from(self.ticks) / u128::from(count - 1)
            }
        }
    }
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
        })
    }

    /// Runs to the end of the plan, and says what ended it.
    fn all(
        &mut self,
        plan: &Plan,
        rows: &mut ProbeRows<'_>,
        mut frames: Option<&mut Frames>,
    ) -> miette::Result<&'static str> {
        let interrupt = Interrupt::listen();
        let mut bar = Progress::new(&self.scene.name);
        let mut ended_by = "duration";
        let look_every = in_ticks(LOOK_EVERY_S, self.model);
        let samples_tell = self.scene.probes.iter().any(Probe::tells_of_inversion);
        for tick in 0..=plan.ticks {
            let repeated = tick > 0 && self.tick().repeated > 0;
            let time_s = self.state.time_s(self.model);
            if self.state.quarantine.is_some() {
                ended_by = "quarantined";
            } else if tick < plan.ticks && interrupt.is_set() {
                ended_by = "interrupted";
            }
            let last = tick == plan.ticks || ended_by != "duration";
            let sampled = last || tick.is_multiple_of(plan.sample_every);
            if repeated || tick.is_multiple_of(look_every) || (sampled && samples_tell) || last {
                self.look(time_s);
            }
            if sampled {
                rows.sample(time_s, self.model, &self.state, self.scratch.reactions_n())?;
            }
            if let Some(frames) = &mut frames
                && plan.frame_is_due(tick, frames.count() as u64, last)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks whose states are frames, when the run ends after `ends`.
    fn frames(plan: &Plan, ends: u64) -> Vec<u64> {
        let mut due = Vec::new();
        for tick in 0..=ends {
            if plan.frame_is_due(tick, due.len() as u64, tick == ends) {
                due.push(tick);
            }
        }
        due
    }

    #[test]
    fn the_wanted_number_of_frames_from_the_start_to_the_end() {
        let plan = |ticks, count| Plan::new(ticks, 1, 1, Some(FrameCount::Some(count)));
        assert_eq!(frames(&plan(10, 2), 10), [0, 10]);
        assert_eq!(frames(&plan(10, 4), 10), [0, 3, 6, 10]);
        for count in 2..=101 {
            assert_eq!(frames(&plan(100, count), 100).len(), count as usize);
        }
    }

    #[test]
    fn more_frames_than_ticks_are_one_for_every_state() {
        assert_eq!(frames(&Plan::new(3, 1, 1, Some(FrameCount::Some(1000))), 3), [0, 1, 2, 3]);
        assert_eq!(frames(&Plan::new(1, 1, 1, Some(FrameCount::Some(u32::MAX))), 1), [0, 1]);
    }

    /// With an interval that does not divide the run, its end was in no frame.
    #[test]
    fn the_last_state_is_a_frame_whenever_the_run_ends() {
        assert_eq!(frames(&Plan::new(10, 1, 4, None), 10), [0, 4, 8, 10]);
        assert_eq!(frames(&Plan::new(10, 1, 5, None), 10), [0, 5, 10]);
        assert_eq!(frames(&Plan::new(10, 1, 4, None), 7), [0, 4, 7]);
        assert_eq!(frames(&Plan::new(10, 1, 4, Some(FrameCount::Some(3))), 7), [0, 5, 7]);
        assert!(frames(&Plan::new(10, 1, 4, Some(FrameCount::None)), 10).is_empty());
    }
}
