//! VTU with raw appended arrays: compact, exact, and read by ParaView, VTK and meshio.
use glam::DVec3;
use std::fmt::Write;

/// Cells of one type.
#[derive(Debug, Clone, Copy)]
pub enum Cells<'a> {
    /// Tetrahedra.
    Tets(&'a [[u32; 4]]),
    /// Triangles.
    Triangles(&'a [[u32; 3]]),
}

/// A named array on the points or on the cells; put the unit into the name, as `displacement_m`.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// Its name in the file.
    pub name: &'a str,
    /// One value per point or cell.
    pub values: Values<'a>,
}

/// The values of a field.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// Numbers.
    Scalars(&'a [f64]),
    /// Vectors.
    Vectors(&'a [DVec3]),
    /// Whole numbers, such as groups.
    Integers(&'a [u32]),
}

/// One frame: a mesh and what is known on it.
#[derive(Debug, Clone, Copy)]
pub struct VtuFrame<'a> {
    /// Points; metres, by the conventions of this project.
    pub points: &'a [DVec3],
    /// Cells over the points.
    pub cells: Cells<'a>,
    /// Fields with one value per point.
    pub point_data: &'a [Field<'a>],
    /// Fields with one value per cell.
    pub cell_data: &'a [Field<'a>],
    /// The frame's time (s), which ParaView shows.
    pub time_s: Option<f64>,
}

impl Cells<'_> {
    /// Number of cells, corners of each, and VTK's number of the type.
    fn shape(&self) -> (usize, usize, u8) {
        match self {
            Self::Tets(tets) => (tets.len(), 4, 10),
            Self::Triangles(triangles) => (triangles.len(), 3, 5),
        }
    }

    fn corners(&self) -> &[u32] {
        match self {
            Self::Tets(tets) => tets.as_flattened(),
            Self::Triangles(triangles) => triangles.as_flattened(),
        }
    }
}

impl Values<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Scalars(values) => values.len(),
            Self::Vectors(values) => values.len(),
            Self::Integers(values) => values.len(),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Scalars(values) => values.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Self::Vectors(values) => vectors(values),
            Self::Integers(values) => values.iter().flat_map(|x| x.to_le_bytes()).collect(),
        }
    }

    fn vtk_type(&self) -> (&'static str, usize) {
        match self {
            Self::Scalars(_) => ("Float64", 1),
            Self::Vectors(_) => ("Float64", 3),
            Self::Integers(_) => ("UInt32", 1),
        }
    }
}

fn vectors(values: &[DVec3]) -> Vec<u8> {
    values.iter().flat_map(DVec3::to_array).flat_map(f64::to_le_bytes).collect()
}

/// The bytes of a VTU file.
///
/// # Errors
/// Says which array does not fit: a field of the wrong length, a cell with a point that does not exist.
pub fn encode_vtu(frame: &VtuFrame) -> Result<Vec<u8>, String> {
    check(frame)?;
    let (cells, corners, vtk_type) = frame.cells.shape();
    let mut file = Appended::default();
    let xml = &mut file;
    xml.line("<?xml version=\"1.0\"?>");
    xml.line("<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">");
    xml.line("<UnstructuredGrid>");
    if let Some(time_s) = frame.time_s {
        xml.line("<FieldData>");
        xml.array("TimeValue", "Float64", "NumberOfTuples=\"1\"", &time_s.to_le_bytes());
        xml.line("</FieldData>");
    }
    xml.line(&format!("<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{cells}\">", frame.points.len()));
    xml.line("<Points>");
    xml.array("Points", "Float64", "NumberOfComponents=\"3\"", &vectors(frame.points));
    xml.line("</Points>\n<Cells>");
    let connectivity: Vec<u8> = frame.cells.corners().iter().flat_map(|&i| i64::from(i).to_le_bytes()).collect();
    xml.array("connectivity", "Int64", "", &connectivity);
    let offsets: Vec<u8> = (1..=cells).flat_map(|cell| ((cell * corners) as i64).to_le_bytes()).collect();
    xml.array("offsets", "Int64", "", &offsets);
    xml.array("types", "UInt8", "", &vec![vtk_type; cells]);
    xml.line("</Cells>\n<PointData>");
    frame.point_data.iter().for_each(|field| xml.field(field));
    xml.line("</PointData>\n<CellData>");
    frame.cell_data.iter().for_each(|field| xml.field(field));
    xml.line("</CellData>\n</Piece>\n</UnstructuredGrid>");
    Ok(file.finish())
}

fn check(frame: &VtuFrame) -> Result<(), String> {
    let points = frame.points.len();
    let (cells, corners, _) = frame.cells.shape();
    if let Some(at) = frame.cells.corners().iter().position(|&index| index as usize >= points) {
        return Err(format!("cell {} refers to a point that does not exist (there are {points})", at / corners));
    }
    for (fields, wanted, what) in [(frame.point_data, points, "points"), (frame.cell_data, cells, "cells")] {
        if let Some(field) = fields.iter().find(|field| field.values.len() != wanted) {
            return Err(format!("field `{}` has {} values for {wanted} {what}", field.name, field.values.len()));
        }
    }
    Ok(())
}

/// The XML part and the arrays that go behind it.
#[derive(Default)]
struct Appended {
    xml: String,
    data: Vec<u8>,
}

impl Appended {
    fn line(&mut self, text: &str) {
        self.xml.push_str(text);
        self.xml.push('\n');
    }

    fn field(&mut self, field: &Field) {
        let (vtk_type, components) = field.values.vtk_type();
        self.array(field.name, vtk_type, &format!("NumberOfComponents=\"{components}\""), &field.values.bytes());
    }

    /// The array's element in the XML, and its bytes behind their length.
    fn array(&mut self, name: &str, vtk_type: &str, more: &str, bytes: &[u8]) {
        let offset = self.data.len();
        // Writing to a string does not fail.
        let _ = writeln!(
            self.xml,
            "<DataArray type=\"{vtk_type}\" Name=\"{}\" {more} format=\"appended\" offset=\"{offset}\"/>",
            escaped(name)
        );
        self.data.extend((bytes.len() as u64).to_le_bytes());
        self.data.extend(bytes);
    }

    fn finish(self) -> Vec<u8> {
        let mut file = self.xml.into_bytes();
        file.extend(b"<AppendedData encoding=\"raw\">\n_");
        file.extend(self.data);
        file.extend(b"\n</AppendedData>\n</VTKFile>\n");
        file
    }
}

/// Text as the value of an XML attribute.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
