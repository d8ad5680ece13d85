//! `[device]`: each kind of arm with its keys.
mod hapticmaster;
mod simulated;
mod vrpn;
mod woodenhaptics;

pub use hapticmaster::HapticMasterConfig;
use serde::{Deserialize, Serialize};
pub use simulated::{KeyframeConfig, SimulatedConfig};
pub use vrpn::VrpnConfig;
pub use woodenhaptics::WoodenHapticsConfig;

/// The arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum DeviceConfig {
    /// No hardware: a mass held by a hand that follows a path.
    Simulated(SimulatedConfig),
    /// HapticMASTER, over TCP.
    Hapticmaster(HapticMasterConfig),
    /// WoodenHaptics, on a serial line.
    Woodenhaptics(WoodenHapticsConfig),
    /// Any arm behind a VRPN server.
    Vrpn(VrpnConfig),
}

impl Default for DeviceConfig {
    fn default() -> Self {
        Self::Simulated(SimulatedConfig::default())
    }
}
