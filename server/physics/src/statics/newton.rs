//! Newton's method with a line search, at one load step.
//!
//! ```text
//! K d = f_free,   K = −∂f/∂x               exact while positive definite, else element-wise projected, else shifted
//! x ← x + α d                              α by Armijo's rule on the potential, or the approximate Wolfe rule near the end
//! ```
//! The factor of `K` is kept while it still cuts the residual tenfold per iteration. The approximate Wolfe rule (Hager & Zhang
//! 2005, SIAM J. Optim. 16:170) accepts by slope where differences of potential drown in rounding.
use super::{
    Progress, SolveError, StaticSettings,
    equilibrium::{Forces, Goal, Line, Stage, dot},
    follower,
    tet_model::TetModel,
};
use crate::{
    bodies::tet::stiffness::{Definiteness, Stiffness, force_differential_n},
    elements::free_axes::FreeAxes,
    linalg::cholesky::Factor,
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
pub(super) enum Failure {
    Iterations {
        relative_residual: f64,
    },
    LineSearch {
        relative_residual: f64,
    },
    NotFinite {
        node: u32,
    },
    /// Contact grows without end.
    Contact,
}

pub(super) enum Stop {
    Step(Failure),
    Final(SolveError),
}

impl From<SolveError> for Stop {
    fn from(error: SolveError) -> Self {
        Self::Final(error)
    }
}

pub(super) struct Solver<'a> {
    pub(super) model: TetModel<'a>,
    settings: &'a StaticSettings,
    pub(super) axes: FreeAxes,
    stiffness: Stiffness,
    factor: Factor,
    pub(super) rounding_n: f64,
    pub(super) history: Vec<Progress>,
    pub(super) factorisations: u32,
    progress: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
}

/// `ε ‖diag K‖₂ max|q|` (N): a node or tool known to `ε|q|` has a force known to `ε |q| K_ii`.
fn rounding_n(model: TetModel<'_>, stiffness: &Stiffness, goal: &Goal<'_>) -> f64 {
    let springs = (0..goal.tools.len()).filter_map(|tool| model.environment.contact.spring(tool));
    let springs_sq: f64 = springs.map(|spring| 3.0 * spring.stiffness_n_per_m.powi(2)).sum();
    let diagonal = (stiffness.diagonal().map(|k| k * k).sum::<f64>() + springs_sq).sqrt();
    let places = model.body.rest_positions_m().iter().copied().chain(goal.tools.iter().map(|tool| tool.position_m));
    f64::EPSILON * diagonal * places.map(DVec3::length).fold(0.0, f64::max)
}

impl<'a> Solver<'a> {
    pub(super) fn new(
        model: TetModel<'a>,
        settings: &'a StaticSettings,
        goal: &Goal<'_>,
        progress: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, SolveError> {
        let axes = model.free_axes();
        let mut stiffness = Stiffness::pattern(model.body, &model.environment.surface, &axes);
        let factor = Factor::analyse(&stiffness.matrix)?;
        stiffness.assemble(model.body, model.body.rest_positions_m(), Definiteness::Exact);
        let rounding_n = rounding_n(model, &stiffness, goal);
        Ok(Self {
            model,
            settings,
            axes,
            stiffness,
            factor,
            rounding_n,
            history: Vec::new(),
            factorisations: 0,
            progress,
        })
    }

    /// Newton's method at one stage, from `x`.
    pub(super) fn equilibrate(
        &mut self,
        goal: &Goal<'_>,
        stage: &Stage,
        mut x: Vec<DVec3>,
    ) -> Result<Vec<DVec3>, Stop> {
        self.move_prescribed(goal, stage, &mut x)?;
        let mut previous = f64::INFINITY;
        let mut factor_is_fresh = false;
        let mut factor_is_usable = false;
        for iteration in 0..=self.settings.max_iterations {
            let forces = Forces::at(self.model, stage, &x);
            let residual = forces.free(&self.axes);
            let (norm, relative) = forces.residual(&residual);
            // Finite forces may still have an infinite norm.
            if !(norm.is_finite() && relative.is_finite()) {
                return Err(Stop::Step(Failure::NotFinite { node: self.worst_node(&forces) }));
            }
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
        let carried = force_differential_n(self.model.body, x, &moves);
        let total: Vec<DVec3> = forces.total_n().iter().zip(&carried).map(|(a, b)| *a + *b).collect();
        let mut d = vec![0.0; self.axes.count];
        self.axes.gather(&total, &mut d);
        self.factor.solve(&mut d);
        let d = self.axes.scatter(&d);
        let share = self.longest_step(&d);
        for ((x, wanted), d) in x.iter_mut().zip(&wanted).zip(d) {
            *x = *wanted + d * share;
        }
        Ok(())
    }

    /// Share of a motion in which no coupled tool moves further than a quarter of its radius: contact is not known further ahead.
    fn longest_step(&self, d: &[DVec3]) -> f64 {
        let tools = self.model.environment.tools.iter().zip(&d[self.model.body.mass_kg().len()..]);
        tools.map(|(tool, d)| 0.25 * tool.radius_m / d.length().max(f64::MIN_POSITIVE)).fold(1.0, f64::min)
    }

    /// Whether the tangent stiffness is positive definite.
    pub(super) fn is_stable(&mut self, stage: &Stage, x: &[DVec3]) -> bool {
        self.assemble(stage, x, Definiteness::Exact);
        self.factorisations += 1;
        self.factor.factorise(&self.stiffness.matrix)
    }

    /// Assembles and factorises at `x`.
    fn refactor(&mut self, stage: &Stage, x: &[DVec3]) -> Result<(), SolveError> {
        if self.is_stable(stage, x) {
            return Ok(());
        }
        self.assemble(stage, x, Definiteness::Projected);
        let largest = self.stiffness.diagonal().fold(0.0, f64::max);
        let mut shift = 1e-10 * largest;
        while shift < largest {
            self.factorisations += 1;
            self.stiffness.shift_diagonal(shift);
            if self.factor.factorise(&self.stiffness.matrix) {
                return Ok(());
            }
            shift *= 100.0;
        }
        let reason = "the projected stiffness is not positive definite under any shift".into();
        Err(SolveError::Factorisation { unknowns: self.axes.count, reason })
    }

    /// Stiffness of body, follower loads, contact and couplings; without the follower loads if it is to be definite.
    fn assemble(&mut self, stage: &Stage, x: &[DVec3], definiteness: Definiteness) {
        let (axes, stiffness) = (&self.axes, &mut self.stiffness);
        stiffness.assemble(self.model.body, x, definiteness);
        let definite = definiteness == Definiteness::Projected;
        if !definite {
            follower::add_stiffness(self.model.environment, &stage.load_factors, x, axes, stiffness);
        }
        stage.for_each_block(self.model, x, definite, |i, j, block| stiffness.add_block(axes, i, j, block));
    }

    /// The node with the largest force.
    fn worst_node(&self, forces: &Forces) -> u32 {
        let total = forces.total_n();
        let by_size = |a: &usize, b: &usize| total[*a].abs().max_element().total_cmp(&total[*b].abs().max_element());
        (0..self.model.body.mass_kg().len()).max_by(by_size).unwrap_or(0) as u32
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
        let change = |alpha: f64| line.potential_change_j(alpha);
        let slope_at = |alpha: f64| -dot(&Forces::at(self.model, stage, &line.at(alpha)).total_n(), &d);
        search(self.longest_step(&d), slope, change, slope_at).map(|alpha| line.at(alpha))
    }
}

/// How far to go along a direction of descent, from `longest` down: where the potential has sunk enough, or, where rounding hides that, has become flat.
/// `change_j` tells its change and the size of rounding in it, `slope_at` its slope there; `slope` is that at the start.
pub(super) fn search(
    longest: f64,
    slope: f64,
    change_j: impl Fn(f64) -> (f64, f64),
    slope_at: impl Fn(f64) -> f64,
) -> Option<f64> {
    let mut alpha = longest;
    for _ in 0..MAX_BACKTRACKS {
        let (change, rounding) = change_j(alpha);
        let is_flat = || slope_at(alpha).abs() <= CURVATURE * slope.abs();
        if change <= SUFFICIENT_DECREASE * alpha * slope || change <= 8.0 * rounding && is_flat() {
            return Some(alpha);
        }
        alpha *= shorter(alpha, slope, change);
    }
    None
}

/// Factor on α: the minimum of the parabola through value, slope and new value, kept in [0.1, 0.5].
fn shorter(alpha: f64, slope: f64, change: f64) -> f64 {
    let parabola = -slope * alpha / (2.0 * (change - slope * alpha));
    if parabola.is_finite() { parabola.clamp(0.1, 0.5) } else { 0.1 }
}
