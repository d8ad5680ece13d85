//! Rows run in their long form, kept in the source tree: nobody runs ten million ticks for a look at the page.
use super::{Extent, Measured, Options, Outcome, Row, table};
use crate::machine::Machine;
use miette::{Context, IntoDiagnostic, Result};
use serde::{Deserialize, Serialize};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// A row as it came out once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Row.
    pub row: String,
    /// What passes, in words.
    pub criterion: String,
    /// `passes`, `fails` (known to fall short) or `FAILS`.
    pub verdict: String,
    /// Why it does not pass.
    pub reason: String,
    /// The command that makes this file again.
    pub command: String,
    /// UTC day.
    pub date: String,
    /// Commit of the source tree.
    pub commit: String,
    /// Processor.
    pub processor: String,
    /// How long it took (s).
    pub elapsed_s: f64,
    /// Numbers.
    pub numbers: Vec<Number>,
}

/// A number of a record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Number {
    /// What it is.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its unit; `1` of a ratio.
    pub unit: String,
    /// The most it may be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
}

impl Record {
    pub(super) fn of(row: &Row, options: &Options, outcome: &Outcome, elapsed_s: f64) -> Self {
        let machine = Machine::here();
        let long = if options.extent == Extent::Long { " --long" } else { "" };
        let number =
            |m: &Measured| Number { name: m.name.clone(), value: m.value, unit: m.unit.into(), limit: m.limit };
        Self {
            row: row.name.into(),
            criterion: row.criterion.into(),
            verdict: table::verdict(outcome).into(),
            reason: outcome.reason(),
            command: format!("palpate-lab stress {}{long} --seed {} --record", row.name, options.seed),
            date: machine.date,
            commit: machine.commit,
            processor: machine.processor,
            elapsed_s: elapsed_s.round(),
            numbers: outcome.measured.iter().map(number).collect(),
        }
    }

    /// Writes it where [`records`] looks, and returns the path.
    pub(super) fn write(&self) -> Result<PathBuf> {
        let path = folder().join(format!("{}.toml", self.row));
        let text = toml::to_string(self).into_diagnostic()?;
        fs::create_dir_all(folder())
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot make {}", folder().display()))?;
        fs::write(&path, text).into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))?;
        Ok(path)
    }
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("records")
}

/// All records of the source tree, in the order of their names.
///
/// # Errors
/// A file that cannot be read or is not a record.
pub fn records() -> Result<Vec<Record>> {
    let Ok(entries) = fs::read_dir(folder()) else { return Ok(vec![]) };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.sort();
    let read = |path: &PathBuf| {
        let text = fs::read_to_string(path).into_diagnostic()?;
        toml::from_str(&text).into_diagnostic().wrap_err_with(|| format!("{} is not a record", path.display()))
    };
    paths.iter().map(read).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::ROWS;

    #[test]
    fn the_tree_has_ten_million_ticks() {
        let records = records().unwrap();
        let soak = records.iter().find(|record| record.row == "soak").unwrap();
        assert!(soak.command.contains("--long") && soak.numbers.iter().any(|n| n.limit.is_some()));
        assert!(records.iter().all(|record| ROWS.iter().any(|row| row.name == record.row)));
    }
}
