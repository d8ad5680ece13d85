//! PLY (Stanford polygons), ASCII and binary of both byte orders: vertices and faces, other elements are read past.
use super::builder::{Builder, Kind, Shape};
use super::cursor::{Cursor, Encoding, Scalar, shown};
use super::error::{FileError, Problem};
use glam::DVec3;
use std::path::Path;

const POLYGON: Kind = Kind { shape: Shape::Polygon, name: "polygons", corners: usize::MAX };

/// `element NAME COUNT` and the properties behind it.
struct Element {
    name: String,
    count: i64,
    properties: Vec<Property>,
}

struct Property {
    name: String,
    scalar: Scalar,
    /// Of a list, the type of its length.
    length: Option<Scalar>,
}

impl Element {
    /// Least size of one item: a list may be empty but has a length.
    fn least_size(&self, encoding: Encoding) -> usize {
        let size = |p: &Property| if encoding == Encoding::Ascii { 2 } else { p.length.unwrap_or(p.scalar).size() };
        self.properties.iter().map(size).sum()
    }
}

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    let mut cursor = Cursor::new(path, data);
    let (encoding, elements) = header(&mut cursor)?;
    // Behind lines that end in CR alone a line feed is the first byte of binary data.
    let header = &data[..data.len() - cursor.rest().len()];
    if header.ends_with(b"\r\n") && !header[..header.len() - 1].contains(&b'\n') {
        cursor.go_back(1);
    }
    cursor.encoding = encoding;
    let mut builder = Builder::default();
    for element in &elements {
        if element.properties.is_empty() {
            continue;
        }
        let what = format!("items of `{}`", element.name);
        let count = cursor.check_count(element.count, element.least_size(encoding), &what)?;
        match element.name.as_str() {
            "vertex" => vertices(&mut cursor, &mut builder, element, count)?,
            "face" => faces(&mut cursor, &mut builder, element, count)?,
            _ => {
                for _ in 0..count {
                    item(&mut cursor, &mut builder, element, &[], |_, _| ())?;
                }
                let name = Kind { shape: Shape::Other, name: "items of other elements", corners: 0 };
                (0..count).for_each(|_| builder.element(name, &[], &[]));
            }
        }
    }
    Ok(builder)
}

fn header(cursor: &mut Cursor) -> Result<(Encoding, Vec<Element>), FileError> {
    let mut elements: Vec<Element> = Vec::new();
    let mut encoding = None;
    let mut first = true;
    loop {
        let line = cursor.line().ok_or_else(|| cursor.truncated("`end_header`"))?;
        let text = String::from_utf8_lossy(line);
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match (first, words.as_slice()) {
            (true, ["ply"]) => {}
            (true, _) => return Err(cursor.expected("`ply`", line)),
            (_, ["comment" | "obj_info", ..] | []) => {}
            (_, ["format", name, "1.0"]) => encoding = Some(encoding_of(cursor, name)?),
            (_, ["element", name, count]) => {
                let count = count.parse().map_err(|_| cursor.expected("a count", count.as_bytes()))?;
                elements.push(Element { name: (*name).to_string(), count, properties: Vec::new() });
            }
            (_, ["property", rest @ ..]) => {
                let property = property(cursor, line, rest)?;
                let Some(element) = elements.last_mut() else {
                    return Err(cursor.expected("`element` before the first `property`", line));
                };
                element.properties.push(property);
            }
            (_, ["end_header"]) => break,
            _ => return Err(cursor.expected("a line of a PLY header", line)),
        }
        first = false;
    }
    let encoding = encoding.ok_or_else(|| cursor.expected("a line `format …` in the header", b"none"))?;
    Ok((encoding, elements))
}

fn encoding_of(cursor: &Cursor, name: &str) -> Result<Encoding, FileError> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::Little),
        "binary_big_endian" => Ok(Encoding::Big),
        _ => Err(cursor.expected("ascii, binary_little_endian or binary_big_endian", name.as_bytes())),
    }
}

fn property(cursor: &Cursor, line: &[u8], words: &[&str]) -> Result<Property, FileError> {
    match *words {
        ["list", length, scalar, name] => {
            let length_type = scalar_of(cursor, length)?;
            if !length_type.is_integer() {
                return Err(cursor.expected("an integer type for the length of a list", length.as_bytes()));
            }
            Ok(Property { name: name.to_string(), scalar: scalar_of(cursor, scalar)?, length: Some(length_type) })
        }
        [scalar, name] => Ok(Property { name: name.to_string(), scalar: scalar_of(cursor, scalar)?, length: None }),
        _ => Err(cursor.expected("`property TYPE NAME` or `property list TYPE TYPE NAME`", line)),
    }
}

fn scalar_of(cursor: &Cursor, name: &str) -> Result<Scalar, FileError> {
    Ok(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return Err(cursor.expected("a number type of PLY (char … double)", name.as_bytes())),
    })
}

/// Takes one item; `keep` gets the index of each property in `used` and each of its values.
fn item(
    cursor: &mut Cursor,
    builder: &mut Builder,
    element: &Element,
    used: &[usize],
    mut keep: impl FnMut(usize, f64),
) -> Result<(), FileError> {
    for (index, property) in element.properties.iter().enumerate() {
        let count = match property.length {
            None => 1,
            Some(scalar) => {
                let count = cursor.int(scalar, "the length of a list")?;
                let each = if cursor.encoding == Encoding::Ascii { 2 } else { property.scalar.size() };
                cursor.check_count(count, each, "values of a list")?
            }
        };
        for _ in 0..count {
            if used.contains(&index) {
                keep(index, cursor.real(property.scalar, &property.name)?);
            } else if let Err(word) = cursor.optional_real(property.scalar, &property.name)? {
                builder.leave_out(&property.name, || format!("has `{}`{}", shown(word), cursor.place()));
            }
        }
    }
    Ok(())
}

fn vertices(cursor: &mut Cursor, builder: &mut Builder, element: &Element, count: usize) -> Result<(), FileError> {
    let mut axes = [0; 3];
    for (axis, name) in axes.iter_mut().zip(["x", "y", "z"]) {
        let Some(index) = element.properties.iter().position(|p| p.name == name && p.length.is_none()) else {
            return Err(cursor.expected(&format!("a vertex property `{name}`"), b"none"));
        };
        *axis = index;
    }
    for node in 0..count {
        let mut position = DVec3::ZERO;
        item(cursor, builder, element, &axes, |index, value| {
            if let Some(axis) = axes.iter().position(|&a| a == index) {
                position[axis] = value;
            }
        })?;
        if !position.is_finite() {
            return Err(cursor.fail(Problem::NonFinite { node: node as i64, position }));
        }
        builder.nodes.push(position);
    }
    Ok(())
}

fn faces(cursor: &mut Cursor, builder: &mut Builder, element: &Element, count: usize) -> Result<(), FileError> {
    let is_corners = |p: &Property| ["vertex_indices", "vertex_index"].contains(&p.name.as_str()) && p.length.is_some();
    let Some(list) = element.properties.iter().position(is_corners) else {
        return Err(cursor.expected("a list `vertex_indices` of the faces", b"none"));
    };
    let mut polygons = 0;
    let mut corners = Vec::new();
    let mut nodes = Vec::new();
    for face in 0..count {
        corners.clear();
        item(cursor, builder, element, &[list], |_, value| corners.push(value))?;
        nodes.clear();
        for &corner in &corners {
            if !(corner >= 0.0 && corner.fract() == 0.0 && corner < builder.nodes.len() as f64) {
                let known = format!("there are {}, counting from 0", builder.nodes.len());
                let element = format!("face {face}");
                return Err(cursor.fail(Problem::UnknownNode { element, node: corner as i64, known }));
            }
            nodes.push(corner as u32);
        }
        polygons += usize::from(nodes.len() > 3);
        builder.element(POLYGON, &nodes, &[]);
    }
    if polygons > 0 {
        builder.warnings.push(format!("{polygons} polygons are cut into triangles from their first corner"));
    }
    Ok(())
}
