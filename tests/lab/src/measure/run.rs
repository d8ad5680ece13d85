//! Going through a problem with every method, and timing them in turns.
//!
//! Peers run in processes of their own, which would cost them and us the caches at every tick: they and our methods take turns in
//! [`BLOCKS`] blocks, so that a slow moment of the machine still strikes all.
use super::Row;
use crate::{
    methods::{Method, Pace, Running, tremor},
    peers::{Peers, Session, Variant},
    problems::{
        Problem,
        sample::{self, FieldError, Probe, Sample},
    },
    references::{Reference, series},
    timing::quantiles,
};
use glam::DVec3;
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
pub const LAST: usize = 20;
/// Ticks after which it is known whether the budget will do.
const TRIAL: usize = 10;
/// Blocks of turns, where peers are measured beside our methods.
const BLOCKS: usize = 10;
/// Time for the turns of a peer's variant in a block, over what it has to come to rest.
const PEERS_SHARE: f64 = 0.03;

struct Contender {
    row: Row,
    running: Option<Box<dyn Running>>,
    times_s: Vec<f64>,
}

/// Measures every method on a problem, and peers beside them.
///
/// # Errors
/// No reference, or a body that cannot be built.
pub fn problem(
    problem: &Problem,
    methods: &[Box<dyn Method>],
    peers: &mut Peers,
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
    let mut sessions = peers.start(problem, &pace, effort.budget_s, &mut |peer, resolution| {
        tell(Turn { what: "settles", method: peer, resolution });
    });
    tell(Turn { what: "takes turns with the others", method: "each", resolution: 0 });
    let mut fractions = tremor().cycle();
    let blocks = if sessions.is_empty() { 1 } else { BLOCKS };
    for _ in 0..blocks {
        take_turns(&mut contenders, &mut fractions, effort.rounds.div_ceil(blocks));
        for session in &mut sessions {
            session.time(effort.rounds.div_ceil(blocks), PEERS_SHARE * effort.budget_s);
        }
    }
    let judged = sessions.iter().flat_map(Session::variants).map(|variant| judge(problem, variant, &reference));
    Ok(contenders.into_iter().chain(judged.collect::<Result<Vec<_>>>()?).map(Contender::finish).collect())
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
    // A dynamic problem is judged by every tick.
    let kept = pace.motion.ticks().unwrap_or(LAST);
    let mut answers = Vec::with_capacity(kept);
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
        if tick + kept > ticks {
            answers.push(running.answer());
        }
    }
    let sized = Row { energy_error: running.energy_error(), ..sized };
    let row = if pace.motion.ticks().is_some() {
        Row {
            answer: Some(series::rms(&answers)),
            answer_error: Some(series::relative_difference(&answers, &reference.series_m())),
            ..sized
        }
    } else {
        answered(sized, &answers, &sample::points(problem.body), &running.displacements_m(), reference)
    };
    Contender { row, running: Some(running), times_s: Vec::with_capacity(effort.rounds) }
}

/// The answer over the last ticks and the field at some material points, against the reference.
fn answered(row: Row, last: &[f64], samples: &[Sample], displacements_m: &[DVec3], reference: &Reference) -> Row {
    let answer = last.iter().sum::<f64>() / last.len() as f64;
    let spread = last.iter().map(|a| (a - answer).abs()).fold(0.0, f64::max);
    let field = FieldError::of(samples, displacements_m, &reference.displacements_m());
    Row {
        answer: Some(answer),
        answer_error: Some(answer / reference.value - 1.0),
        field_l2: field.map(|f| f.l2),
        field_around: field.and_then(|f| f.around_l2),
        field_max: field.map(|f| f.max),
        drift: Some(spread / answer.abs()),
        ..row
    }
}

/// A peer's variant: its nodes' displacements are read at the same material points as ours.
fn judge(problem: &Problem, variant: Variant, reference: &Reference) -> Result<Contender> {
    let Variant { row, answers, displacements_m, times_s } = variant;
    if answers.is_empty() {
        return Ok(Contender::failed(row));
    }
    let body = problem.body.tets(row.resolution)?;
    let samples = sample::points(problem.body);
    let rest_m = body.mesh.positions_m();
    let x: Vec<DVec3> = rest_m.iter().zip(&displacements_m).map(|(rest, u)| *rest + *u).collect();
    let at_samples_m = Probe::new(&body, &samples).displacements_m(rest_m, &x);
    Ok(Contender { row: answered(row, &answers, &samples, &at_samples_m, reference), running: None, times_s })
}

/// A slow moment of the machine strikes all of them. A turn is two ticks, of which the second is timed: the first fetches back
/// what the others pushed out of the caches. The action trembles meanwhile, as a hand does.
fn take_turns(contenders: &mut [Contender], fractions: &mut impl Iterator<Item = f64>, rounds: usize) {
    let warm_up = rounds / 10 + 1;
    for round in 0..warm_up + rounds {
        let [first, second] = [0, 1].map(|_| fractions.next().unwrap_or(1.0));
        for contender in contenders.iter_mut() {
            let Some(running) = &mut contender.running else { continue };
            running.tick(first);
            let start = Instant::now();
            running.tick(second);
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
