//! Where a tick's time goes: recorded by the loop, read by anybody.
use palpate_physics::StepReport;
use palpate_realtime::{Histogram, LoopMonitor};
use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

/// Stages of a tick, in order.
pub const STAGES: [&str; 4] = ["input", "contact_and_dynamics", "coupling", "publish"];

/// Distributions (ns) and counters of the loop, over all sessions.
#[derive(Debug, Default)]
pub struct Timing {
    /// Wake-ups, overruns, skipped ticks.
    pub the_loop: Arc<LoopMonitor>,
    /// Whole tick, while time goes on.
    pub tick: Histogram,
    /// One per [`STAGES`].
    pub stages: [Histogram; 4],
    inputs_rejected: AtomicU64,
    repeated_ticks: AtomicU64,
    /// Tick at which the state was quarantined, plus 1; 0: it is not.
    quarantined: AtomicU64,
}

impl Timing {
    /// Counts what the physics refused and repeated.
    pub fn count(&self, report: &StepReport) {
        self.inputs_rejected.fetch_add(u64::from(report.inputs_rejected), Ordering::Relaxed);
        self.repeated_ticks.fetch_add(u64::from(report.repeated > 0), Ordering::Relaxed);
    }

    /// Notes whether the state is quarantined, and since which tick.
    pub fn note_quarantine(&self, at_tick: Option<u64>) {
        self.quarantined.store(at_tick.map_or(0, |tick| tick + 1), Ordering::Relaxed);
    }

    /// Tick at which the state was quarantined, if it is.
    pub fn quarantined_at(&self) -> Option<u64> {
        self.quarantined.load(Ordering::Relaxed).checked_sub(1)
    }

    /// Inputs that the physics refused.
    pub fn inputs_rejected(&self) -> u64 {
        self.inputs_rejected.load(Ordering::Relaxed)
    }

    /// Ticks that proved unstable and were repeated in more substeps.
    pub fn repeated_ticks(&self) -> u64 {
        self.repeated_ticks.load(Ordering::Relaxed)
    }
}
