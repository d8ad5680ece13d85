//! Equilibrium: the static solve that references and `palpated static` use, and natural modes about rest.
//!
//! Forces are those of `fem::element`, the materials and `fem::loads`, so an equilibrium found here is a resting state of
//! [`crate::step`]. Everything is f64; linear systems go to faer's sparse Cholesky (docs/adr/static-solve.md).
//!
//! - `newton.rs`: load stepping and Newton's method with a line search
//! - `equilibrium.rs`: forces and the change of potential along a line
//! - `stiffness.rs`, `follower.rs`: the tangent stiffness in a fixed sparsity pattern
//! - `rigid.rs`: which rigid motions the constraints leave free
//! - `modes.rs`: natural frequencies by subspace iteration
//! - `eigen.rs`: small symmetric eigenproblems
mod eigen;
mod equilibrium;
mod factor;
mod follower;
mod modes;
mod newton;
mod rigid;
mod stiffness;

use crate::{contact::ToolTarget, world::Model};
use glam::DVec3;
pub use modes::{Mode, natural_modes};
pub use rigid::RigidMotion;
use std::ops::ControlFlow;
use thiserror::Error;

/// How far and how hard to solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StaticSettings {
    /// Converged when `‖f_free‖₂ ≤ relative_residual · max(‖f_internal‖₂, ‖f_external‖₂)`, the latter over all degrees of freedom.
    pub relative_residual: f64,
    /// Newton iterations allowed at one load step.
    pub max_iterations: u32,
    /// Load steps to begin with; failed ones are halved, and steps grow again after success.
    pub load_steps: u32,
    /// The smallest load step is `1 / (load_steps · 2^max_halvings)`.
    pub max_halvings: u32,
}

impl Default for StaticSettings {
    fn default() -> Self {
        Self { relative_residual: 1e-10, max_iterations: 100, load_steps: 1, max_halvings: 12 }
    }
}

/// Where a solve stands, once per Newton iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Fraction of loads, displacements and tool motion at which equilibrium is sought, in (0, 1].
    pub load_fraction: f64,
    /// Iteration at this fraction, from 0.
    pub iteration: u32,
    /// `‖f_free‖₂` (N).
    pub residual_n: f64,
    /// The same over its reference (see [`StaticSettings::relative_residual`]).
    pub relative_residual: f64,
}

/// An equilibrium.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticSolution {
    /// Positions (m), one per node.
    pub x: Vec<DVec3>,
    /// Force (N) of the holder on the body, summed over each prescribed set's axes.
    pub reactions_n: Vec<DVec3>,
    /// The same per node, zero on free axes.
    pub node_reactions_n: Vec<DVec3>,
    /// Force (N) of the body on each tool.
    pub tool_forces_n: Vec<DVec3>,
    /// Every Newton iteration, in order.
    pub history: Vec<Progress>,
    /// Newton iterations in all, failed load steps included.
    pub iterations: u32,
    /// Cholesky factorisations in all.
    pub factorisations: u32,
    /// Load steps that converged.
    pub load_steps: u32,
    /// `‖f_free‖₂` (N) at `x`.
    pub residual_n: f64,
    /// The same over its reference. Above the wanted one only where rounding of the positions allows no better: see
    /// `rounding_n`.
    pub relative_residual: f64,
    /// Residual (N) that rounding of positions alone makes, `ε ‖diag K‖₂ max|x|`.
    pub rounding_n: f64,
    /// False when the last tangent stiffness was indefinite: the body would leave this equilibrium at the least push.
    pub stable: bool,
    /// Tets with `det F ≤ 0`. An equilibrium with any is one of the formulas, hardly one of a body.
    pub inverted_tets: u32,
}

/// Why there is no equilibrium to show.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SolveError {
    /// Arguments of the wrong number.
    #[error("{what}: {found} given, the model has {expected}")]
    InputLength {
        /// What was counted.
        what: &'static str,
        /// Given.
        found: usize,
        /// Wanted.
        expected: usize,
    },
    /// Arguments that are not finite.
    #[error("{what} {index} is not finite")]
    InputNotFinite {
        /// What it is.
        what: &'static str,
        /// Which one.
        index: usize,
    },
    /// A setting outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// Rigid motions are left free.
    #[error(
        "the body (the part with node {node}) is free to {}; prescribe displacements that hold it",
        rigid::list(motions)
    )]
    UnderConstrained {
        /// A node of the part that is free.
        node: u32,
        /// Its free motions.
        motions: Vec<RigidMotion>,
    },
    /// Newton's method failed at the smallest load step.
    #[error(
        "no equilibrium found beyond {:.4} % of the load: relative residual {relative_residual:.2e} after {iterations} \
         iterations; {hint}", 100.0 * reached_fraction
    )]
    NoConvergence {
        /// Load fraction of the last equilibrium.
        reached_fraction: f64,
        /// Load fraction that failed.
        failed_fraction: f64,
        /// Relative residual it ended with.
        relative_residual: f64,
        /// Iterations in all.
        iterations: u32,
        /// What may help.
        hint: &'static str,
    },
    /// Forces at a finite position are not finite.
    #[error("the force on node {node} is not finite at {:.4} % of the load; are the loads or constants too large?", 100.0 * load_fraction)]
    NonFinite {
        /// The node.
        node: u32,
        /// Load fraction.
        load_fraction: f64,
    },
    /// The factorisation ran out of memory or indices.
    #[error("the sparse factorisation of {unknowns} unknowns failed: {reason}")]
    Factorisation {
        /// Size of the system.
        unknowns: usize,
        /// What the library says.
        reason: String,
    },
    /// The caller stopped it.
    #[error("stopped at {:.4} % of the load", 100.0 * load_fraction)]
    Cancelled {
        /// Load fraction being solved.
        load_fraction: f64,
    },
}

/// Finds an equilibrium of `model` under its gravity, `load_factors` (one per load), `prescribed_displacements_m` (one per
/// prescribed set) and rigid `tools` (one per tool, held at their target whatever their coupling), starting from rest with the tools at
/// their start positions. A tool moves at most half its radius per load step, so it must come from outside.
///
/// `progress` is called once per Newton iteration and may stop the solve. Friction and viscosity do not act at rest and are
/// left out. The pressure's load stiffness enters with its symmetric part; where a follower pressure ends at a free rim the
/// unsymmetric rest slows Newton's method from quadratic to linear convergence, the more the further the rim turns, but does not
/// change the equilibrium.
///
/// # Errors
/// [`SolveError`].
pub fn solve_static(
    model: &Model,
    load_factors: &[f64],
    prescribed_displacements_m: &[DVec3],
    tools: &[ToolTarget],
    settings: &StaticSettings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<StaticSolution, SolveError> {
    check(model, load_factors, prescribed_displacements_m, tools, settings)?;
    rigid::check_constrained(model)?;
    let goal = equilibrium::Goal { load_factors, prescribed_displacements_m, tools };
    newton::solve(model, &goal, settings, progress)
}

fn check(
    model: &Model,
    load_factors: &[f64],
    prescribed_displacements_m: &[DVec3],
    tools: &[ToolTarget],
    settings: &StaticSettings,
) -> Result<(), SolveError> {
    let spec = model.spec();
    let length = |what, found, expected| {
        if found == expected { Ok(()) } else { Err(SolveError::InputLength { what, found, expected }) }
    };
    length("load factors", load_factors.len(), spec.loads.len())?;
    length("prescribed displacements", prescribed_displacements_m.len(), spec.prescribed.len())?;
    length("tools", tools.len(), spec.tools.len())?;
    let finite = |what, bad: Option<usize>| match bad {
        Some(index) => Err(SolveError::InputNotFinite { what, index }),
        None => Ok(()),
    };
    finite("load factor", load_factors.iter().position(|f| !f.is_finite()))?;
    finite("prescribed displacement", prescribed_displacements_m.iter().position(|d| !d.is_finite()))?;
    finite("tool position", tools.iter().position(|t| !t.position_m.is_finite()))?;
    let setting = |name, value: f64, ok: bool, rule| {
        if ok { Ok(()) } else { Err(SolveError::Setting { name, value, rule }) }
    };
    let tolerance = settings.relative_residual;
    setting("relative_residual", tolerance, tolerance > 0.0 && tolerance < 1.0, "must be in (0, 1)")?;
    setting("max_iterations", f64::from(settings.max_iterations), settings.max_iterations > 0, "must be 1 or more")?;
    setting("load_steps", f64::from(settings.load_steps), settings.load_steps > 0, "must be 1 or more")?;
    setting("max_halvings", f64::from(settings.max_halvings), settings.max_halvings <= 40, "must be 40 or less")
}
