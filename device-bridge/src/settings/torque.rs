//! Limits of torque.
use super::parameter;
use crate::{BridgeError, Config};
use palpate_control::TorqueLimits;

/// Checked.
pub(super) fn limits(config: &Config) -> Result<TorqueLimits, BridgeError> {
    let limits = &config.limits;
    let torque =
        TorqueLimits { max_torque_nm: limits.max_torque_nm, max_torque_rate_nm_per_s: limits.max_torque_rate_nm_per_s };
    torque.checked().map_err(|error| parameter("limits", &error))
}
