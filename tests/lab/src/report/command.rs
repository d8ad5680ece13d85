//! `palpate-lab run`.
use super::{
    page::{self, Results},
    peers, verdict,
};
use crate::{
    convergence,
    hearts::{self, HeartTicks},
    machine::{Machine, Noise},
    measure::{self, Effort, Run, Turn},
    methods,
    peers::Peers,
    problems::{self, Problem},
    skips::{self, Found, Skip},
    stress::{self, Extent, Outcome},
};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{Context, IntoDiagnostic, Result, bail, ensure};
use palpate_realtime::OsMeasures;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::Duration,
};

/// What is run.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// A dozen problems, three resolutions, few repetitions: some minutes
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// Every problem and resolution (the default is every problem at the quick run's resolutions)
    #[arg(long)]
    full: bool,
    /// Directory for report.html, results.csv and, without a filter, convergence.csv, skips.csv and stress.csv
    #[arg(long, default_value = "lab-results")]
    out: PathBuf,
    /// Only problems whose name contains this
    #[arg(long)]
    problem: Option<String>,
    /// Only methods whose name contains this, or another such that is given
    #[arg(long)]
    method: Vec<String>,
    /// Processor to be held to
    #[arg(long)]
    processor: Option<usize>,
    /// Other simulators beside ours, on the problems with a patch: MuJoCo's flex and PositionBasedDynamics' XPBD
    ///
    /// Needs python3 with venv and, the first time, the network: the packages are installed into an environment of the lab's own.
    /// What is missing is skipped with a line. tests/lab/peers/README.md tells how to add another.
    #[arg(long)]
    peers: bool,
    /// Folder of the peers' Python environment; may be deleted at any time [default: palpate-lab-peers in the user's cache folder]
    #[arg(long, requires = "peers")]
    peers_env: Option<PathBuf>,
}

/// Methods of a quick run: of hybrids three.
fn is_quick_method(name: &str) -> bool {
    !name.starts_with("hybrid") || ["hybrid 200 awake", "hybrid 600 awake", methods::SERVED].contains(&name)
}

/// Problems of a quick run: most of those of rubber-like tissue, and the beam; with peers theirs too.
fn is_quick(problem: &Problem) -> bool {
    let rubber = problem.name.contains("nu0.45");
    let other_places = ["under-base", "flank", "shoulder", "near-tip"];
    let long = ["patch-large", "sweep"].iter().chain(&other_places).any(|part| problem.name.contains(part));
    rubber && !long || problem.name == "cantilever"
}

/// Measures, and writes the page and the table.
///
/// # Errors
/// Nothing chosen, a missing reference, or a file that cannot be written.
pub fn run(options: &Options) -> Result<()> {
    let chosen = |name: &str, filter: &Option<String>| filter.as_deref().is_none_or(|f| name.contains(f));
    let mut problems = problems::all();
    let in_extent = |p: &Problem| !options.quick || is_quick(p) || options.peers && p.name == problems::OF_PEERS;
    problems.retain(|p| chosen(&p.name, &options.problem) && in_extent(p));
    let mut methods = methods::all();
    let in_extent = |name: &str| !options.quick || is_quick_method(name);
    methods.retain(|m| match &options.method[..] {
        [] => in_extent(m.name()),
        filters => filters.iter().any(|filter| m.name().contains(filter)),
    });
    if problems.is_empty() {
        let names: Vec<String> = problems::all().into_iter().map(|p| p.name).collect();
        let left_out = options.quick && names.iter().any(|name| chosen(name, &options.problem));
        ensure!(!left_out, "no such problem is in a quick run: leave out --quick");
        bail!(
            "no problem has \"{}\" in its name; there are {}",
            options.problem.as_deref().unwrap_or_default(),
            names.join(", ")
        );
    }
    if methods.is_empty() {
        let names: Vec<String> = methods::all().iter().map(|m| m.name().to_owned()).collect();
        bail!("no method has \"{}\" in its name; there are {}", options.method.join("\" or \""), names.join(", "));
    }
    let effort = match (options.quick, options.full) {
        (true, _) => Effort { full: false, rounds: 60, budget_s: 1.2 },
        (_, true) => Effort { full: true, rounds: 1_000, budget_s: 120.0 },
        _ => Effort { full: false, rounds: 300, budget_s: 20.0 },
    };
    // What cannot be kept should not be measured.
    let out = &options.out;
    std::fs::create_dir_all(out).into_diagnostic().wrap_err_with(|| format!("cannot make {}", out.display()))?;
    save(out, "results.csv", measure::write(&Run::default()))?;
    let mut peers = if options.peers { Peers::install(options.peers_env.as_deref()) } else { Peers::default() };
    for (peer, note) in &peers.notes {
        println!("{peer}: {note}");
    }
    let pinned = OsMeasures { processor: options.processor, ..OsMeasures::NONE }.apply();
    if let Some(refused) = pinned.notes.iter().find(|note| options.processor.is_some() && !note.granted) {
        bail!("{}", refused.text);
    }
    let noise = Noise::measure(2_000);
    let bar = ProgressBar::new(problems.len() as u64);
    bar.set_style(ProgressStyle::with_template("{bar:20} {pos}/{len} {elapsed} {prefix}: {msg}").into_diagnostic()?);
    bar.enable_steady_tick(Duration::from_millis(200));
    let mut run = Run { circumstances: circumstances(options, &effort, &noise), rows: Vec::new() };
    for (index, note) in pinned.notes.iter().enumerate() {
        run.circumstances.insert(format!("system {}", index + 1), note.text.clone());
    }
    for (index, problem) in problems.iter().enumerate() {
        if bar.is_hidden() {
            println!("{} of {}: {}", index + 1, problems.len(), problem.name);
        }
        bar.set_prefix(problem.name.clone());
        let mut tell = |turn: Turn<'_>| bar.set_message(format!("{} {} {}", turn.method, turn.resolution, turn.what));
        run.rows.extend(measure::problem(problem, &methods, &mut peers, &effort, &mut tell)?);
        // A run that is interrupted keeps the problems that were done.
        save(out, "results.csv", measure::write(&run))?;
        bar.inc(1);
    }
    // Whoever asks for one problem or method wants its rows, not a minute of what concerns none in particular.
    let whole = options.problem.is_none() && options.method.is_empty();
    let convergence = if whole { convergence::all()? } else { vec![] };
    let hearts = if whole { hearts(options, &bar)? } else { vec![] };
    let (skips, stress) = if whole { (skips(options, &bar)?, stress(options, &bar)?) } else { (vec![], vec![]) };
    bar.finish_and_clear();
    run.circumstances.extend(peers.notes);
    let results = Results {
        run: &run,
        problems: &problems,
        methods: &methods,
        convergence: &convergence,
        hearts: &hearts,
        skips: &skips,
        stress: &stress,
    };
    write(options, &results)?;
    for study in convergence.iter().filter(|study| !study.is_met()) {
        println!("{}: order {:.2}, {} is demanded", study.quantity, study.order(), study.demand);
    }
    for row in run.rows.iter().filter(|row| !row.failure.is_empty()) {
        println!("{} by {} at {}: {}", row.problem, row.method, row.resolution, row.failure);
    }
    for sentence in peers::sentences(&run.rows) {
        println!("{sentence}");
    }
    for sentence in verdict::sentences(&page::verdicts(&run, &problems)?) {
        println!("{sentence}");
    }
    println!("{} rows; read {}", run.rows.len(), options.out.join("report.html").display());
    Ok(())
}

fn circumstances(options: &Options, effort: &Effort, noise: &Noise) -> BTreeMap<String, String> {
    let machine = Machine::here();
    let extent = if options.quick {
        "quick"
    } else if options.full {
        "full"
    } else {
        "normal"
    };
    let held = options.processor.map_or_else(|| "not held to a processor".into(), |p| format!("held to processor {p}"));
    [
        ("processor", format!("{}, {} threads", machine.processor, machine.threads)),
        ("system", machine.system),
        ("commit", machine.commit),
        ("date", machine.date),
        ("build", machine.build),
        (
            "options",
            format!("{extent}, {} timed turns, {} s a problem and method, {held}", effort.rounds, effort.budget_s),
        ),
        (
            "noise",
            format!(
                "a fixed piece of arithmetic (some 50 us): p99 {:+.1} %, worst {:+.1} % of its median",
                100.0 * noise.p99_over_median,
                100.0 * noise.worst_over_median
            ),
        ),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into()
}

/// Of a quick run the shipped one, else five more.
fn hearts(options: &Options, bar: &ProgressBar) -> Result<Vec<HeartTicks>> {
    bar.set_prefix("hearts");
    bar.set_message("hybrid-ventricle");
    let options = hearts::Options::of(if options.quick { 0 } else { 5 });
    hearts::measure(&options, &mut |ticks| bar.set_message(format!("after {} {}", ticks.name, ticks.awake)))
}

fn skips(options: &Options, bar: &ProgressBar) -> Result<Vec<(Skip, Found)>> {
    let rounds = if options.quick { 200 } else { 1_000 };
    let measure = |skip: Skip| {
        bar.set_prefix("skips");
        bar.set_message(skip.name);
        Ok((skip, (skip.run)(rounds)?))
    };
    skips::ALL.into_iter().map(measure).collect()
}

/// The extent in which a run goes through the stress suite.
fn stress_options(options: &Options) -> stress::Options {
    let extent = if options.quick { Extent::Reduced } else { Extent::Short };
    stress::Options { extent, seed: 1, ..stress::Options::default() }
}

fn stress(options: &Options, bar: &ProgressBar) -> Result<Vec<(stress::Row, Outcome)>> {
    let go_through = |row: stress::Row| {
        bar.set_prefix("stress");
        bar.set_message(row.name);
        Ok((row, (row.run)(&stress_options(options))?))
    };
    stress::ROWS.into_iter().map(go_through).collect()
}

fn save(out: &Path, name: &str, text: String) -> Result<()> {
    let path = out.join(name);
    std::fs::write(&path, text).into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))
}

fn write(options: &Options, results: &Results<'_>) -> Result<()> {
    let out = &options.out;
    if !results.convergence.is_empty() {
        save(out, "convergence.csv", convergence::csv(results.convergence))?;
    }
    if !results.skips.is_empty() {
        save(out, "skips.csv", skips::csv(results.skips))?;
    }
    if !results.stress.is_empty() {
        stress::write_csv(out, &stress_options(options), results.stress)?;
    }
    save(out, "results.csv", measure::write(results.run))?;
    save(out, "report.html", page::page(results)?)
}
