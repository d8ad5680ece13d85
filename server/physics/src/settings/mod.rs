//! How a scene is computed, and what acts on its body.
mod loads;

pub use loads::{LoadSpec, PrescribedSpec};

/// More substeps than this are refused at load.
pub const MAX_SUBSTEPS: u32 = 100_000;

/// Precision of the force kernel. State and time integration are f64 always.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// f32 forces, f64 state: the default of haptic scenes.
    #[default]
    Single,
    /// f64 throughout.
    Double,
}

impl Precision {
    /// Part of internal forces that may be rounding.
    pub(crate) fn relative_rounding(self) -> f64 {
        match self {
            Self::Single => 1e-5,
            Self::Double => 1e-12,
        }
    }
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

/// Whether walls of one body press each other where they meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SelfContactChoice {
    /// Where the skin of a body that can have it faces itself at rest, as around a cavity.
    #[default]
    WhereFacing,
    /// Whatever the skin is like. Bodies and integrators that cannot have it refuse.
    On,
    /// Nowhere: walls pass through each other.
    Off,
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
    /// Whether walls of the body press each other where they meet.
    pub self_contact: SelfContactChoice,
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
            self_contact: SelfContactChoice::default(),
            skips: Skips::default(),
        }
    }
}
