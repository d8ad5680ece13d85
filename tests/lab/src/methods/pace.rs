//! How fast a problem is gone through and how it comes to rest: the same for all methods.
use super::subject;
use crate::problems::{
    Motion, Problem,
    motion::{RATE_HZ, RINGING_DAMPING_PER_S, smooth},
};
use miette::{IntoDiagnostic, Result, miette};
use palpate_physics::statics::natural_modes;
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
    /// What happens in those ticks.
    pub motion: Motion,
}

/// Damping over the lowest frequency ω of the coarsest mesh. 2 is critical; coarse meshes are too stiff, and finer ones, whose ω is
/// lower, must not creep.
const DAMPING: f64 = 1.4;
/// Rest, in 1/ω: what is left of the slowest motion falls by `exp(−0.7 · 15)`, to some 3e-5.
const REST: f64 = 15.0;
/// Ramp, in 1/ω, and its least ticks.
const RAMP: (f64, usize) = (5.0, 100);
/// Tremor of a hand that presses: its share of the action, and its frequency (Hz), that of physiological tremor.
const TREMOR: f64 = 0.05;
const TREMOR_HZ: f64 = 8.0;
/// Least rest (ticks).
const LEAST_REST: usize = 200;

/// A hand does not stand still: how much of the action is there in timed ticks, one period of a tremor. Solvers that begin where they
/// were would otherwise be timed with nothing to do.
pub fn tremor() -> impl Iterator<Item = f64> + Clone {
    let period_ticks = (RATE_HZ / TREMOR_HZ).round() as usize;
    (0..period_ticks).map(move |tick| 1.0 + TREMOR * (TAU * tick as f64 / period_ticks as f64).sin())
}

impl Pace {
    /// That of a dynamic problem; otherwise from the lowest natural frequency of the problem's coarsest mesh.
    ///
    /// # Errors
    /// A body that cannot be built, or whose modes cannot be found.
    pub fn of(problem: &Problem) -> Result<Self> {
        let motion = problem.motion;
        if let Some(rest_ticks) = motion.ticks() {
            return Ok(Self { ramp_ticks: 0, rest_ticks, damping_per_s: RINGING_DAMPING_PER_S, motion });
        }
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
            motion,
        })
    }

    /// How much of the action is there in a tick, counted from 1.
    pub fn fraction(&self, tick: usize) -> f64 {
        match self.motion {
            Motion::ToRest => smooth(tick as f64 / self.ramp_ticks as f64),
            motion => motion.fraction(tick),
        }
    }
}
