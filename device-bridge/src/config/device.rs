//! `[device]`: each kind of arm with its keys.
use serde::{Deserialize, Serialize};

/// The arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum DeviceConfig {
    /// No hardware: a mass held by a hand that follows a path.
    Simulated(SimulatedConfig),
    /// HapticMASTER, over TCP.
    Hapticmaster(HapticMasterConfig),
    /// WoodenHaptics, on a serial line.
    Woodenhaptics(WoodenHapticsConfig),
}

impl Default for DeviceConfig {
    fn default() -> Self {
        Self::Simulated(SimulatedConfig::default())
    }
}

/// The simulated arm and its hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimulatedConfig {
    /// Mass at the tool (kg).
    pub mass_kg: f64,
    /// Friction of the arm (N s/m).
    pub damping_n_s_per_m: f64,
    /// Stiffness of the hand (N/m); 0: nobody holds the arm.
    pub hand_stiffness_n_per_m: f64,
    /// Damping of the hand (N s/m).
    pub hand_damping_n_s_per_m: f64,
    /// The path repeats after so long (s); absent: the hand rests at the last keyframe.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// Where the hand goes.
    pub keyframes: Vec<KeyframeConfig>,
}

/// A HapticMASTER.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HapticMasterConfig {
    /// Host and port.
    pub address: String,
    /// Mass that the hand feels (kg).
    pub inertia_kg: f64,
    /// Send `set` and `get` in requests of their own, for an arm that refuses them in one: half as many poses a second.
    pub apart: bool,
    /// How long finding home may take (s).
    pub homing_s: f64,
    /// Without an answer for so long (s) the arm is lost, and its force taken away.
    pub silence_s: f64,
}

impl Default for HapticMasterConfig {
    fn default() -> Self {
        Self { address: "192.168.0.25:7654".into(), inertia_kg: 2.0, apart: false, homing_s: 60.0, silence_s: 0.02 }
    }
}

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

/// Where the hand is at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyframeConfig {
    /// Time since the start (s).
    pub time_s: f64,
    /// Position (m, the arm's own axes).
    pub position_m: [f64; 3],
}

impl Default for SimulatedConfig {
    /// Presses the daemon's built-in ventricle and lets it go, every two seconds.
    fn default() -> Self {
        let arm = palpate_control::ArmSpec::default();
        Self {
            mass_kg: arm.mass_kg,
            damping_n_s_per_m: arm.damping_n_s_per_m,
            hand_stiffness_n_per_m: arm.hand_stiffness_n_per_m,
            hand_damping_n_s_per_m: arm.hand_damping_n_s_per_m,
            period_s: Some(2.0),
            keyframes: [(0.0, 0.055), (0.6, 0.028), (1.1, 0.028), (1.7, 0.055)]
                .map(|(time_s, x)| KeyframeConfig { time_s, position_m: [x, 0.0, 0.0] })
                .to_vec(),
        }
    }
}
