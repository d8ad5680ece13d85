//! STL, ASCII and binary. A solid is a soup of triangles: equal points are joined to vertices.
use super::builder::{Builder, Kind, Shape};
use super::cursor::{Cursor, Encoding, Scalar};
use super::error::{FileError, Problem};
use glam::DVec3;
use std::collections::HashMap;
use std::path::Path;

/// Header text (80 bytes) and triangle count (4 bytes).
const HEADER: usize = 84;
/// Normal and three points as `f32`, and two bytes of attributes.
const FACET: usize = 50;
const TRIANGLE: Kind = Kind { shape: Shape::Triangle, name: "triangles", corners: 3 };

/// Whether the length is that of a binary file with the count it gives. Some writers begin binary files with `solid`.
pub(super) fn is_binary(data: &[u8]) -> bool {
    let count = data.get(HEADER - 4..HEADER).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    count.is_some_and(|count| data.len() as u64 == HEADER as u64 + FACET as u64 * u64::from(count))
}

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    let mut soup = Soup::default();
    let mut cursor = Cursor::new(path, data);
    if !is_binary(data) && data.trim_ascii_start().starts_with(b"solid") {
        read_ascii(&mut cursor, &mut soup)?;
    } else {
        read_binary(&mut cursor, &mut soup)?;
    }
    Ok(soup.builder)
}

/// Triangles with their equal points joined.
#[derive(Default)]
struct Soup {
    builder: Builder,
    index_of: HashMap<[u64; 3], u32>,
}

impl Soup {
    fn vertex(&mut self, cursor: &Cursor, position: DVec3) -> Result<u32, FileError> {
        let next = self.builder.nodes.len() as u32;
        if !position.is_finite() {
            return Err(cursor.fail(Problem::NonFinite { node: next.into(), position }));
        }
        // Adding 0 makes -0 and 0 one point.
        let key = (position + DVec3::ZERO).to_array().map(f64::to_bits);
        let index = *self.index_of.entry(key).or_insert(next);
        if index == next {
            self.builder.nodes.push(position);
        }
        Ok(index)
    }
}

fn read_ascii(cursor: &mut Cursor, soup: &mut Soup) -> Result<(), FileError> {
    let mut line = cursor.line();
    let mut closed = true;
    // `solid` and `endsolid` carry a free name to the end of the line.
    while let Some(text) = line {
        let text = text.trim_ascii();
        closed = if text.starts_with(b"solid") {
            false
        } else if text.starts_with(b"endsolid") {
            true
        } else if text.starts_with(b"facet") {
            facet(cursor, soup)?;
            closed
        } else if text.is_empty() {
            closed
        } else {
            return Err(cursor.expected("`facet`, `endsolid` or `solid`", text));
        };
        line = cursor.line();
    }
    if closed { Ok(()) } else { Err(cursor.truncated("`endsolid`")) }
}

/// The lines of one facet behind its first.
fn facet(cursor: &mut Cursor, soup: &mut Soup) -> Result<(), FileError> {
    keyword(cursor, "outer")?;
    keyword(cursor, "loop")?;
    let mut corners = Vec::with_capacity(3);
    loop {
        match cursor.text("`vertex` or `endloop`")? {
            "vertex" => {
                let mut position = DVec3::ZERO;
                for axis in 0..3 {
                    position[axis] = cursor.parse("a coordinate")?;
                }
                corners.push(soup.vertex(cursor, position)?);
            }
            "endloop" => break,
            other => return Err(cursor.expected("`vertex` or `endloop`", other.as_bytes())),
        }
    }
    if corners.len() != 3 {
        return Err(cursor.expected("three vertices in a facet", corners.len().to_string().as_bytes()));
    }
    keyword(cursor, "endfacet")?;
    soup.builder.element(TRIANGLE, &corners, &[]);
    Ok(())
}

fn keyword(cursor: &mut Cursor, wanted: &str) -> Result<(), FileError> {
    let found = cursor.text(wanted)?;
    if found == wanted { Ok(()) } else { Err(cursor.expected(&format!("`{wanted}`"), found.as_bytes())) }
}

fn read_binary(cursor: &mut Cursor, soup: &mut Soup) -> Result<(), FileError> {
    cursor.encoding = Encoding::Little;
    cursor.take(HEADER - 4, "the header of 80 bytes")?;
    let count = cursor.int(Scalar::U32, "the number of triangles")?;
    let count = cursor.check_count(count, FACET, "triangles of 50 bytes")?;
    for _ in 0..count {
        let mut numbers = [0.0; 12];
        for number in &mut numbers {
            *number = cursor.real(Scalar::F32, "a triangle")?;
        }
        cursor.take(2, "the attributes of a triangle")?;
        let mut corners = [0; 3];
        for corner in 0..3 {
            corners[corner] = soup.vertex(cursor, DVec3::from_slice(&numbers[3 + 3 * corner..]))?;
        }
        soup.builder.element(TRIANGLE, &corners, &[]);
    }
    let left = cursor.rest().len();
    if left > 0 {
        soup.builder.warnings.push(format!("{left} bytes behind the last triangle are not read"));
    }
    Ok(())
}
