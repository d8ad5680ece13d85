//! Arms: one file or folder for each, behind one small trait.
pub mod hapticmaster;
pub mod kinds;
pub mod serial;
pub mod simulated;
pub mod woodenhaptics;
pub mod workspace;

use crate::{
    BridgeError,
    settings::{ArmSettings, DeviceSettings},
};
use glam::DVec3;
use hapticmaster::{HapticMaster, start};
use palpate_control::Motion;
use simulated::SimulatedDevice;
use std::fmt::Debug;
use thiserror::Error;
use tokio_util::sync::CancellationToken;
use woodenhaptics::WoodenHaptics;
use workspace::Placed;

/// What an arm measures at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Pose and twist of the tool centre: in a driver, in the arm's own axes; in the loop, in the world ([`Placed`]).
    pub motion: Motion,
    /// Bit i is button i.
    pub buttons: u32,
    /// Force of the hand on the arm (N), if it has a sensor.
    pub measured_force_n: Option<DVec3>,
    /// How long ago (s), at most, the pose was measured from which the motion goes on.
    pub age_s: f64,
    /// Share of the force that the arm is to have: 1, but for a clutch.
    pub force_share: f64,
}

/// Why an arm is of no use any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Fault {
    /// Nothing has come from it for too long.
    #[error("it has stopped answering")]
    Silent,
    /// What comes is not its protocol.
    #[error("what it sends is not its protocol")]
    Garbled,
    /// It says no.
    #[error("it refused a command")]
    Refused,
    /// Somebody pressed the button.
    #[error("its emergency stop is pressed")]
    EmergencyStop,
    /// The connection ended.
    #[error("the connection to it ended")]
    Disconnected,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Silent, Self::Garbled, Self::Refused, Self::EmergencyStop, Self::Disconnected];
}

/// An arm that was opened, used by the servo thread alone. Neither call may block, allocate or log.
pub trait Arm: Debug + Send {
    /// Reads the arm. `periods` servo periods have passed since the last reading, 1 unless ticks were skipped.
    ///
    /// # Errors
    /// A [`Fault`], from then on every time: the arm has to be opened anew.
    fn read(&mut self, periods: u64) -> Result<Reading, Fault>;

    /// Puts a force (N, in the axes of its readings) on the arm, held until the next call.
    fn apply(&mut self, force_n: DVec3);
}

/// Opens the arm that the configuration names, however long that takes, until told to stop.
///
/// # Errors
/// [`BridgeError::Start`].
pub fn open(settings: &DeviceSettings, period_s: f64, stop: &CancellationToken) -> Result<Box<dyn Arm>, BridgeError> {
    let arm = open_arm(&settings.arm, period_s, stop)?;
    Ok(Box::new(Placed::new(arm, settings.workspace, settings.clutch, period_s)))
}

fn open_arm(settings: &ArmSettings, period_s: f64, stop: &CancellationToken) -> Result<Box<dyn Arm>, BridgeError> {
    match settings {
        ArmSettings::Simulated(arm) => Ok(Box::new(SimulatedDevice::new(arm.clone()))),
        ArmSettings::HapticMaster(settings) => {
            let started =
                start::start(settings, stop).map_err(|source| BridgeError::Start { source: Box::new(source) })?;
            tracing::info!("the HapticMASTER at {} is started: {}", settings.address, started.version);
            let arm = HapticMaster::new(started, settings, period_s);
            Ok(Box::new(arm.map_err(|source| BridgeError::System { what: "read the arm without waiting", source })?))
        }
        ArmSettings::WoodenHaptics(settings) => {
            let started = WoodenHaptics::start(settings, period_s);
            Ok(Box::new(started.map_err(|source| BridgeError::Start { source: Box::new(source) })?))
        }
    }
}

/// A driver for tests: rests at the origin unless told where it is, remembers its force, and panics at a given reading.
#[cfg(test)]
#[derive(Debug)]
pub struct Witness {
    panics_at: u64,
    reads: std::sync::atomic::AtomicU64,
    fails: std::sync::atomic::AtomicBool,
    reading: std::sync::Mutex<Reading>,
    /// Force now, and the largest so far (N).
    force_n: std::sync::Mutex<(f64, f64)>,
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
impl Witness {
    pub(crate) fn panicking_at(reading: u64) -> Self {
        Self {
            panics_at: reading,
            reads: 0.into(),
            fails: false.into(),
            reading: Self::at_rest().into(),
            force_n: (0.0, 0.0).into(),
        }
    }

    pub(crate) fn at_rest() -> Reading {
        let motion = Motion::at(DVec3::ZERO);
        Reading { motion, buttons: 0, measured_force_n: None, age_s: 0.0, force_share: 1.0 }
    }

    pub(crate) fn set(&self, reading: Reading) {
        *self.reading.lock().unwrap() = reading;
    }

    pub(crate) fn force_n(&self) -> f64 {
        self.force_n.lock().unwrap().0
    }

    pub(crate) fn fail(&self) {
        self.fails.store(true, std::sync::atomic::Ordering::Relaxed);
    }

    pub(crate) fn peak_n(&self) -> f64 {
        self.force_n.lock().unwrap().1
    }

    fn read_now(&self) -> Reading {
        assert!(self.reads.fetch_add(1, std::sync::atomic::Ordering::Relaxed) < self.panics_at, "the driver fails");
        *self.reading.lock().unwrap()
    }

    fn hold(&self, force_n: DVec3) {
        let mut held = self.force_n.lock().unwrap();
        *held = (force_n.length(), held.1.max(force_n.length()));
    }
}

#[cfg(test)]
impl Arm for std::sync::Arc<Witness> {
    fn read(&mut self, _: u64) -> Result<Reading, Fault> {
        if self.fails.load(std::sync::atomic::Ordering::Relaxed) { Err(Fault::Silent) } else { Ok(self.read_now()) }
    }

    fn apply(&mut self, force_n: DVec3) {
        self.hold(force_n);
    }
}
