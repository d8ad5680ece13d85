//! What the keys of a recording that is played back mean.
use super::within;
use crate::{BridgeError, config::PlaybackConfig, device::playback::Settings};
use std::ops::RangeInclusive;

const SPEEDS: RangeInclusive<f64> = 0.01..=10.0;
const RESTS_S: RangeInclusive<f64> = 0.01..=3600.0;

pub(super) fn checked(config: &PlaybackConfig) -> Result<Settings, BridgeError> {
    within("device.speed", &[config.speed], SPEEDS)?;
    within("device.rest_s", &[config.rest_s], RESTS_S)?;
    Ok(Settings { file: config.file.clone(), speed: config.speed, repeat: config.repeat, rest_s: config.rest_s })
}
