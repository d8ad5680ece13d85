//! VTU (unstructured grids) and VTP (polygonal data), in every way VTK stores their arrays.
use super::array::{DataArray, Source, Storage};
use super::cells::{CellTable, Groups, LINES, POLYGON, STRIP, VERTICES};
use crate::files::builder::Builder;
use crate::files::cursor::{Scalar, find, shown};
use crate::files::error::{FileError, Problem};
use glam::DVec3;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use std::path::Path;

pub(in crate::files) fn read(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    let storage =
        Storage { path, data, big_endian: false, header: Scalar::U32, compressor: String::new(), appended: None };
    let mut document = Document { storage, unstructured: true, pieces: Vec::new() };
    document.parse()?;
    let mut builder = Builder::default();
    for piece in &document.pieces {
        document.piece(piece, &mut builder)?;
    }
    Ok(builder)
}

/// A part of the mesh with nodes of its own.
struct Piece {
    at: usize,
    points: usize,
    /// The arrays, each with the element it stands in.
    arrays: Vec<(String, DataArray)>,
}

struct Document<'a> {
    storage: Storage<'a>,
    unstructured: bool,
    pieces: Vec<Piece>,
}

impl<'a> Document<'a> {
    /// Reads the XML, up to the appended data; these need not be text.
    fn parse(&mut self) -> Result<(), FileError> {
        const APPENDED: &[u8] = b"<AppendedData";
        let data = self.storage.data;
        let end = find(data, APPENDED).unwrap_or(data.len());
        let text = match std::str::from_utf8(&data[..end]) {
            Ok(text) => text,
            Err(error) => {
                let found = shown(&data[error.valid_up_to()..end]);
                let problem = Problem::Expected { wanted: "text in XML".to_string(), found };
                return Err(self.storage.fail(error.valid_up_to(), problem));
            }
        };
        self.appended(end)?;
        if !data.trim_ascii_end().ends_with(b"</VTKFile>") {
            return Err(self.storage.fail(data.len(), Problem::Truncated { wanted: "`</VTKFile>`".to_string() }));
        }
        self.elements(text)
    }

    fn elements(&mut self, text: &'a str) -> Result<(), FileError> {
        let mut reader = Reader::from_str(text);
        reader.config_mut().check_end_names = self.storage.appended.is_none();
        let mut open: Vec<String> = Vec::new();
        loop {
            let at = reader.buffer_position() as usize;
            let event = reader.read_event().map_err(|error| {
                let found = shown(error.to_string().as_bytes());
                self.storage.fail(at, Problem::Expected { wanted: "well-formed XML".to_string(), found })
            })?;
            match event {
                Event::Start(element) => {
                    self.start(&element, &open, at)?;
                    open.push(name_of(&element));
                }
                Event::Empty(element) => self.start(&element, &open, at)?,
                Event::End(_) => drop(open.pop()),
                Event::Text(words) if open.last().is_some_and(|name| name == "DataArray") => {
                    self.text(&words.into_inner());
                }
                Event::Eof => return Ok(()),
                _ => {}
            }
        }
    }

    fn start(&mut self, element: &BytesStart, open: &[String], at: usize) -> Result<(), FileError> {
        match name_of(element).as_str() {
            "VTKFile" => self.root(element, at),
            "Piece" => {
                let points = self.count(element, "NumberOfPoints", at)?;
                self.pieces.push(Piece { at, points, arrays: Vec::new() });
                Ok(())
            }
            "DataArray" => {
                let parent = open.last().map(String::as_str).unwrap_or_default();
                // Of all fields, only the groups of cells are of use.
                let wanted = match parent {
                    "Points" | "Cells" | "Polys" | "Verts" | "Lines" | "Strips" => true,
                    "CellData" => attribute(element, "Name").is_some_and(|name| Groups::default().wants(&name, 1)),
                    _ => false,
                };
                // Arrays that are not wanted still take the text that follows them.
                let array = if wanted { self.array(element, at)? } else { DataArray::unused(at) };
                if let Some(piece) = self.pieces.last_mut() {
                    piece.arrays.push((if wanted { parent.to_string() } else { String::new() }, array));
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The text of the array read last.
    fn text(&mut self, words: &str) {
        let array = self.pieces.last_mut().and_then(|piece| piece.arrays.last_mut());
        if let Some((parent, DataArray { source: Source::Ascii(text) | Source::Inline(text), .. })) = array
            && !parent.is_empty()
        {
            text.push_str(words);
        }
    }

    fn root(&mut self, element: &BytesStart, at: usize) -> Result<(), FileError> {
        let value = |key| attribute(element, key).unwrap_or_default();
        self.unstructured = match value("type").as_str() {
            "UnstructuredGrid" => true,
            "PolyData" => false,
            other => {
                let what = format!("a VTK file of type `{}` is not read", shown(other.as_bytes()));
                let instead = "save it as UnstructuredGrid (.vtu) or PolyData (.vtp), in one file".to_string();
                return Err(self.storage.fail(at, Problem::Unsupported { what, instead }));
            }
        };
        self.storage.big_endian = value("byte_order") == "BigEndian";
        self.storage.header = if value("header_type") == "UInt64" { Scalar::U64 } else { Scalar::U32 };
        self.storage.compressor = value("compressor");
        Ok(())
    }

    fn appended(&mut self, at: usize) -> Result<(), FileError> {
        let rest = &self.storage.data[at..];
        let Some(close) = rest.iter().position(|&b| b == b'>') else { return Ok(()) };
        let base64 = find(&rest[..close], b"base64").is_some();
        // The data begin behind an underscore, which only blanks may precede.
        let blanks = rest[close + 1..].iter().take_while(|b| b.is_ascii_whitespace()).count();
        let start = close + 1 + blanks;
        if rest.get(start) != Some(&b'_') {
            let found = shown(rest.get(start..).unwrap_or_default());
            let wanted = "`_` before the appended data".to_string();
            return Err(self.storage.fail(at + start, Problem::Expected { wanted, found }));
        }
        self.storage.appended = Some((at + start + 1, base64));
        Ok(())
    }

    fn array(&self, element: &BytesStart, at: usize) -> Result<DataArray, FileError> {
        let value = |key| attribute(element, key).unwrap_or_default();
        let wrong = |wanted: &str, found: &str| {
            self.storage.fail(at, Problem::Expected { wanted: wanted.to_string(), found: shown(found.as_bytes()) })
        };
        let scalar = match value("type").as_str() {
            "Int8" => Scalar::I8,
            "UInt8" => Scalar::U8,
            "Int16" => Scalar::I16,
            "UInt16" => Scalar::U16,
            "Int32" => Scalar::I32,
            "UInt32" => Scalar::U32,
            "Int64" => Scalar::I64,
            "UInt64" => Scalar::U64,
            "Float32" => Scalar::F32,
            "Float64" => Scalar::F64,
            other => return Err(wrong("a number type of VTK (Int8 … Float64)", other)),
        };
        let source = match value("format").as_str() {
            "ascii" => Source::Ascii(String::new()),
            "binary" => Source::Inline(String::new()),
            "appended" => Source::Appended(self.count(element, "offset", at)?),
            other => return Err(wrong("the format ascii, binary or appended", other)),
        };
        let components = value("NumberOfComponents").parse().unwrap_or(1);
        Ok(DataArray { name: value("Name"), scalar, components, source, at })
    }

    fn count(&self, element: &BytesStart, key: &str, at: usize) -> Result<usize, FileError> {
        let text = attribute(element, key).unwrap_or_default();
        text.trim().parse().map_err(|_| {
            let wanted = format!("a count as {key} of {}", name_of(element));
            self.storage.fail(at, Problem::Expected { wanted, found: shown(text.as_bytes()) })
        })
    }

    fn piece(&self, piece: &Piece, builder: &mut Builder) -> Result<(), FileError> {
        let first_node = builder.nodes.len() as u32;
        let values = match piece.in_element("Points").next() {
            Some(array) => self.storage.reals(array)?,
            None => Vec::new(),
        };
        if Some(values.len()) != piece.points.checked_mul(3) {
            let what =
                format!("the piece announces {} points, its array has {} coordinates", piece.points, values.len());
            return Err(self.storage.fail(piece.at, Problem::Inconsistent { what }));
        }
        for (node, position) in values.chunks_exact(3).map(DVec3::from_slice).enumerate() {
            if !position.is_finite() {
                return Err(self.storage.fail(piece.at, Problem::NonFinite { node: node as i64, position }));
            }
            builder.nodes.push(position);
        }
        let own = first_node..builder.nodes.len() as u32;
        let mut groups = Groups::default();
        for array in piece.in_element("CellData").filter(|array| array.components <= 1) {
            match self.storage.reals(array) {
                Ok(values) => groups.offer(&array.name, &values),
                // Real numbers with words among them, such as `-nan(ind)`, tell no groups.
                Err(error) if array.holds_words() && matches!(*error.problem, Problem::Expected { .. }) => {
                    builder.leave_out(&array.name, || error.problem.to_string());
                }
                Err(error) => return Err(error),
            }
        }
        let tables: &[(&str, Option<i64>)] = if self.unstructured {
            &[("Cells", None)]
        } else {
            &[("Verts", Some(VERTICES)), ("Lines", Some(LINES)), ("Polys", Some(POLYGON)), ("Strips", Some(STRIP))]
        };
        for &(parent, cell_type) in tables {
            let arrays: Vec<&DataArray> = piece.in_element(parent).collect();
            let table = self.table(&arrays, cell_type)?;
            let tags = groups.tags.as_deref().filter(|_| self.unstructured);
            table.build(builder, &own, tags).map_err(|problem| self.storage.fail(piece.at, problem))?;
        }
        Ok(())
    }

    /// The cells of `connectivity`, `offsets` (the ends) and `types`.
    fn table(&self, arrays: &[&DataArray], cell_type: Option<i64>) -> Result<CellTable, FileError> {
        let named = |name: &str| match arrays.iter().find(|array| array.name == name) {
            Some(array) => self.storage.integers(array),
            None => Ok(Vec::new()),
        };
        let ends = named("offsets")?;
        let types = match cell_type {
            Some(cell_type) => vec![cell_type; ends.len()],
            None => named("types")?,
        };
        let offsets = std::iter::once(0).chain(ends).collect();
        Ok(CellTable { connectivity: named("connectivity")?, offsets, types })
    }
}

impl Piece {
    /// The arrays in elements called `parent`.
    fn in_element<'p>(&'p self, parent: &'p str) -> impl Iterator<Item = &'p DataArray> {
        self.arrays.iter().filter(move |(p, _)| p == parent).map(|(_, array)| array)
    }
}

impl DataArray {
    /// Whether what is no number in it may be a word for what is not finite.
    fn holds_words(&self) -> bool {
        matches!(self.source, Source::Ascii(_)) && !self.scalar.is_integer()
    }

    fn unused(at: usize) -> Self {
        Self { name: String::new(), scalar: Scalar::U8, components: 1, source: Source::Ascii(String::new()), at }
    }
}

fn name_of(element: &BytesStart) -> String {
    String::from_utf8_lossy(element.name().as_ref().as_ref()).into_owned()
}

fn attribute(element: &BytesStart, key: &str) -> Option<String> {
    let attribute = element.try_get_attribute(key).ok().flatten()?;
    Some(attribute.normalized_value(XmlVersion::Implicit1_0).ok()?.into_owned())
}
