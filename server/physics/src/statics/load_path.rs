//! Load stepping: from rest to the goal in stages, each an equilibrium.
use super::{
    Progress, SolveError, StaticSettings, StaticSolution,
    equilibrium::{Goal, Stage},
    newton::{Failure, Solver, Stop},
    tet_model::TetModel,
};
use crate::{contact::RestingContact, tick::Environment};
use glam::DVec3;
use std::ops::ControlFlow;

/// More load steps than this, failed ones included, are not tried.
pub const MAX_LOAD_STEPS: u32 = 10_000;
/// How often contact may grow within a load step.
pub(super) const MAX_WIDENINGS: u32 = 20;

/// From rest to the goal.
pub(super) fn solve(
    model: TetModel<'_>,
    goal: &Goal<'_>,
    settings: &StaticSettings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<StaticSolution, SolveError> {
    let largest = largest_step(model.environment, goal)?;
    let mut solver = Solver::new(model, settings, goal, progress)?;
    let start = model.environment.tools.iter().map(|tool| tool.start_position_m);
    let mut at: Vec<DVec3> = model.body.rest_positions_m().iter().copied().chain(start).collect();
    let mut contact = RestingContact::appear(&model.environment.contact, &at);
    let (stage, load_steps) = raise(largest, settings, |fraction| {
        let (mut stage, begin) = Stage::enter(model, goal, fraction, &at, &contact);
        at = settle(&mut solver, goal, &mut stage, &begin).map_err(|stop| (stop, solver.history.len() as u32))?;
        contact = stage.contact.clone();
        Ok(stage)
    })?;
    Ok(StaticSolution::of(&mut solver, &stage, at, load_steps))
}

/// Raises the load in steps: halved after a failure, doubled after a success. `attempt` finds the equilibrium at a fraction of the goal from the last that it found, or
/// tells why not and how many iterations there were in all. Returns what it had at the goal, and how many steps led there.
pub(super) fn raise<T>(
    largest: f64,
    settings: &StaticSettings,
    mut attempt: impl FnMut(f64) -> Result<T, (Stop, u32)>,
) -> Result<(T, u32), SolveError> {
    let mut step = largest.min(1.0 / f64::from(settings.load_steps));
    // Rounding of the fraction is far below this.
    let smallest = (step * 0.5_f64.powi(settings.max_halvings as i32)).max(1e-12);
    let (mut reached, mut succeeded) = (0.0, 0);
    for _ in 0..MAX_LOAD_STEPS {
        // What is left is taken in one step if rounding alone stands between.
        let fraction = if 1.0 - reached <= step * (1.0 + 1e-9) { 1.0 } else { reached + step };
        match attempt(fraction) {
            Ok(found) => {
                succeeded += 1;
                if fraction >= 1.0 {
                    return Ok((found, succeeded));
                }
                reached = fraction;
                step = (2.0 * step).min(largest);
            }
            Err((Stop::Final(error), _)) => return Err(error),
            Err((Stop::Step(failure), iterations)) => {
                step = 0.5 * (fraction - reached);
                if step < smallest {
                    return Err(give_up(failure, reached, fraction, iterations));
                }
            }
        }
    }
    Err(SolveError::TooManySteps { reached_fraction: reached, failed: MAX_LOAD_STEPS - succeeded })
}

/// Equilibrium of a stage: a coupled tool that moves may come upon samples that it was not in front of when it set out.
fn settle(solver: &mut Solver<'_>, goal: &Goal<'_>, stage: &mut Stage, begin: &[DVec3]) -> Result<Vec<DVec3>, Stop> {
    let mut found = solver.equilibrate(goal, stage, begin.to_vec())?;
    for _ in 0..MAX_WIDENINGS {
        let Some(wider) = stage.contact.widened(&solver.model.environment.contact, begin, &found) else {
            return Ok(found);
        };
        stage.contact = wider;
        found = solver.equilibrate(goal, stage, found)?;
    }
    Err(Stop::Step(Failure::Contact))
}

fn give_up(failure: Failure, reached_fraction: f64, failed_fraction: f64, iterations: u32) -> SolveError {
    let (relative_residual, hint) = match failure {
        Failure::NotFinite { node } => return SolveError::NonFinite { node, load_fraction: failed_fraction },
        Failure::Iterations { relative_residual } => {
            (relative_residual, "allow more iterations or load steps, or look for a load the body cannot carry")
        }
        Failure::LineSearch { relative_residual } => (
            relative_residual,
            "the potential does not fall along Newton's direction: the load may be past a limit point, tets may have \
             inverted (StVK softens in compression; neo-Hookean does not), or the residual asked for is below rounding",
        ),
        Failure::Contact => (f64::NAN, "a tool slides on without end; is it pushed past the body?"),
    };
    SolveError::NoConvergence { reached_fraction, failed_fraction, relative_residual, iterations, hint }
}

/// A device moves at most half its tool's radius per load step: the tool presses what it was outside of.
pub(super) fn largest_step(environment: &Environment, goal: &Goal<'_>) -> Result<f64, SolveError> {
    let mut largest = 1.0_f64;
    for (spec, target) in environment.tools.iter().zip(goal.tools) {
        let distance_m = spec.start_position_m.distance(target.position_m);
        let step = 0.5 * spec.radius_m / distance_m.max(f64::MIN_POSITIVE);
        if step < 1.0 / f64::from(MAX_LOAD_STEPS) {
            return Err(SolveError::ToolTooFar { tool: spec.name.clone(), distance_m, radius_m: spec.radius_m });
        }
        largest = largest.min(step);
    }
    Ok(largest)
}
