//! How fast a problem is gone through and how it comes to rest: the same for all methods.
use super::subject;
use crate::problems::Problem;
use miette::{IntoDiagnostic, Result, miette};
use palpate_physics::solve::natural_modes;
use std::f64::consts::TAU;

/// Ramp, rest and damping of a problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Ticks in which tool or load comes.
    pub ramp_ticks: usize,
    /// Ticks after it until the answer is read.
    pub rest_ticks: usize,
    /// Mass damping (1/s).
    pub damping_per_s: f64,
}

/// Damping over the lowest frequency ω of the coarsest mesh. 2 is critical; coarse meshes are too stiff, and finer ones, whose ω is
/// lower, must not creep.
const DAMPING: f64 = 1.4;
/// Rest, in 1/ω: what is left of the slowest motion falls by `exp(−0.7 · 15)`, to some 3e-5.
const REST: f64 = 15.0;
/// Ramp, in 1/ω, and its least ticks.
const RAMP: (f64, usize) = (5.0, 100);
/// Least rest (ticks).
const LEAST_REST: usize = 200;
/// Ticks per second.
const RATE_HZ: f64 = 1000.0;

impl Pace {
    /// From the lowest natural frequency of the problem's coarsest mesh.
    ///
    /// # Errors
    /// A body that cannot be built, or whose modes cannot be found.
    pub fn of(problem: &Problem) -> Result<Self> {
        let body = problem.body.tets(problem.body.resolutions(false)[0])?;
        let unloaded = subject::unloaded(problem, &body)?;
        let modes = natural_modes(&unloaded, 1).into_diagnostic()?;
        let lowest = modes.first().ok_or_else(|| miette!("{} has no mode", problem.name))?;
        let omega = TAU * lowest.frequency_hz;
        let ticks = |times: f64, least: usize| ((times / omega * RATE_HZ).ceil() as usize).max(least);
        Ok(Self {
            ramp_ticks: ticks(RAMP.0, RAMP.1),
            rest_ticks: ticks(REST, LEAST_REST),
            damping_per_s: DAMPING * omega,
        })
    }

    /// How much of the action is there after some ticks: `6s⁵ − 15s⁴ + 10s³`, at rest at both ends.
    pub fn fraction(&self, ticks: usize) -> f64 {
        let s = (ticks as f64 / self.ramp_ticks as f64).min(1.0);
        s * s * s * (10.0 + s * (6.0 * s - 15.0))
    }
}
