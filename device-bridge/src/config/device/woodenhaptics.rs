//! The keys of a WoodenHaptics.
use serde::{Deserialize, Serialize};

/// A WoodenHaptics. Of each three the first is of the body that turns round the upright axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WoodenHapticsConfig {
    /// Path of the serial port.
    pub port: String,
    /// Its rate (bit/s); a board with USB of its own does not care.
    pub baud: u32,
    /// What the encoders say where all angles are 0: the pose in which the arm is switched on, if 0.
    pub home_counts: [i16; 3],
    /// Motors and encoders that turn the other way.
    pub reversed: [bool; 3],
    /// Counts for a turn of a motor.
    pub counts_per_turn: f64,
    /// Height of the second axis, length of the second and of the third body (m).
    pub link_lengths_m: [f64; 3],
    /// Diameters of the capstans (m).
    pub capstan_diameters_m: [f64; 3],
    /// Diameters of the bodies that their cables turn (m).
    pub body_diameters_m: [f64; 3],
    /// Where the middle of the workspace, the origin of poses, is seen from the foot (m).
    pub centre_m: [f64; 3],
    /// Torque of a motor (N m/A).
    pub torque_constant_nm_per_a: f64,
    /// Largest current of a motor (A).
    pub max_current_a: f64,
    /// Without a line for so long (s) the arm is lost, and its force taken away.
    pub silence_s: f64,
}

impl Default for WoodenHapticsConfig {
    /// The published design.
    fn default() -> Self {
        Self {
            port: "/dev/ttyACM0".into(),
            baud: 115_200,
            home_counts: [0; 3],
            reversed: [false; 3],
            counts_per_turn: 2000.0,
            link_lengths_m: [0.080, 0.205, 0.245],
            capstan_diameters_m: [0.010; 3],
            body_diameters_m: [0.160, 0.120, 0.120],
            centre_m: [0.220, 0.0, 0.080],
            torque_constant_nm_per_a: 0.0259,
            max_current_a: 3.0,
            silence_s: 0.02,
        }
    }
}
