//! Going through a problem with every method, and timing them in turns.
use super::Row;
use crate::{
    methods::{Method, Pace, Running},
    problems::{
        Problem,
        sample::{self, FieldError},
    },
    references::Reference,
    timing::quantiles,
};
use miette::Result;
use std::time::Instant;

/// How much is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// All resolutions.
    pub full: bool,
    /// Timed turns.
    pub rounds: usize,
    /// Longest time (s) for a method to go through a problem.
    pub budget_s: f64,
}

/// What progress hears of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn<'a> {
    /// What is done.
    pub what: &'a str,
    /// By which method.
    pub method: &'a str,
    /// At which resolution.
    pub resolution: u32,
}

/// Ticks over which the answer is averaged.
const LAST: usize = 20;
/// Ticks after which it is known whether the budget will do.
const TRIAL: usize = 10;

struct Contender {
    row: Row,
    running: Option<Box<dyn Running>>,
    times_s: Vec<f64>,
}

/// Measures every method on a problem.
///
/// # Errors
/// No reference, or a body that cannot be built.
pub fn problem(
    problem: &Problem,
    methods: &[Box<dyn Method>],
    effort: &Effort,
    tell: &mut dyn FnMut(Turn<'_>),
) -> Result<Vec<Row>> {
    let reference = Reference::of(problem)?;
    let pace = Pace::of(problem)?;
    let mut contenders = Vec::new();
    for method in methods {
        for resolution in method.resolutions(problem.body, effort.full) {
            tell(Turn { what: "settles", method: method.name(), resolution });
            contenders.push(settle(problem, method.as_ref(), resolution, (&pace, effort), &reference));
        }
    }
    tell(Turn { what: "takes turns with the others", method: "each", resolution: 0 });
    take_turns(&mut contenders, effort.rounds);
    Ok(contenders.into_iter().map(Contender::finish).collect())
}

fn settle(
    problem: &Problem,
    method: &dyn Method,
    resolution: u32,
    (pace, effort): (&Pace, &Effort),
    reference: &Reference,
) -> Contender {
    let named = Row {
        problem: problem.name.clone(),
        method: method.name().into(),
        competes: method.competes(problem),
        resolution,
        ..Row::default()
    };
    let before = crate::MEMORY.allocated();
    let mut running = match method.build(problem, resolution, pace) {
        Ok(running) => running,
        Err(error) => return Contender::failed(Row { failure: error.to_string(), ..named }),
    };
    let [elements, nodes, substeps] = running.size();
    let memory_bytes = crate::MEMORY.allocated().saturating_sub(before);
    let sized = Row { elements, nodes, substeps, memory_bytes, ..named };
    let ticks = pace.ramp_ticks + pace.rest_ticks;
    let mut last = Vec::with_capacity(LAST);
    let mut fastest_s = f64::INFINITY;
    for tick in 1..=ticks {
        let start = Instant::now();
        running.tick(pace.fraction(tick));
        fastest_s = fastest_s.min(start.elapsed().as_secs_f64());
        if let Some(failure) = running.failure() {
            return Contender::failed(Row { failure, ..sized });
        }
        let projected_s = fastest_s * ticks as f64;
        if tick == TRIAL && projected_s > effort.budget_s {
            let failure = format!("would take {projected_s:.1} s to come to rest; {} s are allowed", effort.budget_s);
            return Contender::failed(Row { failure, ..sized });
        }
        if tick + LAST > ticks {
            last.push(running.answer());
        }
    }
    let answer = last.iter().sum::<f64>() / last.len() as f64;
    let spread = last.iter().map(|a| (a - answer).abs()).fold(0.0, f64::max);
    let field = FieldError::of(&sample::points(problem.body), &running.displacements_m(), &reference.displacements_m());
    let row = Row {
        answer: Some(answer),
        answer_error: Some(answer / reference.value - 1.0),
        field_l2: field.map(|f| f.l2),
        field_max: field.map(|f| f.max),
        drift: Some(spread / answer.abs()),
        energy_error: running.energy_error(),
        ..sized
    };
    Contender { row, running: Some(running), times_s: Vec::with_capacity(effort.rounds) }
}

/// A slow moment of the machine strikes all of them. A turn is two ticks, of which the second is timed: the first fetches back
/// what the others pushed out of the caches.
fn take_turns(contenders: &mut [Contender], rounds: usize) {
    let warm_up = rounds / 10 + 1;
    for round in 0..warm_up + rounds {
        for contender in contenders.iter_mut() {
            let Some(running) = &mut contender.running else { continue };
            running.tick(1.0);
            let start = Instant::now();
            running.tick(1.0);
            let elapsed = start.elapsed().as_secs_f64();
            if round >= warm_up {
                contender.times_s.push(elapsed);
            }
        }
    }
}

impl Contender {
    fn failed(row: Row) -> Self {
        Self { row, running: None, times_s: vec![] }
    }

    fn finish(self) -> Row {
        let Self { row, running, times_s } = self;
        let failure = running.and_then(|running| running.failure()).unwrap_or_else(|| row.failure.clone());
        if times_s.is_empty() {
            return Row { failure, ..row };
        }
        let micros = |times: &[f64]| quantiles(&mut times.to_vec(), [0.5, 0.99, 1.0]).map(|time_s| time_s * 1e6);
        let [median, p99, worst] = micros(&times_s);
        let (first, second) = times_s.split_at(times_s.len() / 2);
        let apart = if first.is_empty() { 0.0 } else { (micros(first)[0] - micros(second)[0]).abs() };
        Row {
            median_us: Some(median),
            p99_us: Some(p99),
            worst_us: Some(worst),
            unrest: Some(apart / median),
            failure,
            ..row
        }
    }
}
