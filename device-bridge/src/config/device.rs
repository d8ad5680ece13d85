//! `[device]`: each kind of arm with its keys.
mod falcon;
mod haply_2diy;
mod hapticmaster;
mod simulated;
mod woodenhaptics;

pub use falcon::FalconConfig;
pub use haply_2diy::Haply2diyConfig;
pub use hapticmaster::HapticMasterConfig;
use serde::{Deserialize, Serialize};
pub use simulated::{KeyframeConfig, SimulatedConfig};
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
    /// Haply 2diy, on a serial line.
    #[serde(rename = "haply-2diy")]
    Haply2diy(Haply2diyConfig),
    /// Novint Falcon, on the serial port of its USB chip.
    Falcon(FalconConfig),
}

impl Default for DeviceConfig {
    fn default() -> Self {
        Self::Simulated(SimulatedConfig::default())
    }
}
