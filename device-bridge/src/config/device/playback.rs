//! The keys of a recording that is played back.
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A recording as an arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlaybackConfig {
    /// The recording.
    pub file: PathBuf,
    /// How many times as fast as it was recorded.
    pub speed: f64,
    /// Go back to its beginning and begin anew; false: stay at its end.
    pub repeat: bool,
    /// Rest so long (s) at its beginning first, and take so long to go back there.
    pub rest_s: f64,
}

impl Default for PlaybackConfig {
    fn default() -> Self {
        Self { file: "recording.csv".into(), speed: 1.0, repeat: false, rest_s: 1.0 }
    }
}
