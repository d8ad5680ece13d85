//! Equilibrium: the static solve that references and `palpated static` use, and natural modes about rest.
//!
//! Forces are those of `elements::linear_tet`, the materials and `elements::loads`, so an equilibrium found here is a resting state of
//! [`crate::step`]. Everything is f64; linear systems go to faer's sparse Cholesky (docs/adr/static-solve.md).
//!
//! - `load_path.rs`: load stepping
//! - `newton.rs`: Newton's method with a line search at one load step
//! - `equilibrium.rs`: forces and the change of potential along a line
//! - `follower.rs`: the load stiffness of follower pressure
//! - `hybrid/`: the same for bodies with particles, by conjugate gradients
//! - `solution.rs`, `error.rs`: what comes out
mod chained;
mod equilibrium;
mod error;
mod follower;
mod hybrid;
mod load_path;
mod newton;
mod solution;
mod tet_model;

use crate::{
    bodies::{Body, tet},
    elements::{natural_modes::Mode, rigid_motion::FreePart},
    world::Model,
};
pub use equilibrium::Goal;
pub use error::SolveError;
pub use load_path::MAX_LOAD_STEPS;
pub use solution::{AwakeParticles, Imbalance, StaticSolution, ToolAtRest};
use std::ops::ControlFlow;
use tet_model::TetModel;

/// How far and how hard to solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StaticSettings {
    /// Converged when `‖f_free‖₂ ≤ relative_residual · max(‖f_internal‖₂, ‖f_external‖₂)`, the latter over all degrees of freedom.
    pub relative_residual: f64,
    /// Newton iterations allowed at one load step.
    pub max_iterations: u32,
    /// Load steps to begin with, at least; failed ones are halved, and steps grow again after success. No solve tries more than
    /// [`MAX_LOAD_STEPS`].
    pub load_steps: u32,
    /// The smallest load step is the first one over `2^max_halvings`.
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

/// Finds an equilibrium of `model` under its gravity and the loads, displacements and devices of `goal`, starting from rest with the tools
/// at their start positions. A rigid tool is where its device is; a coupled one rests where its spring, saturated or not, balances its
/// contact. A device moves at most half its tool's radius per load step, so the tool must come from outside.
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
    goal: &Goal<'_>,
    settings: &StaticSettings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<StaticSolution, SolveError> {
    check(model, goal, settings)?;
    let environment = model.environment();
    match model.body() {
        Body::Tet(body) => {
            held(body.first_free_part())?;
            load_path::solve(TetModel { body, environment }, goal, settings, progress)
        }
        Body::Hybrid(body) => {
            held(body.first_free_part())?;
            hybrid::solve(environment, body, goal, settings, progress)
        }
        _ => Err(SolveError::NotForThisBody { what: "static equilibrium", but: ", and of those with particles" }),
    }
}

fn held(free: Option<FreePart>) -> Result<(), SolveError> {
    free.map_or(Ok(()), |part| Err(part.into()))
}

/// The `count` lowest natural modes of a body of tetrahedra about rest, ascending.
///
/// # Errors
/// [`SolveError`]; other bodies have none that are known.
pub fn natural_modes(model: &Model, count: usize) -> Result<Vec<Mode>, SolveError> {
    let Some(body) = model.body().as_tet() else {
        return Err(SolveError::NotForThisBody { what: "natural vibration", but: "" });
    };
    Ok(tet::natural_modes(body, model.surface(), count)?)
}

fn check(model: &Model, goal: &Goal<'_>, settings: &StaticSettings) -> Result<(), SolveError> {
    let Goal { load_factors, prescribed_displacements_m, tools, .. } = *goal;
    let spec = model.environment();
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
    if let Some(capsule) = spec.tools.iter().find(|tool| tool.shape.as_capsule().is_some()) {
        return Err(SolveError::SpheresOnly { tool: capsule.name.clone() });
    }
    finite("tool position", tools.iter().position(|t| !t.position_m.is_finite()))?;
    let setting = |name, value: f64, ok: bool, rule| {
        if ok { Ok(()) } else { Err(SolveError::Setting { name, value, rule }) }
    };
    let tolerance = settings.relative_residual;
    setting("relative_residual", tolerance, tolerance > 0.0 && tolerance < 1.0, "must be in (0, 1)")?;
    setting("max_iterations", f64::from(settings.max_iterations), settings.max_iterations > 0, "must be 1 or more")?;
    let steps = settings.load_steps;
    setting("load_steps", f64::from(steps), (1..=MAX_LOAD_STEPS).contains(&steps), "must be 1 to 10000")?;
    setting("max_halvings", f64::from(settings.max_halvings), settings.max_halvings <= 40, "must be 40 or less")
}
