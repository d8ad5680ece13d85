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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_refusal_names_the_key() {
        let refused = |change: fn(&mut VrpnConfig)| {
            let mut config = VrpnConfig::default();
            change(&mut config);
            checked(&config, &LimitsConfig::default()).unwrap_err().to_string()
        };
        assert!(refused(|c| c.tracker = String::new()).starts_with("device.tracker: \"\" is no name"));
        assert!(refused(|c| c.button = "Phantom0@host".into()).starts_with("device.button"));
        assert!(refused(|c| c.force_device = "a\n".into()).starts_with("device.force_device"));
        assert!(refused(|c| c.sensor = -1).starts_with("device.sensor: -1 is out"));
        assert!(refused(|c| c.field_radius_m = 0.0).starts_with("device.field_radius_m: 0 is out"));
        assert!(refused(|c| c.position_step_m = f64::NAN).starts_with("device.position_step_m"));
        assert!(refused(|c| c.silence_s = -1.0).starts_with("device.silence_s"));
        let none = VrpnConfig { button: String::new(), force_device: String::new(), ..VrpnConfig::default() };
        assert!(checked(&none, &LimitsConfig::default()).is_ok());
    }
}
