//! Active particles as points, in the formats that can say so.
use crate::{ViewError, places, surface::Surface};
use glam::DVec3;
use std::fmt::Write as _;

/// VTK's number for a point.
const VTK_VERTEX: u8 = 1;

/// Positions (m) of the active particles of a surface's last update; empty when it has none.
///
/// # Errors
/// An array cut short.
pub(super) fn positions_m(surface: &Surface) -> Result<Vec<DVec3>, ViewError> {
    surface.last.active_particles.as_ref().map_or(Ok(Vec::new()), places::positions_m)
}

/// Stanford PLY (ASCII).
pub(super) fn to_ply(surface: &Surface, positions_m: &[DVec3]) -> String {
    format!(
        "ply\nformat ascii 1.0\ncomment active particles of {} at tick {}, metres\nelement vertex {}\nproperty float x\n\
         property float y\nproperty float z\nend_header\n{}",
        surface.header.scene_name.replace(['\n', '\r'], " "),
        surface.last.tick,
        positions_m.len(),
        rows(positions_m)
    )
}

/// VTK unstructured grid (XML, ASCII), a cell a particle.
pub(super) fn to_vtu(_: &Surface, positions_m: &[DVec3]) -> String {
    let count = positions_m.len();
    let each = |of: fn(usize) -> usize| {
        (0..count).fold(String::new(), |mut text, i| {
            // Writing into a String cannot fail.
            let _ = writeln!(text, "{}", of(i));
            text
        })
    };
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{count}\" NumberOfCells=\"{count}\">\n<Points>\n\
         <DataArray type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\" format=\"ascii\">\n{}</DataArray>\n</Points>\n\
         <Cells>\n<DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">\n{}</DataArray>\n\
         <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">\n{}</DataArray>\n\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">\n{}</DataArray>\n</Cells>\n</Piece>\n\
         </UnstructuredGrid>\n</VTKFile>\n",
        rows(positions_m),
        each(|i| i),
        each(|i| i + 1),
        each(|_| usize::from(VTK_VERTEX)),
    )
}

fn rows(positions_m: &[DVec3]) -> String {
    positions_m.iter().fold(String::new(), |mut text, p| {
        // To a tenth of a micrometre: the stream's own quantum is of that size. Writing into a String cannot fail.
        let _ = writeln!(text, "{:.7} {:.7} {:.7}", p.x, p.y, p.z);
        text
    })
}
