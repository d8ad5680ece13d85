//! What a model is built from.
use crate::{
    contact::ToolSpec, hybrid::ParticleSpec, material::Material, mesh::TetMesh, seed::SeedBodySpec,
    spring::SpringBodySpec,
};
use glam::DVec3;

/// A material and density shared by some tets.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Name for messages.
    pub name: String,
    /// Constitutive law and constants.
    pub material: Material,
    /// Density (kg/m³).
    pub density_kg_per_m3: f64,
}

/// A load at factor 1; every tick scales it ([`TickInput::load_factors`]).
#[derive(Debug, Clone, PartialEq)]
pub enum LoadSpec {
    /// Forces on nodes (N, world).
    NodalForces(Vec<(u32, DVec3)>),
    /// Dead traction on surface triangles (Pa, world), per rest area.
    Traction {
        /// Surface triangle indices.
        triangles: Vec<u32>,
        /// Traction (Pa).
        traction_pa: DVec3,
    },
    /// Pressure on surface triangles (Pa, positive pushes inwards).
    Pressure {
        /// Surface triangle indices.
        triangles: Vec<u32>,
        /// Pressure (Pa).
        pressure_pa: f64,
        /// Follows the deformed surface, or acts as at rest (dead).
        follower: bool,
    },
}

/// Nodes whose displacement is prescribed along some axes ([`TickInput::prescribed_displacements_m`]); fixed ones are prescribed zero.
#[derive(Debug, Clone, PartialEq)]
pub struct PrescribedSpec {
    /// Name for reactions.
    pub name: String,
    /// Nodes.
    pub nodes: Vec<u32>,
    /// Which of x, y, z are prescribed.
    pub axes: [bool; 3],
}

/// Precision of the force kernel. State and time integration are f64 always.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// f32 forces, f64 state: the default of haptic scenes.
    #[default]
    Single,
    /// f64 throughout.
    Double,
}

/// How many substeps a tick takes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Substeps {
    /// From the measured ω_max (see [`Model::substeps`]).
    #[default]
    Measured,
    /// As given, at rest stable or not; [`Settings::subcycle_unstable`].
    Fixed(u32),
}

/// How time is integrated; `docs/adr/integrators.md` compares them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Integrator {
    /// Explicit leapfrog (velocity Verlet): second order, conserves momentum, energy bounded.
    #[default]
    Leapfrog,
    /// The seeds' position Verlet (hybrid 2006, eq. 33): leapfrog's positions, velocities half a step ahead of them.
    SeedVerlet,
    /// The seeds' semi-implicit Euler with nodewise Jacobian (eq. 34): first order, drags the body's motion as a whole. Measured
    /// substeps are leapfrog's, which always suffice; the paper takes one step, `Substeps::Fixed(1)`, stable or not.
    SeedSemiImplicit,
    /// Backward Euler, one Newton step per substep by preconditioned conjugate gradients: first order, stable at any step by
    /// damping what the step cannot resolve. Measured substeps are what tools on couplings need, one without.
    BackwardEuler,
}

/// What is left out where a scene does not need it. Results are the same bit for bit; the switches are for tests and benchmarks
/// that prove it and tell the time saved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Skips {
    /// Viscous terms of materials with φ = ψ = 0.
    pub viscous_terms: bool,
    /// Contact tests of triangles that a tool cannot have reached yet.
    pub distant_contact: bool,
}

impl Default for Skips {
    fn default() -> Self {
        Self { viscous_terms: true, distant_contact: true }
    }
}

/// Numerical settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Tick period T (s).
    pub tick_period_s: f64,
    /// How time is integrated.
    pub integrator: Integrator,
    /// Substeps per tick.
    pub substeps: Substeps,
    /// Fraction of the stable step used, in (0, 1].
    pub step_safety: f64,
    /// Takes back a tick of leapfrog that proves unstable and repeats it in more substeps.
    pub subcycle_unstable: bool,
    /// Takes the coarse level of a hybrid body in steps of its own, as long as it stays stable in (`hybrid::long_steps`).
    pub long_coarse_steps: bool,
    /// Largest principal stretch the step must stay stable at (≥ 1).
    pub stretch_allowance: f64,
    /// Precision of the force kernel.
    pub precision: Precision,
    /// Mass-proportional damping c (1/s): `v̇ = … − c v`.
    pub mass_damping_per_s: f64,
    /// Most iterations of an implicit scheme's solver per substep (≥ 1).
    pub solver_iterations: u32,
    /// Where that solver stops: residual over its start, in the preconditioner's norm, in (0, 1).
    pub solver_tolerance: f64,
    /// A body that is at rest to within this (m), every node of it, and that no tool is near is not computed (`integrate::sleep`);
    /// 0: never.
    pub sleep_tolerance_m: f64,
    /// What is left out.
    pub skips: Skips,
}

impl Settings {
    /// The defaults for bodies with particles: whether a step is stable is judged as they run, and room for stretch costs them more than it does others.
    pub fn for_particles() -> Self {
        Self { stretch_allowance: 1.1, ..Self::default() }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            tick_period_s: 1e-3,
            integrator: Integrator::Leapfrog,
            substeps: Substeps::Measured,
            step_safety: 0.9,
            subcycle_unstable: true,
            long_coarse_steps: true,
            stretch_allowance: 1.2,
            precision: Precision::Single,
            mass_damping_per_s: 0.0,
            solver_iterations: 100,
            solver_tolerance: 1e-3,
            sleep_tolerance_m: 0.0,
            skips: Skips::default(),
        }
    }
}

/// Everything a [`Model`] is built from.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSpec {
    /// Rest mesh; of a hybrid body, the coarse one.
    pub mesh: TetMesh,
    /// Particles that make it a hybrid body. Its surface is their skin: loads are at the skin's vertices and triangles.
    pub particles: Option<ParticleSpec>,
    /// Makes its tets the core of the papers' hybrid; there is one material then, and what is prescribed is held.
    pub seed: Option<SeedBodySpec>,
    /// Makes it a mass-spring surface: its mesh has no tets then ([`TetMesh::of_points`]), it has no materials, and what is prescribed is held.
    pub springs: Option<SpringBodySpec>,
    /// Materials.
    pub regions: Vec<Region>,
    /// Region of each tet.
    pub tet_region: Vec<u16>,
    /// Prescribed displacements; a node's axis may be prescribed once.
    pub prescribed: Vec<PrescribedSpec>,
    /// Loads.
    pub loads: Vec<LoadSpec>,
    /// Gravity (m/s²).
    pub gravity_m_per_s2: DVec3,
    /// Tools.
    pub tools: Vec<ToolSpec>,
    /// Numerical settings.
    pub settings: Settings,
}
