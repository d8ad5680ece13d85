//! What the keys of a PHANToM or Touch mean.
use super::super::seconds;
use crate::{BridgeError, Config, config::PhantomConfig, device::phantom::Settings};

/// As OpenHaptics' installers name it.
const LIBRARIES: [&str; 4] = ["libHD.so", "libHD.so.3", "libHD.so.3.5", "libHD.so.3.4"];

/// The whole configuration counts: its rate and its limits.
///
/// # Errors
/// [`BridgeError`] naming the key.
pub fn checked(arm: &PhantomConfig, config: &Config) -> Result<Settings, BridgeError> {
    let libraries = match arm.library.as_str() {
        "" => LIBRARIES.map(str::to_owned).to_vec(),
        path => vec![path.to_owned()],
    };
    Ok(Settings {
        libraries,
        name: arm.name.clone(),
        torque: arm.torque,
        reset_encoders: arm.reset_encoders,
        calibration: seconds("device.calibration_s", arm.calibration_s)?,
        silence: seconds("device.silence_s", arm.silence_s)?,
        rate_hz: config.servo.rate_hz.round() as u32,
        max_force_n: config.limits.max_force_n,
        continuous_force_n: config.limits.continuous_force_n,
    })
}
