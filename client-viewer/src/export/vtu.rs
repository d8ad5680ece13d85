//! VTK unstructured grid (XML, ASCII), with the displacement vector per vertex.
use crate::surface::Surface;
use glam::Vec3;
use std::fmt::Write as _;

/// VTK's number for a triangle.
const VTK_TRIANGLE: u8 = 5;

/// Deformed positions (m), `displacement_m`, triangles.
pub(super) fn to_text(surface: &Surface) -> String {
    let points = rows(surface.positions_m());
    let displacements = rows(surface.displacement_m.iter().copied());
    let mut connectivity = String::new();
    let mut offsets = String::new();
    let mut types = String::new();
    for (i, [a, b, c]) in surface.triangles.iter().enumerate() {
        // Writing into a String cannot fail.
        let _ = writeln!(connectivity, "{a} {b} {c}");
        let _ = writeln!(offsets, "{}", 3 * (i + 1));
        let _ = writeln!(types, "{VTK_TRIANGLE}");
    }
    let (vertices, triangles) = (surface.rest_m.len(), surface.triangles.len());
    let array = |kind: &str, name: &str, components: &str, data: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\"{components} format=\"ascii\">\n{data}</DataArray>\n")
    };
    let three = " NumberOfComponents=\"3\"";
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{vertices}\" NumberOfCells=\"{triangles}\">\n\
         <Points>\n{}</Points>\n<Cells>\n{}{}{}</Cells>\n<PointData Vectors=\"displacement_m\">\n{}</PointData>\n\
         </Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
        array("Float32", "Points", three, &points),
        array("Int64", "connectivity", "", &connectivity),
        array("Int64", "offsets", "", &offsets),
        array("UInt8", "types", "", &types),
        array("Float32", "displacement_m", three, &displacements),
    )
}

fn rows(vectors: impl IntoIterator<Item = Vec3>) -> String {
    vectors.into_iter().fold(String::new(), |mut text, v| {
        let _ = writeln!(text, "{} {} {}", v.x, v.y, v.z);
        text
    })
}
