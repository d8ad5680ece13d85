//! `[workspace]`: where in the world an arm is.
use serde::{Deserialize, Serialize};

/// From the arm's own axes to the world's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WorkspaceConfig {
    /// Where in the world the arm's x, y and z point.
    pub axes: [String; 3],
    /// Where in the world the arm's origin is (m).
    pub origin_m: [f64; 3],
    /// How far the tool moves when the arm moves by 1. Forces stay as they are.
    pub scale: f64,
    /// The button, from 0, that lets go of the tool while it is pressed; absent: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clutch_button: Option<u32>,
}

impl Default for WorkspaceConfig {
    fn default() -> Self {
        Self { axes: ["+x", "+y", "+z"].map(str::to_owned), origin_m: [0.0; 3], scale: 1.0, clutch_button: None }
    }
}
