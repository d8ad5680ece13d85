//! The keys of a Haply 2diy.
use serde::{Deserialize, Serialize};

/// A Haply 2diy. Of each two the first is of motor 1, at the origin of its plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Haply2diyConfig {
    /// Path of the serial port.
    pub port: String,
    /// Its rate (bit/s); a board with USB of its own does not care.
    pub baud: u32,
    /// What the board calls the arm.
    pub device_id: u8,
    /// From one motor to the other (m): 0.038, or 0 of the second generation.
    pub base_m: f64,
    /// Length of the links at the motors, and of those at the tool (m).
    pub link_lengths_m: [f64; 2],
    /// Where the middle of the workspace, the origin of poses, is seen from motor 1 (m).
    pub centre_m: [f64; 2],
    /// Ports of the board that the motors are on, 1 to 4.
    pub ports: [u8; 2],
    /// Motors and encoders that turn against the clock.
    pub counter_clockwise: [bool; 2],
    /// Angles (degrees) of the links at the motors when the bridge starts.
    pub home_deg: [f64; 2],
    /// Counts of an encoder for a turn.
    pub counts_per_turn: [f64; 2],
    /// Motors that push against the way that their encoders count.
    pub reversed: [bool; 2],
    /// Largest torque of a motor (N m).
    pub max_torque_nm: f64,
    /// Without an answer for so long (s) the arm is lost, and its force taken away.
    pub silence_s: f64,
}

impl Default for Haply2diyConfig {
    /// The third generation as its makers' examples set it up.
    fn default() -> Self {
        Self {
            port: "/dev/ttyACM0".into(),
            baud: 115_200,
            device_id: 5,
            base_m: 0.038,
            link_lengths_m: [0.070, 0.090],
            centre_m: [0.019, 0.095],
            ports: [2, 1],
            counter_clockwise: [true, true],
            home_deg: [168.0, 12.0],
            counts_per_turn: [4880.0, 4880.0],
            reversed: [false, false],
            max_torque_nm: 0.123,
            silence_s: 0.02,
        }
    }
}
