//! Load stepping and Newton's method with a line search.
//!
//! ```text
//! K d = f_free,   K = −∂f/∂x               exact while positive definite, else element-wise projected, else shifted
//! x ← x + α d                              α by Armijo's rule on the potential, or the approximate Wolfe rule near the end
//! ```
//! The factor of `K` is kept while it still cuts the residual tenfold per iteration. The approximate Wolfe rule (Hager & Zhang
//! 2005, SIAM J. Optim. 16:170) accepts by slope where differences of potential drown in rounding.
use super::{
    Progress, SolveError, StaticSettings, StaticSolution,
    equilibrium::{Forces, Goal, Line, Stage, dot},
    factor::Factor,
    follower,
    stiffness::{Definiteness, FreeAxes, Stiffness, force_differential_n},
};
use crate::{
    contact::{ToolSpec, ToolTarget},
    fem::element::RestTet,
    world::Model,
};
use glam::DVec3;
use std::ops::ControlFlow;

/// Armijo's and the curvature constant.
const SUFFICIENT_DECREASE: f64 = 1e-4;
const CURVATURE: f64 = 0.9;
const MAX_BACKTRACKS: u32 = 40;
/// A factor is reused while an iteration with it cuts the residual to less than this.
const REUSE_BELOW: f64 = 0.1;

/// Why a load step failed; smaller steps may succeed.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Failure {
    Iterations { relative_residual: f64 },
    LineSearch { relative_residual: f64 },
    NotFinite { node: u32 },
}

enum Stop {
    Step(Failure),
    Final(SolveError),
}

impl From<SolveError> for Stop {
    fn from(error: SolveError) -> Self {
        Self::Final(error)
    }
}

struct Solver<'a> {
    model: &'a Model,
    settings: &'a StaticSettings,
    axes: FreeAxes,
    stiffness: Stiffness,
    factor: Factor,
    rounding_n: f64,
    stable: bool,
    history: Vec<Progress>,
    factorisations: u32,
    progress: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
}

pub(super) fn solve(
    model: &Model,
    goal: &Goal<'_>,
    settings: &StaticSettings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<StaticSolution, SolveError> {
    let axes = FreeAxes::of(model);
    let mut stiffness = Stiffness::pattern(model, &axes);
    let factor = Factor::analyse(&stiffness)?;
    stiffness.assemble(model, model.rest_positions_m(), Definiteness::Exact);
    let rounding_n = rounding_n(model, &stiffness);
    let mut solver = Solver {
        model,
        settings,
        axes,
        stiffness,
        factor,
        rounding_n,
        stable: true,
        history: Vec::new(),
        factorisations: 0,
        progress,
    };
    solver.follow_load(goal)
}

/// `ε ‖diag K‖₂ max|x|` (N): a node known to `ε|x|` has a force known to `ε |x| K_ii`.
fn rounding_n(model: &Model, stiffness: &Stiffness) -> f64 {
    let diagonal = stiffness.diagonal().map(|k| k * k).sum::<f64>().sqrt();
    let far = model.rest_positions_m().iter().map(|x| x.length()).fold(0.0, f64::max);
    f64::EPSILON * diagonal * far
}

impl Solver<'_> {
    /// Raises the load in steps: halved after a failure, doubled after a success.
    fn follow_load(&mut self, goal: &Goal<'_>) -> Result<StaticSolution, SolveError> {
        let mut x = self.model.rest_positions_m().to_vec();
        let (mut reached, mut steps) = (0.0, 0);
        let first = 1.0 / f64::from(self.settings.load_steps);
        let smallest = first * 0.5_f64.powi(self.settings.max_halvings as i32);
        let largest = largest_step(self.model, goal);
        let mut step = first.min(largest);
        let smallest = smallest.min(step);
        let mut contact = None;
        while reached < 1.0 {
            let fraction = if reached + step > 1.0 - 1e-9 { 1.0 } else { reached + step };
            let stage = Stage::new(self.model, goal, fraction, &x, contact.as_ref());
            match self.equilibrate(goal, &stage, x.clone()) {
                Ok(found) => {
                    x = found;
                    reached = fraction;
                    steps += 1;
                    step = (2.0 * step).min(largest);
                    contact = Some(stage.contact);
                }
                Err(Stop::Final(error)) => return Err(error),
                Err(Stop::Step(failure)) => {
                    step = 0.5 * (fraction - reached);
                    if step < smallest {
                        return Err(self.give_up(failure, reached, fraction));
                    }
                }
            }
        }
        let stage = Stage::new(self.model, goal, 1.0, &x, contact.as_ref());
        Ok(self.solution(&stage, x, steps))
    }

    fn give_up(&self, failure: Failure, reached_fraction: f64, failed_fraction: f64) -> SolveError {
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
        };
        let iterations = self.history.len() as u32;
        SolveError::NoConvergence { reached_fraction, failed_fraction, relative_residual, iterations, hint }
    }

    /// Newton's method at one stage, from `x`.
    fn equilibrate(&mut self, goal: &Goal<'_>, stage: &Stage, mut x: Vec<DVec3>) -> Result<Vec<DVec3>, Stop> {
        self.move_prescribed(goal, stage, &mut x)?;
        let mut previous = f64::INFINITY;
        let mut factor_is_fresh = false;
        let mut factor_is_usable = false;
        for iteration in 0..=self.settings.max_iterations {
            let forces = Forces::at(self.model, stage, &x);
            forces.check_finite(stage).map_err(not_finite)?;
            let residual = forces.free(&self.axes);
            // Finite forces may still have an infinite norm.
            let norm = residual.iter().map(|r| r * r).sum::<f64>().sqrt();
            let reference = forces.reference_n();
            if !(norm.is_finite() && reference.is_finite()) {
                return Err(Stop::Step(Failure::NotFinite { node: largest(&forces.total_n()) }));
            }
            let relative = if norm > 0.0 { norm / reference } else { 0.0 };
            self.report(stage.fraction, iteration, norm, relative)?;
            if relative <= self.settings.relative_residual || norm <= self.rounding_n {
                return Ok(x);
            }
            if iteration == self.settings.max_iterations {
                return Err(Stop::Step(Failure::Iterations { relative_residual: relative }));
            }
            if !(factor_is_usable && norm < REUSE_BELOW * previous) {
                self.refactor(stage, &x)?;
                factor_is_fresh = true;
            }
            previous = norm;
            x = match self.descend(stage, &x, &residual) {
                Some(next) => next,
                None if !factor_is_fresh => {
                    self.refactor(stage, &x)?;
                    self.descend(stage, &x, &residual)
                        .ok_or(Stop::Step(Failure::LineSearch { relative_residual: relative }))?
                }
                None => return Err(Stop::Step(Failure::LineSearch { relative_residual: relative })),
            };
            factor_is_usable = true;
            factor_is_fresh = false;
        }
        Ok(x)
    }

    fn report(&mut self, load_fraction: f64, iteration: u32, norm: f64, relative: f64) -> Result<(), SolveError> {
        let progress = Progress { load_fraction, iteration, residual_n: norm, relative_residual: relative };
        self.history.push(progress);
        match (self.progress)(&progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(SolveError::Cancelled { load_fraction }),
        }
    }

    /// Brings prescribed axes to their place, and the free ones along by one linear solve: `K d = f + (∂f/∂x) δ`.
    fn move_prescribed(&mut self, goal: &Goal<'_>, stage: &Stage, x: &mut [DVec3]) -> Result<(), Stop> {
        let wanted = stage.prescribed(self.model, goal, x);
        let moves: Vec<DVec3> = wanted.iter().zip(x.iter()).map(|(a, b)| *a - *b).collect();
        if moves.iter().all(|d| *d == DVec3::ZERO) {
            return Ok(());
        }
        self.refactor(stage, x)?;
        let forces = Forces::at(self.model, stage, x);
        let carried = force_differential_n(self.model, x, &moves);
        let total: Vec<DVec3> = forces.total_n().iter().zip(&carried).map(|(a, b)| *a + *b).collect();
        let mut d = vec![0.0; self.axes.count];
        self.axes.gather(&total, &mut d);
        self.factor.solve(&mut d);
        for ((x, wanted), d) in x.iter_mut().zip(&wanted).zip(self.axes.scatter(&d)) {
            *x = *wanted + d;
        }
        Ok(())
    }

    /// Assembles and factorises at `x`.
    fn refactor(&mut self, stage: &Stage, x: &[DVec3]) -> Result<(), SolveError> {
        self.stiffness.assemble(self.model, x, Definiteness::Exact);
        follower::add_stiffness(self.model, &stage.load_factors, x, &self.axes, &mut self.stiffness);
        self.add_contact_stiffness(stage, x, Definiteness::Exact);
        self.factorisations += 1;
        self.stable = self.factor.factorise(&self.stiffness);
        if self.stable {
            return Ok(());
        }
        self.stiffness.assemble(self.model, x, Definiteness::Projected);
        self.add_contact_stiffness(stage, x, Definiteness::Projected);
        let largest = self.stiffness.diagonal().fold(0.0, f64::max);
        let mut shift = 1e-10 * largest;
        while shift < largest {
            self.factorisations += 1;
            self.stiffness.shift_diagonal(shift);
            if self.factor.factorise(&self.stiffness) {
                return Ok(());
            }
            shift *= 100.0;
        }
        let reason = "the projected stiffness is not positive definite under any shift".into();
        Err(SolveError::Factorisation { unknowns: self.axes.count, reason })
    }

    fn add_contact_stiffness(&mut self, stage: &Stage, x: &[DVec3], definiteness: Definiteness) {
        let (axes, stiffness) = (&self.axes, &mut self.stiffness);
        let definite = definiteness == Definiteness::Projected;
        stage.contact.for_each_block(self.model.contact(), x, definite, |i, j, block| {
            stiffness.add_block(axes, i, j, block);
        });
    }

    /// One step along Newton's direction; `None` when no length of it is acceptable.
    fn descend(&mut self, stage: &Stage, x: &[DVec3], residual: &[f64]) -> Option<Vec<DVec3>> {
        let mut d = residual.to_vec();
        self.factor.solve(&mut d);
        let slope = -d.iter().zip(residual).map(|(d, r)| d * r).sum::<f64>();
        // Written so that a NaN fails.
        if !(slope < 0.0 && slope.is_finite()) {
            return None;
        }
        let d = self.axes.scatter(&d);
        let line = Line::new(self.model, stage, x, &d);
        let mut alpha = 1.0;
        for _ in 0..MAX_BACKTRACKS {
            let next = line.at(alpha);
            let (change, rounding) = line.potential_change_j(alpha);
            if change <= SUFFICIENT_DECREASE * alpha * slope {
                return Some(next);
            }
            if change <= 8.0 * rounding {
                let slope_there = -dot(&Forces::at(self.model, stage, &next).total_n(), &d);
                if slope_there.abs() <= CURVATURE * slope.abs() {
                    return Some(next);
                }
            }
            alpha *= shorter(alpha, slope, change);
        }
        None
    }

    fn solution(&mut self, stage: &Stage, x: Vec<DVec3>, load_steps: u32) -> StaticSolution {
        let forces = Forces::at(self.model, stage, &x);
        let total = forces.total_n();
        let fixed = self.model.inverse_mass_per_kg().iter().map(|m| m.cmpeq(DVec3::ZERO));
        // The holder supplies what the other forces lack.
        let node_reactions_n: Vec<DVec3> =
            fixed.zip(&total).map(|(fixed, f)| DVec3::select(fixed, -*f, DVec3::ZERO)).collect();
        let of_set = |set: &crate::PrescribedSpec| {
            let sum: DVec3 = set.nodes.iter().map(|&n| node_reactions_n[n as usize]).sum();
            DVec3::select(glam::BVec3::from_array(set.axes), sum, DVec3::ZERO)
        };
        let reactions_n = self.model.spec().prescribed.iter().map(of_set).collect();
        let last = self.history.last().copied();
        StaticSolution {
            reactions_n,
            node_reactions_n,
            tool_forces_n: forces.on_tools,
            iterations: self.history.len() as u32,
            factorisations: self.factorisations,
            load_steps,
            residual_n: last.map_or(0.0, |p| p.residual_n),
            relative_residual: last.map_or(0.0, |p| p.relative_residual),
            rounding_n: self.rounding_n,
            stable: self.stable,
            inverted_tets: inverted_tets(self.model, &x),
            history: std::mem::take(&mut self.history),
            x,
        }
    }
}

/// Factor on α: the minimum of the parabola through value, slope and new value, kept in [0.1, 0.5].
fn shorter(alpha: f64, slope: f64, change: f64) -> f64 {
    let parabola = -slope * alpha / (2.0 * (change - slope * alpha));
    if parabola.is_finite() { parabola.clamp(0.1, 0.5) } else { 0.1 }
}

/// A tool moves at most half its radius per load step: it presses what it was outside of.
fn largest_step(model: &Model, goal: &Goal<'_>) -> f64 {
    let tools = model.spec().tools.iter().zip(goal.tools);
    let step = |(spec, target): (&ToolSpec, &ToolTarget)| {
        0.5 * spec.radius_m / spec.start_position_m.distance(target.position_m).max(f64::MIN_POSITIVE)
    };
    tools.map(step).fold(1.0, f64::min)
}

/// The node with the largest force.
fn largest(forces_n: &[DVec3]) -> u32 {
    let by_size = |a: &usize, b: &usize| forces_n[*a].abs().max_element().total_cmp(&forces_n[*b].abs().max_element());
    (0..forces_n.len()).max_by(by_size).unwrap_or(0) as u32
}

fn inverted_tets(model: &Model, x: &[DVec3]) -> u32 {
    let volume_ratio =
        |(rest, nodes): (&RestTet, &[u32; 4])| rest.gradient_of(&nodes.map(|n| x[n as usize])).determinant();
    model.rest_tets().iter().zip(model.mesh().tets()).map(volume_ratio).filter(|&j| j <= 0.0).count() as u32
}

fn not_finite(error: SolveError) -> Stop {
    match error {
        SolveError::NonFinite { node, .. } => Stop::Step(Failure::NotFinite { node }),
        other => Stop::Final(other),
    }
}
