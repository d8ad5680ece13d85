//! MEDIT's `.mesh`, ASCII: faces of three and four corners and solids, whose references are groups, 0 being none.
use super::builder::{Builder, Kind, Shape};
use super::cursor::{Cursor, Scalar};
use super::error::{FileError, Problem};
use super::split::Solid;
use glam::DVec3;
use std::path::Path;

/// The word that a file begins with, behind comments.
pub(super) const FIRST: &str = "MeshVersionFormatted";

const EDGES: Kind = Kind { shape: Shape::Curve, name: "lines", corners: 2 };
const TRIANGLES: Kind = Kind { shape: Shape::Triangle, name: "triangles", corners: 3 };
const QUADRILATERALS: Kind = Kind { shape: Shape::Polygon, name: "quadrangles", corners: 4 };
const TETRAHEDRA: Kind = Kind { shape: Shape::Tet, name: "tetrahedra", corners: 4 };

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    let mut reader = Reader { cursor: Cursor::new(path, data), builder: Builder::default(), used: Vec::new() };
    reader.word(FIRST)?;
    let version: i64 = reader.parse("the version, 1 to 4")?;
    if !(1..=4).contains(&version) {
        return Err(reader.cursor.expected("the version, 1 to 4", version.to_string().as_bytes()));
    }
    loop {
        let section = reader.text("a section such as Vertices, or End")?;
        match section {
            "Dimension" => reader.dimension()?,
            "Vertices" => reader.vertices()?,
            "Edges" => reader.elements(EDGES, 2)?,
            "EdgesP2" => reader.elements(EDGES, 3)?,
            "Triangles" => reader.elements(TRIANGLES, 3)?,
            "TrianglesP2" => reader.elements(TRIANGLES, 6)?,
            "Quadrilaterals" => reader.elements(QUADRILATERALS, 4)?,
            "Tetrahedra" => reader.elements(TETRAHEDRA, 4)?,
            "TetrahedraP2" => reader.elements(TETRAHEDRA, 10)?,
            "QuadrilateralsQ2" => reader.elements(QUADRILATERALS, 9)?,
            "Hexahedra" => reader.elements(Kind::solid(Solid::Hexahedron), 8)?,
            "HexahedraQ2" => reader.elements(Kind::solid(Solid::Hexahedron), 27)?,
            "Prisms" => reader.elements(Kind::solid(Solid::Prism), 6)?,
            "PrismsP2" => reader.elements(Kind::solid(Solid::Prism), 18)?,
            "Pyramids" => reader.elements(Kind::solid(Solid::Pyramid), 5)?,
            "PyramidsP2" => reader.elements(Kind::solid(Solid::Pyramid), 14)?,
            "End" => return Ok(reader.finish()),
            _ => reader.skip(section)?,
        }
    }
}

struct Reader<'a> {
    cursor: Cursor<'a>,
    builder: Builder,
    /// Of every vertex, whether an element has it.
    used: Vec<bool>,
}

impl<'a> Reader<'a> {
    /// Passes comments, which go from `#` to the end of their line.
    fn skip_comments(&mut self) {
        self.cursor.skip_space();
        while self.cursor.rest().starts_with(b"#") {
            self.cursor.line();
            self.cursor.skip_space();
        }
    }

    fn text(&mut self, wanted: &str) -> Result<&'a str, FileError> {
        self.skip_comments();
        self.cursor.text(wanted)
    }

    fn parse<T: std::str::FromStr>(&mut self, wanted: &str) -> Result<T, FileError> {
        self.skip_comments();
        self.cursor.parse(wanted)
    }

    fn word(&mut self, wanted: &str) -> Result<(), FileError> {
        let found = self.text(&format!("`{wanted}`"))?;
        if found == wanted { Ok(()) } else { Err(self.cursor.expected(&format!("`{wanted}`"), found.as_bytes())) }
    }

    fn dimension(&mut self) -> Result<(), FileError> {
        let dimension: i64 = self.parse("the dimension 3")?;
        if dimension == 3 {
            Ok(())
        } else {
            Err(self.cursor.expected("the dimension 3", dimension.to_string().as_bytes()))
        }
    }

    fn count(&mut self, words_each: usize, what: &str) -> Result<usize, FileError> {
        let count = self.parse(&format!("the number of {what}"))?;
        self.cursor.check_count(count, 2 * words_each, what)
    }

    /// `count`, then `x y z reference` of every vertex; the references tell of the geometry, not of a group.
    fn vertices(&mut self) -> Result<(), FileError> {
        if !self.builder.nodes.is_empty() {
            return Err(self.cursor.expected("one section Vertices", b"a second one"));
        }
        for node in 0..self.count(4, "vertices")? {
            let mut position = DVec3::ZERO;
            for axis in 0..3 {
                position[axis] = self.parse("a coordinate")?;
            }
            if !position.is_finite() {
                return Err(self.cursor.fail(Problem::NonFinite { node: node as i64 + 1, position }));
            }
            self.builder.nodes.push(position);
            self.used.push(false);
            self.parse::<i64>("the reference of a vertex")?;
        }
        Ok(())
    }

    /// `count`, then `nodes… reference` of every element; nodes count from 1.
    fn elements(&mut self, kind: Kind, node_count: usize) -> Result<(), FileError> {
        let known = self.builder.nodes.len() as i64;
        let mut nodes = Vec::with_capacity(node_count);
        for element in 1..=self.count(node_count + 1, kind.name)? {
            nodes.clear();
            for _ in 0..node_count {
                let node: i64 = self.parse("the vertex of an element")?;
                if !(1..=known).contains(&node) {
                    let known = format!("there are {known} vertices before it, counting from 1");
                    let element = format!("element {element} of the {}", kind.name);
                    return Err(self.cursor.fail(Problem::UnknownNode { element, node, known }));
                }
                nodes.push((node - 1) as u32);
                self.used[(node - 1) as usize] = true;
            }
            let reference: i64 = self.parse("the reference of an element")?;
            self.builder.element(kind, &nodes, if reference == 0 { &[] } else { std::slice::from_ref(&reference) });
        }
        Ok(())
    }

    /// Vertices without an element are points of the geometry, such as the centre of an arc.
    fn finish(mut self) -> Builder {
        for (node, _) in self.used.iter().enumerate().filter(|(_, used)| !**used) {
            self.builder.lone_node(node as u32);
        }
        self.builder
    }

    /// Passes the numbers of a section that has no part in a mesh, such as `Corners`, `Ridges` or `Normals`.
    fn skip(&mut self, section: &str) -> Result<(), FileError> {
        if !section.starts_with(|first: char| first.is_ascii_uppercase()) {
            return Err(self.cursor.expected("a section such as Vertices, or End", section.as_bytes()));
        }
        if !PASSED.contains(&section) {
            self.builder.leave_out(section, || "a section that is not read".to_string());
        }
        loop {
            self.skip_comments();
            match self.cursor.rest().first() {
                None => return Err(self.cursor.truncated("`End`")),
                Some(first) if first.is_ascii_uppercase() => return Ok(()),
                Some(_) => drop(self.cursor.optional_real(Scalar::F64, "a number")?),
            }
        }
    }
}

/// Sections that say more of vertices and elements which stand elsewhere.
const PASSED: [&str; 13] = [
    "Corners",
    "Ridges",
    "RequiredVertices",
    "RequiredEdges",
    "RequiredTriangles",
    "RequiredQuadrilaterals",
    "Normals",
    "NormalAtVertices",
    "NormalAtTriangleVertices",
    "NormalAtQuadrilateralVertices",
    "Tangents",
    "TangentAtVertices",
    "TangentAtEdges",
];
