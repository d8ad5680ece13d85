//! `palpate-bridge measure`: arm, servo loop and network together, for a while and without any force: are they good enough for one?
//!
//! The *success rate* is libfranka's: the share of ticks in which the newest answer was in time, not older than `watchdog.stale_after_s`. Below 0.95 it warns, below 0.90
//! (`servo.least_success_rate`) no force is given: the bridge latches it while it runs, too.
mod chart;

use crate::{BridgeError, Config, Handle, run::run_with, settings::Settings};
pub use chart::{bars, svg};
use palpate_realtime::{LoopMonitor, Percentiles};
use std::{
    fmt,
    time::{Duration, Instant},
};
use tokio_util::sync::CancellationToken;

/// A success rate below this is warned of.
pub const WARN_BELOW: f64 = 0.95;
/// How long an arm and a daemon are waited for unless `server.give_up_after_s` says so.
const PATIENCE: Duration = Duration::from_secs(10);
/// Between two looks at whether it is attached.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// What was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Wanted and reached rate of the servo loop (Hz).
    pub rate_hz: (f64, f64),
    /// How late its ticks began (ns).
    pub lateness: Percentiles,
    /// What they cost (ns).
    pub cost: Percentiles,
    /// Ticks that began late, and that were left out.
    pub late_ticks: (u64, u64),
    /// Age of the arm's poses (ns).
    pub pose_age: Percentiles,
    /// From a pose to the first command that used it (ns).
    pub round_trip: Percentiles,
    /// Samples sent, and commands received.
    pub messages: (u64, u64),
    /// Share of ticks with an answer in time.
    pub success_rate: f64,
    /// Below this no force is given.
    pub least_success_rate: f64,
    /// Stiffness (N/m) of a contact beside the arm, and of one whose force crosses the network.
    pub stiffness_n_per_m: (f64, f64),
}

impl Report {
    fn new(handle: &Handle, settings: &Settings, reached_hz: f64) -> Self {
        let stats = handle.stats();
        let servo = stats.servo();
        let of = |look: fn(&LoopMonitor) -> u64| servo.map_or(0, look);
        let (pose_age, round_trip) = (stats.pose_age.percentiles(), stats.round_trip.percentiles());
        let bound = handle.stiffness().unwrap_or(settings.servo.stiffness);
        let at = |delay_ns: f64| bound.at_delay(1e-9 * delay_ns).largest_n_per_m();
        let judged = stats.judged.get();
        Self {
            rate_hz: (1.0 / settings.servo.period_s, reached_hz),
            lateness: servo.map_or_else(Percentiles::default, |servo| servo.wakeup_lateness.percentiles()),
            cost: servo.map_or_else(Percentiles::default, |servo| servo.tick_cost.percentiles()),
            late_ticks: (of(LoopMonitor::overruns), of(LoopMonitor::skipped)),
            messages: (stats.sent.get(), stats.received.get()),
            success_rate: if judged == 0 { 0.0 } else { stats.in_time.get() as f64 / judged as f64 },
            least_success_rate: settings.servo.least_success_rate,
            stiffness_n_per_m: (at(pose_age.mean_ns), at(round_trip.p99_ns as f64)),
            pose_age,
            round_trip,
        }
    }

    /// Whether a force may be given.
    pub fn is_good_enough(&self) -> bool {
        self.success_rate >= self.least_success_rate
    }

    /// Share of the samples that no command answered by itself: newer ones took their place, or they were lost.
    pub fn unanswered(&self) -> f64 {
        let (sent, received) = self.messages;
        if sent == 0 { 1.0 } else { 1.0 - (received as f64 / sent as f64).min(1.0) }
    }
}

/// Attaches without force, for so long; the counters stay in `handle`.
///
/// # Errors
/// What stops a bridge; [`BridgeError::Unreachable`] when no daemon answers.
pub async fn measure(config: &Config, time: Duration, handle: Handle) -> Result<Report, BridgeError> {
    let mut config = config.clone();
    config.server.give_up_after_s.get_or_insert(PATIENCE.as_secs_f64());
    let settings = Settings::new(&config)?;
    handle.without_force();
    let shutdown = CancellationToken::new();
    let bridge = run_with(&config, shutdown.clone(), handle.clone());
    tokio::pin!(bridge);
    let ticks = || handle.stats().servo().map_or(0, LoopMonitor::ticks);
    let watched = async {
        while !handle.is_attached() {
            tokio::time::sleep(LOOK_EVERY).await;
        }
        let (began, before) = (Instant::now(), ticks());
        tokio::time::sleep(time).await;
        (ticks() - before) as f64 / began.elapsed().as_secs_f64()
    };
    let reached_hz = tokio::select! {
        ended = &mut bridge => return Err(ended.err().unwrap_or(BridgeError::ServoDied)),
        reached_hz = watched => reached_hz,
    };
    let report = Report::new(&handle, &settings, reached_hz);
    shutdown.cancel();
    bridge.await.map(|_| report)
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |ns: u64| ns as f64 / 1e3;
        let times = |p: &Percentiles| {
            format!(
                "p50 {:.0} us, p99 {:.0} us, p99.9 {:.0} us, max {:.0} us",
                us(p.p50_ns),
                us(p.p99_ns),
                us(p.p999_ns),
                us(p.max_ns)
            )
        };
        writeln!(
            f,
            "loop     {:.1} Hz of {:.0}; ticks began late by {}; cost {}",
            self.rate_hz.1,
            self.rate_hz.0,
            times(&self.lateness),
            times(&self.cost)
        )?;
        writeln!(f, "         {} overruns, {} ticks left out", self.late_ticks.0, self.late_ticks.1)?;
        writeln!(f, "arm      age of its poses {}", times(&self.pose_age))?;
        writeln!(f, "trip     pose to force {}", times(&self.round_trip))?;
        let (sent, received) = self.messages;
        writeln!(
            f,
            "stream   {sent} samples sent, {received} commands received: {:.2} % without an answer of their own",
            100.0 * self.unanswered()
        )?;
        let (beside, across) = self.stiffness_n_per_m;
        writeln!(
            f,
            "gains    a contact of {beside:.0} N/m is stable beside this arm, and one of {across:.0} N/m across this network"
        )?;
        let rate = self.success_rate;
        let verdict = if !self.is_good_enough() {
            format!("below {:.2}: NO FORCE is given over this link", self.least_success_rate)
        } else if rate < WARN_BELOW {
            format!("below {WARN_BELOW}: the force will often be reduced; look at the network, and at docs/realtime.md")
        } else {
            "good".into()
        };
        write!(f, "success  {rate:.4} of the ticks had an answer in time: {verdict}")
    }
}
