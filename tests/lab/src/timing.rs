//! Quantiles, and interleaved timing: contenders take turns, so that a slow moment of the machine strikes all of them.
use std::time::Instant;

/// Median and 99th percentile of a contender's times (s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Median (s).
    pub median_s: f64,
    /// 99th percentile (s).
    pub p99_s: f64,
}

impl Summary {
    /// Of a list of times (s); zeros for an empty one.
    pub fn of(mut times_s: Vec<f64>) -> Self {
        let [median_s, p99_s] = quantiles(&mut times_s, [0.5, 0.99]);
        Self { median_s, p99_s }
    }
}

/// Values below which these fractions of `values` lie, by the nearest rank; zeros for an empty list. Sorts the values.
pub fn quantiles<const N: usize>(values: &mut [f64], fractions: [f64; N]) -> [f64; N] {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1) as f64;
    fractions.map(|fraction| values.get((fraction * last).round() as usize).copied().unwrap_or(0.0))
}

/// Runs every contender `rounds` times in turn, after `rounds/10 + 1` turns that are not counted. A turn is two runs, of which the
/// second is timed: the first fetches back what the others pushed out of the caches.
pub fn interleaved(contenders: &mut [Box<dyn FnMut() + '_>], rounds: usize) -> Vec<Summary> {
    let warm_up = rounds / 10 + 1;
    let mut times = vec![Vec::with_capacity(rounds); contenders.len()];
    for round in 0..warm_up + rounds {
        for (contender, times) in contenders.iter_mut().zip(&mut times) {
            contender();
            let start = Instant::now();
            contender();
            let elapsed = start.elapsed().as_secs_f64();
            if round >= warm_up {
                times.push(elapsed);
            }
        }
    }
    times.into_iter().map(Summary::of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_and_percentile_of_a_known_list() {
        let summary = Summary::of((0..=100).rev().map(f64::from).collect());
        assert_eq!(summary, Summary { median_s: 50.0, p99_s: 99.0 });
    }
}
