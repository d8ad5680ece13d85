//! VTK legacy.
use super::super::builder::Builder;
use super::super::error::{FileError, Place, Problem};
use std::path::Path;
pub(in super::super) fn read(path: &Path, _data: &[u8]) -> Result<Builder, FileError> {
    let p = Problem::Unsupported { what: "this format is not read yet".into(), instead: "use STL, OBJ or PLY".into() };
    Err(FileError::new(path, Place::File, p))
}
