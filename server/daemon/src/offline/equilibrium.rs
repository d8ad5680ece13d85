//! `palpated static`: the equilibrium of a scene under its final loads.
use super::{
    args::{OutputArgs, positive},
    exit::{CODES, Untrusted},
    folder,
    frames::Frames,
    interrupt::Interrupt,
    load,
    probe_rows::ProbeRows,
    summary::{Ending, SolveNumbers, Summary},
    walls,
};
use crate::{bodies::served, progress::Progress, strained::Seen};
use glam::DVec3;
use miette::Diagnostic;
use palpate_physics::{
    Model, State,
    contact::ToolTarget,
    statics::{self, Goal, SolveError, StaticSettings, StaticSolution},
    world::{self, strained},
};
use palpate_scene::Scene;
use std::{ops::ControlFlow, process::ExitCode, time::Instant};
use thiserror::Error;

/// Flags of `palpated static`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = format!("Examples:\n  \
    palpated static cantilever                 where the beam comes to rest\n  \
    palpated static cantilever --out rest      and keep probes.csv, frames.pvd and summary.json\n  \
    palpated static lame-sphere --json         a sphere under pressure, for other programs\n\n\
    Loads and tools arrive slowly, and without friction. A tool on a spring rests where the spring balances its contact.\n\
    Of a body with particles those are awake that tools would keep awake where they rest, and those within the same reach of a load.\n\n{CODES}"))]
pub struct StaticArgs {
    #[command(flatten)]
    output: OutputArgs,
    /// Take loads, motions and tools as they are at this time, instead of what they settle to
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    at_s: Option<f64>,
    /// Largest residual force relative to the forces in play, between 0 and 1
    #[arg(long, value_name = "RATIO", value_parser = ratio)]
    residual: Option<f64>,
}

#[derive(Debug, Error, Diagnostic)]
#[error("no equilibrium of \"{scene}\"")]
#[diagnostic(help("{advice}"))]
struct NoEquilibrium {
    scene: String,
    advice: &'static str,
    #[source]
    cause: SolveError,
}

/// Runs the command.
///
/// # Errors
/// A scene that does not load, no convergence, or a folder that cannot be written.
pub fn run(args: &StaticArgs) -> miette::Result<ExitCode> {
    let output = &args.output;
    let mut scene = load::load_with_warnings(&output.scene)?;
    let model = load::build_with_warnings(&mut scene)?;
    if let Some(refusal) = served(&model).no_equilibrium(&scene.name) {
        return Err(refusal);
    }
    if let Some(out) = &output.out {
        folder::check(out, output.force)?;
    }
    let started = Instant::now();
    let sought = Sought::of(&scene, args.at_s);
    let solution = solve(&scene, &model, &sought, args.residual)?;
    // Only now that there is something to replace them with do earlier results go.
    let out = output.out.as_deref().map(|out| folder::prepare(out, output.force)).transpose()?;
    let state = solution.state(&model, &sought.load_factors);
    let mut rows = ProbeRows::new(&scene.probes, out.as_ref().map(|out| out.join(folder::PROBES)).as_deref())?;
    rows.sample(sought.time_s, &model, &state, &solution.node_reactions_n)?;
    rows.flush()?;
    let wall_s = started.elapsed().as_secs_f64();
    if let Some(warning) = walls_that_meet(&model, &state) {
        eprintln!("warning: {warning}");
        scene.warnings.push(warning);
    }
    let untrusted = untrusted(&solution, args.residual);
    let by = untrusted.as_ref().map_or("equilibrium", Untrusted::word);
    let mut ending = Ending { command: "static", by, simulated_s: sought.time_s, wall_s, frames: 0 };
    if let Some(out) = &out {
        let mut frames = Frames::new(out, &model, &[])?;
        frames.write(sought.time_s, &model, &state)?;
        ending.frames = frames.count();
    }
    let mut summary = Summary::new(&scene, &model, &state, &rows, &ending);
    summary.solve = Some(SolveNumbers {
        iterations: solution.iterations,
        load_steps: solution.load_steps,
        residual_n: solution.residual_n,
        relative_residual: (!solution.is_unloaded()).then_some(solution.relative_residual),
        rounding_n: solution.rounding_n,
        stable: solution.stable,
        inverted_tets: solution.inverted_tets,
        spread_loads: (model.body().particle_count() > 0).then_some(solution.awake.spread_loads),
    });
    summary.warn(Seen::of(strained(&model, &state)).weakened(&model, false));
    if let Some(out) = &out {
        summary.write(out)?;
    }
    summary.print(output.json, out.as_deref())?;
    Ok(untrusted.map_or(ExitCode::SUCCESS, Untrusted::told))
}

/// What to say where walls of the body meet, which the solver lets pass.
fn walls_that_meet(model: &Model, state: &State) -> Option<String> {
    let met = world::meeting_walls(model, state);
    (met.vertices > 0).then(|| {
        format!(
            "walls of the body meet in this equilibrium, their vertices {}; the search for it does not count that they press each other: \
             let `palpated simulate` come to rest",
            walls::apart(met.least_gap_m)
        )
    })
}

/// Why what was found is not to be trusted, if so.
fn untrusted(found: &StaticSolution, residual: Option<f64>) -> Option<Untrusted> {
    let balance = found.imbalance(residual.unwrap_or(StaticSettings::default().relative_residual));
    if found.inverted_tets > 0 {
        return Some(Untrusted::InvertedAtRest { count: found.inverted_tets });
    }
    if !found.stable {
        let balance = balance.map_or_else(String::new, |balance| format!(", and its forces do not balance: {balance}"));
        return Some(Untrusted::Unstable { balance });
    }
    balance.map(|balance| Untrusted::Unbalanced(balance.to_string()))
}

/// Under what the equilibrium is sought.
struct Sought {
    time_s: f64,
    load_factors: Vec<f64>,
    prescribed_m: Vec<DVec3>,
    tools: Vec<ToolTarget>,
}

impl Sought {
    fn of(scene: &Scene, at_s: Option<f64>) -> Self {
        let mut load_factors = vec![0.0; scene.model.loads.len()];
        let mut prescribed_m = vec![DVec3::ZERO; scene.model.prescribed.len()];
        let time_s = at_s.unwrap_or(scene.output.duration_s);
        match at_s {
            Some(time_s) => scene.timeline.fill(time_s, &mut load_factors, &mut prescribed_m),
            None => scene.timeline.fill_final(&mut load_factors, &mut prescribed_m),
        }
        let tools = (0..scene.model.tools.len()).map(|tool| scene.offline_target(tool, time_s).at_rest()).collect();
        Self { time_s, load_factors, prescribed_m, tools }
    }

    fn goal(&self) -> Goal<'_> {
        Goal {
            load_factors: &self.load_factors,
            prescribed_displacements_m: &self.prescribed_m,
            tools: &self.tools,
            awake: None,
        }
    }
}

fn solve(scene: &Scene, model: &Model, sought: &Sought, residual: Option<f64>) -> miette::Result<StaticSolution> {
    let default = StaticSettings::default();
    let settings = StaticSettings { relative_residual: residual.unwrap_or(default.relative_residual), ..default };
    let interrupt = Interrupt::listen();
    let mut bar = Progress::new(&scene.name);
    let mut show = |progress: &statics::Progress| {
        bar.show_work(&format!(
            "{:.1} % of the load, iteration {}, residual {:.1e} of {:.0e}",
            100.0 * progress.load_fraction,
            progress.iteration,
            progress.relative_residual,
            settings.relative_residual
        ));
        if interrupt.is_set() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let solved = statics::solve_static(model, &sought.goal(), &settings, &mut show);
    bar.finish();
    solved.map_err(|cause| NoEquilibrium { scene: scene.name.clone(), advice: advice(&cause), cause }.into())
}

/// What to do about it.
fn advice(cause: &SolveError) -> &'static str {
    match cause {
        SolveError::NotForThisBody { .. } => "let `palpated simulate` come to rest",
        SolveError::UnderConstrained { .. } => "add a [[fixed]] region to the scene",
        SolveError::Cancelled { .. } => "it was interrupted; nothing was written",
        SolveError::ToolTooFar { .. } => {
            "let the tool start nearer to where it is to rest, or leave it out of the scene"
        }
        SolveError::Factorisation { .. } => {
            "use a coarser mesh or more memory, or let `palpated simulate` come to rest"
        }
        SolveError::SpheresOnly { .. } => "let `palpated simulate` come to rest, or make the tool a sphere",
        SolveError::NonFinite { .. } => "look for a load or a constant in the wrong unit",
        SolveError::NoConvergence { .. } | SolveError::TooManySteps { .. } => {
            "apply less load, or let `palpated simulate` find the way with viscosity or mass_damping_per_s"
        }
        SolveError::InputLength { .. } | SolveError::InputNotFinite { .. } | SolveError::Setting { .. } => {
            "correct that value"
        }
    }
}

/// A number between 0 and 1, neither of them.
fn ratio(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value < 1.0 => Ok(value),
        _ => Err("give a number larger than 0 and smaller than 1".into()),
    }
}
