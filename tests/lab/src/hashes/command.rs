//! `palpate-lab hashes`.
use super::{
    case::Case,
    compare::differences,
    hashing::{self, Seen},
    host::Host,
    own,
    record::{Line, Record},
    shipped,
};
use clap::Args;
use miette::{Result, bail, ensure};
use std::{
    path::PathBuf,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

/// `palpate-lab hashes`.
#[derive(Debug, Clone, Args)]
#[allow(clippy::struct_excessive_bools)] // flags of a command line
pub struct Options {
    /// Compare with the file: the default
    #[arg(long, conflicts_with = "update")]
    check: bool,
    /// Write the file anew, for a change that is meant to change bits
    #[arg(long)]
    update: bool,
    /// Only scenes whose name contains this
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// Scenes that are cut short are run to their ends, too
    #[arg(long)]
    long: bool,
    /// Another file than the source tree's, for a machine on which bits differ: update it before a change, compare after
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
    /// Tell of each scene how long it takes and what happens in it
    #[arg(long)]
    verbose: bool,
}

/// Every scene, as far as it is run by default; with `long`, those that are cut short to their ends as well.
///
/// # Errors
/// The scenes' folder cannot be read.
pub fn every_case(long: bool) -> Result<Vec<Case>> {
    let mut cases = shipped::cases()?;
    if long {
        let whole: Vec<Case> = cases.iter().filter(|case| case.is_cut()).map(Case::whole).collect();
        cases.extend(whole);
    }
    cases.extend(own::cases());
    Ok(cases)
}

/// Runs cases, on as many threads as there are processors; `done` is told of each how long (s) it took.
///
/// # Errors
/// The first case that cannot be run.
pub fn all(cases: &[Case], done: &(dyn Fn(&str, f64) + Sync)) -> Result<Vec<(Line, Seen)>> {
    let next = AtomicUsize::new(0);
    let lines = Mutex::new(Vec::new());
    let work = || {
        while let Some((number, case)) =
            Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|n| Some((n, cases.get(n)?)))
        {
            let started = Instant::now();
            let line = hashing::hashes_of(case);
            done(&case.name, started.elapsed().as_secs_f64());
            // Nobody panics who holds it.
            if let Ok(mut lines) = lines.lock() {
                lines.push((number, line));
            }
        }
    };
    std::thread::scope(|scope| {
        let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        (0..threads).for_each(|_| _ = scope.spawn(work));
    });
    let mut lines = lines.into_inner().unwrap_or_default();
    ensure!(lines.len() == cases.len(), "a thread panicked in one of the scenes");
    lines.sort_by_key(|(number, _)| *number);
    let (lines, failures): (Vec<_>, Vec<_>) = lines.into_iter().map(|(_, line)| line).partition(Result::is_ok);
    let told: Vec<String> =
        failures.into_iter().filter_map(Result::err).map(|failure| format!("{failure:?}")).collect();
    ensure!(told.is_empty(), "{}", told.join("\n"));
    lines.into_iter().collect()
}

/// Runs the command.
///
/// # Errors
/// Scenes whose bits differ from what is kept, a file that was made elsewhere, or what cannot be read, run or written.
pub fn run(options: &Options) -> Result<()> {
    let path = options.file.clone().unwrap_or_else(Record::path);
    let here = Host::here();
    let mut kept = match Record::read(&path) {
        Err(_) if options.update => Record { host: here.clone(), lines: Vec::new() },
        kept => kept?,
    };
    if let Some(what) = here.differs_from(&kept.host) {
        let help = "compare on a machine like that, or make a file of your own: --update --file FILE before the change, --file FILE after it";
        ensure!(
            options.update && options.only.is_none(),
            miette::miette!(help = help, "{} was made elsewhere, where bits may differ: {what}", path.display())
        );
        kept = Record { host: here, lines: Vec::new() };
    }
    let mut cases = every_case(options.long)?;
    if let Some(name) = &options.only {
        cases.retain(|case| case.name.contains(name));
        ensure!(!cases.is_empty(), "no scene has \"{name}\" in its name");
    }
    let started = Instant::now();
    let found = all(&cases, &|name, time_s| {
        if options.verbose {
            println!("{name}: {time_s:.2} s");
        }
    })?;
    if options.verbose {
        for (line, seen) in &found {
            println!("{}: {seen:?}", line.name);
        }
    }
    let found: Vec<Line> = found.into_iter().map(|(line, _)| line).collect();
    let ticks: u64 = found.iter().map(|line| line.ticks).sum();
    println!("{} scenes, {ticks} ticks, {:.1} s", found.len(), started.elapsed().as_secs_f64());
    if options.update {
        return update(kept, found, options, &path);
    }
    let is_compared = |line: &&Line| options.long || !line.name.ends_with(WHOLE);
    let compared: Vec<Line> = kept.lines.iter().filter(is_compared).cloned().collect();
    let list = differences(&compared, &found, options.only.is_none());
    if list.is_empty() {
        println!("all bits are as they were");
        return Ok(());
    }
    for difference in &list {
        println!("{difference}");
    }
    let help = "if no bit was to change, look for what was added up in another order; bisect with --only NAME. If bits were to change, say so in the commit, and write the file anew: palpate-lab hashes --update";
    bail!(help = help, "{} of {} scenes have other bits than {}", list.len(), found.len(), path.display())
}

const WHOLE: &str = "/whole";

/// Writes what was found, and keeps of the rest what was not run.
fn update(mut kept: Record, found: Vec<Line>, options: &Options, path: &std::path::Path) -> Result<()> {
    let was_run = |line: &Line| found.iter().any(|found| found.name == line.name);
    if options.only.is_some() {
        let cases: Vec<String> = every_case(true)?.into_iter().map(|case| case.name).collect();
        kept.lines.retain(|line| !was_run(line));
        kept.lines.extend(found);
        kept.lines.sort_by_key(|line| cases.iter().position(|name| *name == line.name).unwrap_or(usize::MAX));
    } else {
        if !options.long && kept.lines.iter().any(|line| line.name.ends_with(WHOLE)) {
            println!("hashes of whole scenes are old now and were left out: --update --long makes them");
        }
        kept.lines = found;
    }
    kept.write(path)?;
    println!("wrote {}", path.display());
    Ok(())
}
