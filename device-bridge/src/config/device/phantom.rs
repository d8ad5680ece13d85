//! The keys of a PHANToM or Touch.
use serde::{Deserialize, Serialize};

/// A PHANToM or Touch, through OpenHaptics' libHD.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhantomConfig {
    /// Path of libHD; empty: where the system finds it.
    pub library: String,
    /// Name that the arm has in the setup program of its driver; empty: the default one.
    pub name: String,
    /// Give torque to an arm that has motors for it.
    pub torque: bool,
    /// The arm is in its reset position (all links at right angles) when the bridge starts: for arms without an inkwell, once after they were switched on.
    pub reset_encoders: bool,
    /// How long calibration may take (s).
    pub calibration_s: f64,
    /// Without a frame for so long (s) the arm is lost, and its force taken away.
    pub silence_s: f64,
}

impl Default for PhantomConfig {
    fn default() -> Self {
        Self {
            library: String::new(),
            name: String::new(),
            torque: true,
            reset_encoders: false,
            calibration_s: 60.0,
            silence_s: 0.02,
        }
    }
}
