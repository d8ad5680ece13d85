//! Arms: one file or folder for each, behind one small trait.
pub mod hapticmaster;
pub mod kinds;
pub mod serial;
pub mod simulated;
#[cfg(test)]
mod witness;
pub mod woodenhaptics;
pub mod workspace;

use crate::{
    BridgeError,
    settings::{ArmSettings, DeviceSettings},
};
use glam::DVec3;
use hapticmaster::HapticMaster;
use palpate_control::Motion;
use simulated::SimulatedDevice;
use std::fmt::Debug;
use thiserror::Error;
use tokio_util::sync::CancellationToken;
#[cfg(test)]
pub use witness::Witness;
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

/// What an arm is to do, in the axes of its readings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Effort {
    /// Force (N) at the tool centre.
    pub force_n: DVec3,
    /// Torque (N m) about it, for an arm that has motors for it.
    pub torque_nm: DVec3,
}

impl Effort {
    /// Nothing.
    pub const NONE: Self = Self::force(DVec3::ZERO);

    /// A force (N) alone.
    pub const fn force(force_n: DVec3) -> Self {
        Self { force_n, torque_nm: DVec3::ZERO }
    }

    /// For a driver's last step: nothing when its arm is lost, and nothing that is no number.
    #[must_use]
    pub fn unless(&self, lost: bool) -> Self {
        let number = |v: DVec3| if lost || !v.is_finite() { DVec3::ZERO } else { v };
        Self { force_n: number(self.force_n), torque_nm: number(self.torque_nm) }
    }
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

    /// Puts this on the arm, held until the next call.
    fn apply(&mut self, effort: &Effort);
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
    Ok(match settings {
        ArmSettings::Simulated(arm) => Box::new(SimulatedDevice::new(arm.clone())),
        ArmSettings::HapticMaster(settings) => Box::new(HapticMaster::open(settings, period_s, stop)?),
        ArmSettings::WoodenHaptics(settings) => Box::new(WoodenHaptics::start(settings, period_s).map_err(unstarted)?),
    })
}

fn unstarted(error: impl std::error::Error + Send + Sync + 'static) -> BridgeError {
    BridgeError::Start { source: Box::new(error) }
}
