//! Growing pauses between attempts to connect.
use std::time::Duration;

/// Pauses that double from the first to the longest, each shortened by a random part of up to half, so that bridges which lost
/// the same daemon do not come back in step.
#[derive(Debug, Clone)]
pub struct Backoff {
    first: Duration,
    longest: Duration,
    attempt: u32,
    random: u64,
}

impl Backoff {
    /// The same seed gives the same pauses.
    pub fn new(first: Duration, longest: Duration, seed: u64) -> Self {
        Self { first, longest, attempt: 0, random: seed }
    }

    /// The next pause.
    pub fn pause(&mut self) -> Duration {
        let full = self.first.saturating_mul(1 << self.attempt.min(20)).min(self.longest);
        self.attempt = self.attempt.saturating_add(1);
        full.mul_f64(1.0 - 0.5 * self.unit())
    }

    /// Starts again with the shortest pause: a connection worked.
    pub fn reset(&mut self) {
        self.attempt = 0;
    }

    /// Uniform in [0, 1): SplitMix64 (Steele, Lea and Flood 2014).
    fn unit(&mut self) -> f64 {
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_within_their_bounds_and_start_again() {
        let (first, longest) = (Duration::from_millis(100), Duration::from_secs(5));
        let mut backoff = Backoff::new(first, longest, 7);
        for attempt in 0..40 {
            let full = first.saturating_mul(1 << attempt.min(20)).min(longest);
            let pause = backoff.pause();
            assert!(pause <= full && pause >= full / 2, "attempt {attempt}: {pause:?} of {full:?}");
        }
        backoff.reset();
        assert!(backoff.pause() <= first);
    }

    #[test]
    fn seeds_differ_and_repeat() {
        let pauses = |seed| {
            let mut backoff = Backoff::new(Duration::from_millis(100), Duration::from_secs(5), seed);
            (0..8).map(|_| backoff.pause()).collect::<Vec<_>>()
        };
        assert_eq!(pauses(1), pauses(1));
        assert_ne!(pauses(1), pauses(2));
    }
}
