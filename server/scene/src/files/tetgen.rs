//! TetGen: `.node` and `.ele`, and `.face` where it is there. Counting starts at 0 or 1, as the first node says.
use super::builder::{Builder, Kind, Shape};
use super::cursor::Cursor;
use super::error::{FileError, Problem};
use super::format;
use glam::DVec3;
use std::path::Path;

const TET: Kind = Kind { shape: Shape::Tet, name: "tetrahedra", corners: 4 };
const TRIANGLE: Kind = Kind { shape: Shape::Triangle, name: "triangles", corners: 3 };

/// Reads the files with the stem of `path`, whichever of them it names.
pub(super) fn read(path: &Path) -> Result<Builder, FileError> {
    let mut builder = Builder::default();
    let node_path = path.with_extension("node");
    let data = format::load(&node_path)?;
    let first = nodes(&mut Lines::new(&node_path, &data), &mut builder)?;

    let element_path = path.with_extension("ele");
    let face_path = path.with_extension("face");
    // A surface may come as .node and .face alone.
    if element_path.exists() || !face_path.exists() {
        let data = format::load(&element_path)?;
        elements(&mut Lines::new(&element_path, &data), &mut builder, first, TET)?;
    }
    if face_path.exists() {
        let data = format::load(&face_path)?;
        elements(&mut Lines::new(&face_path, &data), &mut builder, first, TRIANGLE)?;
    }
    Ok(builder)
}

/// Lines that are neither empty nor comments, as words.
struct Lines<'a> {
    cursor: Cursor<'a>,
}

impl<'a> Lines<'a> {
    fn new(path: &'a Path, data: &'a [u8]) -> Self {
        Self { cursor: Cursor::new(path, format::unmarked(data)) }
    }

    fn next(&mut self, wanted: &str) -> Result<Vec<&'a str>, FileError> {
        loop {
            let line = self.cursor.line().ok_or_else(|| self.cursor.truncated(wanted))?;
            let line = line.split(|&b| b == b'#').next().unwrap_or_default();
            let text = std::str::from_utf8(line).map_err(|_| self.cursor.expected(wanted, line))?;
            let words: Vec<&str> = text.split_ascii_whitespace().collect();
            if !words.is_empty() {
                return Ok(words);
            }
        }
    }

    /// Word `place` of a line.
    fn parse<T: std::str::FromStr>(&self, words: &[&str], place: usize, wanted: &str) -> Result<T, FileError> {
        let word = words.get(place).ok_or_else(|| self.cursor.expected(wanted, b"the end of the line"))?;
        word.parse().map_err(|_| self.cursor.expected(wanted, word.as_bytes()))
    }
}

/// `count 3 attributes markers`, then `number x y z attributes… [marker]`; the number of the first node.
fn nodes(lines: &mut Lines, builder: &mut Builder) -> Result<i64, FileError> {
    let head = lines.next("the number of nodes")?;
    let count = lines.parse(&head, 0, "the number of nodes")?;
    let count = lines.cursor.check_count(count, 8, "nodes")?;
    let dimension: i64 = lines.parse(&head, 1, "the dimension 3")?;
    if dimension != 3 {
        return Err(lines.cursor.expected("the dimension 3", dimension.to_string().as_bytes()));
    }
    let attributes: usize = if head.len() > 2 { lines.parse(&head, 2, "the number of attributes")? } else { 0 };
    let markers: usize = if head.len() > 3 { lines.parse(&head, 3, "0 or 1 boundary markers")? } else { 0 };
    let mut first = 0;
    for node in 0..count {
        let words = lines.next("a node")?;
        let number: i64 = lines.parse(&words, 0, "the number of a node")?;
        if node == 0 {
            if !(0..=1).contains(&number) {
                return Err(lines.cursor.expected("0 or 1 as the number of the first node", words[0].as_bytes()));
            }
            first = number;
        } else if number != first + node as i64 {
            let wanted = format!("node {}, for nodes are numbered without gaps", first + node as i64);
            return Err(lines.cursor.expected(&wanted, words[0].as_bytes()));
        }
        let mut position = DVec3::ZERO;
        for axis in 0..3 {
            position[axis] = lines.parse(&words, 1 + axis, "a coordinate")?;
        }
        if !position.is_finite() {
            return Err(lines.cursor.fail(Problem::NonFinite { node: number, position }));
        }
        builder.nodes.push(position);
        if markers > 0 {
            let marker: i64 = lines.parse(&words, attributes.saturating_add(4), "a boundary marker")?;
            // 0 marks the inside.
            if marker != 0 {
                builder.node_in_group(node as u32, marker);
            }
        }
    }
    Ok(first)
}

/// Tets: `count corners attributes`, then `number nodes… attributes…`, of which the first is the region.
/// Faces: `count markers`, then `number nodes… [marker]`; the marker 0 is none. They have three nodes, of second order
/// six, which the length of a line tells alone.
fn elements(lines: &mut Lines, builder: &mut Builder, first: i64, kind: Kind) -> Result<(), FileError> {
    let corners = kind.corners;
    let tets = kind.shape == Shape::Tet;
    let head = lines.next("the number of elements")?;
    let count = lines.parse(&head, 0, "the number of elements")?;
    let count = lines.cursor.check_count(count, 2 * (corners + 1), kind.name)?;
    let mut node_count =
        if tets { lines.parse(&head, 1, "the number of nodes of a tetrahedron, 4 or 10")? } else { 3 };
    if tets && node_count != 4 && node_count != 10 {
        return Err(lines.cursor.expected("4 or 10 nodes of a tetrahedron", node_count.to_string().as_bytes()));
    }
    let place = if tets { 2 } else { 1 };
    let attributes: usize =
        if head.len() > place { lines.parse(&head, place, "the number of attributes")? } else { 0 };
    let known = format!("the nodes are {first} to {}", first + builder.nodes.len() as i64 - 1);
    let mut nodes = Vec::with_capacity(node_count);
    for _ in 0..count {
        let words = lines.next("an element")?;
        if !tets {
            node_count = face_nodes(words.len(), attributes);
        }
        nodes.clear();
        for corner in 0..node_count {
            let node: i64 = lines.parse(&words, 1 + corner, "the node of an element")?;
            let index = node.saturating_sub(first);
            if !(0..builder.nodes.len() as i64).contains(&index) {
                let element = format!("element {}", words[0]);
                return Err(lines.cursor.fail(Problem::UnknownNode { element, node, known }));
            }
            nodes.push(index as u32);
        }
        let mut tag = None;
        if attributes > 0 {
            let value: f64 = lines.parse(&words, 1 + node_count, "an attribute")?;
            tag = (value.fract() == 0.0 && value.abs() < 9e15 && (tets || value != 0.0)).then_some(value as i64);
        }
        builder.element(kind, &nodes, tag.as_slice());
    }
    Ok(())
}

/// Number of nodes of a face whose line has so many words. Behind the marker TetGen may name the two tets beside it.
fn face_nodes(words: usize, markers: usize) -> usize {
    if matches!(words.checked_sub(markers), Some(7 | 9)) { 6 } else { 3 }
}
