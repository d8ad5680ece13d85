//! PHANToM and Touch: impedance arms that only OpenHaptics' libHD speaks to. It is loaded at run time, so that a bridge is built and runs without it.
//!
//! HD calls us at 1 kHz on a thread of its own, in frames ([`frame`]): each writes the newest effort of the servo and publishes a pose for it, through newest-value slots, so that neither waits
//! for the other. A frame lets go by itself when the servo has not been heard for [`frame::PATIENCE_FRAMES`] frames, and a servo that sees no frame for
//! [`Settings::silence`] loses the arm.
//!
//! What only hardware can tell: whether torque is in mN m in Cartesian axes (`HD_CURRENT_TORQUE`, which HD's headers call deprecated beside joint torques), whether an arm without encoders in
//! its gimbal has an angular velocity, whether HD itself lets go when its program is killed.
pub mod ffi;
pub mod frame;
pub mod limits;
pub mod start;

use super::{Arm, Effort, Fault, LONGEST_EXTRAPOLATION_S, Reading, unstarted};
use crate::BridgeError;
use frame::Pose;
use palpate_control::extrapolate;
use palpate_realtime::{SlotReader, SlotWriter};
use start::{Session, StartError, Started, start};
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// What to load, and what of it to use.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Names or paths of the library; the first that can be loaded.
    pub libraries: Vec<String>,
    /// Name of the arm in HD's configuration; empty: its default one.
    pub name: String,
    /// Give torque to an arm that has motors for it.
    pub torque: bool,
    /// The arm is in its reset position when it is started: what its encoders say there is zero.
    pub reset_encoders: bool,
    /// How long calibration may take.
    pub calibration: Duration,
    /// Without a frame for so long the arm is lost.
    pub silence: Duration,
    /// Rate of frames (Hz).
    pub rate_hz: u32,
    /// Largest force (N) that is ever asked of it.
    pub max_force_n: f64,
    /// Force (N) that the bridge keeps below for ever, if it does.
    pub continuous_force_n: Option<f64>,
}

/// The arm.
#[derive(Debug)]
pub struct Phantom {
    session: Session,
    poses: SlotReader<Option<Pose>>,
    efforts: SlotWriter<Effort>,
    period_s: f64,
    silence_periods: u64,
    pose: Pose,
    stiffest_wall_n_per_m: Option<f64>,
    /// Since the newest pose came.
    quiet_periods: u64,
    lost: Option<Fault>,
}

impl Phantom {
    /// Starts the arm, which may take as long as it has to be calibrated. Blocks until told to stop.
    ///
    /// # Errors
    /// [`BridgeError::Start`].
    pub fn open(settings: &Settings, period_s: f64, stop: &CancellationToken) -> Result<Self, BridgeError> {
        Self::start(settings, period_s, stop).map_err(unstarted)
    }

    /// As [`Self::open`].
    ///
    /// # Errors
    /// [`StartError`].
    pub fn start(settings: &Settings, period_s: f64, stop: &CancellationToken) -> Result<Self, StartError> {
        let Started { session, poses, efforts, pose, limits } = start(settings, stop)?;
        let silence_periods = (settings.silence.as_secs_f64() / period_s).ceil() as u64;
        let stiffest_wall_n_per_m = limits.stiffness_n_per_m;
        Ok(Self {
            session,
            poses,
            efforts,
            period_s,
            silence_periods,
            pose,
            stiffest_wall_n_per_m,
            quiet_periods: 0,
            lost: None,
        })
    }

    fn receive(&mut self) -> Result<(), Fault> {
        if let Some(Some(pose)) = self.poses.take() {
            self.pose = *pose;
            self.quiet_periods = 0;
        }
        match self.session.shared.error() {
            Some(code) => Err(frame::fault(code)),
            None if self.quiet_periods > self.silence_periods => Err(Fault::Silent),
            None => Ok(()),
        }
    }
}

impl Arm for Phantom {
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        if let Some(fault) = self.lost {
            return Err(fault);
        }
        self.quiet_periods = self.quiet_periods.saturating_add(periods);
        self.receive().map_err(|fault| *self.lost.get_or_insert(fault))?;
        let quiet_s = self.quiet_periods as f64 * self.period_s;
        Ok(Reading {
            motion: extrapolate(&self.pose.motion, quiet_s, LONGEST_EXTRAPOLATION_S),
            buttons: self.pose.buttons,
            measured_force_n: None,
            // Its frame was since the last tick.
            age_s: quiet_s + self.period_s,
            force_share: 1.0,
        })
    }

    /// A lost arm's frames, should there be any, are told to let go.
    fn apply(&mut self, effort: &Effort) {
        self.efforts.publish(effort.unless(self.lost.is_some()));
    }

    fn stiffest_wall_n_per_m(&self) -> Option<f64> {
        self.stiffest_wall_n_per_m
    }
}
