//! Numerical stress: every row with its pass criterion, deterministic from a seed, short in CI and long on demand.
//!
//! - `outcome.rs`: numbers, limits, known shortfalls
//! - `table.rs`: the printed table and `stress.csv`
//! - `record.rs`: long runs, kept in the source tree
//! - `rig.rs`, `meshes.rs`: what rows share
//! - one file per row
mod activation;
mod bad_input;
mod hands;
mod impulses;
mod incompressible;
pub(crate) mod meshes;
mod outcome;
mod random_scenes;
mod record;
mod recovery;
mod rig;
mod slivers;
mod soak;
mod springs;
mod stiffness_ratio;
mod table;
mod time_step;

pub use activation::Switching;
use clap::Args;
use miette::{Result, bail};
pub use outcome::{Measured, Outcome};
pub use record::{Record, records};
use std::path::PathBuf;
pub use table::{number, verdict, write_csv};

/// How much of a row is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Extent {
    /// For tests: seconds for all rows, unoptimised callers.
    Reduced,
    /// The default: about a minute for all rows.
    #[default]
    Short,
    /// On demand: hours.
    Long,
}

/// What a row is run with.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// How much of it.
    pub extent: Extent,
    /// Where its random numbers start.
    pub seed: u64,
    /// What `activation` does, if not what its criterion says.
    pub switching: Switching,
}

impl Options {
    /// The value for this extent.
    pub(crate) fn pick<T>(&self, reduced: T, short: T, long: T) -> T {
        match self.extent {
            Extent::Reduced => reduced,
            Extent::Short => short,
            Extent::Long => long,
        }
    }
}

/// One row of the suite.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Name on the command line.
    pub name: &'static str,
    /// What passes, in words.
    pub criterion: &'static str,
    /// Runs it.
    pub run: fn(&Options) -> Result<Outcome>,
}

/// Every row, in the order of the table.
pub const ROWS: [Row; 18] = [
    Row { name: "time-step", criterion: time_step::CRITERION, run: time_step::run },
    Row { name: "stiffness-ratio", criterion: stiffness_ratio::CRITERION, run: stiffness_ratio::run },
    Row { name: "incompressible", criterion: incompressible::CRITERION, run: incompressible::run },
    Row { name: "recovery", criterion: recovery::CRITERION, run: recovery::run },
    Row { name: "impulses", criterion: impulses::CRITERION, run: impulses::run },
    Row { name: "soak", criterion: soak::CRITERION, run: soak::run },
    Row { name: "bad-input", criterion: bad_input::CRITERION, run: bad_input::run },
    Row { name: "slivers", criterion: slivers::CRITERION, run: slivers::run },
    Row { name: "random-scenes", criterion: random_scenes::CRITERION, run: random_scenes::run },
    Row { name: "activation", criterion: activation::CRITERION, run: activation::run },
    Row { name: "presses", criterion: hands::presses::CRITERION, run: hands::presses::run },
    Row { name: "laws", criterion: hands::laws::CRITERION, run: hands::laws::run },
    Row { name: "leaps", criterion: hands::leaps::CRITERION, run: hands::leaps::run },
    Row { name: "squeezes", criterion: hands::squeezes::CRITERION, run: hands::squeezes::run },
    Row { name: "strokes", criterion: hands::strokes::CRITERION, run: hands::strokes::run },
    Row { name: "hearts", criterion: hands::hearts::CRITERION, run: hands::hearts::run },
    Row { name: "pans", criterion: hands::pans::CRITERION, run: hands::pans::run },
    Row { name: "springs", criterion: springs::CRITERION, run: springs::run },
];

/// `palpate-lab stress`.
#[derive(Debug, Clone, Args)]
pub struct Command {
    /// Rows to run; all of them if none is named
    rows: Vec<String>,
    /// Long form: a soak of ten million ticks, ten thousand random scenes
    #[arg(long)]
    long: bool,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Of `activation`: switch every so many ticks of a millisecond
    #[arg(long, value_name = "MS", default_value_t = Switching::default().every_ms, value_parser = clap::value_parser!(u32).range(1..=1000))]
    every_ms: u32,
    /// Of `activation`: Poisson's ratio
    #[arg(long, value_name = "NU", default_value_t = Switching::default().poisson_ratio)]
    poisson_ratio: f64,
    /// Folder for stress.csv
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Keep the numbers in the source tree (tests/lab/records), where the page of `palpate-lab run` shows them
    #[arg(long)]
    record: bool,
}

/// Runs rows and prints them; writes `stress.csv` if asked to.
///
/// # Errors
/// A row that falls short without being known to, an unknown name, or a file that cannot be written.
pub fn run(command: &Command) -> Result<()> {
    let rows = selected(&command.rows)?;
    let extent = if command.long { Extent::Long } else { Extent::Short };
    let switching = Switching { every_ms: command.every_ms, poisson_ratio: command.poisson_ratio };
    if command.record && switching != Switching::default() {
        bail!("only what the criterion asks for is kept; leave --record out, or --every-ms and --poisson-ratio");
    }
    let options = Options { extent, seed: command.seed, switching };
    let mut results = Vec::with_capacity(rows.len());
    for row in rows {
        let started = std::time::Instant::now();
        let outcome = (row.run)(&options)?;
        let elapsed_s = started.elapsed().as_secs_f64();
        table::print(&row, &outcome, elapsed_s);
        if command.record {
            println!("kept in {}", Record::of(&row, &options, &outcome, elapsed_s).write()?.display());
        }
        results.push((row, outcome));
    }
    if let Some(folder) = &command.out {
        println!("wrote {}", write_csv(folder, &options, &results)?.display());
    }
    let surprises: Vec<&str> = results.iter().filter(|(_, o)| o.surprises()).map(|(row, _)| row.name).collect();
    if surprises.is_empty() {
        return Ok(());
    }
    let again = format!("again with: palpate-lab stress {} --seed {}", surprises.join(" "), options.seed);
    bail!(help = again, "fell short without being known to: {}", surprises.join(", "))
}

fn selected(names: &[String]) -> Result<Vec<Row>> {
    if names.is_empty() {
        return Ok(ROWS.to_vec());
    }
    let find = |name: &String| {
        ROWS.iter().find(|row| row.name == name).copied().ok_or_else(|| {
            let known: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
            miette::miette!("no row is called \"{name}\"; there are: {}", known.join(", "))
        })
    };
    names.iter().map(find).collect()
}
