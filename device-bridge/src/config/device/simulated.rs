//! The keys of the simulated arm.
use serde::{Deserialize, Serialize};

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
    /// Presses the daemon's built-in heart and lets it go, every two seconds.
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
