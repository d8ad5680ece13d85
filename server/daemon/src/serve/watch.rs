//! Looks at the loop from outside: what an operator has to know goes to the log, and to health.
use super::manager::notify;
use crate::session::Daemon;
use palpate_proto::v1::device_server::DeviceServer;
use sd_notify::NotifyState;
use std::{sync::Arc, time::Duration};
use tokio::time::{Instant, MissedTickBehavior, interval};
use tonic::server::NamedService as _;
use tonic_health::{ServingStatus, server::HealthReporter};

/// How often.
const PERIOD: Duration = Duration::from_millis(100);
/// Between two lines about late ticks.
const LATE_PERIOD: Duration = Duration::from_secs(10);

type Device = DeviceServer<crate::grpc::device::DeviceService>;

/// Watches until the daemon stops. A quarantined body gives no force: `Device`, and the daemon as a whole, do not serve then.
pub(super) async fn watch(daemon: Arc<Daemon>, health: HealthReporter) {
    let mut every = interval(PERIOD);
    every.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut quarantined = None;
    // A service manager starts the daemon anew when the loop has not woken for so long.
    let watchdog = sd_notify::watchdog_enabled();
    let (mut ticks, mut last_told) = (0, Instant::now());
    let (mut late, mut late_said) = (0, Instant::now());
    loop {
        tokio::select! {
            () = daemon.stop.cancelled() => return,
            _ = every.tick() => {}
        }
        let ticks_now = daemon.timing.the_loop.ticks();
        if ticks_now != ticks && watchdog.is_some_and(|every| last_told.elapsed() * 3 >= every) {
            (ticks, last_told) = (ticks_now, Instant::now());
            notify(&[NotifyState::Watchdog]);
        }
        let now = daemon.timing.quarantined_at();
        if now != quarantined {
            quarantined = now;
            if let Some(tick) = now {
                tracing::error!(tick, "the body is quarantined: arms get no force until Reset or Restore");
            } else {
                tracing::info!("the body is no longer quarantined");
            }
            let status = if now.is_some() { ServingStatus::NotServing } else { ServingStatus::Serving };
            for service in [Device::NAME, ""] {
                health.set_service_status(service, status).await;
            }
        }
        let overruns = daemon.timing.the_loop.overruns();
        if overruns > late && late_said.elapsed() >= LATE_PERIOD {
            tracing::warn!(
                overruns = overruns - late,
                "ticks ended later than the next was due, since this was last said"
            );
            (late, late_said) = (overruns, Instant::now());
        }
    }
}
