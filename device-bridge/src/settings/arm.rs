//! What the keys of each arm mean: a file for each.
pub mod hapticmaster;
pub mod simulated;
pub mod vrpn;
pub mod woodenhaptics;

use super::value;
use crate::{
    BridgeError, Config,
    config::DeviceConfig,
    device::{hapticmaster::start::StartSettings, vrpn::Settings as Vrpn, woodenhaptics::Settings as WoodenHaptics},
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
    /// An arm behind a VRPN server.
    Vrpn(Vrpn),
}

/// The arm of a configuration, checked.
pub(super) fn checked(config: &Config, period_s: f64) -> Result<ArmSettings, BridgeError> {
    match &config.device {
        DeviceConfig::Simulated(arm) => Ok(ArmSettings::Simulated(simulated::checked(arm, period_s)?)),
        DeviceConfig::Hapticmaster(arm) => Ok(ArmSettings::HapticMaster(hapticmaster::checked(arm, &config.limits)?)),
        DeviceConfig::Woodenhaptics(arm) => Ok(ArmSettings::WoodenHaptics(woodenhaptics::checked(arm)?)),
        DeviceConfig::Vrpn(arm) => Ok(ArmSettings::Vrpn(vrpn::checked(arm, &config.limits)?)),
    }
}

fn within(key: &str, values: &[f64], range: RangeInclusive<f64>) -> Result<(), BridgeError> {
    match values.iter().find(|value| !range.contains(value)) {
        Some(wrong) => Err(value(key, format!("{wrong} is out of range: use {} to {}", range.start(), range.end()))),
        None => Ok(()),
    }
}
