//! The keys of a Falcon.
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A Novint Falcon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FalconConfig {
    /// Path of the serial port.
    pub port: String,
    /// File of its firmware, for an arm in which none runs; it is Novint's, and not part of this program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub firmware: Option<PathBuf>,
    /// How long the hand may take to show the arm its home (s).
    pub homing_s: f64,
    /// Where the middle of the workspace, the origin of poses, is in the arm's own axes (m): z points at the hand.
    pub centre_m: [f64; 3],
    /// Angle of the legs at count 0 (degrees).
    pub zero_deg: f64,
    /// Units of a frame for a torque on a leg (1/(N m)).
    pub torque_units_per_nm: f64,
    /// Positive units push towards smaller angles.
    pub reversed: bool,
    /// Most units of a motor.
    pub max_torque_units: i16,
    /// Without a frame for so long (s) the arm is lost, and its force taken away.
    pub silence_s: f64,
}

impl Default for FalconConfig {
    fn default() -> Self {
        Self {
            port: "/dev/ttyUSB0".into(),
            firmware: None,
            homing_s: 60.0,
            centre_m: [0.0, 0.0, 0.125],
            zero_deg: 35.0,
            torque_units_per_nm: 10_000.0,
            reversed: true,
            max_torque_units: 5000,
            silence_s: 0.02,
        }
    }
}
