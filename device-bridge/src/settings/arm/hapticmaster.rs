//! What the keys of a HapticMASTER mean.
use super::{super::seconds, within};
use crate::{
    BridgeError,
    config::{HapticMasterConfig, LimitsConfig},
    device::hapticmaster::{Dialect, start::StartSettings},
};
use std::ops::RangeInclusive;

/// What a HapticMASTER can be made to feel like (kg).
const INERTIAS_KG: RangeInclusive<f64> = 2.0..=100.0;

pub(super) fn checked(config: &HapticMasterConfig, limits: &LimitsConfig) -> Result<StartSettings, BridgeError> {
    within("device.inertia_kg", &[config.inertia_kg], INERTIAS_KG)?;
    Ok(StartSettings {
        address: config.address.clone(),
        dialect: if config.apart { Dialect::Apart } else { Dialect::Mixed },
        inertia_kg: config.inertia_kg,
        max_force_n: limits.max_force_n,
        homing: seconds("device.homing_s", config.homing_s)?,
        silence: seconds("device.silence_s", config.silence_s)?,
    })
}
