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
    /// No arm at all: a test looks at its force.
    #[cfg(test)]
    Witness(std::sync::Arc<Witness>),
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
            #[cfg(test)]
            Self::Witness(witness) => witness.read(),
        }
    }

    /// Puts a force (N, world) on the arm, held until the next call.
    pub fn apply(&mut self, force_n: DVec3) {
        match self {
            Self::Simulated(device) => device.apply(force_n),
            #[cfg(test)]
            Self::Witness(witness) => witness.apply(force_n),
        }
    }
}

/// A driver for tests: rests at the origin, remembers its force, and panics at a given reading.
#[cfg(test)]
#[derive(Debug)]
pub struct Witness {
    panics_at: u64,
    reads: std::sync::atomic::AtomicU64,
    /// Force now, and the largest so far (N).
    force_n: std::sync::Mutex<(f64, f64)>,
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
impl Witness {
    pub(crate) fn panicking_at(reading: u64) -> Self {
        Self { panics_at: reading, reads: 0.into(), force_n: (0.0, 0.0).into() }
    }

    pub(crate) fn force_n(&self) -> f64 {
        self.force_n.lock().unwrap().0
    }

    pub(crate) fn peak_n(&self) -> f64 {
        self.force_n.lock().unwrap().1
    }

    fn read(&self) -> Reading {
        assert!(self.reads.fetch_add(1, std::sync::atomic::Ordering::Relaxed) < self.panics_at, "the driver fails");
        Reading { motion: Motion::at(DVec3::ZERO), buttons: 0, measured_force_n: None }
    }

    fn apply(&self, force_n: DVec3) {
        let mut held = self.force_n.lock().unwrap();
        *held = (force_n.length(), held.1.max(force_n.length()));
    }
}
