//! What was counted until one time, and its words.
use palpate_control::{Fault, Link};
use palpate_realtime::Percentiles;
use std::fmt;

/// Counters at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)] // as in Stats
pub struct Summary {
    pub sent: u64,
    pub dropped_up: u64,
    pub received: u64,
    pub rejected: u64,
    pub dropped_down: u64,
    pub peer_faults: u64,
    pub reconnects: u64,
    pub latched: u64,
    pub saturated: u64,
    pub rate_limited: u64,
    pub non_finite: u64,
    pub damped: u64,
    pub peak_force_n: f64,
    pub final_force_n: f64,
    pub link: Link,
    pub round_trip: Percentiles,
    pub waited: Percentiles,
    pub judged: u64,
    pub in_time: u64,
    pub ticks: u64,
    pub overruns: u64,
    pub skipped: u64,
    pub wakeup_lateness: Percentiles,
    pub tick_cost: Percentiles,
}

/// Why a force goes down, in words.
pub(crate) fn reason(fault: Fault) -> &'static str {
    match fault {
        Fault::Stale => "no answer to a fresh pose for too long",
        Fault::NonFinite => "the arm's position is not finite",
        Fault::Peer => "the daemon stopped the force",
        Fault::Requested => "stopping",
        Fault::Device => "the arm is lost",
        Fault::Unreliable => "too many answers came too late",
        Fault::Stalled => "this program stood still, and its guard took the force away",
    }
}

impl Summary {
    /// Share of the ticks since the first answer in which the newest was in time.
    pub fn share_in_time(&self) -> Option<f64> {
        (self.judged > 0).then(|| self.in_time as f64 / self.judged as f64)
    }

    /// The fault that keeps the arm without force; a stop that was asked for is none.
    pub fn latched_fault(&self) -> Option<Fault> {
        match self.link {
            Link::Latched(fault) if fault != Fault::Requested => Some(fault),
            _ => None,
        }
    }

    /// The most important counters in one line, for logs while the bridge runs.
    /// `recent_peak_n` is [`super::Stats::take_recent_peak_n`].
    pub fn line(&self, recent_peak_n: f64) -> String {
        let us = |ns: u64| ns as f64 / 1e3;
        let trip = match &self.round_trip {
            trip if trip.count == 0 => "no trip measured".to_owned(),
            trip => format!("pose to force p50 {:.0} us, p99 {:.0} us", us(trip.p50_ns), us(trip.p99_ns)),
        };
        let state = self
            .latched_fault()
            .map_or_else(String::new, |fault| format!("; without force, a fault is latched: {}", reason(fault)));
        format!(
            "force up to {:.3} N since the last report, {:.3} N since the start; {} samples sent, {} commands received, {trip}; \
             {} overruns, {} reconnects{state}",
            recent_peak_n, self.peak_force_n, self.sent, self.received, self.overruns, self.reconnects
        )
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |ns: u64| ns as f64 / 1e3;
        writeln!(
            f,
            "stream   {} samples sent ({} dropped), {} commands received ({} refused, {} dropped), {} reconnects",
            self.sent, self.dropped_up, self.received, self.rejected, self.dropped_down, self.reconnects
        )?;
        let trip = &self.round_trip;
        if trip.count == 0 {
            writeln!(f, "trip     pose to force: none measured")?;
        } else {
            let (p50, p99, max) = (us(trip.p50_ns), us(trip.p99_ns), us(trip.max_ns));
            write!(f, "trip     pose to force p50 {p50:.0} us, p99 {p99:.0} us, max {max:.0} us")?;
            if self.waited.count > 0 {
                write!(f, ", of which {:.0} us (p50) the pose waited for its tick", us(self.waited.p50_ns))?;
            }
            let share = self.share_in_time().unwrap_or(0.0);
            writeln!(f, "; an answer in time in {:.2} % of ticks", 1e2 * share)?;
        }
        writeln!(
            f,
            "servo    {} ticks, {} overruns, {} skipped; woke late p50 {:.1} us, p99 {:.1} us, max {:.1} us; cost p99 {:.1} us",
            self.ticks,
            self.overruns,
            self.skipped,
            us(self.wakeup_lateness.p50_ns),
            us(self.wakeup_lateness.p99_ns),
            us(self.wakeup_lateness.max_ns),
            us(self.tick_cost.p99_ns)
        )?;
        write!(
            f,
            "force    peak {:.3} N; ticks limited: peak {}, rate {}, passivity {}, not finite {}; faults: {} latched, {} reported \
             by the daemon",
            self.peak_force_n,
            self.saturated,
            self.rate_limited,
            self.damped,
            self.non_finite,
            self.latched,
            self.peer_faults
        )?;
        if let Some(fault) = self.latched_fault() {
            write!(
                f,
                "\nstate    without force at the end, since a fault is latched: {}. SIGUSR1 while the bridge runs, or a new start, \
                 lets the force come back; under --auto-recover it comes back by itself once the daemon answers steadily",
                reason(fault)
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stats;

    /// The line of counters was an empty message with the table below it: a log that is searched by line had nothing of it.
    #[test]
    fn the_counters_in_one_line_say_force_and_fault() {
        let stats = Stats::default();
        stats.set_force(0.5);
        stats.set_link(Link::Fresh);
        let line = stats.summary().line(stats.take_recent_peak_n());
        assert!(
            line.starts_with("force up to 0.500 N since the last report, 0.500 N since the start; 0 samples")
                && !line.contains('\n'),
            "{line}"
        );
        assert!(!line.contains("zero"), "{line}");
        stats.set_link(Link::Latched(Fault::Peer));
        let line = stats.summary().line(stats.take_recent_peak_n());
        assert!(line.ends_with("; without force, a fault is latched: the daemon stopped the force"), "{line}");
    }
}
