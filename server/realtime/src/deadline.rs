//! Ticks on a fixed grid of absolute deadlines.
use crate::clock::Clock;
use thiserror::Error;

/// A period that no loop can keep.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("a tick period of {period_s} s is out of range: it must be between 10 us and 10 s")]
pub struct PeriodError {
    /// The period (s).
    pub period_s: f64,
}

/// One wake-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wakeup {
    /// Number of this tick on the grid, from 0; skipped ticks are numbered too.
    pub tick: u64,
    /// When it was due (ns).
    pub deadline_ns: u64,
    /// When it woke (ns).
    pub woke_ns: u64,
    /// Ticks skipped just before this one, because the previous one took so long.
    pub skipped: u64,
    /// The previous tick's work ended after this deadline.
    pub overrun: bool,
}

impl Wakeup {
    /// How late it woke (ns).
    pub fn lateness_ns(&self) -> u64 {
        self.woke_ns.saturating_sub(self.deadline_ns)
    }
}

/// Share of the period that every wait sleeps.
pub const REST: f64 = 0.05;

/// The grid. Deadline n is `start + n · period`, whatever earlier ticks cost: errors do not accumulate.
///
/// After an overrun the newest deadline that has passed is served, late, and the older ones are skipped and counted: at most one
/// late tick follows, never a burst that catches up.
///
/// Every wait sleeps for [`REST`] of the period at least, so that a loop of real-time priority whose work never ends in time
/// still leaves a processor to the rest of the machine: to the tasks, on the same processor, that would lighten its work or stop it.
#[derive(Debug, Clone)]
pub struct Deadlines {
    clock: Clock,
    period_ns: u64,
    next_ns: u64,
    next_tick: u64,
}

impl Deadlines {
    /// First tick one period from now.
    ///
    /// # Errors
    /// [`PeriodError`] when the period is not between 10 µs and 10 s.
    pub fn new(clock: Clock, period_s: f64) -> Result<Self, PeriodError> {
        if !(1e-5..=10.0).contains(&period_s) {
            return Err(PeriodError { period_s });
        }
        let period_ns = (period_s * 1e9).round() as u64;
        let next_ns = clock.now_ns() + period_ns;
        Ok(Self { clock, period_ns, next_ns, next_tick: 0 })
    }

    /// A new grid: tick 0 one period from now.
    pub fn restart(&mut self) {
        self.next_ns = self.clock.now_ns() + self.period_ns;
        self.next_tick = 0;
    }

    /// The period (ns).
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// The clock.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Moves the grid: the next deadline, and all after it, are later by `by_ns` (below zero: earlier), half a period at most.
    pub fn shift(&mut self, by_ns: i64) {
        let most_ns = (self.period_ns / 2) as i64;
        self.next_ns = self.next_ns.saturating_add_signed(by_ns.clamp(-most_ns, most_ns));
    }

    /// Sleeps until the next deadline, and for [`REST`] of the period at least.
    pub fn wait(&mut self) -> Wakeup {
        let now_ns = self.clock.now_ns();
        let overrun = now_ns > self.next_ns;
        let rested_ns = now_ns + (self.period_ns as f64 * REST) as u64;
        let skipped = rested_ns.saturating_sub(self.next_ns) / self.period_ns;
        let deadline_ns = self.next_ns + skipped * self.period_ns;
        let tick = self.next_tick + skipped;
        self.clock.sleep_until(deadline_ns.max(rested_ns));
        self.next_ns = deadline_ns + self.period_ns;
        self.next_tick = tick + 1;
        Wakeup { tick, deadline_ns, woke_ns: self.clock.now_ns(), skipped, overrun }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn the_grid_does_not_drift() {
        let (clock, time) = Clock::manual();
        let mut deadlines = Deadlines::new(clock, 1e-3).unwrap();
        time.wake_late_by(30_000);
        for n in 0..1000 {
            let wakeup = deadlines.wait();
            assert_eq!((wakeup.tick, wakeup.deadline_ns, wakeup.lateness_ns()), (n, (n + 1) * MS, 30_000));
            assert!(!wakeup.overrun);
            time.advance(600_000);
        }
    }

    #[test]
    fn a_shift_moves_every_deadline_after_it() {
        let (clock, _time) = Clock::manual();
        let mut deadlines = Deadlines::new(clock, 1e-3).unwrap();
        deadlines.wait();
        for (by_ns, moved_ns) in [(2_000, 2_000), (-5_000, -3_000), (i64::MAX, 497_000), (i64::MIN, -3_000)] {
            deadlines.shift(by_ns);
            for _ in 0..2 {
                let wakeup = deadlines.wait();
                let due_ns = ((wakeup.tick + 1) * MS).saturating_add_signed(moved_ns);
                assert_eq!((wakeup.deadline_ns, wakeup.skipped), (due_ns, 0));
            }
        }
    }

    #[test]
    fn a_small_overrun_is_late_but_skips_nothing() {
        let (clock, time) = Clock::manual();
        let mut deadlines = Deadlines::new(clock, 1e-3).unwrap();
        deadlines.wait();
        time.advance(1_300_000);
        let late = deadlines.wait();
        // 0.3 ms late, and rested for 0.05 ms.
        assert_eq!((late.tick, late.skipped, late.overrun, late.lateness_ns()), (1, 0, true, 350_000));
        let next = deadlines.wait();
        assert_eq!((next.tick, next.overrun, next.lateness_ns()), (2, false, 0));
    }

    #[test]
    fn a_long_overrun_skips_whole_ticks_without_a_burst() {
        let (clock, time) = Clock::manual();
        let mut deadlines = Deadlines::new(clock, 1e-3).unwrap();
        deadlines.wait();
        time.advance(7_400_000);
        let late = deadlines.wait();
        assert_eq!((late.tick, late.skipped, late.deadline_ns, late.lateness_ns()), (7, 6, 8 * MS, 450_000));
        let next = deadlines.wait();
        assert_eq!((next.tick, next.skipped, next.overrun, next.deadline_ns), (8, 0, false, 9 * MS));
    }

    #[test]
    fn silly_periods_are_refused() {
        for period_s in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-6, 11.0] {
            let error = Deadlines::new(Clock::Monotonic, period_s).unwrap_err();
            assert!(error.to_string().contains("between 10 us and 10 s"));
        }
    }

    /// Served at once after every overrun, a loop whose ticks cost more than their period never slept: under `SCHED_FIFO` nothing
    /// else ran on its processor.
    #[test]
    fn a_loop_that_is_always_late_sleeps_all_the_same() {
        let (clock, time) = Clock::manual();
        let mut deadlines = Deadlines::new(clock.clone(), 1e-3).unwrap();
        let mut slept_ns = 0;
        for _ in 0..1000 {
            time.advance(2_600_000);
            let before_ns = clock.now_ns();
            let wakeup = deadlines.wait();
            assert!(wakeup.lateness_ns() < MS, "the newest deadline: {wakeup:?}");
            slept_ns += clock.now_ns() - before_ns;
        }
        assert_eq!(slept_ns, 1000 * MS / 20);
    }

    proptest! {
        /// Whatever the ticks cost: numbers and deadlines agree, every tick is run or counted as skipped, every wait rests.
        #[test]
        fn accounting_adds_up(costs_ns in prop::collection::vec(0..5 * MS, 1..200), late_ns in 0..MS / 2) {
            let (clock, time) = Clock::manual();
            time.wake_late_by(late_ns);
            let mut deadlines = Deadlines::new(clock, 1e-3).unwrap();
            let (mut run, mut skipped) = (0, 0);
            for cost_ns in costs_ns {
                let before_ns = deadlines.clock().now_ns();
                let wakeup = deadlines.wait();
                prop_assert!(wakeup.woke_ns - before_ns >= MS / 20);
                skipped += wakeup.skipped;
                prop_assert_eq!(wakeup.tick, run + skipped);
                prop_assert_eq!(wakeup.deadline_ns, (wakeup.tick + 1) * MS);
                prop_assert!(wakeup.woke_ns >= wakeup.deadline_ns);
                prop_assert!(wakeup.lateness_ns() < MS + late_ns);
                run += 1;
                time.advance(cost_ns);
            }
        }
    }
}
