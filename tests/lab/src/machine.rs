//! On which machine, at which commit and when something was measured, and how restless the machine was.
use crate::timing::quantiles;
use std::{
    process::Command,
    time::{Instant, SystemTime, UNIX_EPOCH},
};

/// What a reader must know to judge a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    /// Processor.
    pub processor: String,
    /// Hardware threads.
    pub threads: usize,
    /// Operating system and architecture.
    pub system: String,
    /// Commit of the source tree, with `+` when it has changes; "unknown" outside one.
    pub commit: String,
    /// UTC day.
    pub date: String,
    /// "release", or "debug" with its warning.
    pub build: String,
}

impl Machine {
    /// This one, now.
    pub fn here() -> Self {
        let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
        Self {
            processor: model.map_or_else(|| "unknown".into(), |(_, name)| name.trim().to_owned()),
            threads: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            commit: commit().unwrap_or_else(|| "unknown".into()),
            date: today_utc(),
            build: if cfg!(debug_assertions) { "debug (times mean nothing)".into() } else { "release".into() },
        }
    }
}

fn commit() -> Option<String> {
    let git = |args: &[&str]| {
        let output = Command::new("git").args(args).current_dir(env!("CARGO_MANIFEST_DIR")).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let hash = git(&["rev-parse", "--short", "HEAD"])?;
    let changed = !git(&["status", "--porcelain"])?.is_empty();
    Some(if changed { hash + "+" } else { hash })
}

/// Today's date (UTC), `2026-11-22`.
pub fn today_utc() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    civil(seconds / 86_400)
}

/// The Gregorian date of a day since 1970, by counting in eras of 400 years that begin in March (146 097 days).
fn civil(days: u64) -> String {
    let days = days + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * of_year + 2) / 153;
    let day = of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

/// How restless the machine is: times (s) of one fixed piece of arithmetic, repeated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// 99th percentile over the median, less 1.
    pub p99_over_median: f64,
    /// Worst over the median, less 1.
    pub worst_over_median: f64,
}

impl Noise {
    /// Spins for about `rounds` times 50 µs.
    pub fn measure(rounds: usize) -> Self {
        let mut times: Vec<f64> = Vec::with_capacity(rounds);
        let mut x = 1.0_f64;
        for _ in 0..rounds {
            let start = Instant::now();
            for _ in 0..20_000 {
                x = std::hint::black_box(x * 0.999_999 + 1e-6);
            }
            times.push(start.elapsed().as_secs_f64());
        }
        let [median, p99, worst] = quantiles(&mut times, [0.5, 0.99, 1.0]);
        Self { p99_over_median: p99 / median - 1.0, worst_over_median: worst / median - 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_their_dates() {
        for (days, date) in [(0, "1970-01-01"), (11_016, "2000-02-29"), (19_782, "2024-02-29"), (20_779, "2026-11-22")]
        {
            assert_eq!(civil(days), date);
        }
    }
}
