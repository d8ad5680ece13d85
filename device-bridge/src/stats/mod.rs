//! What the bridge counts. Written by the servo and the uplink, read by anybody.
mod summary;

use crate::device;
use palpate_control::{Fault, Link};
use palpate_realtime::{Histogram, LoopMonitor, Percentiles};
use std::{
    net::SocketAddr,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicU8, AtomicU64, Ordering},
    },
};
pub use summary::Summary;
pub(crate) use summary::reason;

/// A counter.
#[derive(Debug, Default)]
pub struct Counter(AtomicU64);

impl Counter {
    /// One more.
    pub fn increment(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    /// So many more.
    pub fn add(&self, count: u64) {
        self.0.fetch_add(count, Ordering::Relaxed);
    }

    /// Sets it.
    pub fn set(&self, value: u64) {
        self.0.store(value, Ordering::Relaxed);
    }

    /// Its value.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Everything counted since the start.
#[derive(Debug, Default)]
pub struct Stats {
    /// Samples given to the stream.
    pub sent: Counter,
    /// Samples overwritten by newer ones before the stream took them.
    pub dropped_up: Counter,
    /// Commands accepted.
    pub received: Counter,
    /// Messages refused because a part was bad.
    pub rejected: Counter,
    /// Commands overwritten by newer ones before the servo took them.
    pub dropped_down: Counter,
    /// Faults that the daemon reported.
    pub peer_faults: Counter,
    /// Times the arm was attached.
    pub attached: Counter,
    /// Attempts to connect that failed, and streams that broke.
    pub failures: Counter,
    /// Faults latched by the watchdog.
    pub latched: Counter,
    /// Ticks whose force was cut to the peak.
    pub saturated: Counter,
    /// Ticks whose force was held back by the rate.
    pub rate_limited: Counter,
    /// Ticks whose force or reading was not finite.
    pub non_finite: Counter,
    /// Ticks in which the passivity controller damped.
    pub damped: Counter,
    /// Of the VRPN server.
    pub vrpn_server: VrpnStats,
    /// From reading the arm to receiving the first command that used it (ns).
    pub round_trip: Histogram,
    /// For how long the poses of those commands had waited for the daemon's tick (ns), where it says so.
    pub waited: Histogram,
    /// Ticks since the first command.
    pub judged: Counter,
    /// Those of them in which the newest answer was in time.
    pub in_time: Counter,
    /// Age of the arm's newest pose at each tick (ns).
    pub pose_age: Histogram,
    peak_force_n: AtomicU64,
    /// Bits of the least energy (J) that the hand had put in.
    least_energy_j: AtomicU64,
    /// Bits of the largest stiffness (N/m) that is rendered now.
    gain_n_per_m: AtomicU64,
    /// Bits of the success rate; 0: not known yet.
    success_rate: AtomicU64,
    /// Since it was last reported: the force of a moment says nothing of a press that comes and goes.
    recent_peak_n: AtomicU64,
    force_n: AtomicU64,
    link: AtomicU8,
    /// 0: none; else its place among [`device::Fault::ALL`], from 1.
    device_fault: AtomicU8,
    servo: OnceLock<Arc<LoopMonitor>>,
}

/// What the VRPN server counts.
#[derive(Debug, Default)]
pub struct VrpnStats {
    /// Programs served.
    pub served: Counter,
    /// Programs turned away, being one too many.
    pub turned_away: Counter,
    /// Moments sent, each to one program.
    pub told: Counter,
    /// Moments that a program missed, since newer ones took their place before it could take them.
    pub dropped: Counter,
    address: OnceLock<SocketAddr>,
}

impl VrpnStats {
    /// Where it listens, if there is one.
    pub fn address(&self) -> Option<SocketAddr> {
        self.address.get().copied()
    }

    pub(crate) fn set_address(&self, address: SocketAddr) {
        let _ = self.address.set(address);
    }
}

impl Stats {
    /// The force (N) on the arm now.
    pub fn force_n(&self) -> f64 {
        f64::from_bits(self.force_n.load(Ordering::Relaxed))
    }

    /// State of the link as the servo sees it.
    pub fn link(&self) -> Link {
        link_of(self.link.load(Ordering::Relaxed))
    }

    /// The servo loop's own measurements, once it runs.
    pub fn servo(&self) -> Option<&LoopMonitor> {
        self.servo.get().map(AsRef::as_ref)
    }

    pub(crate) fn set_servo(&self, monitor: Arc<LoopMonitor>) {
        let _ = self.servo.set(monitor);
    }

    pub(crate) fn set_force(&self, magnitude_n: f64) {
        // The bits of numbers that are not negative are ordered as the numbers are.
        self.force_n.store(magnitude_n.to_bits(), Ordering::Relaxed);
        self.peak_force_n.fetch_max(magnitude_n.to_bits(), Ordering::Relaxed);
        self.recent_peak_n.fetch_max(magnitude_n.to_bits(), Ordering::Relaxed);
    }

    /// The least energy (J) that the hand had put into the virtual world at any time; below 0 it had got some.
    pub fn least_energy_j(&self) -> f64 {
        f64::from_bits(self.least_energy_j.load(Ordering::Relaxed))
    }

    pub(crate) fn set_least_energy(&self, least_j: f64) {
        self.least_energy_j.store(least_j.to_bits(), Ordering::Relaxed);
    }

    /// How stiff (N/m) a contact is rendered at most now, with the delay as it is.
    pub fn largest_stiffness_n_per_m(&self) -> f64 {
        f64::from_bits(self.gain_n_per_m.load(Ordering::Relaxed))
    }

    pub(crate) fn set_gain(&self, n_per_m: f64) {
        self.gain_n_per_m.store(n_per_m.to_bits(), Ordering::Relaxed);
    }

    /// Share of the last thousand ticks in which the newest answer was in time; `None` before there were so many.
    pub fn success_rate(&self) -> Option<f64> {
        Some(f64::from_bits(self.success_rate.load(Ordering::Relaxed))).filter(|rate| *rate > 0.0)
    }

    pub(crate) fn set_success_rate(&self, rate: Option<f64>) {
        self.success_rate.store(rate.unwrap_or(0.0).to_bits(), Ordering::Relaxed);
    }

    /// Largest force (N) on the arm since this was last asked.
    pub(crate) fn take_recent_peak_n(&self) -> f64 {
        f64::from_bits(self.recent_peak_n.swap(0, Ordering::Relaxed))
    }

    /// Why the arm was lost, if it was.
    pub fn device_fault(&self) -> Option<device::Fault> {
        let place = usize::from(self.device_fault.load(Ordering::Relaxed)).checked_sub(1)?;
        device::Fault::ALL.get(place).copied()
    }

    pub(crate) fn set_device_fault(&self, fault: device::Fault) {
        let place = device::Fault::ALL.iter().position(|known| *known == fault).unwrap_or(0);
        self.device_fault.store(place as u8 + 1, Ordering::Relaxed);
    }

    pub(crate) fn set_link(&self, link: Link) {
        self.link.store(code_of(link), Ordering::Relaxed);
    }

    /// A copy for people.
    pub fn summary(&self) -> Summary {
        let servo = self.servo();
        Summary {
            sent: self.sent.get(),
            dropped_up: self.dropped_up.get(),
            received: self.received.get(),
            rejected: self.rejected.get(),
            dropped_down: self.dropped_down.get(),
            peer_faults: self.peer_faults.get(),
            reconnects: self.attached.get().saturating_sub(1),
            latched: self.latched.get(),
            saturated: self.saturated.get(),
            rate_limited: self.rate_limited.get(),
            non_finite: self.non_finite.get(),
            damped: self.damped.get(),
            peak_force_n: f64::from_bits(self.peak_force_n.load(Ordering::Relaxed)),
            final_force_n: self.force_n(),
            link: self.link(),
            round_trip: self.round_trip.percentiles(),
            waited: self.waited.percentiles(),
            judged: self.judged.get(),
            in_time: self.in_time.get(),
            ticks: servo.map_or(0, LoopMonitor::ticks),
            overruns: servo.map_or(0, LoopMonitor::overruns),
            skipped: servo.map_or(0, LoopMonitor::skipped),
            wakeup_lateness: servo.map_or_else(Percentiles::default, |s| s.wakeup_lateness.percentiles()),
            tick_cost: servo.map_or_else(Percentiles::default, |s| s.tick_cost.percentiles()),
        }
    }
}

const FAULTS: [Fault; 7] =
    [Fault::Stale, Fault::NonFinite, Fault::Peer, Fault::Requested, Fault::Device, Fault::Unreliable, Fault::Stalled];

fn code_of(link: Link) -> u8 {
    let index = |fault| FAULTS.iter().position(|f| *f == fault).unwrap_or(0) as u8;
    match link {
        Link::Waiting => 0,
        Link::Fresh => 1,
        Link::Extrapolating => 2,
        Link::Ramping(fault) => 8 + index(fault),
        Link::Latched(fault) => 16 + index(fault),
    }
}

fn link_of(code: u8) -> Link {
    let fault = FAULTS[usize::from(code % 8).min(FAULTS.len() - 1)];
    match code {
        1 => Link::Fresh,
        2 => Link::Extrapolating,
        8..16 => Link::Ramping(fault),
        16.. => Link::Latched(fault),
        _ => Link::Waiting,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_of_the_link_survives_its_code() {
        let states = FAULTS.iter().flat_map(|fault| [Link::Ramping(*fault), Link::Latched(*fault)]);
        for link in states.chain([Link::Waiting, Link::Fresh, Link::Extrapolating]) {
            assert_eq!(link_of(code_of(link)), link);
        }
    }

    #[test]
    fn the_peak_is_the_largest_force() {
        let stats = Stats::default();
        for force_n in [0.5, 2.0, 1.0] {
            stats.set_force(force_n);
        }
        assert_eq!((stats.summary().peak_force_n, stats.force_n()), (2.0, 1.0));
    }
}
