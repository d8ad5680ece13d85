//! TetGen.
use super::builder::Builder;
use super::error::{FileError, Place, Problem};
use std::path::Path;
pub(super) fn read(path: &Path) -> Result<Builder, FileError> {
    let p = Problem::Unsupported { what: "this format is not read yet".into(), instead: "use STL, OBJ or PLY".into() };
    Err(FileError::new(path, Place::File, p))
}
