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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_refusal_names_the_key() {
        let refused = |change: fn(&mut FalconConfig)| {
            let mut config = FalconConfig::default();
            change(&mut config);
            checked(&config).unwrap_err().to_string()
        };
        assert!(refused(|c| c.zero_deg = 200.0).starts_with("device.zero_deg: 200 is out of range"));
        assert!(refused(|c| c.torque_units_per_nm = 0.0).starts_with("device.torque_units_per_nm: 0 is out"));
        assert!(refused(|c| c.max_torque_units = -5).starts_with("device.max_torque_units: -5 is out"));
        assert!(refused(|c| c.centre_m = [0.0; 3]).starts_with("device.centre_m: is out of its reach"));
        assert!(refused(|c| c.homing_s = f64::INFINITY).starts_with("device.homing_s: inf is no time"));
        assert!(refused(|c| c.silence_s = -1.0).starts_with("device.silence_s: -1 is no time"));
    }
}
