//! `[[tool]]`, `[arm]` and `[[probe]]`.
use super::motion::{InterpolationName, KeyframeTable};
use schemars::JsonSchema;
use serde::Deserialize;

/// How a tool follows its device.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum CouplingName {
    /// The tool is where its driver says.
    Rigid,
    /// The tool is a mass on a spring and damper (virtual coupling).
    Spring,
}

/// What moves a tool.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum DriverName {
    /// An arm over the network.
    Device,
    /// A CSV file.
    Trajectory,
    /// The keyframes given here.
    Script,
}

/// What a tool looks like.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ShapeName {
    /// A ball.
    #[default]
    Sphere,
    /// A cylinder with a hemisphere on either end. It turns with its driver.
    Capsule,
    /// The smallest ball that cannot fall between the samples of the surface.
    Point,
}

/// A tool.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ToolTable {
    /// Name, unique.
    pub(crate) name: String,
    /// What it looks like; a sphere by default.
    #[serde(default)]
    pub(crate) shape: ShapeName,
    /// Radius (m), larger than 0. Of a point there is none to give.
    pub(crate) radius_m: Option<f64>,
    /// Capsule: from its centre to the centre of a hemisphere (m), larger than 0.
    pub(crate) half_length_m: Option<f64>,
    /// Capsule: the direction it lies along at the start, the tool's own z (world); z by default.
    pub(crate) axis: Option<[f64; 3]>,
    /// How it follows its driver.
    pub(crate) coupling: CouplingName,
    /// Spring coupling: stiffness (N/m), larger than 0.
    pub(crate) stiffness_n_per_m: Option<f64>,
    /// Spring coupling: damping (N s/m), not negative.
    pub(crate) damping_n_s_per_m: Option<f64>,
    /// Spring coupling: mass of the tool (kg), larger than 0.
    pub(crate) mass_kg: Option<f64>,
    /// Capsule on a spring: stiffness of its orientation (N m/rad), larger than 0; by default `stiffness_n_per_m` times the square of its radius of
    /// gyration.
    pub(crate) turn_stiffness_nm_per_rad: Option<f64>,
    /// Capsule on a spring: damping of its orientation (N m s/rad), not negative; by default `damping_n_s_per_m` times that.
    pub(crate) turn_damping_nm_s_per_rad: Option<f64>,
    /// Capsule on a spring: inertia about every axis (kg m²), larger than 0; by default `mass_kg` times that.
    pub(crate) inertia_kg_m2: Option<f64>,
    /// Coulomb's friction coefficient; 0 by default.
    #[serde(default)]
    pub(crate) friction_coefficient: f64,
    /// What moves it.
    pub(crate) driver: DriverName,
    /// Driver `device`: where the tool waits until an arm attaches (m, world).
    pub(crate) start_m: Option<[f64; 3]>,
    /// Driver `trajectory`: CSV file with the columns `time_s`, `x_m`, `y_m`, `z_m` (or `_ms`, `_mm`), relative to the
    /// scene file.
    pub(crate) trajectory_file: Option<String>,
    /// Driver `script`: where to be, and when.
    pub(crate) keyframe: Option<Vec<KeyframeTable>>,
    /// Between keyframes or samples; smooth for scripts and linear for trajectories by default.
    pub(crate) interpolation: Option<InterpolationName>,
    /// Start again after the last keyframe; false by default.
    #[serde(default)]
    pub(crate) repeat: bool,
}

/// The path that the hand on the simulated arm follows. Offline the tool follows it directly.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ArmTable {
    /// The tool the arm drives; its driver is `device`.
    pub(crate) tool: String,
    /// Where the hand wants to be, and when.
    pub(crate) keyframe: Vec<KeyframeTable>,
    /// Between keyframes; smooth by default.
    pub(crate) interpolation: Option<InterpolationName>,
    /// Start again after the last keyframe; false by default.
    #[serde(default)]
    pub(crate) repeat: bool,
}

/// What a probe measures.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ProbeKind {
    /// Displacement of the material point nearest to `point_m` (m).
    Displacement,
    /// Force that holds the fixed and prescribed nodes of `region` (N).
    Reaction,
    /// Kinetic, elastic, gravitational energy, external work and dissipation (J).
    Energy,
    /// Force of the body on `tool` (N).
    ContactForce,
    /// Force on the device of `tool` (N).
    DeviceForce,
    /// Torque of the body on `tool`, about its centre (N m); of a sphere, none.
    ContactTorque,
    /// Torque on the device of `tool` (N m); of a sphere, none.
    DeviceTorque,
    /// Centre of `tool` (m).
    ToolPosition,
    /// Deepest penetration of `tool` into the surface (m).
    Penetration,
    /// Smallest ratio of deformed to rest volume over all tets.
    MinVolumeRatio,
}

/// A measurement.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ProbeTable {
    /// Name, unique; with the unit it heads the columns of probes.csv.
    pub(crate) name: String,
    /// What it measures.
    pub(crate) measure: ProbeKind,
    /// Displacement: the point at rest (m).
    pub(crate) point_m: Option<[f64; 3]>,
    /// Reaction: the region.
    pub(crate) region: Option<String>,
    /// Tool measures: the tool.
    pub(crate) tool: Option<String>,
}
