//! What the keys of a Falcon mean.
use super::{
    super::{seconds, value},
    within,
};
use crate::{
    BridgeError,
    config::FalconConfig,
    device::falcon::{Settings, kinematics},
};
use glam::DVec3;
use std::ops::RangeInclusive;

const ANGLES_DEG: RangeInclusive<f64> = -180.0..=180.0;
const UNITS_PER_NM: RangeInclusive<f64> = 1.0..=1e6;
const UNITS: RangeInclusive<f64> = 1.0..=32767.0;

/// A Falcon's constants, checked.
///
/// # Errors
/// [`BridgeError`] naming the key.
pub fn checked(config: &FalconConfig) -> Result<Settings, BridgeError> {
    within("device.zero_deg", &[config.zero_deg], ANGLES_DEG)?;
    within("device.torque_units_per_nm", &[config.torque_units_per_nm], UNITS_PER_NM)?;
    within("device.max_torque_units", &[config.max_torque_units.into()], UNITS)?;
    let centre_m = DVec3::from_array(config.centre_m);
    if kinematics::legs(centre_m).is_none() {
        return Err(value("device.centre_m", "is out of its reach: the middle is [0.0, 0.0, 0.125]".to_owned()));
    }
    Ok(Settings {
        port: config.port.clone(),
        firmware: config.firmware.clone(),
        homing: seconds("device.homing_s", config.homing_s)?,
        centre_m,
        zero_rad: config.zero_deg.to_radians(),
        torque_units_per_nm: config.torque_units_per_nm,
        reversed: config.reversed,
        max_torque_units: config.max_torque_units,
        silence: seconds("device.silence_s", config.silence_s)?,
    })
}
