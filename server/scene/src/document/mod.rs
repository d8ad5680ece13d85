//! The scene document as it is written: one struct per table, every key with its unit. What the keys may hold together
//! is checked when they are compiled (`crate::compile`).
pub(crate) mod body;
pub(crate) mod law;
pub(crate) mod motion;
pub(crate) mod region;
pub(crate) mod schema;
pub(crate) mod seed;
pub(crate) mod source;
pub(crate) mod springs;
pub(crate) mod tool;
pub(crate) mod words;

use motion::{AmplitudeTable, AxesText};
use schemars::JsonSchema;
use serde::Deserialize;

/// A Palpate scene. Lengths may be given in metres (`radius_m`) or millimetres (`radius_mm`).
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Document {
    /// Name, description and world.
    pub(crate) scene: SceneTable,
    /// The body: exactly one of its sub-tables.
    pub(crate) body: body::BodyTable,
    /// Materials; of two that cover a tet the later one holds. Springs have none.
    #[serde(default)]
    pub(crate) material: Vec<MaterialTable>,
    /// Named parts of the body.
    #[serde(default)]
    pub(crate) region: Vec<region::RegionTable>,
    /// Regions that do not move.
    #[serde(default)]
    pub(crate) fixed: Vec<FixedTable>,
    /// Regions that move as told.
    #[serde(default)]
    pub(crate) prescribed: Vec<PrescribedTable>,
    /// Forces, tractions and pressures.
    #[serde(default)]
    pub(crate) load: Vec<LoadTable>,
    /// Spherical tools.
    #[serde(default)]
    pub(crate) tool: Vec<tool::ToolTable>,
    /// What the hand on the simulated arm does in this scene.
    pub(crate) arm: Option<tool::ArmTable>,
    /// What is measured.
    #[serde(default)]
    pub(crate) probe: Vec<tool::ProbeTable>,
    /// Integrator, time step and precision.
    #[serde(default)]
    pub(crate) numerics: NumericsTable,
    /// Length and intervals of an offline run.
    #[serde(default)]
    pub(crate) output: OutputTable,
}

/// Name, description and world.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneTable {
    /// Short name.
    pub(crate) name: String,
    /// What the scene shows.
    #[serde(default)]
    pub(crate) description: String,
    /// Period of the haptic tick (s, 10 µs to 10 s).
    #[serde(default = "default_tick_period_s")]
    pub(crate) tick_period_s: f64,
    /// Gravity (m/s², world); none by default.
    #[serde(default)]
    pub(crate) gravity_m_per_s2: [f64; 3],
}

fn default_tick_period_s() -> f64 {
    1e-3
}

/// The papers' factors on elastic stress.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
pub(crate) enum ConventionName {
    /// Force is minus the gradient of the stated energy.
    #[default]
    #[serde(rename = "consistent")]
    Consistent,
    /// As printed in 2006: λ and µ act halved.
    #[serde(rename = "paper-2006")]
    Paper2006,
    /// As printed in 2005.
    #[serde(rename = "paper-2005")]
    Paper2005,
}

/// A material. Give `young_modulus_pa` with `poisson_ratio`, or `lambda_pa` with `mu_pa`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MaterialTable {
    /// Name for messages.
    pub(crate) name: Option<String>,
    /// Region whose tets have it (centroid inside); the whole body by default.
    pub(crate) region: Option<String>,
    /// Constitutive law.
    pub(crate) law: law::LawName,
    /// Young's modulus E (Pa), larger than 0.
    pub(crate) young_modulus_pa: Option<f64>,
    /// Poisson's ratio ν, in (-1, 0.5).
    pub(crate) poisson_ratio: Option<f64>,
    /// First Lamé constant λ (Pa).
    pub(crate) lambda_pa: Option<f64>,
    /// Shear modulus µ (Pa).
    pub(crate) mu_pa: Option<f64>,
    /// The papers' factor on elastic stress.
    #[serde(default)]
    pub(crate) convention: ConventionName,
    /// Volumetric viscosity φ (Pa s), 0 by default.
    #[serde(default)]
    pub(crate) viscosity_phi_pa_s: f64,
    /// Shear viscosity ψ (Pa s), 0 by default.
    #[serde(default)]
    pub(crate) viscosity_psi_pa_s: f64,
    /// Density (kg/m³), larger than 0.
    pub(crate) density_kg_per_m3: f64,
}

/// A region that does not move.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FixedTable {
    /// Region whose nodes are held.
    pub(crate) region: String,
    /// Which axes are held, for example "z"; all by default.
    #[serde(default)]
    pub(crate) axes: AxesText,
}

/// A region that moves as told: displacement times amplitude.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PrescribedTable {
    /// Name for messages; the region's by default.
    pub(crate) name: Option<String>,
    /// Region whose nodes move.
    pub(crate) region: String,
    /// Displacement from rest at amplitude 1 (m).
    pub(crate) displacement_m: [f64; 3],
    /// Which axes are prescribed, for example "xy"; all by default. The others are free.
    #[serde(default)]
    pub(crate) axes: AxesText,
    /// Factor over time.
    pub(crate) amplitude: AmplitudeTable,
}

/// A load: exactly one of pressure, traction and the two kinds of force.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct LoadTable {
    /// Region it acts on.
    pub(crate) region: String,
    /// Pressure on surface triangles (Pa), positive pushes inwards.
    pub(crate) pressure_pa: Option<f64>,
    /// Pressure follows the deformed surface (true), or acts as at rest (false). Required with `pressure_pa`.
    pub(crate) follower: Option<bool>,
    /// Dead traction on surface triangles (Pa, world), per rest area.
    pub(crate) traction_pa: Option<[f64; 3]>,
    /// Force shared equally by the region's nodes (N, world).
    pub(crate) total_force_n: Option<[f64; 3]>,
    /// Force on each of the region's nodes (N, world).
    pub(crate) force_per_node_n: Option<[f64; 3]>,
    /// Factor over time.
    pub(crate) amplitude: AmplitudeTable,
}

/// Precision of the force kernel.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PrecisionName {
    /// f32 forces, f64 state.
    #[default]
    Single,
    /// f64 throughout.
    Double,
}

/// How time is integrated.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum IntegratorName {
    /// Explicit leapfrog.
    #[default]
    Leapfrog,
    /// Position Verlet of the hybrid method's 2006 paper (eq. 33).
    SeedVerlet,
    /// Semi-implicit Euler with one Jacobian per node, of the same paper (eq. 34).
    SeedSemiImplicit,
    /// Backward Euler, linearised, by preconditioned conjugate gradients.
    BackwardEuler,
}

/// Integrator, time step and precision.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct NumericsTable {
    /// Precision of the force kernel.
    pub(crate) precision: PrecisionName,
    /// How time is integrated.
    pub(crate) integrator: IntegratorName,
    /// Substeps per tick, 1 to 100000; measured from the largest natural frequency by default.
    pub(crate) substeps: Option<u32>,
    /// Fraction of the stable step used, in (0, 1].
    pub(crate) step_safety: f64,
    /// Leapfrog takes back a tick that proves unstable and repeats it in more substeps.
    pub(crate) subcycle_unstable: bool,
    /// The coarse tets of a body with particles are taken in steps of their own, as long as are stable for them.
    pub(crate) long_coarse_steps: bool,
    /// Largest principal stretch the step must stay stable at, 1 or larger; 1.2 by default, 1.1 of a body with particles.
    pub(crate) stretch_allowance: Option<f64>,
    /// Mass-proportional damping (1/s).
    pub(crate) mass_damping_per_s: f64,
    /// Most iterations of an implicit integrator's solver per substep, 1 to 10000.
    pub(crate) solver_iterations: u32,
    /// Where that solver stops, relative to where it starts, in (0, 1).
    pub(crate) solver_tolerance: f64,
    /// A held body that is at rest to within so many micrometres, and that no tool is near, is not computed until something
    /// changes. 0: always computed.
    pub(crate) sleep_tolerance_um: f64,
}

impl Default for NumericsTable {
    fn default() -> Self {
        let settings = palpate_physics::Settings::default();
        Self {
            precision: PrecisionName::Single,
            integrator: IntegratorName::Leapfrog,
            substeps: None,
            step_safety: settings.step_safety,
            subcycle_unstable: settings.subcycle_unstable,
            long_coarse_steps: settings.long_coarse_steps,
            stretch_allowance: None,
            mass_damping_per_s: settings.mass_damping_per_s,
            solver_iterations: settings.solver_iterations,
            solver_tolerance: settings.solver_tolerance,
            sleep_tolerance_um: 1e6 * settings.sleep_tolerance_m,
        }
    }
}

/// Length and intervals of an offline run.
#[expect(clippy::struct_field_names, reason = "keys carry their unit")]
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct OutputTable {
    /// Simulated time (s).
    pub(crate) duration_s: f64,
    /// Time between two rows of probes (s); rounded to whole ticks.
    pub(crate) sample_interval_s: f64,
    /// Time between two frames (s); rounded to whole ticks.
    pub(crate) frame_interval_s: f64,
}

impl Default for OutputTable {
    fn default() -> Self {
        Self { duration_s: 1.0, sample_interval_s: 0.01, frame_interval_s: 0.05 }
    }
}
