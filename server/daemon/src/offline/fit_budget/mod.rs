//! `palpated fit-budget`: the particles' spacing, how many may be awake and the coarse tets of a scene, by what a tick may take on this
//! machine.
//!
//! - `scene_text.rs`: the three numbers in a scene's text
//! - `trial.rs`: a scene with some numbers, pressed
//! - `search.rs`: which numbers are tried
mod scene_text;
mod search;
mod trial;

use super::{args::positive, interrupt::Interrupt, load::Refused, say::say, summary::Percentiles};
use crate::progress::Progress;
use miette::{IntoDiagnostic, WrapErr};
use palpate_physics::bodies::hybrid::spec::MOST_ACTIVE;
use palpate_scene::{
    Limits, SceneError, Stage,
    wording::{short, two_digits},
};
use scene_text::{Numbers, SceneText, TextError};
use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};
use trial::{ASIDE, DEPTH, DRAG_M_PER_S, Off, Pressed, Trial};

/// Part of a tick that it may take by default: the loop has other things to do, and some ticks take longer than most.
const PART_OF_TICK: f64 = 0.5;
/// Spacing of particles over the radius of the tool that touches them.
const SPACING: f64 = 0.5;
/// Part of the body's volume in whole cells below which the spacing is too coarse for the body; what it is lowered by, and how often.
const ENOUGH_WHOLE: f64 = 0.35;
/// Most particles of a lattice whose spacing the scene does not say.
const MOST_PARTICLES: u32 = 500_000;
const FINER: f64 = 0.8;
const MOST_FINER: usize = 4;

/// Flags of `palpated fit-budget`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
A scene with [body.particles] may leave out spacing_mm and most_active there, and target_tets of its body. What it leaves out is chosen, and \
written into the file, so that its runs are the same bits ever after; all else in the file stays as it is.

The spacing is half the radius of the first tool, or finer where the body is thin. For several numbers of coarse tets the most awake \
particles are sought whose ticks fit, while that tool presses the body and is dragged. Of these the ones are taken whose forces are nearest to \
those of the body with all of its particles awake: how far they are off is told.

Examples:
  palpated fit-budget my-organ.toml                  half of a tick
  palpated fit-budget my-organ.toml --tick-us 300
  palpated fit-budget my-organ.toml --again          choose again what is written there, as on another machine

Do it on the machine that is to serve the scene, with nothing else running. Exit code: 0 when numbers were chosen, else 1.")]
pub struct FitBudgetArgs {
    /// Scene file
    pub scene: PathBuf,
    /// What a tick may take, in the median (µs); half of the scene's tick by default
    #[arg(long, value_name = "MICROSECONDS", value_parser = positive)]
    pub tick_us: Option<f64>,
    /// Choose all three numbers, also those that the scene says
    #[arg(long)]
    pub again: bool,
    /// Tell what would be written, and write nothing
    #[arg(long)]
    pub dry_run: bool,
}

/// Numbers whose ticks fit.
struct Fitting {
    numbers: Numbers,
    coarse_tets: usize,
    pressed: Pressed,
}

/// Runs the command.
///
/// # Errors
/// A scene that does not load or leaves nothing to be chosen, a budget that nothing fits, or a file that cannot be written.
pub fn run(args: &FitBudgetArgs) -> miette::Result<ExitCode> {
    let path = &args.scene;
    if !path.exists() && palpate_scene::builtin(&path.display().to_string()).is_some() {
        return Err(miette::miette!(
            help = "copy its file from deploy/scenes, and give the copy",
            "\"{}\" is built in: there is no file to write into",
            path.display()
        ));
    }
    let read = std::fs::read_to_string(path);
    let text = read.into_diagnostic().wrap_err_with(|| format!("cannot read {}", path.display()))?;
    let text = SceneText::read(path, &text, args.again)?;
    let mut bar = Progress::new(&path.display().to_string());
    let found =
        Search { path, text: &text, budget_us: args.tick_us, interrupt: Interrupt::listen(), bar: &mut bar }.run();
    bar.finish();
    let found = found?;
    found.print(path);
    if args.dry_run {
        say(format_args!("not written, since --dry-run was given"));
        return Ok(ExitCode::SUCCESS);
    }
    let written = std::fs::write(path, text.with_chosen(&found.chosen().0.numbers));
    written.into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))?;
    say(format_args!("written to {}", path.display()));
    Ok(ExitCode::SUCCESS)
}

/// A search, and what it shows while it is under way.
struct Search<'a> {
    path: &'a Path,
    text: &'a SceneText,
    budget_us: Option<f64>,
    interrupt: Interrupt,
    bar: &'a mut Progress,
}

/// What a search found.
struct Found {
    tool: String,
    radius_m: f64,
    period_us: f64,
    budget_us: f64,
    particles: usize,
    /// As many of them awake as may be.
    reference_awake: usize,
    /// At least one.
    fitting: Vec<(Fitting, Off)>,
}

impl Search<'_> {
    fn run(mut self) -> miette::Result<Found> {
        let said = self.text.said;
        let mut tets: Vec<Option<u32>> = match (said.target_tets, self.text.asks_for_tets()) {
            (None, true) => search::TETS.into_iter().map(Some).collect(),
            (tets, _) => vec![tets],
        };
        let awake = said.most_active.map_or_else(|| search::AWAKE.to_vec(), |most| vec![most]);
        let (spacing_m, first) = self.first(&mut tets, awake[0])?;
        let period_us = first.model.settings().tick_period_s * 1e6;
        let budget_us = self.budget_us.unwrap_or(PART_OF_TICK * period_us);
        let mut fitting = Vec::new();
        let mut least_us = f64::INFINITY;
        for target_tets in tets {
            let largest = search::largest_that_fits(&awake, |most_active| {
                let numbers = Numbers { spacing_m, most_active, target_tets };
                let (coarse_tets, pressed) = self.press(&numbers)?;
                least_us = least_us.min(pressed.tick_wall_us.p50);
                let fits = pressed.tick_wall_us.p50 <= budget_us;
                Ok::<_, miette::Report>((Fitting { numbers, coarse_tets, pressed }, fits))
            });
            let largest = match largest {
                // The body cannot be filled with so many tets, or they are too small beside its particles.
                Err(error) if !fitting.is_empty() && cannot_be_built(&error) => break,
                largest => largest?,
            };
            // More tets take longer still.
            let Some((_, found)) = largest else { break };
            fitting.push(found);
        }
        let Some(most_tets) = fitting.last().map(|last| last.numbers.target_tets) else {
            return Err(miette::miette!(
                help = "do it again with nothing else running here, or give a larger budget, a longer tick_period_s, or a faster machine",
                "no numbers were found whose ticks take {} us: the least was {} us, in the median",
                short(budget_us),
                short(least_us)
            ));
        };
        let particles = first.model.body().particle_count();
        let reference_awake = particles.min(MOST_ACTIVE);
        let all = Numbers { spacing_m, most_active: reference_awake as u32, target_tets: most_tets };
        let reference = self.press(&all)?.1;
        let fitting = fitting.into_iter().filter_map(|fitting| Some((fitting.pressed.off(&reference)?, fitting)));
        let fitting: Vec<(Fitting, Off)> = fitting.map(|(off, fitting)| (fitting, off)).collect();
        if fitting.is_empty() {
            return Err(miette::miette!("the tool felt nothing of the body where it is nearest to it"));
        }
        let tool = &first.scene.model.tools[0];
        let (tool, radius_m) = (tool.name.clone(), tool.radius_m);
        Ok(Found { tool, radius_m, period_us, budget_us, particles, reference_awake, fitting })
    }

    /// Returns the spacing (m) and the body with particles so far apart, of the fewest coarse tets that it can be filled with: fewer, as a thin
    /// wall cannot be made of, are taken out.
    fn first(&mut self, tets: &mut Vec<Option<u32>>, most_active: u32) -> miette::Result<(f64, Trial)> {
        loop {
            let found = self.spacing(tets[0], most_active);
            let is_of_body = |error: &miette::Report| error.downcast_ref().map(SceneError::stage) == Some(Stage::Body);
            if tets.len() == 1 || !found.as_ref().is_err_and(is_of_body) {
                return found;
            }
            tets.remove(0);
        }
    }

    /// Returns the spacing (m), and the body with particles so far apart.
    fn spacing(&mut self, target_tets: Option<u32>, most_active: u32) -> miette::Result<(f64, Trial)> {
        let said_m = self.text.said.spacing_m;
        let no_tool = || TextError::NoTool { name: self.path.display().to_string() };
        let from_m = match said_m {
            Some(said_m) => said_m,
            None => SPACING * self.text.tool_radius_m().ok_or_else(no_tool)?,
        };
        let mut finer = 0;
        loop {
            let factor = FINER.powi(finer as i32);
            let spacing_m = if said_m.is_some() { from_m } else { two_significant(from_m * factor) };
            // What the scene says itself is read as it stands there.
            let numbers = Numbers { spacing_m, most_active, target_tets };
            let trial = self.trial(&numbers, &self.text.with_chosen(&numbers))?;
            let whole = trial.part_in_whole_cells();
            if said_m.is_some() || whole >= ENOUGH_WHOLE || finer == MOST_FINER {
                return Ok((spacing_m, trial));
            }
            finer += 1;
        }
    }

    fn trial(&mut self, numbers: &Numbers, text: &str) -> miette::Result<Trial> {
        if self.interrupt.is_set() {
            return Err(miette::miette!("interrupted; {} is as it was", self.path.display()));
        }
        let tets = numbers.target_tets.map_or(String::new(), |tets| format!("{tets} coarse tets, "));
        let spacing = short(numbers.spacing_m * 1e3);
        self.bar.show_work(&format!("{tets}particles {spacing} mm apart, up to {} awake", numbers.most_active));
        // A lattice that the program chose is not to take minutes and gigabytes.
        let limits = if self.text.said.spacing_m.is_some() {
            Limits::local()
        } else {
            Limits { tets: MOST_PARTICLES, ..Limits::local() }
        };
        Trial::new(self.path, text, &limits)
    }

    /// Presses the body with these numbers; with it the number of its coarse tets is returned.
    fn press(&mut self, numbers: &Numbers) -> miette::Result<(usize, Pressed)> {
        let trial = self.trial(numbers, &self.text.with_all(numbers))?;
        Ok((trial.coarse_tets(), trial.press()?))
    }
}

/// Whether a body cannot be made of its numbers, or is refused.
fn cannot_be_built(error: &miette::Report) -> bool {
    let stage = error.downcast_ref().map(SceneError::stage);
    matches!(stage, Some(Stage::Body | Stage::Model)) || error.is::<Refused>()
}

fn two_significant(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

impl Found {
    /// The numbers whose forces are nearest to those of the body with all particles awake.
    fn chosen(&self) -> &(Fitting, Off) {
        let nearer = |best: usize, other: usize| {
            if self.fitting[other].1.in_all < self.fitting[best].1.in_all { other } else { best }
        };
        &self.fitting[(1..self.fitting.len()).fold(0, nearer)]
    }

    fn print(&self, path: &Path) {
        let millimetres = |metres: f64| short(metres * 1e3);
        say(format_args!(
            "budget     {} us of a tick of {} ms, in the median",
            short(self.budget_us),
            short(self.period_us * 1e-3)
        ));
        say(format_args!(
            "press      the tool \"{}\", {} mm in radius, {} mm deep where it is nearest to the body, dragged by {} mm to either side at {} mm/s",
            self.tool,
            millimetres(self.radius_m),
            millimetres(DEPTH * self.radius_m),
            millimetres(ASIDE * self.radius_m),
            millimetres(DRAG_M_PER_S)
        ));
        let spacing_m = self.chosen().0.numbers.spacing_m;
        say(format_args!("particles  {}, {} mm apart", self.particles, millimetres(spacing_m)));
        say(format_args!(
            "           its forces beside those with {} awake, on the same way:",
            if self.reference_awake == self.particles { "all".to_owned() } else { self.reference_awake.to_string() }
        ));
        say(format_args!("coarse tets  most_active    awake    tick p50 (us)    p99 (us)    stronger    off in all"));
        for (fitting, off) in &self.fitting {
            let Percentiles { p50, p99, .. } = fitting.pressed.tick_wall_us;
            say(format_args!(
                "{:11} {:12} {:8} {p50:16.0} {p99:11.0} {:>+9.1} % {:11.1} %",
                fitting.coarse_tets,
                fitting.numbers.most_active,
                fitting.pressed.most_awake,
                100.0 * off.larger,
                100.0 * off.in_all
            ));
        }
        let Numbers { most_active, target_tets, .. } = self.chosen().0.numbers;
        let tets = target_tets.map_or(String::new(), |tets| format!(", target_tets = {tets}"));
        let percent = two_digits(100.0 * self.chosen().1.in_all);
        say(format_args!(
            "chosen     spacing_mm = {}, most_active = {most_active}{tets}: {percent} % off",
            millimetres(spacing_m)
        ));
        if self.late() {
            say(format_args!(
                "warning: more than one tick in a hundred took longer than the {} ms that it has; {} may need a smaller --tick-us, or other work held this machine up",
                short(self.period_us * 1e-3),
                path.display()
            ));
        }
    }

    fn late(&self) -> bool {
        self.chosen().0.pressed.tick_wall_us.p99 > self.period_us
    }
}
