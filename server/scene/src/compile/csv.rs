//! CSV files of numbers: a header that names columns with their unit, then one row per line. Separators are commas,
//! semicolons or tabs; lines that start with `#` are comments.
use crate::limits::Limits;
use std::path::Path;

/// What is wrong with a CSV file.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CsvError {
    #[error("cannot read {file}: {error}")]
    Read { file: String, error: std::io::Error },
    #[error("{file} is empty: it needs a header line and rows")]
    Empty { file: String },
    #[error("{file}:1: there is no column `{wanted}` (found: {found})")]
    Column { file: String, wanted: String, found: String },
    #[error("{file}:{line}: expected a finite number in column `{column}`, found `{found}`")]
    Number { file: String, line: usize, column: String, found: String },
}

/// The wanted columns of a file in SI units, row by row. A column is named `name_unit`, its unit one of `units`.
pub(crate) fn read<const N: usize>(
    path: &Path,
    limits: &Limits,
    wanted: [Column; N],
) -> Result<Vec<[f64; N]>, CsvError> {
    let file = path.display().to_string();
    let text = limits.read_text(path).map_err(|error| CsvError::Read { file: file.clone(), error })?;
    parse(&file, &text, wanted)
}

/// A wanted column: its name, and the units it may be in with their size in SI.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    pub(crate) name: &'static str,
    pub(crate) units: &'static [(&'static str, f64)],
}

/// Time in s or ms.
pub(crate) const TIME: Column = Column { name: "time", units: &[("s", 1.0), ("ms", 1e3)] };

/// A length in m or mm.
pub(crate) const fn length(name: &'static str) -> Column {
    Column { name, units: &[("m", 1.0), ("mm", 1e3)] }
}

/// A number without unit.
pub(crate) const fn number(name: &'static str) -> Column {
    Column { name, units: &[("", 1.0)] }
}

fn parse<const N: usize>(file: &str, text: &str, wanted: [Column; N]) -> Result<Vec<[f64; N]>, CsvError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let Some((_, header)) = lines.next() else { return Err(CsvError::Empty { file: file.into() }) };
    let separator = [';', '\t', ','].into_iter().find(|&c| header.contains(c)).unwrap_or(',');
    let names: Vec<&str> = header.split(separator).map(str::trim).collect();
    let mut places = [(0, 1.0); N];
    for (place, column) in places.iter_mut().zip(wanted) {
        *place = find(&names, column).ok_or_else(|| CsvError::Column {
            file: file.into(),
            wanted: spell(column.name, column.units[0].0),
            found: names.join(", "),
        })?;
    }
    let mut rows = Vec::new();
    for (line, text) in lines {
        let cells: Vec<&str> = text.split(separator).map(str::trim).collect();
        let mut row = [0.0; N];
        for (value, (place, per_si)) in row.iter_mut().zip(places) {
            let cell = cells.get(place).copied().unwrap_or_default();
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            *value = number.ok_or_else(|| CsvError::Number {
                file: file.into(),
                line,
                column: names[place].into(),
                found: cell.into(),
            })? / per_si;
        }
        rows.push(row);
    }
    if rows.is_empty() { Err(CsvError::Empty { file: file.into() }) } else { Ok(rows) }
}

fn find(names: &[&str], column: Column) -> Option<(usize, f64)> {
    let unit = |(unit, per_si): &(&str, f64)| {
        names.iter().position(|name| *name == spell(column.name, unit)).map(|place| (place, *per_si))
    };
    column.units.iter().find_map(unit)
}

fn spell(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name}_{unit}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: [Column; 2] = [TIME, length("x")];

    #[test]
    fn units_order_and_separators_are_taken_from_the_header() {
        let rows = parse("f", "# comment\ny_m;x_mm;time_ms\n1;20;500\n\n2;30;1500\n", WANTED).unwrap();
        assert_eq!(rows, [[0.5, 0.02], [1.5, 0.03]]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let message = |text: &str| parse("f.csv", text, WANTED).unwrap_err().to_string();
        assert_eq!(message("time_s,y_m\n0,0\n"), "f.csv:1: there is no column `x_m` (found: time_s, y_m)");
        assert_eq!(
            message("time_s,x_m\n0,0\n1,nan\n"),
            "f.csv:3: expected a finite number in column `x_m`, found `nan`"
        );
        assert_eq!(message("time_s,x_m\n0\n"), "f.csv:2: expected a finite number in column `x_m`, found ``");
        assert!(message("\n").contains("empty"));
    }
}
