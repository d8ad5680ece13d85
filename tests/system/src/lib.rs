//! What the system tests share: the repository's root, and the real programs.
pub mod daemon;
pub mod programs;

use std::path::{Path, PathBuf};

/// Root of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}
