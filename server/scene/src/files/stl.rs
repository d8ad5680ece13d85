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

/// Whether the length is that of a binary file with the count it gives.
pub(super) fn is_binary(data: &[u8]) -> bool {
    announced_length(data) == Some(data.len() as u64)
}

/// Length of a binary file with the count that stands in `data`.
fn announced_length(data: &[u8]) -> Option<u64> {
    let count = data.get(HEADER - 4..HEADER)?.try_into().ok().map(u32::from_le_bytes)?;
    Some(HEADER as u64 + FACET as u64 * u64::from(count))
}

/// Whether a text begins as an ASCII file does.
pub(super) fn begins_solid(text: &[u8]) -> bool {
    begins(text, b"solid")
}

/// Keywords are lower case by the format's definition, upper case by some writers.
fn begins(text: &[u8], keyword: &[u8]) -> bool {
    text.get(..keyword.len()).is_some_and(|start| start.eq_ignore_ascii_case(keyword))
}

/// Tells ASCII from binary files, which some writers begin with `solid` too, and some end with more than triangles.
fn is_ascii(data: &[u8]) -> bool {
    let text = data.trim_ascii_start();
    if is_binary(data) || !begins_solid(text) {
        return false;
    }
    // Four letters of a text are no control characters, and announce more than a file ever holds.
    let count = data.get(HEADER - 4..HEADER).unwrap_or_default();
    if count.iter().all(|byte| !byte.is_ascii_control() || byte.is_ascii_whitespace()) {
        return true;
    }
    let behind = text.iter().position(|byte| matches!(byte, b'\n' | b'\r')).map_or(&[][..], |end| &text[end..]);
    let second = behind.trim_ascii_start();
    let fits = announced_length(data).is_some_and(|length| length <= data.len() as u64);
    !fits && [&b"facet"[..], b"endsolid", b"solid"].iter().any(|keyword| begins(second, keyword))
}

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    let mut soup = Soup::default();
    let mut cursor = Cursor::new(path, data);
    if is_ascii(data) {
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
        closed = if begins_solid(text) {
            false
        } else if begins(text, b"endsolid") {
            true
        } else if begins(text, b"facet") {
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
        match cursor.text("`vertex` or `endloop`")?.to_ascii_lowercase().as_str() {
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
    if found.eq_ignore_ascii_case(wanted) {
        Ok(())
    } else {
        Err(cursor.expected(&format!("`{wanted}`"), found.as_bytes()))
    }
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
    let behind = "behind the last triangle";
    match cursor.rest().len() {
        0 => {}
        1 => soup.builder.warnings.push(format!("a byte {behind} is not read")),
        left => soup.builder.warnings.push(format!("{left} bytes {behind} are not read")),
    }
    Ok(())
}
