//! The keys of an Inverse3.
use serde::{Deserialize, Serialize};

/// How forces are told to an Inverse service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Inverse3Dialect {
    /// `"values"`, as of version 3.1.
    Values,
    /// `"vector"` and `"execute"`, as of version 3.5.
    Vector,
}

/// A Haply Inverse3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Inverse3Config {
    /// `ws://HOST:PORT` of the Inverse service.
    pub url: String,
    /// The arm's name in the service; empty: the first.
    pub device_id: String,
    /// The grip's name; empty: the first, if there is one.
    pub grip_id: String,
    /// How forces are told: `vector` from version 3.5 on, `values` before.
    pub dialect: Inverse3Dialect,
    /// Take an arm that says it is not calibrated, whose poses may be wrong.
    pub uncalibrated: bool,
    /// Without a state for so long (s) the arm is lost; without a force of the loop for so long it is let go.
    pub silence_s: f64,
}

impl Default for Inverse3Config {
    fn default() -> Self {
        Self {
            url: "ws://localhost:10001".into(),
            device_id: String::new(),
            grip_id: String::new(),
            dialect: Inverse3Dialect::Vector,
            uncalibrated: false,
            silence_s: 0.02,
        }
    }
}
