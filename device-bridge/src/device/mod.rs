//! Arms. One today; a driver for a real one adds a variant.
pub mod simulated;

use crate::settings::DeviceSettings;
use glam::DVec3;
use palpate_control::Motion;
use simulated::SimulatedDevice;

/// What an arm measures at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Pose and twist of the tool centre (world).
    pub motion: Motion,
    /// Bit i is button i.
    pub buttons: u32,
    /// Force of the hand on the arm (N), if it has a sensor.
    pub measured_force_n: Option<DVec3>,
}

/// An attached arm, used by the servo thread alone. Neither call may block, allocate or log.
#[derive(Debug)]
pub enum Device {
    /// No hardware.
    Simulated(SimulatedDevice),
}

impl Device {
    /// Opens the arm that the configuration names.
    pub fn open(settings: &DeviceSettings) -> Self {
        match settings {
            DeviceSettings::Simulated(arm) => Self::Simulated(SimulatedDevice::new(arm.clone())),
        }
    }

    /// Reads the arm. `periods` servo periods have passed since the last reading, 1 unless ticks were skipped.
    pub fn read(&mut self, periods: u64) -> Reading {
        match self {
            Self::Simulated(device) => device.read(periods),
        }
    }

    /// Puts a force (N, world) on the arm, held until the next call.
    pub fn apply(&mut self, force_n: DVec3) {
        match self {
            Self::Simulated(device) => device.apply(force_n),
        }
    }
}
