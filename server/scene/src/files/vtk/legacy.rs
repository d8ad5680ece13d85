//! The legacy format of VTK, ASCII and binary (big-endian), versions 1 to 5.1: unstructured grids and polygonal data.
use super::attributes::{self, Keep};
use super::cells::{CellTable, Groups, LINES, POLYGON, STRIP, VERTICES};
use crate::files::builder::Builder;
use crate::files::cursor::{Cursor, Encoding, Scalar, shown};
use crate::files::error::{FileError, Problem};
use glam::DVec3;
use std::path::Path;

pub(in crate::files) fn read(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    let mut reader = Reader {
        cursor: Cursor::new(path, data),
        builder: Builder::default(),
        table: CellTable { offsets: vec![0], ..CellTable::default() },
        groups: Groups::default(),
        unstructured: true,
    };
    let binary = reader.header()?;
    if binary {
        reader.cursor.encoding = Encoding::Big;
    }
    while let Some(words) = next_line(&mut reader.cursor)? {
        reader.section(&words)?;
    }
    reader.finish()
}

/// The words of the next line that is not empty.
pub(super) fn next_line<'a>(cursor: &mut Cursor<'a>) -> Result<Option<Vec<&'a str>>, FileError> {
    cursor.skip_space();
    let Some(line) = cursor.line() else { return Ok(None) };
    match std::str::from_utf8(line) {
        Ok(text) => Ok(Some(text.split_ascii_whitespace().collect())),
        Err(_) => Err(cursor.expected("a keyword of VTK's legacy format", line)),
    }
}

struct Reader<'a> {
    cursor: Cursor<'a>,
    builder: Builder,
    table: CellTable,
    groups: Groups,
    /// An unstructured grid, or polygonal data.
    unstructured: bool,
}

impl Reader<'_> {
    /// `# vtk DataFile Version …`, a title, ASCII or BINARY, DATASET.
    fn header(&mut self) -> Result<bool, FileError> {
        let first = self.cursor.line().ok_or_else(|| self.cursor.truncated("`# vtk DataFile Version`"))?;
        if !first.starts_with(b"# vtk DataFile Version ") {
            return Err(self.cursor.expected("`# vtk DataFile Version`", first));
        }
        self.cursor.line().ok_or_else(|| self.cursor.truncated("the title"))?;
        let encoding = self.cursor.text("ASCII or BINARY")?;
        match encoding {
            "ASCII" => Ok(false),
            "BINARY" => self.cursor.line().map(|_| true).ok_or_else(|| self.cursor.truncated("DATASET")),
            _ => Err(self.cursor.expected("ASCII or BINARY", encoding.as_bytes())),
        }
    }

    fn section(&mut self, words: &[&str]) -> Result<(), FileError> {
        match *words {
            ["DATASET", "UNSTRUCTURED_GRID"] => self.unstructured = true,
            ["DATASET", "POLYDATA"] => self.unstructured = false,
            ["DATASET", other] => {
                let what = format!("a data set of type {} is not read", shown(other.as_bytes()));
                let instead = "save it as UNSTRUCTURED_GRID (volumes) or POLYDATA (surfaces)".to_string();
                return Err(self.cursor.fail(Problem::Unsupported { what, instead }));
            }
            ["POINTS", count, scalar] => self.points(count, scalar)?,
            ["CELLS", count, size] => self.cells(count, size, None)?,
            ["CELL_TYPES", count] => self.cell_types(count)?,
            ["VERTICES", count, size] => self.cells(count, size, Some(VERTICES))?,
            ["LINES", count, size] => self.cells(count, size, Some(LINES))?,
            ["POLYGONS", count, size] => self.cells(count, size, Some(POLYGON))?,
            ["TRIANGLE_STRIPS", count, size] => self.cells(count, size, Some(STRIP))?,
            ["FIELD", _, count] => {
                attributes::field(&mut self.cursor, count, &mut Keep { groups: None, builder: &mut self.builder })?;
            }
            ["METADATA", ..] => attributes::metadata(&mut self.cursor),
            ["CELL_DATA", count] => {
                let mut keep = Keep { groups: Some(&mut self.groups), builder: &mut self.builder };
                attributes::read(&mut self.cursor, count, &mut keep)?;
            }
            ["POINT_DATA", count] => {
                attributes::read(&mut self.cursor, count, &mut Keep { groups: None, builder: &mut self.builder })?;
            }
            _ => return Err(self.cursor.expected("a keyword of VTK's legacy format", words.join(" ").as_bytes())),
        }
        Ok(())
    }

    fn points(&mut self, count: &str, scalar: &str) -> Result<(), FileError> {
        let scalar = attributes::scalar(&self.cursor, scalar)?;
        let count = self.count(count, 3 * self.least(scalar), "points")?;
        if !self.builder.nodes.is_empty() {
            return Err(self.cursor.expected("one section POINTS", b"a second one"));
        }
        for node in 0..count {
            let mut position = DVec3::ZERO;
            for axis in 0..3 {
                position[axis] = self.cursor.real(scalar, "a coordinate")?;
            }
            if !position.is_finite() {
                return Err(self.cursor.fail(Problem::NonFinite { node: node as i64, position }));
            }
            self.builder.nodes.push(position);
        }
        Ok(())
    }

    /// Up to 4.2: `corner-count corners…` of `count` cells, `size` numbers in all. Since 5.0: `count` offsets, one more
    /// than cells, and `size` indices.
    fn cells(&mut self, count: &str, size: &str, cell_type: Option<i64>) -> Result<(), FileError> {
        let before = self.table.offsets.len() - 1;
        let mut ahead = self.cursor.clone();
        match next_line(&mut ahead).ok().flatten().as_deref() {
            Some(["OFFSETS", scalar]) => {
                self.cursor = ahead;
                self.offsets_and_connectivity(count, size, scalar)?;
            }
            _ => self.counted_cells(count, size)?,
        }
        let cells = self.table.offsets.len() - 1 - before;
        if let Some(cell_type) = cell_type {
            self.table.types.extend(std::iter::repeat_n(cell_type, cells));
        }
        Ok(())
    }

    fn counted_cells(&mut self, count: &str, size: &str) -> Result<(), FileError> {
        let count = self.count(count, self.least(Scalar::I32), "cells")?;
        let size = self.count(size, self.least(Scalar::I32), "numbers of cells")?;
        let mut left = size;
        for cell in 0..count {
            let corners = self.cursor.int(Scalar::I32, "the number of corners of a cell")?;
            let corners = usize::try_from(corners).ok().filter(|&n| n < left);
            let Some(corners) = corners else {
                let what = format!("cell {cell} does not fit into the {size} numbers announced for all cells");
                return Err(self.cursor.fail(Problem::Inconsistent { what }));
            };
            left -= corners + 1;
            for _ in 0..corners {
                let node = self.cursor.int(Scalar::I32, "a corner of a cell")?;
                self.table.connectivity.push(node);
            }
            self.table.offsets.push(self.table.connectivity.len() as i64);
        }
        Ok(())
    }

    fn offsets_and_connectivity(&mut self, count: &str, size: &str, scalar: &str) -> Result<(), FileError> {
        let base = self.table.connectivity.len() as i64;
        let scalar = attributes::scalar(&self.cursor, scalar)?;
        let count = self.count(count, self.least(scalar), "offsets")?;
        for place in 0..count {
            let offset = self.cursor.int(scalar, "the offset of a cell")?;
            if place > 0 {
                self.table.offsets.push(base.saturating_add(offset));
            } else if offset != 0 {
                return Err(self.cursor.expected("0 as the first offset", offset.to_string().as_bytes()));
            }
        }
        let words = next_line(&mut self.cursor)?.unwrap_or_default();
        let ["CONNECTIVITY", scalar] = *words else {
            return Err(self.cursor.expected("`CONNECTIVITY` and its type", words.join(" ").as_bytes()));
        };
        let scalar = attributes::scalar(&self.cursor, scalar)?;
        for _ in 0..self.count(size, self.least(scalar), "indices of cells")? {
            let node = self.cursor.int(scalar, "a corner of a cell")?;
            self.table.connectivity.push(node);
        }
        Ok(())
    }

    fn cell_types(&mut self, count: &str) -> Result<(), FileError> {
        for _ in 0..self.count(count, self.least(Scalar::I32), "cell types")? {
            let number = self.cursor.int(Scalar::I32, "the type of a cell")?;
            self.table.types.push(number);
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Builder, FileError> {
        // The groups of polygonal data are those of surfaces, which have none.
        let tags = if self.unstructured { self.groups.tags.as_deref() } else { None };
        let own = 0..self.builder.nodes.len() as u32;
        self.table.build(&mut self.builder, &own, tags).map_err(|problem| self.cursor.fail(problem))?;
        Ok(self.builder)
    }

    fn least(&self, scalar: Scalar) -> usize {
        if self.cursor.encoding == Encoding::Ascii { 2 } else { scalar.size() }
    }

    fn count(&self, count: &str, bytes_each: usize, what: &str) -> Result<usize, FileError> {
        let wanted = format!("the number of {what}");
        let count = count.parse().map_err(|_| self.cursor.expected(&wanted, count.as_bytes()))?;
        self.cursor.check_count(count, bytes_each, what)
    }
}
