//! What the keys of an Inverse3 mean.
use super::super::seconds;
use crate::{
    BridgeError,
    config::{Inverse3Config, Inverse3Dialect, RealtimeConfig},
    device::inverse3::{Dialect, Settings},
};

/// An Inverse3's settings, checked. Its socket's thread comes right after the servo's.
///
/// # Errors
/// [`BridgeError`] naming the key.
pub fn checked(config: &Inverse3Config, realtime: &RealtimeConfig) -> Result<Settings, BridgeError> {
    let below = realtime.fifo_priority.saturating_sub(1);
    Ok(Settings {
        url: config.url.clone(),
        device_id: config.device_id.clone(),
        grip_id: config.grip_id.clone(),
        dialect: match config.dialect {
            Inverse3Dialect::Values => Dialect::Values,
            Inverse3Dialect::Vector => Dialect::Vector,
        },
        uncalibrated: config.uncalibrated,
        silence: seconds("device.silence_s", config.silence_s)?,
        fifo_priority: (below > 0).then_some(below),
    })
}
