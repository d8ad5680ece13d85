//! Wake-up lateness and cost of a 1 kHz loop with a body in it, and wake-up lateness of `cyclictest` beside it if it is
//! installed (Debian package rt-tests).
use crate::methods::tet_body;
use crate::{bodies, press::Press};
use clap::Args;
use miette::{IntoDiagnostic, Result, miette};
use palpate_physics::{Model, material::Law};
use palpate_realtime::{Clock, LoopMonitor, OsMeasures, Percentiles, TickLoop};
use std::{collections::BTreeMap, ops::ControlFlow, process::Command, sync::Arc};

const RATE_HZ: u64 = 1000;

/// What is measured.
#[derive(Debug, Clone, Copy, Args)]
pub struct Options {
    /// Seconds for each of the two, in turns of one second
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=3600))]
    seconds: u64,
    /// Priority under SCHED_FIFO
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: u8,
    /// Processor both are held to
    #[arg(long)]
    processor: Option<usize>,
    /// Tetrahedra of the ventricle that a 10 mm sphere presses
    #[arg(long, default_value_t = 1_352)]
    tets: u32,
}

/// Measures and prints.
///
/// # Errors
/// A body that cannot be built, or a loop that cannot run.
pub fn print(options: &Options) -> Result<()> {
    let shape = bodies::ventricle(3.6, options.tets)?;
    let tool = bodies::tool_beside(&shape, 10e-3);
    let model = bodies::model(&shape, bodies::material(Law::StableNeoHookean, 10e3, 0.45)?, Some(tool))?;
    println!(
        "{} s at {RATE_HZ} Hz each, in turns of 1 s, SCHED_FIFO {}; body: ventricle, 90 mm, {} tets, {} substeps, pressed 1 mm",
        options.seconds,
        options.priority,
        tet_body(&model).mesh().tets().len(),
        model.substeps()
    );
    let ours = Arc::new(LoopMonitor::default());
    let mut theirs = Ok(BTreeMap::new());
    for turn in 0..options.seconds {
        // One after the other: on a machine with few processors they would measure each other.
        std::thread::scope(|scope| {
            scope
                .spawn(|| palpate(options, &model, &ours, turn == 0))
                .join()
                .map_err(|_| miette!("the loop panicked"))?
        })?;
        theirs = theirs.and_then(|counts| cyclictest(options, counts));
    }
    println!("{} overruns, {} ticks skipped", ours.overruns(), ours.skipped());
    row("tick of the body", &ours.tick_cost.percentiles());
    row("woke late, Palpate", &ours.wakeup_lateness.percentiles());
    match theirs {
        Ok(counts) => row("woke late, cyclictest", &percentiles(&counts)),
        Err(reason) => println!("cyclictest: {reason}"),
    }
    Ok(())
}

fn row(name: &str, p: &Percentiles) {
    let us = |ns: u64| ns as f64 / 1e3;
    println!(
        "{name:<21} p50 {:>7.1} us   p99 {:>7.1} us   p99.9 {:>7.1} us   max {:>8.1} us   ({} ticks)",
        us(p.p50_ns),
        us(p.p99_ns),
        us(p.p999_ns),
        us(p.max_ns),
        p.count
    );
}

fn palpate(options: &Options, model: &Model, monitor: &Arc<LoopMonitor>, first: bool) -> Result<()> {
    let Options { priority, processor, .. } = *options;
    let measures = OsMeasures { fifo_priority: Some(priority), lock_memory: true, processor, stay_awake: true };
    let granted = measures.apply();
    for note in granted.notes.iter().filter(|_| first) {
        println!("  {note}");
    }
    let mut press = Press::new(model, 1e-3, 200);
    press.tick();
    let tick_loop = TickLoop::new(Clock::Monotonic, 1.0 / RATE_HZ as f64).into_diagnostic()?;
    tick_loop.measured_in(Arc::clone(monitor)).run(|wakeup| {
        press.tick();
        if wakeup.tick + 1 >= RATE_HZ { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    Ok(())
}

/// Adds a turn of `cyclictest` with the same period, priority and clock: counts by whole microseconds.
fn cyclictest(options: &Options, mut counts: BTreeMap<u64, u64>) -> Result<BTreeMap<u64, u64>, String> {
    let mut command = Command::new("cyclictest");
    command.args(["--quiet", "--mlockall", "--threads=1", "--histogram=100000", "--policy=fifo"]);
    command.arg(format!("--interval={}", 1_000_000 / RATE_HZ)).arg(format!("--priority={}", options.priority));
    command.arg(format!("--loops={RATE_HZ}"));
    if let Some(processor) = options.processor {
        command.arg(format!("--affinity={processor}"));
    }
    let output = command.output().map_err(|error| format!("not run ({error}); install the Debian package rt-tests"))?;
    if !output.status.success() {
        return Err(format!("failed: {}", String::from_utf8_lossy(&output.stderr).trim()));
    }
    for (us, count) in String::from_utf8_lossy(&output.stdout).lines().filter_map(bin) {
        *counts.entry(us).or_default() += count;
    }
    Ok(counts)
}

/// `000012 000345`: microseconds and count.
fn bin(line: &str) -> Option<(u64, u64)> {
    let (us, count) = line.split_once(char::is_whitespace)?;
    let count = count.trim().parse().ok()?;
    (count > 0).then_some((us.trim().parse().ok()?, count))
}

fn percentiles(counts: &BTreeMap<u64, u64>) -> Percentiles {
    let total: u64 = counts.values().sum();
    let at = |quantile: f64| {
        let wanted = (total as f64 * quantile).ceil() as u64;
        let mut seen = 0;
        let found = counts.iter().find(|(_, count)| {
            seen += **count;
            seen >= wanted
        });
        found.map_or(0, |(us, _)| us * 1000)
    };
    let mean_ns = counts.iter().map(|(us, count)| us * count).sum::<u64>() as f64 * 1e3 / total.max(1) as f64;
    let max_ns = counts.keys().next_back().map_or(0, |us| us * 1000);
    Percentiles { p50_ns: at(0.5), p99_ns: at(0.99), p999_ns: at(0.999), max_ns, mean_ns, count: total }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_of_cyclictest_is_read() {
        let text = "# Histogram\n000000 000000\n000012 000090\n000030 000009\n000400 000001\n# Total: 000000100\n";
        let counts: BTreeMap<u64, u64> = text.lines().filter_map(bin).collect();
        let p = percentiles(&counts);
        assert_eq!((p.p50_ns, p.p99_ns, p.p999_ns, p.max_ns, p.count), (12_000, 30_000, 400_000, 400_000, 100));
    }
}
