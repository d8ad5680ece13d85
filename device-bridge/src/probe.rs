//! `palpate-bridge probe`: opens an arm, reads it for a while without any force, and says how it does.
use crate::{
    BridgeError, Config,
    config::RecordConfig,
    device::{self, Effort, Reading},
    recording::recorder::Failure,
    settings::Settings,
};
use glam::DVec3;
use palpate_realtime::{Clock, Histogram, Percentiles, TickLoop};
use std::{fmt, ops::ControlFlow, time::Duration};
use tokio_util::sync::CancellationToken;

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// Where the tool was in the end (m, world).
    pub position_m: DVec3,
    /// Corners of the box that it was in (m, world).
    pub reached_m: (DVec3, DVec3),
    /// Force of the hand in the end (N, world), if the arm has a sensor.
    pub measured_force_n: Option<DVec3>,
    /// Buttons pressed in the end.
    pub buttons: u32,
    /// Readings with a pose that was not there before, per second.
    pub poses_per_s: f64,
    /// Age of the poses at the readings (ns).
    pub age: Percentiles,
    /// Ticks that began late.
    pub overruns: u64,
}

/// Reads the arm of a configuration at its servo's rate for so long.
///
/// # Errors
/// A bad configuration, an arm that cannot be started, or one that fails meanwhile.
pub fn probe(config: &Config, time: Duration) -> Result<Report, BridgeError> {
    // A look at the arm is no recording.
    let settings = Settings::new(&Config { record: RecordConfig::default(), ..config.clone() })?;
    let period_s = settings.servo.period_s;
    let mut arm = device::open(&settings.device, period_s, &CancellationToken::new(), &Failure::default(), |_| Ok(()))?;
    let mut tick_loop = TickLoop::new(Clock::Monotonic, period_s)
        .map_err(|error| BridgeError::Value { key: "servo.rate_hz".to_owned(), reason: error.to_string() })?;
    let monitor = tick_loop.monitor();
    let ticks = (time.as_secs_f64() / period_s).ceil().max(1.0) as u64;
    let ages = Histogram::new();
    let (mut last, mut fault, mut fresh): (Option<Reading>, _, _) = (None, None, 0_u64);
    let mut reached_m = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    tick_loop.run(|wakeup| {
        match arm.read(1 + wakeup.skipped) {
            Ok(reading) => {
                // A pose that was there before has grown older by all the periods that passed.
                let aged_s = (1 + wakeup.skipped) as f64 * period_s;
                fresh += u64::from(last.is_none_or(|last| reading.age_s < last.age_s + aged_s - 0.5 * period_s));
                ages.record((reading.age_s * 1e9) as u64);
                let x = reading.motion.position_m;
                reached_m = (reached_m.0.min(x), reached_m.1.max(x));
                last = Some(reading);
            }
            Err(found) => fault = Some(found),
        }
        arm.apply(&Effort::NONE);
        let over = monitor.ticks() + monitor.skipped() + 1 >= ticks || fault.is_some();
        if over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    match (fault, last) {
        (None, Some(reading)) => Ok(Report {
            position_m: reading.motion.position_m,
            reached_m,
            measured_force_n: reading.measured_force_n,
            buttons: reading.buttons,
            poses_per_s: fresh as f64 / (ticks as f64 * period_s),
            age: ages.percentiles(),
            overruns: monitor.overruns(),
        }),
        (fault, _) => Err(BridgeError::DeviceLost { fault: fault.unwrap_or(device::Fault::Silent) }),
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mm = |v: DVec3| format!("{:.2}, {:.2}, {:.2} mm", 1e3 * v.x, 1e3 * v.y, 1e3 * v.z);
        let us = |ns: u64| ns as f64 / 1e3;
        writeln!(f, "position  {} (world)", mm(self.position_m))?;
        writeln!(f, "reached   from {} to {}", mm(self.reached_m.0), mm(self.reached_m.1))?;
        let force = self.measured_force_n.map(|f| format!("{:.3}, {:.3}, {:.3} N of the hand (world)", f.x, f.y, f.z));
        writeln!(f, "force     {}", force.as_deref().unwrap_or("no sensor"))?;
        writeln!(f, "buttons   {:#b}", self.buttons)?;
        let (p50, p99, max) = (us(self.age.p50_ns), us(self.age.p99_ns), us(self.age.max_ns));
        writeln!(
            f,
            "poses     {:.0} a second; age p50 {p50:.0} us, p99 {p99:.0} us, max {max:.0} us",
            self.poses_per_s
        )?;
        write!(f, "loop      {} overruns", self.overruns)
    }
}
