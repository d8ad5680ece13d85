//! Dynamic stiffness under a patch that swings, by frequency, beside the reference's.
//!
//! The load `F` of the lab's sweep sets all frequencies going, and `u` is where it presses. Of a body that answers linearly
//! `F̂(s) = K(s) û(s)`, with `û(s) = Σ u e^{−st}` over the ticks of the whole answer. With `s = β + iω` what comes late counts
//! little, so that an answer of a second is whole. Of a mass with damping α that is `s² + αs = −ω² + i(2β + α)ω + β² + αβ`: as if it were damped by
//! `2β` more than in the sweep, and held by a spring of `β² + αβ` times the mass.
//! F is the same for all, so that the stiffness of a method over the reference's is `|û_reference| / |û|`.
use crate::{
    methods::{self, LINEAR_TETS, Method, Pace, SMOOTHED_TETS},
    problems::{
        self, Motion, Problem,
        motion::{RATE_HZ, RINGING_DAMPING_PER_S},
    },
    references::Reference,
};
use miette::{Result, miette};
use std::f64::consts::TAU;

/// β (1/s).
const DECAY_PER_S: f64 = 20.0;
/// Frequencies (Hz).
const FREQUENCIES_HZ: [f64; 10] = [2.0, 5.0, 8.0, 11.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0];
/// Methods with particles whose names begin so are left out: what differs is only near the surface.
const LEFT_OUT: [&str; 2] = ["hybrid 50 ", "hybrid 1400 "];

/// The lab's sweep.
pub(super) fn problem() -> Result<Problem> {
    let is_sweep = |problem: &Problem| matches!(problem.motion, Motion::Sweep { .. });
    problems::all().into_iter().find(is_sweep).ok_or_else(|| miette!("the lab has no problem with a sweep"))
}

/// Measures and prints the table.
pub(super) fn print() -> Result<()> {
    let problem = problem()?;
    let reference_m = Reference::of(&problem)?.series_m();
    let pace = Pace::of(&problem)?;
    println!(
        "Dynamic stiffness over the reference's, mass damping {} /s: {}",
        RINGING_DAMPING_PER_S + 2.0 * DECAY_PER_S,
        problem.sentence
    );
    println!();
    println!("| body | {} |", FREQUENCIES_HZ.map(|hz| format!("{hz} Hz")).join(" | "));
    println!("|---|{}", "---|".repeat(FREQUENCIES_HZ.len()));
    for method in methods::all() {
        let name = method.name();
        let has_particles = name.starts_with("hybrid ") && !LEFT_OUT.iter().any(|start| name.starts_with(start));
        if !has_particles && ![LINEAR_TETS, SMOOTHED_TETS].contains(&name) {
            continue;
        }
        let resolutions = if has_particles { vec![4, 8] } else { method.resolutions(problem.body, false) };
        for resolution in resolutions {
            let found_m = series_m(method.as_ref(), &problem, resolution, &pace)?;
            let off = FREQUENCIES_HZ.map(|hz| {
                let stiffness = size_at(&reference_m, hz) / size_at(&found_m, hz);
                format!("{:+.1} %", 100.0 * (stiffness - 1.0))
            });
            println!("| {name}, {} tets | {} |", 3 * resolution.pow(3), off.join(" | "));
        }
    }
    Ok(())
}

fn series_m(method: &dyn Method, problem: &Problem, resolution: u32, pace: &Pace) -> Result<Vec<f64>> {
    let mut running = method.build(problem, resolution, pace)?;
    let mut answers_m = vec![];
    for tick in 1..=pace.ramp_ticks + pace.rest_ticks {
        running.tick(pace.fraction(tick));
        if let Some(failure) = running.failure() {
            return Err(miette!("{} stopped in tick {tick}: {failure}", method.name()));
        }
        answers_m.push(running.answer());
    }
    Ok(answers_m)
}

/// `|û(β + iω)|` of answers at the ends of ticks.
fn size_at(answers: &[f64], hz: f64) -> f64 {
    let (mut real, mut imaginary) = (0.0, 0.0);
    for (tick, answer) in (1..).zip(answers) {
        let t_s = f64::from(tick) / RATE_HZ;
        let (sin, cos) = (TAU * hz * t_s).sin_cos();
        let weighted = answer * (-DECAY_PER_S * t_s).exp();
        real += weighted * cos;
        imaginary -= weighted * sin;
    }
    real.hypot(imaginary)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An oscillator `ü + αu̇ + ω₀²u = F` that a force swings from rest, by leapfrog in small steps.
    #[test]
    fn the_stiffness_of_an_oscillator_is_the_known_one() {
        let alpha = RINGING_DAMPING_PER_S;
        let force = |t_s: f64| (TAU * (5.0 * t_s + 27.5 * t_s * t_s)).sin();
        let answer = |omega: f64| -> Vec<f64> {
            let (mut u, mut v, steps) = (0.0, 0.0, 50_u32);
            let h_s = 1.0 / (RATE_HZ * f64::from(steps));
            let mut answers = vec![];
            for tick in 0..1000_u32 {
                for step in 0..steps {
                    let t_s = (f64::from(tick * steps + step) + 0.5) * h_s;
                    u += 0.5 * h_s * v;
                    let pull = force(t_s) - omega * omega * u;
                    v = (v * (1.0 - 0.5 * alpha * h_s) + h_s * pull) / (1.0 + 0.5 * alpha * h_s);
                    u += 0.5 * h_s * v;
                }
                answers.push(u);
            }
            answers
        };
        // K(s) = s² + αs + ω₀²
        let stiffness = |omega: f64, hz: f64| {
            let (beta, imaginary) = (DECAY_PER_S, TAU * hz);
            let real = beta * beta - imaginary * imaginary + alpha * beta + omega * omega;
            real.hypot(2.0 * beta * imaginary + alpha * imaginary)
        };
        let (one, other) = (TAU * 10.0, TAU * 11.0);
        let (of_one, of_other) = (answer(one), answer(other));
        for hz in FREQUENCIES_HZ {
            let found = size_at(&of_one, hz) / size_at(&of_other, hz);
            let expected = stiffness(other, hz) / stiffness(one, hz);
            assert!((found / expected - 1.0).abs() < 2e-3, "{hz} Hz: {found} {expected}");
        }
    }
}
