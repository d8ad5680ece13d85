//! What the keys of each arm mean: a file for each.
pub mod falcon;
pub mod haply_2diy;
pub mod hapticmaster;
pub mod inverse3;
pub mod phantom;
pub mod playback;
pub mod simulated;
pub mod vrpn;
pub mod woodenhaptics;

use super::value;
use crate::{
    BridgeError, Config,
    config::{DeviceConfig, HapticMasterConfig, HapticMasterContact},
    device::{
        falcon::Settings as Falcon, haply_2diy::Settings as Haply2diy, hapticmaster::start::StartSettings,
        inverse3::Settings as Inverse3, phantom::Settings as Phantom, playback::Settings as Playback,
        vrpn::Settings as Vrpn, woodenhaptics::Settings as WoodenHaptics,
    },
};
use palpate_control::SimulatedArm;
use std::ops::RangeInclusive;

/// Lengths and diameters of an arm on a table.
const LENGTHS_M: RangeInclusive<f64> = 1e-3..=2.0;

/// Which arm.
#[derive(Debug, Clone)]
pub enum ArmSettings {
    /// The simulated one.
    Simulated(SimulatedArm),
    /// A HapticMASTER.
    HapticMaster(StartSettings),
    /// A WoodenHaptics.
    WoodenHaptics(WoodenHaptics),
    /// A PHANToM or Touch.
    Phantom(Phantom),
    /// An Inverse3.
    Inverse3(Inverse3),
    /// A recording.
    Playback(Playback),
    /// A 2diy.
    Haply2diy(Haply2diy),
    /// A Falcon.
    Falcon(Falcon),
    /// An arm behind a VRPN server.
    Vrpn(Vrpn),
}

impl ArmSettings {
    /// Not one that is only computed or read.
    pub fn has_motors(&self) -> bool {
        !matches!(self, Self::Simulated(_) | Self::Playback(_))
    }
}

/// The arm of a configuration, checked.
pub(super) fn checked(config: &Config, period_s: f64) -> Result<ArmSettings, BridgeError> {
    match &config.device {
        DeviceConfig::Simulated(arm) => Ok(ArmSettings::Simulated(simulated::checked(arm, period_s)?)),
        DeviceConfig::Hapticmaster(arm) => Ok(ArmSettings::HapticMaster(hapticmaster::checked(arm, config)?)),
        DeviceConfig::Woodenhaptics(arm) => Ok(ArmSettings::WoodenHaptics(woodenhaptics::checked(arm)?)),
        DeviceConfig::Phantom(arm) => Ok(ArmSettings::Phantom(phantom::checked(arm, config)?)),
        DeviceConfig::Inverse3(arm) => Ok(ArmSettings::Inverse3(inverse3::checked(arm, &config.realtime)?)),
        DeviceConfig::Playback(arm) => Ok(ArmSettings::Playback(playback::checked(arm)?)),
        DeviceConfig::Haply2diy(arm) => Ok(ArmSettings::Haply2diy(haply_2diy::checked(arm)?)),
        DeviceConfig::Falcon(arm) => Ok(ArmSettings::Falcon(falcon::checked(arm)?)),
        DeviceConfig::Vrpn(arm) => Ok(ArmSettings::Vrpn(vrpn::checked(arm, &config.limits)?)),
    }
}

/// Whether an arm is to render the contact's plane by itself.
pub(super) fn renders_planes(device: &DeviceConfig) -> bool {
    matches!(device, DeviceConfig::Hapticmaster(HapticMasterConfig { contact: HapticMasterContact::Plane, .. }))
}

fn within(key: &str, values: &[f64], range: RangeInclusive<f64>) -> Result<(), BridgeError> {
    match values.iter().find(|value| !range.contains(value)) {
        Some(wrong) => Err(value(key, format!("{wrong} is out of range: use {} to {}", range.start(), range.end()))),
        None => Ok(()),
    }
}
