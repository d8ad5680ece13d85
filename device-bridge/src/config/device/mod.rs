//! `[device]`: each kind of arm with its keys.
mod falcon;
mod haply_2diy;
mod hapticmaster;
mod inverse3;
mod phantom;
mod playback;
mod simulated;
mod vrpn;
mod woodenhaptics;

use crate::device::kinds;
pub use falcon::FalconConfig;
pub use haply_2diy::Haply2diyConfig;
pub use hapticmaster::{HapticMasterConfig, HapticMasterContact};
pub use inverse3::{Inverse3Config, Inverse3Dialect};
pub use phantom::PhantomConfig;
pub use playback::PlaybackConfig;
use serde::{Deserialize, Serialize};
pub use simulated::{KeyframeConfig, SimulatedConfig};
use toml::de::{DeTable, DeValue};
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
    /// PHANToM or Touch, through OpenHaptics' libHD.
    Phantom(PhantomConfig),
    /// Haply Inverse3, over a WebSocket.
    Inverse3(Inverse3Config),
    /// No hardware: a recording.
    Playback(PlaybackConfig),
    /// Haply 2diy, on a serial line.
    #[serde(rename = "haply-2diy")]
    Haply2diy(Haply2diyConfig),
    /// Novint Falcon, on the serial port of its USB chip.
    Falcon(FalconConfig),
    /// Any arm behind a VRPN server.
    Vrpn(VrpnConfig),
}

/// What is wrong with the keys of `[device]`, and where: serde forgets the places in a table whose type one of its own keys tells.
pub(super) fn wrong_key(text: &str) -> Option<toml::de::Error> {
    let mut document = DeTable::parse(text).ok()?;
    let mut device = document.get_mut().remove("device")?;
    let DeValue::Table(table) = device.get_mut() else { return None };
    let kind = table.remove("kind")?;
    (kinds::named(kind.get_ref().as_str()?)?.keys)(device.into()).err()
}

impl Default for DeviceConfig {
    fn default() -> Self {
        Self::Simulated(SimulatedConfig::default())
    }
}
