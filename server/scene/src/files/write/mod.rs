//! Writers: VTU frames for ParaView, and surfaces as OBJ, PLY and STL.
use super::error::{FileError, Place, Problem};
use glam::DVec3;
use std::io::Write;
use std::path::Path;

mod pvd;
mod vtu;

pub use pvd::PvdIndex;
pub use vtu::{Cells, Field, Values, VtuFrame, encode_vtu};

/// Writes a frame as VTU.
///
/// # Errors
/// Arrays that do not fit each other, or the file cannot be written.
pub fn write_vtu(path: &Path, frame: &VtuFrame) -> Result<(), FileError> {
    let bytes = encode_vtu(frame).map_err(|what| FileError::new(path, Place::File, Problem::Inconsistent { what }))?;
    store(path, &bytes)
}

/// Writes a triangulated surface as OBJ. Coordinates are written so that they read back to the same bits.
///
/// # Errors
/// The file cannot be written.
pub fn write_obj(path: &Path, vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), FileError> {
    let mut text = Vec::new();
    for v in vertices {
        let _ = writeln!(text, "v {} {} {}", v.x, v.y, v.z);
    }
    for [a, b, c] in triangles.iter().map(|t| t.map(|index| u64::from(index) + 1)) {
        let _ = writeln!(text, "f {a} {b} {c}");
    }
    store(path, &text)
}

/// Writes a triangulated surface as binary little-endian PLY in double precision.
///
/// # Errors
/// The file cannot be written.
pub fn write_ply(path: &Path, vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), FileError> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        triangles.len()
    )
    .into_bytes();
    bytes.extend(vertices.iter().flat_map(DVec3::to_array).flat_map(f64::to_le_bytes));
    for triangle in triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|index| index.to_le_bytes()));
    }
    store(path, &bytes)
}

/// Writes a triangulated surface as binary STL, in single precision as the format has it.
///
/// # Errors
/// More triangles than the format can count, or the file cannot be written.
pub fn write_stl(path: &Path, vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), FileError> {
    let inconsistent = |what: String| FileError::new(path, Place::File, Problem::Inconsistent { what });
    let count = u32::try_from(triangles.len()).map_err(|_| inconsistent("too many triangles for STL".to_string()))?;
    let mut bytes = vec![b' '; 80];
    bytes.extend(count.to_le_bytes());
    for (number, triangle) in triangles.iter().enumerate() {
        let Some(&[a, b, c]) = corners(vertices, triangle).as_ref() else {
            return Err(inconsistent(format!("triangle {number} refers to a vertex that does not exist")));
        };
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let numbers = [normal, a, b, c].into_iter().flat_map(|v| v.to_array());
        bytes.extend(numbers.flat_map(|x| (x as f32).to_le_bytes()));
        bytes.extend([0, 0]);
    }
    store(path, &bytes)
}

fn corners(vertices: &[DVec3], triangle: &[u32; 3]) -> Option<[DVec3; 3]> {
    let at = |index: u32| vertices.get(index as usize).copied();
    Some([at(triangle[0])?, at(triangle[1])?, at(triangle[2])?])
}

/// Writes beside, and then in place: a program that is killed, or a disk that is full, leaves no file in part.
fn store(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let written = std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, path));
    written
        .inspect_err(|_| {
            // Half a file helps nobody; that it may not be there is no second error.
            let _ = std::fs::remove_file(&beside);
        })
        .map_err(|error| FileError::new(path, Place::File, Problem::Io { action: "written", error }))
}
