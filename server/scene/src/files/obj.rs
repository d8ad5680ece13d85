//! Wavefront OBJ: vertices and faces; everything else of it (normals, textures, materials) has no part in a surface.
use super::builder::{Builder, Kind, Shape};
use super::cursor::Cursor;
use super::error::{FileError, Problem};
use glam::DVec3;
use std::borrow::Cow;
use std::path::Path;

const POLYGON: Kind = Kind { shape: Shape::Polygon, name: "polygons", corners: usize::MAX };

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    let mut builder = Builder::default();
    let mut cursor = Cursor::new(path, data);
    let mut polygons = 0;
    while let Some(first) = cursor.line() {
        let line = continued(&mut cursor, first);
        let line = line.split(|&b| b == b'#').next().unwrap_or_default();
        let Ok(line) = std::str::from_utf8(line) else {
            if line.starts_with(b"v ") || line.starts_with(b"f ") {
                return Err(cursor.expected("a vertex or a face", line));
            }
            continue; // a name in another character set
        };
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => vertex(&cursor, &mut builder, words)?,
            Some("f") => {
                let corners = face(&cursor, builder.nodes.len(), words)?;
                polygons += usize::from(corners.len() > 3);
                builder.element(POLYGON, &corners, &[]);
            }
            Some("l" | "p") => {
                builder.element(Kind { shape: Shape::Other, name: "lines and points", corners: 0 }, &[], &[]);
            }
            Some(word) if !KNOWN.contains(&word) => {
                return Err(cursor.expected("a statement of an OBJ file (v, f, …)", word.as_bytes()));
            }
            _ => {}
        }
    }
    if polygons > 0 {
        builder.warnings.push(format!("{polygons} polygons are cut into triangles from their first corner"));
    }
    Ok(builder)
}

/// Statements without geometry of polygons.
const KNOWN: [&str; 24] = [
    "vt",
    "vn",
    "vp",
    "g",
    "s",
    "o",
    "mg",
    "usemtl",
    "mtllib",
    "usemap",
    "maplib",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "ctech",
    "stech",
    "cstype",
    "deg",
    "bmat",
    "step",
    "call",
];

/// Lines that end in a backslash go on in the next.
fn continued<'a>(cursor: &mut Cursor<'a>, first: &'a [u8]) -> Cow<'a, [u8]> {
    let mut line = Cow::Borrowed(first);
    while line.ends_with(b"\\") {
        let joined = line.to_mut();
        joined.pop();
        joined.push(b' ');
        joined.extend_from_slice(cursor.line().unwrap_or_default());
    }
    line
}

fn vertex<'a>(
    cursor: &Cursor,
    builder: &mut Builder,
    mut words: impl Iterator<Item = &'a str>,
) -> Result<(), FileError> {
    let mut position = DVec3::ZERO;
    for axis in 0..3 {
        let word = words.next().ok_or_else(|| cursor.expected("three coordinates", b"the end of the line"))?;
        position[axis] = word.parse().map_err(|_| cursor.expected("a coordinate", word.as_bytes()))?;
    }
    if !position.is_finite() {
        return Err(cursor.fail(Problem::NonFinite { node: builder.nodes.len() as i64 + 1, position }));
    }
    builder.nodes.push(position);
    Ok(())
}

/// Corners are `v`, `v/vt`, `v//vn` or `v/vt/vn`; vertices count from 1, or from the last one backwards as -1, -2, ….
fn face<'a>(cursor: &Cursor, vertices: usize, words: impl Iterator<Item = &'a str>) -> Result<Vec<u32>, FileError> {
    let mut corners = Vec::new();
    for word in words {
        let number = word.split('/').next().unwrap_or_default();
        let number: i64 = number.parse().map_err(|_| cursor.expected("the number of a vertex", word.as_bytes()))?;
        let count = vertices as i64;
        let index = if number > 0 { number - 1 } else { count.saturating_add(number) };
        if number == 0 || !(0..count).contains(&index) {
            let known = format!("{count} vertices are defined so far, counting from 1");
            return Err(cursor.fail(Problem::UnknownNode { element: "a face".to_string(), node: number, known }));
        }
        corners.push(index as u32);
    }
    // A line that ends with the file may have been cut.
    if corners.len() < 3 && cursor.is_last_line_open() {
        return Err(cursor.expected("three or more corners of a face", corners.len().to_string().as_bytes()));
    }
    Ok(corners)
}
