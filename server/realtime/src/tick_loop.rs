//! A loop on a grid of deadlines, with its own measurements.
use crate::{
    clock::Clock,
    deadline::{Deadlines, PeriodError, Wakeup},
    histogram::Histogram,
};
use std::{
    ops::ControlFlow,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

/// What the loop measures of itself; any thread reads it.
#[derive(Debug, Default)]
pub struct LoopMonitor {
    /// How late each tick woke (ns).
    pub wakeup_lateness: Histogram,
    /// What each tick cost, from wake-up to the end of its work (ns).
    pub tick_cost: Histogram,
    ticks: AtomicU64,
    overruns: AtomicU64,
    skipped: AtomicU64,
}

impl LoopMonitor {
    /// Ticks run.
    pub fn ticks(&self) -> u64 {
        self.ticks.load(Ordering::Relaxed)
    }

    /// Ticks whose work ended after the next deadline.
    pub fn overruns(&self) -> u64 {
        self.overruns.load(Ordering::Relaxed)
    }

    /// Ticks never run, because earlier ones took so long.
    pub fn skipped(&self) -> u64 {
        self.skipped.load(Ordering::Relaxed)
    }

    fn woke(&self, wakeup: &Wakeup) {
        self.wakeup_lateness.record(wakeup.lateness_ns());
        self.ticks.fetch_add(1, Ordering::Relaxed);
        self.overruns.fetch_add(u64::from(wakeup.overrun), Ordering::Relaxed);
        self.skipped.fetch_add(wakeup.skipped, Ordering::Relaxed);
    }
}

/// Waits for each deadline, calls, measures. Neither allocates nor locks.
#[derive(Debug)]
pub struct TickLoop {
    deadlines: Deadlines,
    monitor: Arc<LoopMonitor>,
}

impl TickLoop {
    /// A loop of the given period (s); its first tick is one period after [`TickLoop::run`] begins.
    ///
    /// # Errors
    /// [`PeriodError`] when the period is not between 10 µs and 10 s.
    pub fn new(clock: Clock, period_s: f64) -> Result<Self, PeriodError> {
        Ok(Self { deadlines: Deadlines::new(clock, period_s)?, monitor: Arc::new(LoopMonitor::default()) })
    }

    /// Another period (s) from the next [`TickLoop::run`] on.
    ///
    /// # Errors
    /// [`PeriodError`]; the period stays.
    pub fn set_period(&mut self, period_s: f64) -> Result<(), PeriodError> {
        self.deadlines = Deadlines::new(self.deadlines.clock().clone(), period_s)?;
        Ok(())
    }

    /// Measures into `monitor` from now on.
    #[must_use]
    pub fn measured_in(self, monitor: Arc<LoopMonitor>) -> Self {
        Self { monitor, ..self }
    }

    /// The measurements.
    pub fn monitor(&self) -> Arc<LoopMonitor> {
        Arc::clone(&self.monitor)
    }

    /// The clock.
    pub fn clock(&self) -> &Clock {
        self.deadlines.clock()
    }

    /// Runs `tick` at every deadline on this thread until it breaks. An overrun is counted when the next deadline is waited for,
    /// so the work that ends the loop is never counted as one.
    pub fn run(&mut self, mut tick: impl FnMut(&Wakeup) -> ControlFlow<()>) {
        self.run_shifted(|wakeup| match tick(wakeup) {
            ControlFlow::Continue(()) => ControlFlow::Continue(0),
            ControlFlow::Break(()) => ControlFlow::Break(()),
        });
    }

    /// As [`TickLoop::run`], on a grid that each tick may move: by how much (ns) all ticks after it are later, or earlier.
    pub fn run_shifted(&mut self, mut tick: impl FnMut(&Wakeup) -> ControlFlow<(), i64>) {
        self.deadlines.restart();
        loop {
            let wakeup = self.deadlines.wait();
            self.monitor.woke(&wakeup);
            let flow = tick(&wakeup);
            self.monitor.tick_cost.record(self.deadlines.clock().now_ns().saturating_sub(wakeup.woke_ns));
            match flow {
                ControlFlow::Continue(0) => {}
                ControlFlow::Continue(by_ns) => self.deadlines.shift(by_ns),
                ControlFlow::Break(()) => return,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_ticks_overruns_and_skips_on_a_manual_clock() {
        let (clock, time) = Clock::manual();
        let mut tick_loop = TickLoop::new(clock, 1e-3).unwrap();
        let monitor = tick_loop.monitor();
        time.advance(5_000_000_000);
        time.wake_late_by(40_000);
        let mut ticks = Vec::new();
        tick_loop.run(|wakeup| {
            ticks.push(wakeup.tick);
            // 0.5 ms of work; 3.5 ms in every fourth.
            time.advance(if ticks.len() % 4 == 0 { 3_500_000 } else { 500_000 });
            if ticks.len() == 12 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        // Two skipped after each long tick. The late tick that follows ends after its next deadline too, by 40 us: four overruns.
        // The time before run() is no overrun.
        assert_eq!(ticks, [0, 1, 2, 3, 6, 7, 8, 9, 12, 13, 14, 15]);
        assert_eq!((monitor.ticks(), monitor.overruns(), monitor.skipped()), (12, 4, 4));
        let lateness = monitor.wakeup_lateness.percentiles();
        assert_eq!(lateness.count, 12);
        assert_eq!(
            lateness.max_ns, 630_000,
            "40 us late, 3.5 ms of work, 50 us of rest, 40 us late again: 0.63 ms after 7 ms"
        );
        assert_eq!(monitor.tick_cost.percentiles().max_ns, 3_500_000);
    }

    #[test]
    fn another_period_takes_another_grid_and_the_same_measurements() {
        let (clock, time) = Clock::manual();
        let mut tick_loop = TickLoop::new(clock.clone(), 1e-3).unwrap().measured_in(Arc::default());
        let monitor = tick_loop.monitor();
        tick_loop.run(|_| ControlFlow::Break(()));
        time.advance(7_300_000);
        assert!(tick_loop.set_period(f64::NAN).is_err());
        tick_loop.set_period(5e-3).unwrap();
        let before_ns = clock.now_ns();
        tick_loop.run(|wakeup| {
            assert_eq!(wakeup.woke_ns - before_ns, (wakeup.tick + 1) * 5_000_000);
            if wakeup.tick == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!((monitor.ticks(), monitor.overruns(), monitor.skipped()), (4, 0, 0));
    }

    #[test]
    fn keeps_a_real_grid() {
        let mut tick_loop = TickLoop::new(Clock::Monotonic, 1e-3).unwrap();
        let began_ns = Clock::Monotonic.now_ns();
        let mut last = 0;
        tick_loop.run(|wakeup| {
            assert!(wakeup.woke_ns >= wakeup.deadline_ns);
            last = wakeup.tick;
            if wakeup.tick >= 49 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        // Tick n is due n + 1 periods after the start, whatever was skipped.
        assert!(Clock::Monotonic.now_ns() - began_ns >= (last + 1) * 1_000_000);
    }
}
