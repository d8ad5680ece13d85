//! Functions of time, keyframes and axes.
use schemars::JsonSchema;
use serde::Deserialize;

/// Some of the axes x, y and z, for example "xz".
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(transparent)]
pub(crate) struct AxesText(#[schemars(regex(pattern = r"^[xyz]{1,3}$"))] pub(crate) String);

impl Default for AxesText {
    fn default() -> Self {
        Self("xyz".into())
    }
}

/// A factor over time: exactly one of its keys.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct AmplitudeTable {
    /// Always this factor.
    pub(crate) constant: Option<f64>,
    /// Along a straight line.
    pub(crate) ramp: Option<TransitionTable>,
    /// Along a smooth step, at rest at both ends.
    pub(crate) smooth_step: Option<TransitionTable>,
    /// A sine.
    pub(crate) sine: Option<SineTable>,
    /// On and off.
    pub(crate) pulse: Option<PulseTable>,
    /// Straight lines between points.
    pub(crate) table: Option<PointsTable>,
}

/// From one factor to another.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TransitionTable {
    /// Factor before; 0 by default.
    #[serde(default)]
    pub(crate) from: f64,
    /// Factor after; 1 by default.
    #[serde(default = "one")]
    pub(crate) to: f64,
    /// Start (s); 0 by default.
    #[serde(default)]
    pub(crate) start_s: f64,
    /// Length (s), larger than 0.
    pub(crate) duration_s: f64,
}

fn one() -> f64 {
    1.0
}

/// `mean + amplitude sin(2π f (t − start) + phase)`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SineTable {
    /// Mean; 0 by default.
    #[serde(default)]
    pub(crate) mean: f64,
    /// Largest deviation; 1 by default.
    #[serde(default = "one")]
    pub(crate) amplitude: f64,
    /// Frequency (Hz), larger than 0.
    pub(crate) frequency_hz: f64,
    /// Phase (rad); 0 by default.
    #[serde(default)]
    pub(crate) phase_rad: f64,
    /// Start (s); 0 by default.
    #[serde(default)]
    pub(crate) start_s: f64,
}

/// A factor while the pulse lasts, 0 otherwise.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PulseTable {
    /// Factor inside; 1 by default.
    #[serde(default = "one")]
    pub(crate) value: f64,
    /// Start (s); 0 by default.
    #[serde(default)]
    pub(crate) start_s: f64,
    /// Length (s), larger than 0.
    pub(crate) duration_s: f64,
    /// Repetition (s), longer than the pulse; once by default.
    pub(crate) period_s: Option<f64>,
}

/// Points of a factor over time: inline, or a CSV file.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PointsTable {
    /// Times (s), increasing.
    pub(crate) times_s: Option<Vec<f64>>,
    /// Factors, one per time.
    pub(crate) values: Option<Vec<f64>>,
    /// CSV file with the columns `time_s` (or `time_ms`) and `value`, relative to the scene file.
    pub(crate) file: Option<String>,
}

/// A position at a time.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct KeyframeTable {
    /// Time (s).
    pub(crate) time_s: f64,
    /// Position (m, world).
    pub(crate) position_m: [f64; 3],
}

/// How to go from one keyframe to the next.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum InterpolationName {
    /// At constant speed.
    Linear,
    /// At rest at every keyframe, with continuous acceleration.
    Smooth,
}
