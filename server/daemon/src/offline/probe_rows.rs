//! Probes as rows: the CSV file, and the last row for the summary.
use super::whole_rows::WholeRows;
use glam::DVec3;
use miette::{IntoDiagnostic, WrapErr};
use palpate_physics::{Model, State};
use palpate_scene::{
    Probe,
    probes::{MAX_COLUMNS, Measure},
};
use serde::{Deserialize, Serialize};
use std::{io::Write, path::Path};

/// Evaluates all probes into one row, and writes it if there is a file.
pub(super) struct ProbeRows<'s> {
    probes: &'s [Probe],
    row: Vec<f64>,
    peaks: Vec<Peak>,
    file: Option<WholeRows>,
    count: u64,
}

/// The row in which something was largest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Peak {
    /// Largest magnitude, or for the volume ratio smallest value.
    pub(super) value: f64,
    /// When (s).
    pub(super) time_s: f64,
}

/// How far rows had come.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RowsMark {
    /// Length of the file, if there is one.
    bytes: u64,
    count: u64,
    row: Vec<f64>,
    peaks: Vec<Peak>,
}

/// What a probe's peaks are of: the length of a vector, or each value.
fn peaks_of(probe: &Probe) -> &'static [&'static str] {
    if probe.columns() == ["x", "y", "z"] { &["magnitude"] } else { probe.columns() }
}

/// Whether a value is further than the peak so far.
fn is_further(probe: &Probe, value: f64, peak: f64) -> bool {
    match probe.measure() {
        Measure::MinVolumeRatio => value < peak,
        _ => value.abs() > peak.abs(),
    }
}

impl<'s> ProbeRows<'s> {
    /// Without a path only the newest row is kept.
    pub(super) fn new(probes: &'s [Probe], path: Option<&Path>) -> miette::Result<Self> {
        let columns = probes.iter().map(|probe| probe.columns().len()).sum();
        let file = match path {
            Some(path) => Some(create(path, probes)?),
            None => None,
        };
        let peaks = probes.iter().map(|probe| peaks_of(probe).len()).sum();
        let none = Peak { value: 0.0, time_s: 0.0 };
        Ok(Self { probes, row: vec![0.0; columns], peaks: vec![none; peaks], file, count: 0 })
    }

    /// Goes on behind a mark.
    pub(super) fn resume(probes: &'s [Probe], path: &Path, mark: &RowsMark) -> miette::Result<Self> {
        let without_file = Self::new(probes, None)?;
        let file = WholeRows::resume(path, mark.bytes)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot go on with {}", path.display()))?;
        let RowsMark { count, row, peaks, .. } = mark.clone();
        Ok(Self { row, peaks, file: Some(file), count, ..without_file })
    }

    /// How far they are. Everything until here is with the disk then.
    pub(super) fn mark(&mut self) -> miette::Result<RowsMark> {
        let bytes = self.file.as_mut().map_or(Ok(0), WholeRows::length);
        let bytes = bytes.into_diagnostic().wrap_err("cannot write probes.csv")?;
        Ok(RowsMark { bytes, count: self.count, row: self.row.clone(), peaks: self.peaks.clone() })
    }

    /// Evaluates at a state; `reactions_n` is the force (N) that holds each node.
    pub(super) fn sample(
        &mut self,
        time_s: f64,
        model: &Model,
        state: &State,
        reactions_n: &[DVec3],
    ) -> miette::Result<()> {
        let (mut place, mut peaks) = (0, self.peaks.iter_mut());
        for probe in self.probes {
            let mut values = [0.0; MAX_COLUMNS];
            probe.evaluate_with(model, state, reactions_n, &mut values);
            let columns = probe.columns().len();
            self.row[place..place + columns].copy_from_slice(&values[..columns]);
            place += columns;
            let vector_length = DVec3::new(values[0], values[1], values[2]).length();
            for (&of, (peak, value)) in peaks_of(probe).iter().zip(peaks.by_ref().zip(values)) {
                let value = if of == "magnitude" { vector_length } else { value };
                if self.count == 0 || is_further(probe, value, peak.value) {
                    *peak = Peak { value, time_s };
                }
            }
        }
        self.count += 1;
        let Some(file) = &mut self.file else { return Ok(()) };
        file.add(|out| write_row(out, time_s, &self.row)).into_diagnostic().wrap_err("cannot write probes.csv")
    }

    /// Rows so far.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// The newest value of every column: probe, column, value.
    pub(super) fn newest(&self) -> impl Iterator<Item = (&Probe, &'static str, f64)> + '_ {
        let columns = self.probes.iter().flat_map(|probe| probe.columns().iter().map(move |column| (probe, *column)));
        columns.zip(&self.row).map(|((probe, column), value)| (probe, column, *value))
    }

    /// The peaks over all rows: probe, of what, and which.
    pub(super) fn peaks(&self) -> impl Iterator<Item = (&Probe, &'static str, Peak)> + '_ {
        let names = self.probes.iter().flat_map(|probe| peaks_of(probe).iter().map(move |of| (probe, *of)));
        names.zip(&self.peaks).map(|((probe, of), peak)| (probe, of, *peak))
    }

    /// Writes what is buffered.
    pub(super) fn flush(&mut self) -> miette::Result<()> {
        self.file.as_mut().map_or(Ok(()), WholeRows::flush).into_diagnostic().wrap_err("cannot write probes.csv")
    }
}

fn create(path: &Path, probes: &[Probe]) -> miette::Result<WholeRows> {
    let refused = || format!("cannot write {}", path.display());
    let mut file = WholeRows::create(path).into_diagnostic().wrap_err_with(refused)?;
    let columns: Vec<String> = std::iter::once("time_s".to_owned()).chain(probes.iter().flat_map(heads)).collect();
    file.add(|out| writeln!(out, "{}", columns.join(","))).into_diagnostic().wrap_err_with(refused)?;
    Ok(file)
}

/// Numbers as the shortest text that reads back to the same bits.
fn write_row(file: &mut impl Write, time_s: f64, row: &[f64]) -> std::io::Result<()> {
    write!(file, "{time_s}")?;
    row.iter().try_for_each(|value| write!(file, ",{value}"))?;
    writeln!(file)
}

/// Headings of a probe's columns: name, column, unit.
fn heads(probe: &Probe) -> Vec<String> {
    let name = probe.name().replace([',', '"', '\n'], " ");
    let unit = if probe.unit() == "1" { String::new() } else { format!("_{}", probe.unit().to_lowercase()) };
    let head = |column: &&str| match *column {
        "value" => format!("{name}{unit}"),
        column => format!("{name}_{column}{unit}"),
    };
    probe.columns().iter().map(head).collect()
}
