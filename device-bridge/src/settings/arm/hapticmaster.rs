//! What the keys of a HapticMASTER mean.
use super::{
    super::{seconds, value},
    within,
};
use crate::{
    BridgeError, Config,
    config::{HapticMasterConfig, HapticMasterContact},
    device::hapticmaster::{
        Dialect,
        plane::{DampFactor, PlaneSettings},
        start::StartSettings,
    },
};
use std::ops::RangeInclusive;

/// What a HapticMASTER can be made to feel like (kg).
const INERTIAS_KG: RangeInclusive<f64> = 2.0..=100.0;

pub(super) fn checked(arm: &HapticMasterConfig, config: &Config) -> Result<StartSettings, BridgeError> {
    within("device.inertia_kg", &[arm.inertia_kg], INERTIAS_KG)?;
    let by_plane = arm.contact == HapticMasterContact::Plane;
    if by_plane && !config.render.local_model {
        let reason = "the plane is the local model's: set render.local_model to true, or this to \"bias\"";
        return Err(value("device.contact", reason.into()));
    }
    let damp_factor =
        if arm.damping_is_ratio { DampFactor::Ratio { inertia_kg: arm.inertia_kg } } else { DampFactor::Coefficient };
    Ok(StartSettings {
        address: arm.address.clone(),
        dialect: if arm.apart { Dialect::Apart } else { Dialect::Mixed },
        inertia_kg: arm.inertia_kg,
        max_force_n: config.limits.max_force_n,
        plane: by_plane.then_some(PlaneSettings { damp_factor }),
        homing: seconds("device.homing_s", arm.homing_s)?,
        silence: seconds("device.silence_s", arm.silence_s)?,
    })
}
