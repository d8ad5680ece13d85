//! `palpate-lab compare OLD NEW`: what got slower or less accurate beyond noise.
use crate::measure::{self, Row, Run};
use clap::Args;
use miette::{Context, IntoDiagnostic, Result, bail};
use std::path::{Path, PathBuf};

/// Two runs.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// results.csv of the run before, or its folder
    old: PathBuf,
    /// results.csv of the run after, or its folder
    new: PathBuf,
    /// Slower counts from this fraction on, also where noise is less
    #[arg(long, default_value_t = 0.10)]
    slower: f64,
    /// Less accurate counts from this growth of the error on, as a fraction of the answer
    #[arg(long, default_value_t = 1e-3)]
    less_accurate: f64,
}

/// What changed for the worse, and what for the better, a sentence each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Comparison {
    /// Regressions.
    pub worse: Vec<String>,
    /// Improvements.
    pub better: Vec<String>,
    /// Rows in both.
    pub compared: usize,
}

/// Compares two runs row by row. A row that only the old one has is a regression if it had an answer there and the new run, of the same
/// extent, has the problem and the method elsewhere: a smaller run leaves out whole problems, methods or resolutions, which says nothing.
pub fn compare(old: &Run, new: &Run, slower: f64, less_accurate: f64) -> Comparison {
    let mut found = Comparison::default();
    let same_extent = extent(old) == extent(new);
    for before in &old.rows {
        let same = |row: &&Row| {
            (&row.problem, &row.method, row.resolution) == (&before.problem, &before.method, before.resolution)
        };
        let name = format!("{} by {} at {}", before.problem, before.method, before.resolution);
        let Some(after) = new.rows.iter().find(same) else {
            let has = |same: fn(&Row) -> &String| new.rows.iter().any(|row| same(row) == same(before));
            if same_extent && before.answer.is_some() && has(|row| &row.problem) && has(|row| &row.method) {
                found.worse.push(format!("{name}: the row is gone"));
            }
            continue;
        };
        found.compared += 1;
        match (before.answer.is_some(), after.answer.is_some()) {
            (true, false) => found.worse.push(format!("{name}: no answer any more: {}", after.failure)),
            (false, true) => found.better.push(format!("{name}: has an answer now")),
            _ => {}
        }
        if let (Some(b), Some(a)) = (before.median_us, after.median_us) {
            let limit = slower.max(before.noise_with(after));
            let text = format!(
                "{name}: {b:.1} us → {a:.1} us a tick ({:+.0} %; noise {:.0} %)",
                100.0 * (a / b - 1.0),
                100.0 * limit
            );
            if a > b * (1.0 + limit) {
                found.worse.push(text);
            } else if b > a * (1.0 + limit) {
                found.better.push(text);
            }
        }
        accuracy(&mut found, &name, before, after, less_accurate);
    }
    found
}

/// How much was run; `None` where it is not stated.
fn extent(run: &Run) -> Option<&str> {
    run.circumstances.get("options")?.split(',').next()
}

fn accuracy(found: &mut Comparison, name: &str, before: &Row, after: &Row, limit: f64) {
    let kinds = [
        ("answer", before.error(), after.error()),
        ("field (L2)", before.field_l2, after.field_l2),
        ("field (around, L2)", before.field_around, after.field_around),
        ("field (max)", before.field_max, after.field_max),
        ("energy", before.energy_error, after.energy_error),
    ];
    for (kind, b, a) in kinds {
        let (Some(b), Some(a)) = (b, a) else { continue };
        let text = format!("{name}: error of the {kind} {:.3} % → {:.3} %", 100.0 * b, 100.0 * a);
        if a > b + limit || a.is_nan() && !b.is_nan() {
            found.worse.push(text);
        } else if b > a + limit {
            found.better.push(text);
        }
    }
}

/// Prints the comparison; an error, and so exit code 1, if something got worse.
///
/// # Errors
/// Files that cannot be read, nothing to compare, or regressions.
pub fn run(options: &Options) -> Result<()> {
    let (old, new) = (load(&options.old)?, load(&options.new)?);
    let found = compare(&old, &new, options.slower, options.less_accurate);
    for (key, value) in &old.circumstances {
        let now = new.circumstances.get(key).map_or("not stated", String::as_str);
        if now != value && key != "noise" {
            println!("{key}: {value} → {now}");
        }
    }
    for key in ["processor", "build"] {
        if old.circumstances.get(key) != new.circumstances.get(key) {
            println!("WARNING the two runs differ in {key}: differences of time say nothing about the code");
        }
    }
    for text in &found.better {
        println!("better  {text}");
    }
    for text in &found.worse {
        println!("WORSE   {text}");
    }
    println!("{} rows compared, {} worse, {} better", found.compared, found.worse.len(), found.better.len());
    let alone = (old.rows.len() - found.compared, new.rows.len() - found.compared);
    if alone != (0, 0) {
        println!("{} rows are in the old run alone, {} in the new one alone", alone.0, alone.1);
    }
    if found.compared == 0 {
        bail!(
            "the two runs have no row in common ({} and {}): run both with the same options",
            extent(&old).unwrap_or("extent not stated"),
            extent(&new).unwrap_or("extent not stated")
        );
    }
    if found.worse.is_empty() {
        return Ok(());
    }
    bail!("worse in {} respect{}", found.worse.len(), if found.worse.len() == 1 { "" } else { "s" })
}

fn load(path: &Path) -> Result<Run> {
    let path = &if path.is_dir() { path.join("results.csv") } else { path.to_owned() };
    let text =
        std::fs::read_to_string(path).into_diagnostic().wrap_err_with(|| format!("cannot read {}", path.display()))?;
    measure::read(&text).wrap_err_with(|| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(median: f64, unrest: f64, error: f64) -> Row {
        Row {
            problem: "p".into(),
            method: "m".into(),
            median_us: Some(median),
            unrest: Some(unrest),
            answer: Some(1.0 + error),
            answer_error: Some(error),
            ..Row::default()
        }
    }

    fn of(old: Row, new: Row) -> (usize, usize) {
        let run = |row| Run { rows: vec![row], ..Run::default() };
        let found = compare(&run(old), &run(new), 0.1, 1e-3);
        (found.worse.len(), found.better.len())
    }

    #[test]
    fn a_row_that_is_gone_counts_unless_the_run_was_a_smaller_one() {
        let at = |method: &str, resolution| Row { method: method.into(), resolution, ..row(100.0, 0.0, 0.1) };
        let run = |rows| Run { rows, ..Run::default() };
        let old = run(vec![at("m", 1), at("m", 2), at("n", 1)]);
        let worse = |new: &Run| compare(&old, new, 0.1, 1e-3).worse.len();
        assert_eq!(worse(&run(vec![at("m", 1), at("n", 1)])), 1, "a resolution is gone");
        assert_eq!(worse(&run(vec![at("m", 1), at("m", 2)])), 0, "a method was left out");
        let mut quick = run(vec![at("m", 1), at("n", 1)]);
        quick.circumstances.insert("options".into(), "quick, 60 timed turns".into());
        assert_eq!(worse(&quick), 0, "a smaller extent");
    }

    #[test]
    fn only_what_is_beyond_noise_counts() {
        assert_eq!(of(row(100.0, 0.0, 0.1), row(109.0, 0.0, 0.1)), (0, 0));
        assert_eq!(of(row(100.0, 0.0, 0.1), row(115.0, 0.0, 0.1)), (1, 0));
        assert_eq!(of(row(100.0, 0.03, 0.1), row(115.0, 0.03, 0.1)), (0, 0));
        assert_eq!(of(row(115.0, 0.0, 0.1), row(100.0, 0.0, 0.1)), (0, 1));
        // An error's sign is of no consequence.
        assert_eq!(of(row(1.0, 0.0, 0.1), row(1.0, 0.0, -0.1)), (0, 0));
        assert_eq!(of(row(1.0, 0.0, -0.1), row(1.0, 0.0, -0.11)), (1, 0));
    }

    #[test]
    fn an_answer_that_is_lost_is_worse() {
        let lost = Row { answer: None, answer_error: None, median_us: None, failure: "x".into(), ..row(1.0, 0.0, 0.1) };
        assert_eq!(of(row(1.0, 0.0, 0.1), lost.clone()), (1, 0));
        assert_eq!(of(lost, row(1.0, 0.0, 0.1)), (0, 1));
    }
}
