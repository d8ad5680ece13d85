//! How much time passed between two poses: by the server's clock where that can be believed, else by when they came.
//!
//! A network tells poses late, some more than others. A pose that came 20 ms late and the next one, which came in time, are
//! 1 ms apart by arrival and 21 ms by the way of the arm: a velocity made from arrivals would be twenty times the true one for
//! a tick. VRPN writes into each message when it was made.
use super::wire::Time;

/// Length of a block (s): so long both clocks must agree before the poses of the next block are believed.
const BLOCK_S: f64 = 0.1;
/// The two clocks agree on a block when they differ by no more than this and a quarter of its time (s).
const LATE_S: f64 = 0.02;
/// No pause between poses is taken from the server's clock beyond this (s): its day may have been set.
const LONGEST_S: f64 = 1.0;

/// Compares the server's clock with ours.
///
/// A server's clock may stand still, count in coarse steps or be set while it runs. So poses are believed by blocks: in the
/// block before, every pose was later than the one before it, and both clocks told about the same time for all of it.
#[derive(Debug, Clone, Default)]
pub struct SenderClock {
    last: Option<Time>,
    /// A pose of this block was not later than the one before.
    is_broken: bool,
    stamped_s: f64,
    arrived_s: f64,
    is_believed: bool,
}

impl SenderClock {
    /// The time (s) between this pose and the one before it, of which it came `arrived_s` after.
    pub fn passed_s(&mut self, time: Time, arrived_s: f64) -> f64 {
        let Some(last) = self.last.replace(time) else { return arrived_s };
        let stamped_s = seconds_between(last, time);
        let is_sound = stamped_s > 0.0 && stamped_s <= LONGEST_S;
        self.is_broken |= !is_sound;
        self.stamped_s += stamped_s;
        self.arrived_s += arrived_s;
        let passed_s = if self.is_believed && is_sound { stamped_s } else { arrived_s };
        if self.arrived_s >= BLOCK_S {
            let apart_s = (self.stamped_s - self.arrived_s).abs();
            self.is_believed = !self.is_broken && apart_s <= LATE_S + 0.25 * self.arrived_s;
            (self.is_broken, self.stamped_s, self.arrived_s) = (false, 0.0, 0.0);
        }
        passed_s
    }
}

fn seconds_between(from: Time, to: Time) -> f64 {
    (f64::from(to.s) - f64::from(from.s)) + 1e-6 * (f64::from(to.us) - f64::from(from.us))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(us: u64) -> Time {
        Time { s: (us / 1_000_000) as u32, us: (us % 1_000_000) as u32 }
    }

    /// What is said to have passed for each of many poses, all made every millisecond; the server's clock says `clock(ms)` (µs), and
    /// every 20th pose comes 15 ms late with those made meanwhile behind it.
    fn told(clock: impl Fn(u64) -> u64) -> Vec<f64> {
        let mut sender = SenderClock::default();
        let comes_at = |ms: u64| if ms % 20 < 15 { ms - ms % 20 + 15 } else { ms };
        let (mut before, mut said) = (0, Vec::new());
        for ms in 0..1000 {
            // Several that come in one tick: only the last counts, as the driver has it.
            if comes_at(ms) != comes_at(ms + 1) {
                said.push(sender.passed_s(at(clock(ms)), (comes_at(ms) - before) as f64 * 1e-3));
                before = comes_at(ms);
            }
        }
        said
    }

    #[test]
    fn a_clock_that_runs_is_believed_after_a_block() {
        let mut sender = SenderClock::default();
        let mut come = |ms: u64, arrived_s| sender.passed_s(at(1_000_000 + 1000 * ms), arrived_s);
        let late = |ms: u64| if ms % 7 == 6 { 5e-3 } else { 1e-3 / 3.0 };
        let said: Vec<f64> = (0..200).map(|ms| come(ms, late(ms))).collect();
        assert!((0..100).all(|ms| said[ms] == late(ms as u64)), "arrivals at first");
        assert!(said[110..].iter().all(|passed_s| (passed_s - 1e-3).abs() < 1e-9), "then the server's clock");
    }

    #[test]
    fn clocks_that_stand_step_or_run_wild_are_not() {
        for clock in [|_| 7, |ms| ms / 16 * 16_000, |ms| 5_000_000 - ms, |ms| ms, |ms| 20_000 * ms] {
            let said = told(clock);
            let way_s: f64 = said.iter().sum();
            assert!((way_s - 1.0).abs() < 0.03, "{way_s}");
        }
        // One that is set while it runs costs no more than its own pose.
        let said = told(|ms| 1000 * ms + if ms > 500 { 3_600_000_000 } else { 0 });
        assert!((said.iter().sum::<f64>() - 1.0).abs() < 0.06 && said.iter().all(|passed_s| *passed_s < 0.03));
    }
}
