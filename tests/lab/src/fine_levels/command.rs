//! The command.
use super::{
    names::FineMethod,
    page,
    study::{ACTIVE, Case, Row, Summary, summaries},
};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{Context, IntoDiagnostic, Result, bail};
use std::{fmt::Write as _, path::PathBuf, time::Duration};

/// What is run.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Directory for fine-levels.csv and fine-levels.html
    #[arg(long, default_value = "lab-results")]
    out: PathBuf,
    /// Only problems whose name contains this
    #[arg(long)]
    problem: Option<String>,
    /// Only methods whose name contains this, or another such that is given
    #[arg(long)]
    method: Vec<String>,
    /// How many particles are awake, several times over [default: 50 to 1400]
    #[arg(long)]
    active: Vec<usize>,
}

/// Runs all that is chosen, writes the page and the table, prints what it comes to.
///
/// # Errors
/// Nothing chosen, no equilibrium, or a file that cannot be written.
pub fn run(options: &Options) -> Result<()> {
    let mut methods = FineMethod::ALL.to_vec();
    methods.retain(|m| options.method.is_empty() || options.method.iter().any(|filter| m.name().contains(filter)));
    if methods.is_empty() {
        let names: Vec<String> = FineMethod::ALL.iter().map(|method| method.name()).collect();
        bail!("no method has \"{}\" in its name; there are {}", options.method.join("\" or \""), names.join(", "));
    }
    let mut cases = Case::all();
    let names: Vec<String> = cases.iter().map(|case| case.problem.name.clone()).collect();
    cases.retain(|case| options.problem.as_deref().is_none_or(|filter| case.problem.name.contains(filter)));
    if cases.is_empty() {
        let wanted = options.problem.as_deref().unwrap_or_default();
        bail!("no problem has \"{wanted}\" in its name; there are {}", names.join(", "));
    }
    let active = if options.active.is_empty() { ACTIVE.to_vec() } else { options.active.clone() };
    let out = &options.out;
    std::fs::create_dir_all(out).into_diagnostic().wrap_err_with(|| format!("cannot make {}", out.display()))?;
    let bar = ProgressBar::new((cases.len() * methods.len() * active.len()) as u64);
    bar.set_style(ProgressStyle::with_template("{bar:20} {pos}/{len} {elapsed} {msg}").into_diagnostic()?);
    bar.enable_steady_tick(Duration::from_millis(200));
    let mut rows = Vec::new();
    for case in &cases {
        bar.set_message(format!("{}, {} mesh", case.problem.name, case.mesh_name()));
        rows.extend(case.run(&methods, &active, &mut || bar.inc(1))?);
    }
    bar.finish_and_clear();
    for (name, text) in [("fine-levels.csv", csv(&rows)), ("fine-levels.html", page::page(&rows))] {
        let path = out.join(name);
        std::fs::write(&path, text).into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))?;
    }
    print(&summaries(&rows), cases.len());
    println!("\nwritten to {}: fine-levels.html (plots), fine-levels.csv", out.display());
    Ok(())
}

fn csv(rows: &[Row]) -> String {
    let mut text = String::from("problem,mesh,coarse_tets,method,active,points,answer_error,field_l2,field_max\n");
    for row in rows {
        let Row { problem, mesh, coarse_tets, method, active, points, answer_error, field_l2, field_max } = row;
        let _ = writeln!(
            text,
            "{problem},{mesh},{coarse_tets},{method},{active},{points},{answer_error:.6e},{field_l2:.6e},{field_max:.6e}"
        );
    }
    text
}

fn print(summaries: &[Summary], cases: usize) {
    println!("Errors over {cases} cases, median and largest, and in how many a method's field is the nearest of all");
    println!("{:<24} {:>7}  {:>16}  {:>16}  {:>8}", "method", "active", "answer", "field, L2", "nearest");
    for Summary { method, active, answer, field, nearest } in summaries {
        let percents = |[median, largest]: [f64; 2]| format!("{:.1}, {:.1} %", 100.0 * median, 100.0 * largest);
        let of = format!("{}/{}", nearest[0], nearest[1]);
        println!("{method:<24} {active:>7}  {:>16}  {:>16}  {of:>8}", percents(*answer), percents(*field));
    }
}
