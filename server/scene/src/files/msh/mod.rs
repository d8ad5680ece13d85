//! Gmsh MSH: 4.1 and 2.x, ASCII and binary, and the older 1.0.
use super::builder::Builder;
use super::cursor::{Cursor, Encoding, Scalar, find};
use super::error::{FileError, Problem};
use glam::DVec3;
use std::collections::HashMap;
use std::path::Path;

mod elements;
mod v1;
mod v2;
mod v4;

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    let mut reader = Reader {
        cursor: Cursor::new(path, data),
        size: Scalar::U64,
        builder: Builder::default(),
        index_of: HashMap::new(),
        physical: HashMap::new(),
        version: Version::V1,
    };
    while let Some(section) = reader.cursor.word() {
        let known = section.strip_prefix(b"$").and_then(|name| std::str::from_utf8(name).ok());
        let Some(section) = known else {
            return Err(reader.cursor.expected("a section such as $MeshFormat, $Nodes or $Elements", section));
        };
        match (section, reader.version) {
            ("MeshFormat", _) => reader.format()?,
            ("PhysicalNames", _) => reader.physical_names()?,
            ("NOD", _) => v1::nodes(&mut reader)?,
            ("ELM", _) => v1::elements(&mut reader)?,
            ("Entities", Version::V4) => v4::entities(&mut reader, false)?,
            ("PartitionedEntities", Version::V4) => v4::entities(&mut reader, true)?,
            ("Nodes", Version::V4) => v4::nodes(&mut reader)?,
            ("Elements", Version::V4) => v4::elements(&mut reader)?,
            ("Nodes", Version::V2) => v2::nodes(&mut reader, false)?,
            ("ParametricNodes", Version::V2) => v2::nodes(&mut reader, true)?,
            ("Elements", Version::V2) => v2::elements(&mut reader)?,
            ("Nodes" | "ParametricNodes" | "Elements" | "Entities", _) => {
                return Err(reader.cursor.expected("$MeshFormat before any other section", section.as_bytes()));
            }
            _ => reader.skip(section)?,
        }
    }
    Ok(reader.builder)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Version {
    V1,
    V2,
    V4,
}

/// What the sections share.
struct Reader<'a> {
    cursor: Cursor<'a>,
    version: Version,
    /// Type of counts and tags in binary 4.1 files.
    size: Scalar,
    builder: Builder,
    /// Index of a node by its tag: tags need not be contiguous.
    index_of: HashMap<i64, u32>,
    /// Physical groups of an entity, by its dimension and tag.
    physical: HashMap<(i64, i64), Vec<i64>>,
}

impl Reader<'_> {
    /// `$MeshFormat`: version, 1 if binary, size of a count; in binary files the integer 1, which tells the byte order.
    fn format(&mut self) -> Result<(), FileError> {
        let version = self.cursor.text("the version")?;
        self.version = match version {
            "4.1" => Version::V4,
            "2" | "2.0" | "2.1" | "2.2" => Version::V2,
            _ => {
                let what = format!("MSH version {} is not read", super::cursor::shown(version.as_bytes()));
                let instead = "save it as version 4.1 or 2.2: gmsh in.msh -save -format msh41 -o out.msh".to_string();
                return Err(self.cursor.fail(Problem::Unsupported { what, instead }));
            }
        };
        let binary = self.cursor.text("0 for ASCII or 1 for binary")?;
        let size = self.cursor.text("the size of a count")?;
        self.size = match size {
            "4" => Scalar::U32,
            "8" => Scalar::U64,
            _ => return Err(self.cursor.expected("the size of a count, 4 or 8", size.as_bytes())),
        };
        match binary {
            "0" => {}
            "1" => {
                self.end_of_line()?;
                self.cursor.encoding = match self.cursor.take(4, "the integer 1")? {
                    [1, 0, 0, 0] => Encoding::Little,
                    [0, 0, 0, 1] => Encoding::Big,
                    other => return Err(self.cursor.expected("the integer 1 in binary", other)),
                };
            }
            _ => return Err(self.cursor.expected("0 for ASCII or 1 for binary", binary.as_bytes())),
        }
        self.end("MeshFormat")
    }

    /// `dimension tag "name"`, a line each, in binary files too.
    fn physical_names(&mut self) -> Result<(), FileError> {
        let count = self.cursor.parse("the number of physical names")?;
        for _ in 0..self.cursor.check_count(count, 5, "physical names")? {
            let dimension: u8 = self.cursor.parse("the dimension of a physical group")?;
            let tag: i64 = self.cursor.parse("the tag of a physical group")?;
            let line = self.cursor.line().ok_or_else(|| self.cursor.truncated("the name of a physical group"))?;
            let text = line.trim_ascii();
            let Some(name) = text.strip_prefix(b"\"").and_then(|t| t.strip_suffix(b"\"")) else {
                return Err(self.cursor.expected("a name in double quotes", text));
            };
            self.builder.names.insert((dimension, tag.saturating_abs()), String::from_utf8_lossy(name).into_owned());
        }
        self.end("PhysicalNames")
    }

    /// Passes the `$End…` of a section.
    fn end(&mut self, section: &str) -> Result<(), FileError> {
        let wanted = format!("$End{section}");
        let word = self.cursor.text(&wanted)?;
        if word == wanted { Ok(()) } else { Err(self.cursor.expected(&wanted, word.as_bytes())) }
    }

    /// Passes a section that has no part in a mesh, such as `$Periodic` or `$NodeData`.
    fn skip(&mut self, section: &str) -> Result<(), FileError> {
        let end = format!("$End{section}");
        match find(self.cursor.rest(), end.as_bytes()) {
            Some(at) => self.cursor.advance(at + end.len()),
            None => return Err(self.cursor.truncated(&end)),
        }
        Ok(())
    }

    /// Passes the end of a line behind which binary data begin.
    fn end_of_line(&mut self) -> Result<(), FileError> {
        match self.cursor.line() {
            Some(rest) if rest.trim_ascii().is_empty() => Ok(()),
            Some(rest) => Err(self.cursor.expected("the end of the line", rest)),
            None => Err(self.cursor.truncated("binary data")),
        }
    }

    fn int(&mut self, wanted: &str) -> Result<i64, FileError> {
        self.cursor.int(Scalar::I32, wanted)
    }

    fn count(&mut self, wanted: &str) -> Result<i64, FileError> {
        self.cursor.int(self.size, wanted)
    }

    /// Least bytes of a number.
    fn least(&self, binary: usize) -> usize {
        if self.cursor.encoding == Encoding::Ascii { 2 } else { binary }
    }

    fn position(&mut self) -> Result<DVec3, FileError> {
        let mut position = DVec3::ZERO;
        for axis in 0..3 {
            position[axis] = self.cursor.real(Scalar::F64, "a coordinate")?;
        }
        Ok(position)
    }

    fn add_node(&mut self, tag: i64, position: DVec3) -> Result<(), FileError> {
        if !position.is_finite() {
            return Err(self.cursor.fail(Problem::NonFinite { node: tag, position }));
        }
        if self.index_of.insert(tag, self.builder.nodes.len() as u32).is_some() {
            return Err(self.cursor.fail(Problem::DuplicateNode { node: tag }));
        }
        self.builder.nodes.push(position);
        Ok(())
    }

    fn node(&self, element: i64, tag: i64) -> Result<u32, FileError> {
        self.index_of.get(&tag).copied().ok_or_else(|| {
            let element = format!("element {element}");
            let known = match (self.index_of.keys().min(), self.index_of.keys().max()) {
                (Some(least), Some(most)) => format!("the {} nodes have tags {least} to {most}", self.index_of.len()),
                _ => "no nodes are defined before the elements".to_string(),
            };
            self.cursor.fail(Problem::UnknownNode { element, node: tag, known })
        })
    }

    fn nodes_of(&mut self, element: i64, count: usize, scalar: Scalar) -> Result<Vec<u32>, FileError> {
        let mut nodes = Vec::with_capacity(count);
        for _ in 0..count {
            let tag = self.cursor.int(scalar, "the node of an element")?;
            nodes.push(self.node(element, tag)?);
        }
        Ok(nodes)
    }

    /// The element type by Gmsh's number, with its number of nodes.
    fn kind(&self, number: i64) -> Result<(super::builder::Kind, usize), FileError> {
        elements::kind(number).ok_or_else(|| {
            let what = format!("element type {number} of Gmsh is not known");
            self.cursor.fail(Problem::Unsupported { what, instead: "mesh with tetrahedra of four nodes".to_string() })
        })
    }
}
