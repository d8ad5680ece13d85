//! Results as CSV: comment lines `# key: value` with what a reader must know, a header, one line per row.
use super::Row;
use miette::{Result, miette};
use std::{collections::BTreeMap, fmt::Write as _};

const HEADER: &str = "problem,method,competes,resolution,elements,nodes,substeps,median_us,p99_us,worst_us,unrest,memory_bytes,answer,\
                      answer_error,field_l2,field_around,field_max,drift,energy_error,failure";

/// A run: circumstances and rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Run {
    /// Machine, commit, date, options, noise.
    pub circumstances: BTreeMap<String, String>,
    /// Results.
    pub rows: Vec<Row>,
}

/// The text of a run.
pub fn write(run: &Run) -> String {
    let mut text = String::new();
    for (key, value) in &run.circumstances {
        let _ = writeln!(text, "# {key}: {}", value.replace('\n', " "));
    }
    let _ = writeln!(text, "{HEADER}");
    for row in &run.rows {
        let number = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.6e}"));
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
            row.problem,
            row.method,
            row.competes,
            row.resolution,
            row.elements,
            row.nodes,
            row.substeps,
            number(row.median_us),
            number(row.p99_us),
            number(row.worst_us),
            number(row.unrest),
            row.memory_bytes,
            number(row.answer),
            number(row.answer_error),
            number(row.field_l2),
            number(row.field_around),
            number(row.field_max),
            number(row.drift),
            number(row.energy_error),
            row.failure.replace([',', '\n'], ";")
        );
    }
    text
}

/// Reads what [`write`] wrote.
///
/// # Errors
/// A header of another version, or a line that does not fit it, named by its number.
pub fn read(text: &str) -> Result<Run> {
    let mut run = Run::default();
    let mut header_seen = false;
    for (index, line) in text.lines().enumerate() {
        if let Some((key, value)) = line.strip_prefix("# ").and_then(|rest| rest.split_once(": ")) {
            run.circumstances.insert(key.into(), value.into());
        } else if header_seen {
            let row = parse(line).ok_or_else(|| miette!("line {}: not a row of results: {line}", index + 1))?;
            run.rows.push(row);
        } else if line == HEADER {
            header_seen = true;
        } else {
            return Err(miette!("line {}: not the header of this version's results", index + 1));
        }
    }
    Ok(run)
}

fn parse(line: &str) -> Option<Row> {
    let fields: Vec<&str> = line.split(',').collect();
    let [
        problem,
        method,
        competes,
        resolution,
        elements,
        nodes,
        substeps,
        median,
        p99,
        worst,
        unrest,
        memory,
        rest @ ..,
    ] = &fields[..]
    else {
        return None;
    };
    let [answer, answer_error, field_l2, field_around, field_max, drift, energy_error, failure] = rest else {
        return None;
    };
    let number = |field: &str| if field.is_empty() { Some(None) } else { field.parse().ok().map(Some) };
    Some(Row {
        problem: (*problem).into(),
        method: (*method).into(),
        competes: competes.parse().ok()?,
        resolution: resolution.parse().ok()?,
        elements: elements.parse().ok()?,
        nodes: nodes.parse().ok()?,
        substeps: substeps.parse().ok()?,
        median_us: number(median)?,
        p99_us: number(p99)?,
        worst_us: number(worst)?,
        unrest: number(unrest)?,
        memory_bytes: memory.parse().ok()?,
        answer: number(answer)?,
        answer_error: number(answer_error)?,
        field_l2: number(field_l2)?,
        field_around: number(field_around)?,
        field_max: number(field_max)?,
        drift: number(drift)?,
        energy_error: number(energy_error)?,
        failure: (*failure).into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let row = Row {
            problem: "p".into(),
            method: "m n".into(),
            competes: true,
            resolution: 4,
            median_us: Some(1.5),
            ..Row::default()
        };
        let failed = Row { failure: "a; b".into(), ..row.clone() };
        let run = Run { circumstances: [("date".into(), "2026-11-22".into())].into(), rows: vec![row, failed] };
        assert_eq!(read(&write(&run)).unwrap(), run);
        assert!(read("a,b\n1,2\n").is_err());
        assert!(read(&format!("{HEADER}\nx,y\n")).is_err());
    }
}
