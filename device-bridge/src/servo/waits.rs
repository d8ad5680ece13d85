//! What the uplink hears of the daemon's phase, on its way to the servo.
use palpate_control::Wait;
use std::sync::atomic::{AtomicU64, Ordering};

/// The newest wait that the daemon told of; taken once.
#[derive(Debug, Default)]
pub struct Waits {
    /// The wait above, the age of its answer below; both in ns, at most 4 s. 0: none.
    newest: AtomicU64,
    tick_period_ns: AtomicU64,
}

impl Waits {
    /// Another one.
    pub fn tell(&self, wait: &Wait) {
        let [waited, answered] = [wait.waited_ns, wait.answered_after_ns.max(1)].map(|ns| ns.min(u64::from(u32::MAX)));
        self.tick_period_ns.store(wait.tick_period_ns, Ordering::Relaxed);
        self.newest.store(waited << 32 | answered, Ordering::Release);
    }

    /// The one that was told since the last was taken.
    pub fn take(&self) -> Option<Wait> {
        let newest = self.newest.swap(0, Ordering::Acquire);
        let tick_period_ns = self.tick_period_ns.load(Ordering::Relaxed);
        let wait = Wait { waited_ns: newest >> 32, answered_after_ns: newest & u64::from(u32::MAX), tick_period_ns };
        (newest != 0).then_some(wait)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_is_taken_once() {
        let waits = Waits::default();
        assert_eq!(waits.take(), None);
        let wait = |waited_ns, answered_after_ns| Wait { waited_ns, answered_after_ns, tick_period_ns: 2_000_000 };
        waits.tell(&wait(5, 7));
        waits.tell(&wait(0, 900_000));
        assert_eq!(waits.take(), Some(wait(0, 900_000)));
        assert_eq!(waits.take(), None);
        waits.tell(&wait(u64::MAX, 0));
        assert_eq!(waits.take(), Some(wait(u64::from(u32::MAX), 1)));
    }
}
