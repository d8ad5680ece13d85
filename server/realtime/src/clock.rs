//! A monotonic clock that sleeps until a time; real, or turned by a test.
use rustix::{
    io::Errno,
    thread::clock_nanosleep_absolute,
    time::{ClockId, Timespec, clock_gettime},
};
use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

const NS_PER_S: u64 = 1_000_000_000;

/// Monotonic time in ns, from an arbitrary origin. Clones share one time.
#[derive(Debug, Clone, Default)]
pub enum Clock {
    /// `CLOCK_MONOTONIC`.
    #[default]
    Monotonic,
    /// A test's.
    Manual(Arc<ManualClock>),
}

/// Time that passes only when somebody sleeps or advances it, so a loop of seconds runs in microseconds.
#[derive(Debug, Default)]
pub struct ManualClock {
    now_ns: AtomicU64,
    lateness_ns: AtomicU64,
}

impl ManualClock {
    /// Lets time pass, as work does.
    pub fn advance(&self, by_ns: u64) {
        self.now_ns.fetch_add(by_ns, Ordering::Relaxed);
    }

    /// Every later sleep ends this much after its deadline.
    pub fn wake_late_by(&self, lateness_ns: u64) {
        self.lateness_ns.store(lateness_ns, Ordering::Relaxed);
    }
}

impl Clock {
    /// A manual clock at 0, and the handle that turns it.
    pub fn manual() -> (Self, Arc<ManualClock>) {
        let time = Arc::new(ManualClock::default());
        (Self::Manual(Arc::clone(&time)), time)
    }

    /// Now (ns).
    pub fn now_ns(&self) -> u64 {
        match self {
            Self::Monotonic => {
                let now = clock_gettime(ClockId::Monotonic);
                now.tv_sec as u64 * NS_PER_S + now.tv_nsec as u64
            }
            Self::Manual(time) => time.now_ns.load(Ordering::Relaxed),
        }
    }

    /// Returns at `deadline_ns` or later; at once when it has passed. Absolute, so that neither the time the call takes nor a
    /// signal shifts the grid.
    pub fn sleep_until(&self, deadline_ns: u64) {
        match self {
            Self::Monotonic => {
                let request =
                    Timespec { tv_sec: (deadline_ns / NS_PER_S) as i64, tv_nsec: (deadline_ns % NS_PER_S) as i64 };
                while clock_nanosleep_absolute(ClockId::Monotonic, &request) == Err(Errno::INTR) {}
            }
            Self::Manual(time) => {
                let wake_ns = deadline_ns + time.lateness_ns.load(Ordering::Relaxed);
                time.now_ns.fetch_max(wake_ns, Ordering::Relaxed);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_real_clock_never_wakes_early() {
        let clock = Clock::Monotonic;
        let deadline_ns = clock.now_ns() + 2_000_000;
        clock.sleep_until(deadline_ns);
        assert!(clock.now_ns() >= deadline_ns);
        clock.sleep_until(deadline_ns - 1_000_000);
    }

    #[test]
    fn a_manual_clock_jumps_to_the_deadline_and_never_back() {
        let (clock, time) = Clock::manual();
        clock.sleep_until(500);
        assert_eq!(clock.now_ns(), 500);
        time.advance(100);
        clock.sleep_until(550);
        assert_eq!(clock.now_ns(), 600);
        time.wake_late_by(7);
        clock.clone().sleep_until(700);
        assert_eq!(clock.now_ns(), 707);
    }
}
