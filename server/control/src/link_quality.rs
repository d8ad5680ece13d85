//! How often the other side is in time: libfranka's success rate, over the last thousand ticks.

/// Ticks looked back on.
pub const WINDOW: u32 = 1024;
const WORDS: usize = (WINDOW / u64::BITS) as usize;

/// The share of the last [`WINDOW`] ticks that were in time.
#[derive(Debug, Clone, Default)]
pub struct SuccessRate {
    /// Bit t mod 1024 is tick t's.
    in_time: [u64; WORDS],
    next: u32,
    seen: u32,
    good: u32,
}

impl SuccessRate {
    /// Another tick.
    pub fn push(&mut self, in_time: bool) {
        let (word, bit) = ((self.next / u64::BITS) as usize, 1_u64 << (self.next % u64::BITS));
        if self.seen == WINDOW {
            self.good -= u32::from(self.in_time[word] & bit != 0);
        } else {
            self.seen += 1;
        }
        self.in_time[word] = if in_time { self.in_time[word] | bit } else { self.in_time[word] & !bit };
        self.good += u32::from(in_time);
        self.next = (self.next + 1) % WINDOW;
    }

    /// The share, 0 to 1; `None` until as many ticks were seen as are looked back on.
    pub fn rate(&self) -> Option<f64> {
        (self.seen == WINDOW).then(|| f64::from(self.good) / f64::from(WINDOW))
    }

    /// Forgets all ticks.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn it_says_nothing_before_it_has_seen_enough() {
        let mut rate = SuccessRate::default();
        for _ in 0..WINDOW - 1 {
            rate.push(true);
        }
        assert_eq!(rate.rate(), None);
        rate.push(false);
        assert_eq!(rate.rate(), Some(1023.0 / 1024.0));
        rate.reset();
        assert_eq!(rate.rate(), None);
    }

    proptest! {
        /// Beside a list of all ticks.
        #[test]
        fn it_is_the_share_of_the_last_ticks(ticks in prop::collection::vec(any::<bool>(), 1024..4000)) {
            let mut rate = SuccessRate::default();
            for &tick in &ticks {
                rate.push(tick);
            }
            let last = &ticks[ticks.len() - WINDOW as usize..];
            let good = last.iter().filter(|tick| **tick).count();
            prop_assert_eq!(rate.rate(), Some(good as f64 / f64::from(WINDOW)));
        }
    }
}
