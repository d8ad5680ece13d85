//! `[record]`: where to write what the arm does.
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The recording.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RecordConfig {
    /// The file; absent: none is written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Write over a file that is there.
    pub overwrite: bool,
}
