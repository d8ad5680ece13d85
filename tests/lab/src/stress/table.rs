//! The printed table and `stress.csv`.
use super::{Measured, Options, Outcome, Row};
use miette::{IntoDiagnostic, Result, WrapErr};
use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

/// Columns of `stress.csv`: one line per number. `verdict` is `passes`, `fails` (known to fall short) or `FAILS` (not known to) of the whole row; `holds`
/// is of the number, empty if it has no limit.
const COLUMNS: &str = "row,criterion,verdict,reason,quantity,value,unit,limit,holds,extent,seed";

/// `passes`, `fails` (known to fall short) or `FAILS` (not known to).
pub fn verdict(outcome: &Outcome) -> &'static str {
    match (outcome.passed(), outcome.surprises()) {
        (true, _) => "passes",
        (false, false) => "fails",
        (false, true) => "FAILS",
    }
}

pub(super) fn print(row: &Row, outcome: &Outcome, elapsed_s: f64) {
    let known = if outcome.passed() || outcome.surprises() { "" } else { ", as is known" };
    println!("{} {}{known} ({elapsed_s:.1} s): {}", row.name, verdict(outcome), row.criterion);
    for measured in &outcome.measured {
        let Measured { name, value, unit, .. } = measured;
        let limit = measured.limit.map_or(String::new(), |limit| format!("(at most {})", number(limit)));
        let mark = if measured.holds() { ' ' } else { '!' };
        println!("{mark} {name:<62} {:>12} {unit:<8} {limit}", number(*value));
    }
    if !outcome.passed() {
        println!("  because: {}", outcome.reason());
    }
    println!();
}

/// Four digits, as people read them.
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return if value.is_nan() { "NaN".into() } else { "never".into() };
    }
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        let text = format!("{value:.4}");
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    format!("{value:.3e}")
}

/// Writes `stress.csv` and returns its path.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn write_csv(folder: &Path, options: &Options, results: &[(Row, Outcome)]) -> Result<PathBuf> {
    let path = folder.join("stress.csv");
    fs::create_dir_all(folder).into_diagnostic().wrap_err_with(|| format!("cannot make {}", folder.display()))?;
    let text = csv(options, results);
    fs::write(&path, text).into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

fn csv(options: &Options, results: &[(Row, Outcome)]) -> String {
    let mut text = format!("{COLUMNS}\n");
    let extent = format!("{:?}", options.extent).to_lowercase();
    let mut line = |fields: [&str; 9]| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{extent},{}", fields.map(quoted).join(","), options.seed);
    };
    for (row, outcome) in results {
        let (verdict, reason) = (verdict(outcome), outcome.reason());
        for m in &outcome.measured {
            let limit = m.limit.map_or(String::new(), |limit| format!("{limit:e}"));
            let holds = m.limit.map_or(String::new(), |_| m.holds().to_string());
            let value = format!("{:e}", m.value);
            line([row.name, row.criterion, verdict, &reason, &m.name, &value, m.unit, &limit, &holds]);
        }
    }
    text
}

/// A field of RFC 4180.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::{Extent, ROWS};

    #[test]
    fn the_csv_has_a_line_per_number_and_as_many_fields_in_each() {
        let outcome = Outcome { measured: vec![Measured::bounded("a, \"b\"", 2.0, "m", 1.0)], broken: vec![] };
        let options = Options { extent: Extent::Short, seed: 7, ..Options::default() };
        let text = csv(&options, &[(ROWS[0], outcome)]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2);
        assert!(
            lines[1].ends_with("FAILS,\"a, \"\"b\"\" is too large\",\"a, \"\"b\"\"\",2e0,m,1e0,false,short,7"),
            "{}",
            lines[1]
        );
        // Commas count where an even number of quotes stands before them.
        let separators = |line: &str| {
            let outside = line.split('"').step_by(2);
            outside.map(|text| text.matches(',').count()).sum::<usize>()
        };
        assert_eq!(separators(lines[1]), separators(COLUMNS));
    }

    #[test]
    fn numbers_read_well() {
        assert_eq!(
            ["0", "12", "0.0123", "1.500e-9", "never"],
            [0.0, 12.0, 0.0123, 1.5e-9, f64::INFINITY].map(number).as_slice()
        );
    }
}
