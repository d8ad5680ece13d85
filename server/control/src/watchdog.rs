//! Is the other side still there? From the age of the newest sample to a ramp on the force.
//!
//! ```text
//! Waiting ──fresh sample──▶ Fresh ◀─▶ Extrapolating ◀─▶ Ramping ──ramp at 0──▶ Latched ──recover()──▶ Waiting
//!                             └───────────────trip()──────▶ Ramping (no way back) ──▶ Latched
//!                  any ──latch()──▶ Latched
//! ```
//! A short gap is bridged by extrapolation at full force, a longer one ramps the force to zero, and once at zero the fault is
//! latched: force comes back only after an explicit [`Watchdog::recover`], a fresh sample, and a slow ramp up. A sample that is
//! stale when it comes ends no waiting.
use crate::parameter::{ParameterError, not_negative, positive};

/// Times of the watchdog. libfranka, for comparison, stops an arm after 20 lost packets of 1 ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WatchdogSettings {
    /// Age (s) up to which a sample counts as fresh: a tick or two.
    pub fresh_for_s: f64,
    /// Age (s) beyond which the force ramps down; until then the sample is extrapolated.
    pub stale_after_s: f64,
    /// Time (s) the ramp to zero takes.
    pub ramp_to_zero_s: f64,
    /// Time (s) the ramp up takes after the first sample, or after recovery.
    pub ramp_up_s: f64,
}

/// A watchdog that is more patient (s) is none.
const LONGEST_S: f64 = 60.0;

impl Default for WatchdogSettings {
    /// At 1 kHz: fresh for 2 ticks, extrapolated to 5, zero by 17, which leaves 3 for the way to the arm until 20 are missed; back within 200 ms.
    fn default() -> Self {
        Self { fresh_for_s: 2e-3, stale_after_s: 5e-3, ramp_to_zero_s: 12e-3, ramp_up_s: 0.2 }
    }
}

impl WatchdogSettings {
    /// Checks them.
    ///
    /// # Errors
    /// [`ParameterError`] when one is not finite or out of order.
    pub fn checked(self) -> Result<Self, ParameterError> {
        not_negative("fresh_for_s", self.fresh_for_s)?;
        positive("stale_after_s", self.stale_after_s)?;
        positive("ramp_to_zero_s", self.ramp_to_zero_s)?;
        not_negative("ramp_up_s", self.ramp_up_s)?;
        for (name, value) in [("stale_after_s", self.stale_after_s), ("ramp_to_zero_s", self.ramp_to_zero_s)] {
            if value > LONGEST_S {
                return Err(ParameterError { name, value, rule: "must not be larger than 60" });
            }
        }
        if self.stale_after_s < self.fresh_for_s {
            let rule = "must not be smaller than fresh_for_s";
            return Err(ParameterError { name: "stale_after_s", value: self.stale_after_s, rule });
        }
        Ok(self)
    }
}

/// Why the force is off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// No sample for too long.
    Stale,
    /// Too many numbers were NaN or infinite.
    NonFinite,
    /// The other side said so (quarantined body, shutdown, another scene).
    Peer,
    /// Somebody asked for it (signal, end of the program).
    Requested,
    /// The arm itself failed, or was stopped.
    Device,
    /// Samples come, but too many of them too late.
    Unreliable,
    /// The loop itself stood still, and the force was taken away meanwhile.
    Stalled,
}

/// State of the link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Link {
    /// No fresh sample yet.
    Waiting,
    /// The newest sample is at most `fresh_for_s` old.
    Fresh,
    /// Older, and extrapolated.
    Extrapolating,
    /// The force is going down.
    Ramping(Fault),
    /// The force is zero until [`Watchdog::recover`].
    Latched(Fault),
}

/// What the loop does this tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// State of the link.
    pub link: Link,
    /// Factor of the force, 0 to 1.
    pub ramp: f64,
    /// Age of the newest sample (s); 0 while waiting.
    pub age_s: f64,
    /// Time (s) by which to extrapolate the sample: its age, never more than `stale_after_s`.
    pub extrapolate_s: f64,
}

/// Watches the age of the newest sample. Time is any monotonic clock in ns, passed in; it may stand still, and a step back
/// counts as standing still.
#[derive(Debug, Clone)]
pub struct Watchdog {
    settings: WatchdogSettings,
    newest_ns: Option<u64>,
    /// No sample has been fresh enough yet for a force.
    waiting: bool,
    checked_ns: Option<u64>,
    level: f64,
    tripped: Option<(Fault, u64)>,
    latched: Option<Fault>,
    faults: u64,
}

impl Watchdog {
    /// Waiting for a first sample, force at zero.
    pub fn new(settings: WatchdogSettings) -> Self {
        Self {
            settings,
            newest_ns: None,
            waiting: true,
            checked_ns: None,
            level: 0.0,
            tripped: None,
            latched: None,
            faults: 0,
        }
    }

    /// The settings.
    pub fn settings(&self) -> WatchdogSettings {
        self.settings
    }

    /// How often a fault was latched; a stop that was asked for is none.
    pub fn faults(&self) -> u64 {
        self.faults
    }

    /// A valid sample of the time `sample_ns`: when it was measured where that is known, else when it arrived.
    pub fn sample_arrived(&mut self, sample_ns: u64) {
        self.newest_ns = Some(self.newest_ns.map_or(sample_ns, |newest| newest.max(sample_ns)));
    }

    /// Ramps down from `now_ns` on, whatever samples arrive, and latches. The first reason stays.
    pub fn trip(&mut self, now_ns: u64, fault: Fault) {
        if self.latched.is_none() && self.tripped.is_none() {
            self.tripped = Some((fault, now_ns));
        }
    }

    /// Latches at once, for a force that is gone already. The first reason stays. Where no sample was fresh enough yet for a force, none is gone, and it goes on waiting.
    pub fn latch(&mut self, fault: Fault) {
        let has_force = !self.waiting || self.tripped.is_some();
        if self.latched.is_none() && has_force {
            let first = self.tripped.map_or(fault, |(first, _)| first);
            self.level = 0.0;
            self.hold_at_zero(first);
        }
    }

    /// Begins with a fault that was latched before: no force until it is recovered from. It is no new one.
    pub fn begin_latched(&mut self, fault: Fault) {
        self.latched = Some(fault);
        self.level = 0.0;
    }

    /// Leaves a latched fault: the next sample ramps the force up. False when nothing is latched.
    pub fn recover(&mut self) -> bool {
        let was_latched = self.latched.take().is_some();
        if was_latched {
            self.newest_ns = None;
            self.waiting = true;
        }
        was_latched
    }

    /// The verdict for the tick at `now_ns`.
    pub fn check(&mut self, now_ns: u64) -> Verdict {
        let since_check_s = self.checked_ns.map_or(0.0, |last| seconds(now_ns.saturating_sub(last)));
        self.checked_ns = Some(self.checked_ns.map_or(now_ns, |last| last.max(now_ns)));
        let age_s = self.newest_ns.map_or(0.0, |newest| seconds(now_ns.saturating_sub(newest)));
        let link = self.advance(now_ns, age_s, since_check_s);
        Verdict { link, ramp: self.level, age_s, extrapolate_s: age_s.min(self.settings.stale_after_s) }
    }

    fn advance(&mut self, now_ns: u64, age_s: f64, since_check_s: f64) -> Link {
        if let Some(fault) = self.latched {
            self.level = 0.0;
            return Link::Latched(fault);
        }
        if let Some((fault, tripped_ns)) = self.tripped {
            return self.ramp_down(fault, seconds(now_ns.saturating_sub(tripped_ns)));
        }
        let stale = age_s > self.settings.stale_after_s;
        if self.newest_ns.is_none() || (self.waiting && stale) {
            self.level = 0.0;
            return Link::Waiting;
        }
        self.waiting = false;
        if stale {
            return self.ramp_down(Fault::Stale, age_s - self.settings.stale_after_s);
        }
        let rise = if self.settings.ramp_up_s > 0.0 { since_check_s / self.settings.ramp_up_s } else { 1.0 };
        self.level = (self.level + rise).min(1.0);
        if age_s <= self.settings.fresh_for_s { Link::Fresh } else { Link::Extrapolating }
    }

    /// level ≤ 1 − t / ramp_to_zero: a function of time alone, so a late check cannot stretch the ramp.
    fn ramp_down(&mut self, fault: Fault, since_start_s: f64) -> Link {
        self.level = self.level.min(1.0 - since_start_s / self.settings.ramp_to_zero_s).max(0.0);
        if since_start_s < self.settings.ramp_to_zero_s {
            return Link::Ramping(fault);
        }
        self.hold_at_zero(fault);
        Link::Latched(fault)
    }

    fn hold_at_zero(&mut self, fault: Fault) {
        self.latched = Some(fault);
        self.tripped = None;
        self.faults += u64::from(fault != Fault::Requested);
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;

    /// Fed every millisecond until the ramp is up; returns the time of the last sample.
    fn running() -> (Watchdog, u64) {
        let mut watchdog = Watchdog::new(WatchdogSettings::default());
        for tick in 0..=300 {
            watchdog.sample_arrived(tick * MS);
            watchdog.check(tick * MS);
        }
        (watchdog, 300 * MS)
    }

    #[test]
    fn no_force_before_the_first_sample_and_a_slow_rise_after_it() {
        let mut watchdog = Watchdog::new(WatchdogSettings::default());
        let verdict = watchdog.check(5 * MS);
        assert_eq!((verdict.link, verdict.ramp), (Link::Waiting, 0.0));
        for tick in 6..=106 {
            watchdog.sample_arrived(tick * MS);
            watchdog.check(tick * MS);
        }
        // 101 checks of 1 ms on a ramp of 200 ms.
        let ramp = watchdog.check(106 * MS).ramp;
        assert!((ramp - 101.0 / 200.0).abs() < 1e-9, "{ramp}");
    }

    #[test]
    fn a_gap_is_extrapolated_then_ramped_then_latched_before_twenty_ticks() {
        let (mut watchdog, last) = running();
        for age in 1..=30_u64 {
            let verdict = watchdog.check(last + age * MS);
            let expected = match age {
                0..=2 => (Link::Fresh, 1.0),
                3..=5 => (Link::Extrapolating, 1.0),
                6..=16 => (Link::Ramping(Fault::Stale), 1.0 - (age as f64 - 5.0) / 12.0),
                _ => (Link::Latched(Fault::Stale), 0.0),
            };
            assert_eq!(verdict.link, expected.0, "at {age} ms");
            assert!((verdict.ramp - expected.1).abs() < 1e-9, "at {age} ms: {}", verdict.ramp);
            assert!((verdict.extrapolate_s - (age as f64 * 1e-3).min(5e-3)).abs() < 1e-12);
        }
        assert_eq!(watchdog.faults(), 1);
    }

    #[test]
    fn a_sample_during_the_ramp_brings_the_force_back_slowly() {
        let (mut watchdog, last) = running();
        for age in 1..=12 {
            watchdog.check(last + age * MS);
        }
        watchdog.sample_arrived(last + 13 * MS);
        let verdict = watchdog.check(last + 13 * MS);
        assert_eq!(verdict.link, Link::Fresh);
        assert!((verdict.ramp - (1.0 - 7.0 / 12.0 + 1.0 / 200.0)).abs() < 1e-9, "{}", verdict.ramp);
    }

    #[test]
    fn a_latched_fault_stays_until_recovered_and_then_needs_a_sample() {
        let (mut watchdog, last) = running();
        watchdog.check(last + 40 * MS);
        for tick in 41..60 {
            watchdog.sample_arrived(last + tick * MS);
            assert_eq!(watchdog.check(last + tick * MS).link, Link::Latched(Fault::Stale));
        }
        assert!(watchdog.recover());
        assert!(!watchdog.recover());
        assert_eq!(watchdog.check(last + 60 * MS).link, Link::Waiting);
        watchdog.sample_arrived(last + 61 * MS);
        let verdict = watchdog.check(last + 61 * MS);
        assert_eq!(verdict.link, Link::Fresh);
        assert!(verdict.ramp <= 1.0 / 200.0 + 1e-12, "the force must not jump: {}", verdict.ramp);
    }

    #[test]
    fn a_sample_that_is_stale_when_it_comes_ends_no_waiting_and_is_no_fault() {
        let mut watchdog = Watchdog::new(WatchdogSettings::default());
        watchdog.sample_arrived(0);
        let verdict = watchdog.check(100 * MS);
        assert_eq!((verdict.link, verdict.ramp, watchdog.faults()), (Link::Waiting, 0.0, 0));
        watchdog.sample_arrived(200 * MS);
        assert_eq!(watchdog.check(200 * MS).link, Link::Fresh);
    }

    #[test]
    fn a_trip_ramps_down_although_samples_arrive() {
        let (mut watchdog, last) = running();
        watchdog.trip(last, Fault::Requested);
        watchdog.trip(last + MS, Fault::Peer);
        for tick in 1..=12 {
            watchdog.sample_arrived(last + tick * MS);
            watchdog.check(last + tick * MS);
        }
        let verdict = watchdog.check(last + 12 * MS);
        assert_eq!((verdict.link, verdict.ramp, watchdog.faults()), (Link::Latched(Fault::Requested), 0.0, 0));
    }

    #[test]
    fn what_is_latched_at_once_ramps_nothing_and_keeps_the_first_reason() {
        let (mut watchdog, last) = running();
        watchdog.latch(Fault::Stalled);
        watchdog.latch(Fault::Peer);
        watchdog.sample_arrived(last + MS);
        let verdict = watchdog.check(last + MS);
        assert_eq!((verdict.link, verdict.ramp, watchdog.faults()), (Link::Latched(Fault::Stalled), 0.0, 1));
        assert!(watchdog.recover());
        watchdog.trip(last + 2 * MS, Fault::Requested);
        watchdog.latch(Fault::Stalled);
        assert_eq!(watchdog.check(last + 2 * MS).link, Link::Latched(Fault::Requested), "a stop that was asked for");
        assert_eq!(watchdog.faults(), 1);
        let mut waits = Watchdog::new(WatchdogSettings::default());
        waits.latch(Fault::Stalled);
        assert_eq!((waits.check(MS).link, waits.faults()), (Link::Waiting, 0));
    }

    #[test]
    fn a_fault_of_before_is_latched_from_the_start() {
        let mut watchdog = Watchdog::new(WatchdogSettings::default());
        watchdog.begin_latched(Fault::Device);
        for tick in 1..300 {
            watchdog.sample_arrived(tick * MS);
            let verdict = watchdog.check(tick * MS);
            assert_eq!((verdict.link, verdict.ramp), (Link::Latched(Fault::Device), 0.0));
        }
        assert_eq!(watchdog.faults(), 0);
        assert!(watchdog.recover());
        watchdog.sample_arrived(300 * MS);
        assert_eq!(watchdog.check(300 * MS).link, Link::Fresh);
    }

    #[test]
    fn a_loop_that_slept_through_the_ramp_finds_zero() {
        let (mut watchdog, last) = running();
        assert_eq!(watchdog.check(last + 500 * MS).ramp, 0.0);
    }

    #[test]
    fn time_that_steps_back_is_harmless() {
        let (mut watchdog, last) = running();
        let verdict = watchdog.check(last - 100 * MS);
        assert_eq!((verdict.link, verdict.age_s), (Link::Fresh, 0.0));
    }

    #[test]
    fn settings_out_of_order_are_refused() {
        let bad = WatchdogSettings { stale_after_s: 1e-3, ..WatchdogSettings::default() };
        assert_eq!(bad.checked().unwrap_err().name, "stale_after_s");
        let bad = WatchdogSettings { ramp_to_zero_s: 1e20, ..WatchdogSettings::default() };
        assert_eq!(bad.checked().unwrap_err().name, "ramp_to_zero_s");
        let bad = WatchdogSettings { ramp_to_zero_s: f64::NAN, ..WatchdogSettings::default() };
        assert_eq!(bad.checked().unwrap_err().name, "ramp_to_zero_s");
    }

    proptest! {
        /// Whatever arrives whenever: the ramp never jumps up, and it is zero 17 ms after the last sample.
        #[test]
        fn the_ramp_never_jumps_up(steps in prop::collection::vec((0_u64..4 * MS, any::<bool>()), 1..400)) {
            let mut watchdog = Watchdog::new(WatchdogSettings::default());
            let (mut now, mut previous, mut last_sample) = (0, 0.0, None);
            for (step, arrives) in steps {
                now += step;
                if arrives {
                    watchdog.sample_arrived(now);
                    last_sample = Some(now);
                }
                let verdict = watchdog.check(now);
                prop_assert!((0.0..=1.0).contains(&verdict.ramp));
                prop_assert!(verdict.ramp - previous <= seconds(step) / 0.2 + 1e-12);
                if last_sample.is_none_or(|at| now - at >= 17 * MS) {
                    prop_assert_eq!(verdict.ramp, 0.0);
                }
                previous = verdict.ramp;
            }
        }
    }
}
