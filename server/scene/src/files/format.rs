//! Tells a file's format from its content and its name.
use super::cursor::find;
use super::error::{FileError, Place, Problem};
use super::{medit, stl};
use std::path::Path;

/// The families of formats, each with its reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Msh,
    VtkLegacy,
    VtkXml,
    Xdmf,
    TetGen,
    Medit,
    Stl,
    Obj,
    Ply,
}

/// The whole file; a regular one that is not empty.
pub(super) fn load(path: &Path) -> Result<Vec<u8>, FileError> {
    let io = |error| FileError::new(path, Place::File, Problem::Io { action: "read", error });
    // A pipe or a device such as /dev/zero has no end.
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        return Err(FileError::new(path, Place::File, Problem::NotAFile));
    }
    let data = std::fs::read(path).map_err(io)?;
    if data.is_empty() {
        return Err(FileError::new(path, Place::File, Problem::Empty));
    }
    Ok(data)
}

/// Without the byte order mark that some editors put before text in UTF-8. A binary STL file may begin with anything.
pub(super) fn unmarked(data: &[u8]) -> &[u8] {
    data.strip_prefix(b"\xef\xbb\xbf").filter(|_| !stl::is_binary(data)).unwrap_or(data)
}

/// The extension, in lower case.
pub(super) fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// What the content says, or else the name.
pub(super) fn recognise(path: &Path, data: &[u8]) -> Result<Format, FileError> {
    let extension = extension(path);
    if let Some(format) = by_content(data) {
        return Ok(format);
    }
    match extension.as_str() {
        "msh" => Ok(Format::Msh),
        "vtk" => Ok(Format::VtkLegacy),
        "vtu" | "vtp" => Ok(Format::VtkXml),
        "xdmf" | "xmf" => Ok(Format::Xdmf),
        "node" | "ele" | "face" => Ok(Format::TetGen),
        "mesh" => Ok(Format::Medit),
        "stl" => Ok(Format::Stl),
        "obj" => Ok(Format::Obj),
        "ply" => Ok(Format::Ply),
        _ => Err(FileError::new(path, Place::File, Problem::UnknownFormat { extension })),
    }
}

/// What the first element of XML says that is known; comments and declarations may be before it.
fn by_root(data: &[u8]) -> Option<Format> {
    let place = |root: &[u8]| find(data, root).unwrap_or(usize::MAX);
    match (place(b"<Xdmf"), place(b"<VTKFile")) {
        (usize::MAX, usize::MAX) => None,
        (xdmf, vtk) if xdmf < vtk => Some(Format::Xdmf),
        _ => Some(Format::VtkXml),
    }
}

fn by_content(data: &[u8]) -> Option<Format> {
    let start = data.trim_ascii_start();
    let begins = |magic: &str| start.starts_with(magic.as_bytes());
    if begins("$MeshFormat") || begins("$NOD") || begins("$Comments") || begins("$PhysicalNames") {
        Some(Format::Msh)
    } else if begins("# vtk DataFile") {
        Some(Format::VtkLegacy)
    } else if begins(medit::FIRST) {
        Some(Format::Medit)
    } else if begins("<") {
        by_root(start)
    } else if begins("ply\n") || begins("ply\r") {
        Some(Format::Ply)
    } else if stl::begins_solid(start) || stl::is_binary(data) {
        Some(Format::Stl)
    } else {
        None
    }
}
