//! Wake-up jitter of our loop on this machine, and of `cyclictest` beside it if it is installed (Debian package rt-tests).
//!
//! `cargo run --release -p palpate-realtime --example jitter -- [SECONDS] [PRIORITY] [PROCESSOR]` (10 s, SCHED_FIFO 80, any
//! processor). Run it as a user with real-time privileges, on a machine that is doing what it will do in use.
use palpate_realtime::{Clock, OsMeasures, Percentiles, TickLoop};
use std::{ops::ControlFlow, process::Command};

const RATE_HZ: u64 = 1000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let seconds: u64 = arguments.next().map_or(Ok(10), |s| s.parse())?;
    let priority: u8 = arguments.next().map_or(Ok(80), |s| s.parse())?;
    let processor: Option<usize> = arguments.next().map(|s| s.parse()).transpose()?;

    println!("wake-up lateness at {RATE_HZ} Hz for {seconds} s, SCHED_FIFO {priority}");
    // One after the other: on a machine with few processors they would measure each other.
    let ours =
        std::thread::spawn(move || palpate(seconds, priority, processor)).join().map_err(|_| "the loop panicked")??;
    row("palpate-realtime", &ours);
    match cyclictest(seconds, priority, processor) {
        Ok(theirs) => row("cyclictest", &theirs),
        Err(reason) => println!("cyclictest: {reason}"),
    }
    Ok(())
}

fn row(name: &str, p: &Percentiles) {
    let us = |ns: u64| ns as f64 / 1e3;
    println!(
        "{name:<18} p50 {:>7.1} us   p99 {:>7.1} us   p99.9 {:>7.1} us   max {:>8.1} us   ({} ticks)",
        us(p.p50_ns),
        us(p.p99_ns),
        us(p.p999_ns),
        us(p.max_ns),
        p.count
    );
}

fn palpate(seconds: u64, priority: u8, processor: Option<usize>) -> Result<Percentiles, String> {
    let measures = OsMeasures { fifo_priority: Some(priority), lock_memory: true, processor, stay_awake: true };
    let granted = measures.apply();
    for note in &granted.notes {
        println!("  {note}");
    }
    let mut tick_loop = TickLoop::new(Clock::Monotonic, 1.0 / RATE_HZ as f64).map_err(|error| error.to_string())?;
    let monitor = tick_loop.monitor();
    let last = seconds * RATE_HZ;
    tick_loop.run(|wakeup| if wakeup.tick >= last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) });
    println!("  {} overruns, {} ticks skipped", monitor.overruns(), monitor.skipped());
    Ok(monitor.wakeup_lateness.percentiles())
}

/// Runs `cyclictest` with the same period, priority and clock, and reads its histogram (whole microseconds).
fn cyclictest(seconds: u64, priority: u8, processor: Option<usize>) -> Result<Percentiles, String> {
    let mut command = Command::new("cyclictest");
    command.args(["--quiet", "--mlockall", "--threads=1", "--histogram=100000", "--policy=fifo"]);
    command.arg(format!("--interval={}", 1_000_000 / RATE_HZ)).arg(format!("--priority={priority}"));
    command.arg(format!("--loops={}", seconds * RATE_HZ));
    if let Some(processor) = processor {
        command.arg(format!("--affinity={processor}"));
    }
    let output = command.output().map_err(|error| format!("not run ({error}); install the Debian package rt-tests"))?;
    if !output.status.success() {
        return Err(format!("failed: {}", String::from_utf8_lossy(&output.stderr).trim()));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let counts: Vec<(u64, u64)> = text.lines().filter_map(bin).filter(|(_, count)| *count > 0).collect();
    let total: u64 = counts.iter().map(|(_, count)| count).sum();
    let at = |quantile: f64| {
        let wanted = (total as f64 * quantile).ceil() as u64;
        let mut seen = 0;
        let found = counts.iter().find(|(_, count)| {
            seen += count;
            seen >= wanted
        });
        found.map_or(0, |(us, _)| us * 1000)
    };
    let mean_ns = counts.iter().map(|(us, count)| us * count).sum::<u64>() as f64 * 1e3 / total.max(1) as f64;
    let max_ns = counts.last().map_or(0, |(us, _)| us * 1000);
    Ok(Percentiles { p50_ns: at(0.5), p99_ns: at(0.99), p999_ns: at(0.999), max_ns, mean_ns, count: total })
}

/// `000012 000345`: microseconds and count.
fn bin(line: &str) -> Option<(u64, u64)> {
    let (us, count) = line.split_once(char::is_whitespace)?;
    Some((us.trim().parse().ok()?, count.trim().parse().ok()?))
}
