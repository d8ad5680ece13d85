//! When an arm's loop runs beside the daemon's: so that a pose arrives just before it is used.
//!
//! Two loops of one rate meet at any phase: a pose that arrives just after a tick began waits a whole period T for the next, and its
//! force is as old. The daemon says of each pose how long it waited, w (ns). With the margin m wanted,
//!
//! ```text
//! e = wrap(w − m)                   wrapped into (−T/2, T/2]
//! ```
//!
//! is above zero where the pose came earlier than it need have, and below where it missed its tick. The arm's loop moves its grid by
//!
//! ```text
//! s = K e,  |s| ≤ T/500             later where above zero
//! ```
//!
//! for every pose that it hears of: a rate wrong by two thousandths while it finds its phase, which takes a quarter of a second at most,
//! and the phase then follows clocks that drift apart. An answer that is D periods old makes the loop e' = −K e(t − D), which is stable for
//! K D < π/2; K = min(1/50, 1/(8 D)).
//!
//! The margin is what the jitter of both loops and of the network asks for: with d the mean of |wrap(w_k − w_{k−1})|, which for normal
//! jitter of deviation σ is 2σ/√π,
//!
//! ```text
//! m = 20 µs + 3 d ≤ T/4             3.4 σ: one pose in three thousand misses its tick
//! ```

/// Largest gain.
const GAIN: f64 = 1.0 / 50.0;
/// Share of a period by which the grid moves at most for a pose.
const SLEW: f64 = 1.0 / 500.0;
/// Least margin (ns).
const LEAST_MARGIN_NS: f64 = 20_000.0;
/// Margin in mean differences of waits.
const MARGIN_PER_JITTER: f64 = 3.0;
/// Largest margin, as a share of a period.
const LARGEST_MARGIN: f64 = 0.25;
/// Weight of a new difference in their mean.
const FORGETTING: f64 = 1.0 / 128.0;

/// What an answer says of the pose that it answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wait {
    /// For how long (ns) the pose had been with the daemon when a tick took it.
    pub waited_ns: u64,
    /// Age (ns) of the pose when the answer arrived.
    pub answered_after_ns: u64,
    /// Period (ns) of the daemon's tick.
    pub tick_period_ns: u64,
}

/// Moves a loop's grid to where its poses are used soon after they arrive.
#[derive(Debug, Clone)]
#[allow(clippy::struct_field_names)] // units
pub struct PhaseLock {
    period_ns: f64,
    last_waited_ns: Option<f64>,
    jitter_ns: f64,
}

impl PhaseLock {
    /// Of a loop of this period (ns).
    pub fn new(period_ns: u64) -> Self {
        Self { period_ns: period_ns as f64, last_waited_ns: None, jitter_ns: 0.0 }
    }

    /// By how much (ns) the next tick, and all after it, are to be later (below zero: earlier), hearing this of a pose.
    ///
    /// Zero where no phase can be kept: neither period is a multiple of the other.
    pub fn heard(&mut self, wait: &Wait) -> i64 {
        let Some(common_ns) = common_period(self.period_ns, wait.tick_period_ns as f64) else { return 0 };
        let waited_ns = wait.waited_ns as f64;
        if let Some(last_ns) = self.last_waited_ns.replace(waited_ns) {
            // One that stands out, as when the machine stood still, says little of the others.
            let apart_ns = wrapped(waited_ns - last_ns, common_ns).abs().min(0.125 * common_ns);
            self.jitter_ns += FORGETTING * (apart_ns - self.jitter_ns);
        }
        let error_ns = wrapped(waited_ns - self.margin_ns(common_ns), common_ns);
        let ticks_old = wait.answered_after_ns as f64 / common_ns;
        let gain = GAIN.min(1.0 / (8.0 * ticks_old.max(1.0)));
        let most_ns = SLEW * common_ns;
        (gain * error_ns).clamp(-most_ns, most_ns).round() as i64
    }

    /// For how long (ns) a pose is to wait.
    fn margin_ns(&self, common_ns: f64) -> f64 {
        (LEAST_MARGIN_NS + MARGIN_PER_JITTER * self.jitter_ns).min(LARGEST_MARGIN * common_ns)
    }
}

/// The shorter period, where the longer is a multiple of it.
fn common_period(a_ns: f64, b_ns: f64) -> Option<f64> {
    let (short_ns, long_ns) = (a_ns.min(b_ns), a_ns.max(b_ns));
    let ratio = long_ns / short_ns;
    (ratio.is_finite() && (ratio - ratio.round()).abs() < 0.01).then_some(short_ns)
}

/// Into (−period/2, period/2].
fn wrapped(ns: f64, period_ns: f64) -> f64 {
    let rest = ns.rem_euclid(period_ns);
    if rest > 0.5 * period_ns { rest - period_ns } else { rest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::{
        prelude::*,
        test_runner::{RngAlgorithm, TestRng},
    };

    const MS: f64 = 1e6;

    /// An arm's loop and the daemon's, whose clocks, network and threads are not perfect. Times in ns.
    #[derive(Debug, Clone, Copy)]
    struct World {
        arm_period: f64,
        daemon_period: f64,
        /// Where in its period the daemon's grid begins.
        begins: f64,
        /// The way up.
        up: f64,
        /// Half the width of what is added to it, evenly drawn.
        jitter: f64,
        /// From the tick to the arm.
        down: f64,
        /// The daemon's clock is too fast by this share.
        drift: f64,
    }

    const WORLD: World =
        World { arm_period: MS, daemon_period: MS, begins: 0.0, up: 30e3, jitter: 0.0, down: 100e3, drift: 0.0 };

    /// Waits of the poses of the last half of so many seconds, and the farthest that the grid moved within them.
    fn lived(world: World, seconds: f64) -> (Vec<f64>, f64) {
        let mut rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
        let mut lock = PhaseLock::new(world.arm_period as u64);
        let period = world.daemon_period * (1.0 - world.drift);
        let (mut now, mut moved, mut waits) = (0.0, 0.0_f64, Vec::new());
        let (mut answers, mut taken_by) = (std::collections::VecDeque::<(f64, Wait)>::new(), 0.0);
        let mut range = (f64::MAX, f64::MIN);
        while now < seconds * 1e9 {
            let arrives = now + world.up + world.jitter * rng.random_range(-1.0..=1.0);
            let tick = ((arrives - world.begins) / period).ceil();
            // Where two poses wait for one tick, the newer is taken: here, the first, which is harder.
            if tick > taken_by {
                taken_by = tick;
                let taken = world.begins + tick * period;
                let wait = Wait {
                    waited_ns: (taken - arrives) as u64,
                    answered_after_ns: (taken + world.down - now) as u64,
                    tick_period_ns: world.daemon_period as u64,
                };
                answers.push_back((taken + world.down, wait));
                if now > 0.5e9 * seconds {
                    waits.push(taken - arrives);
                }
            }
            let mut shift = 0.0;
            while answers.front().is_some_and(|(at, _)| *at <= now) {
                let (_, wait) = answers.pop_front().unwrap();
                shift += lock.heard(&wait) as f64;
            }
            moved += shift;
            if now > 0.5e9 * seconds {
                range = (range.0.min(moved), range.1.max(moved));
            }
            now += world.arm_period + shift;
        }
        (waits, range.1 - range.0)
    }

    fn quantile(mut waits: Vec<f64>, share: f64) -> f64 {
        waits.sort_by(f64::total_cmp);
        waits[(share * (waits.len() - 1) as f64) as usize]
    }

    #[test]
    fn a_pose_comes_just_before_it_is_used_whatever_the_phase_was() {
        for begins in [0.0, 0.04, 0.2, 0.5, 0.52, 0.7, 0.99] {
            let (waits, moved) = lived(World { begins: begins * MS, ..WORLD }, 2.0);
            let worst = waits.iter().map(|wait| (wait - LEAST_MARGIN_NS).abs()).fold(0.0, f64::max);
            assert!(worst < 100.0 && moved < 100.0, "from {begins}: {worst} ns off the margin, moved by {moved} ns");
        }
    }

    #[test]
    fn jitter_widens_the_margin_and_few_poses_are_late() {
        for jitter in [5e3, 20e3, 60e3] {
            let (waits, _) = lived(World { begins: 0.6 * MS, jitter, ..WORLD }, 20.0);
            let late = waits.iter().filter(|wait| **wait > 0.5 * MS).count() as f64 / waits.len() as f64;
            let median = quantile(waits, 0.5);
            assert!(late < 2e-3, "{jitter}: {late} late");
            assert!(median < LEAST_MARGIN_NS + 2.5 * jitter, "{jitter}: {median} ns of wait");
        }
    }

    #[test]
    fn it_follows_clocks_that_drift_apart() {
        for drift in [-2e-4, 2e-4] {
            let (waits, _) = lived(World { drift, jitter: 5e3, ..WORLD }, 10.0);
            let late = waits.iter().filter(|wait| **wait > 0.5 * MS).count() as f64 / waits.len() as f64;
            assert!(late < 2e-3 && quantile(waits, 0.5) < 70e3, "{late} late");
        }
    }

    #[test]
    fn one_rate_may_be_a_multiple_of_the_other() {
        for (arm_period, daemon_period) in [(0.25 * MS, MS), (2.0 * MS, MS), (MS, 4.0 * MS)] {
            let world = World { arm_period, daemon_period, begins: 0.37 * MS, ..WORLD };
            let (waits, _) = lived(world, 8.0);
            let median = quantile(waits, 0.5).rem_euclid(arm_period.min(daemon_period));
            assert!((median - LEAST_MARGIN_NS).abs() < 500.0, "{world:?}: {median} ns");
        }
    }

    /// Answers across a network are old: a gain for young ones would make the phase swing.
    #[test]
    fn old_answers_make_it_slow_and_not_unstable() {
        for old in [20.0, 100.0, 400.0] {
            let (waits, moved) = lived(World { begins: 0.45 * MS, down: old * MS, ..WORLD }, 60.0);
            assert!(moved < 2e3, "{old} ms: it swings by {moved} ns");
            // The grid moves by whole nanoseconds: less than half of one moves nothing.
            let off_ns = (quantile(waits, 0.5) - LEAST_MARGIN_NS).abs();
            assert!(off_ns < 500.0 + 0.5 * 8.0 * old, "{old} ms: {off_ns} ns off the margin");
        }
    }

    #[test]
    fn without_a_common_period_nothing_moves() {
        let mut lock = PhaseLock::new(1_000_000);
        for tick_period_ns in [0, 700_000, 1_400_000, u64::MAX] {
            assert_eq!(lock.heard(&Wait { waited_ns: 500_000, answered_after_ns: 1, tick_period_ns }), 0);
        }
    }

    proptest! {
        /// Whatever it hears, the rate is wrong by two thousandths at most.
        #[test]
        fn it_never_moves_by_more_than_it_may(heard in prop::collection::vec((any::<u64>(), any::<u64>(), 0..3_usize), 1..200)) {
            let mut lock = PhaseLock::new(1_000_000);
            for (waited_ns, answered_after_ns, period) in heard {
                let tick_period_ns = [1_000_000, 2_000_000, 500_000][period];
                let moved_ns = lock.heard(&Wait { waited_ns, answered_after_ns, tick_period_ns });
                prop_assert!(moved_ns.abs() <= 2_000, "{moved_ns} ns");
            }
        }
    }
}
