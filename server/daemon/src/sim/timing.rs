//! Where a tick's time goes: recorded by the loop, read by anybody.
use palpate_realtime::Histogram;
use std::sync::atomic::{AtomicU64, Ordering};

/// Stages of a tick, in order.
pub const STAGES: [&str; 4] = ["input", "contact_and_dynamics", "coupling", "publish"];

/// Distributions (ns) and counters of the loop, over all sessions.
#[derive(Debug, Default)]
pub struct Timing {
    /// Wake-up lateness.
    pub wakeup: Histogram,
    /// Whole tick.
    pub tick: Histogram,
    /// One per [`STAGES`].
    pub stages: [Histogram; 4],
    overruns: AtomicU64,
    inputs_rejected: AtomicU64,
}

impl Timing {
    /// Counts ticks whose work ended after the next deadline.
    pub fn count_overruns(&self, ticks: u64) {
        self.overruns.fetch_add(ticks, Ordering::Relaxed);
    }

    /// Counts inputs that the physics refused.
    pub fn count_rejected_inputs(&self, inputs: u32) {
        self.inputs_rejected.fetch_add(u64::from(inputs), Ordering::Relaxed);
    }

    /// Ticks whose work ended after the next deadline.
    pub fn overruns(&self) -> u64 {
        self.overruns.load(Ordering::Relaxed)
    }

    /// Inputs that the physics refused.
    pub fn inputs_rejected(&self) -> u64 {
        self.inputs_rejected.load(Ordering::Relaxed)
    }
}
