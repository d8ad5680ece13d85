//! What the keys of an arm behind a VRPN server mean.
use super::{
    super::{seconds, vrpn_server::vrpn_name},
    within,
};
use crate::{
    BridgeError,
    config::{LimitsConfig, VrpnConfig},
    device::vrpn::Settings,
};
use std::ops::RangeInclusive;

const SENSORS: RangeInclusive<f64> = 0.0..=1e6;
/// From more than an arm moves in a few ticks to all of its reach.
const RADII_M: RangeInclusive<f64> = 5e-3..=10.0;
const STEPS_M: RangeInclusive<f64> = 1e-9..=1e-2;

/// Checked.
///
/// # Errors
/// [`BridgeError`] naming the key.
pub fn checked(config: &VrpnConfig, limits: &LimitsConfig) -> Result<Settings, BridgeError> {
    vrpn_name("device.tracker", &config.tracker)?;
    for (key, name) in [("device.button", &config.button), ("device.force_device", &config.force_device)] {
        if !name.is_empty() {
            vrpn_name(key, name)?;
        }
    }
    within("device.sensor", &[f64::from(config.sensor)], SENSORS)?;
    within("device.field_radius_m", &[config.field_radius_m], RADII_M)?;
    within("device.position_step_m", &[config.position_step_m], STEPS_M)?;
    Ok(Settings {
        address: config.address.clone(),
        tracker: config.tracker.clone(),
        sensor: config.sensor,
        button: config.button.clone(),
        force_device: config.force_device.clone(),
        field_radius_m: config.field_radius_m,
        max_force_n: limits.max_force_n,
        velocity_from_poses: config.velocity_from_poses,
        position_step_m: config.position_step_m,
        force_is_measured: config.force_is_measured,
        silence: seconds("device.silence_s", config.silence_s)?,
    })
}
