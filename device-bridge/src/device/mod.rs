//! Arms: one file or folder for each, behind one small trait.
mod backlog;
mod drain;
pub mod falcon;
pub mod haply_2diy;
pub mod hapticmaster;
pub mod inverse3;
pub mod kinds;
mod lines;
#[cfg(test)]
mod noise;
pub mod phantom;
pub mod playback;
pub mod requests;
pub mod serial;
pub mod share;
pub mod simulated;
pub mod tcp;
pub mod vrpn;
#[cfg(test)]
mod witness;
pub mod woodenhaptics;
pub mod workspace;

use crate::{
    BridgeError,
    recording::{
        read::RecordingError,
        recorder::{Failure, Recorded},
    },
    settings::{ArmSettings, DeviceSettings},
};
use falcon::Falcon;
use glam::DVec3;
use haply_2diy::Haply2diy;
use hapticmaster::HapticMaster;
use inverse3::Inverse3;
use palpate_control::{ContactPlane, Motion};
use phantom::Phantom;
use playback::Playback;
use simulated::SimulatedDevice;
use std::{fmt::Debug, os::fd::OwnedFd};
use thiserror::Error;
use tokio_util::sync::CancellationToken;
use vrpn::Vrpn;
#[cfg(test)]
pub use witness::Witness;
use woodenhaptics::WoodenHaptics;
use workspace::Placed;

/// A pose is believed to go on with its velocity for so long (s).
const LONGEST_EXTRAPOLATION_S: f64 = 5e-3;

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
    /// Share of the force that the arm is to have: 1, but for a clutch, and where the driver asks nothing of the arm for a while.
    pub force_share: f64,
}

/// What an arm is to do, in the axes of its readings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Effort {
    /// Force (N) at the tool centre.
    pub force_n: DVec3,
    /// Torque (N m) about it, for an arm that has motors for it.
    pub torque_nm: DVec3,
    /// The contact that is part of the force, for an arm that renders it by itself, with the rest of the force beside it. Others have all of it in the force.
    pub plane: Option<ContactPlane>,
}

impl Effort {
    /// Nothing.
    pub const NONE: Self = Self::force(DVec3::ZERO);

    /// A force (N) alone.
    pub const fn force(force_n: DVec3) -> Self {
        Self { force_n, torque_nm: DVec3::ZERO, plane: None }
    }

    /// For a driver's last step: nothing when its arm is lost, and nothing that is no number.
    #[must_use]
    pub fn unless(&self, lost: bool) -> Self {
        let number = |v: DVec3| if lost || !v.is_finite() { DVec3::ZERO } else { v };
        let plane = self.plane.filter(|plane| !lost && self.force_n.is_finite() && plane.is_one());
        Self { force_n: number(self.force_n), torque_nm: number(self.torque_nm), plane }
    }
}

/// Bytes that take the force away, whatever was said before, and where to write them.
#[derive(Debug)]
pub struct LastWords {
    /// The connection.
    pub to: OwnedFd,
    /// The bytes.
    pub bytes: Vec<u8>,
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
    /// Its motors are warm.
    #[error("its motors are too warm")]
    Overheated,
    /// The hand, or the force, moved it faster than it bears.
    #[error("it was moved too fast")]
    TooFast,
    /// Beyond its peak, or too large a step.
    #[error("more force was asked of it than it gives")]
    TooMuchForce,
    /// What runs its frames does not.
    #[error("the scheduler of its library failed")]
    Scheduler,
    /// Its own word, without a reason.
    #[error("it reports a fault of its own")]
    Broken,
    /// It does not know where it is any more: it was without power, say.
    #[error("it lost its home")]
    Unhomed,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Silent,
        Self::Garbled,
        Self::Refused,
        Self::EmergencyStop,
        Self::Disconnected,
        Self::Overheated,
        Self::TooFast,
        Self::TooMuchForce,
        Self::Scheduler,
        Self::Broken,
        Self::Unhomed,
    ];
}

impl Fault {
    /// Whether answers to somebody else may look like it.
    fn may_be_misheard(self) -> bool {
        matches!(self, Self::Garbled | Self::Refused)
    }
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

    /// The stiffest wall (N/m, as the force is to the readings) that it is made for, if that is known.
    fn stiffest_wall_n_per_m(&self) -> Option<f64> {
        None
    }

    /// What another process can say to it when this one is gone; `None` where the connection does not outlive the process.
    fn last_words(&self) -> Option<LastWords> {
        None
    }

    /// They were said while this process stood still: the arm was let go, and may answer what nobody here asked. An answer to them that the reading just before took for garbage, or for
    /// a refusal, was none.
    fn last_words_were_said(&mut self) {}
}

/// Opens the arm that the configuration names, however long that takes, until told to stop. Before anything is recorded, `demand` is told the stiffest wall (N/m, of the world) that it is made for.
///
/// # Errors
/// [`BridgeError::Start`], and those of `demand`.
pub fn open(
    settings: &DeviceSettings,
    period_s: f64,
    stop: &CancellationToken,
    failure: &Failure,
    demand: impl FnOnce(Option<f64>) -> Result<(), BridgeError>,
) -> Result<Box<dyn Arm>, BridgeError> {
    let mut arm = open_arm(&settings.arm, period_s, stop)?;
    demand(arm.stiffest_wall_n_per_m().map(|of_arm| settings.workspace.stiffness_of_world(of_arm)))?;
    if let Some(record) = &settings.record {
        arm = Box::new(Recorded::start(arm, record, period_s, failure)?);
    }
    Ok(Box::new(Placed::new(arm, settings.workspace, settings.clutch, period_s)))
}

fn open_arm(settings: &ArmSettings, period_s: f64, stop: &CancellationToken) -> Result<Box<dyn Arm>, BridgeError> {
    Ok(match settings {
        ArmSettings::Simulated(arm) => Box::new(SimulatedDevice::new(arm.clone())),
        ArmSettings::HapticMaster(settings) => Box::new(HapticMaster::open(settings, period_s, stop)?),
        ArmSettings::Inverse3(settings) => Box::new(Inverse3::start(settings).map_err(unstarted)?),
        ArmSettings::Playback(settings) => Box::new(Playback::open(settings, period_s).map_err(unreadable)?),
        ArmSettings::Vrpn(settings) => Box::new(Vrpn::start(settings, period_s).map_err(unstarted)?),
        ArmSettings::WoodenHaptics(settings) => Box::new(WoodenHaptics::start(settings, period_s).map_err(unstarted)?),
        ArmSettings::Phantom(settings) => Box::new(Phantom::open(settings, period_s, stop)?),
        ArmSettings::Haply2diy(settings) => Box::new(Haply2diy::start(settings, period_s).map_err(unstarted)?),
        ArmSettings::Falcon(settings) => Box::new(Falcon::open(settings, period_s, stop).map_err(unstarted)?),
    })
}

fn unreadable(error: RecordingError) -> BridgeError {
    let help = "palpate-bridge --record FILE writes such files; docs/arms/playback.md tells what is in them";
    BridgeError::Start { help, source: Box::new(error) }
}

fn unstarted(error: impl std::error::Error + Send + Sync + 'static) -> BridgeError {
    let help = "check that it is switched on, that its emergency stop is released, and its address; docs/arms has a page for each arm";
    BridgeError::Start { help, source: Box::new(error) }
}
