//! The kinds of arms that there are drivers for: each one's name, what people are told of it, and its keys.
use crate::config::{
    DeviceConfig, FalconConfig, Haply2diyConfig, HapticMasterConfig, Inverse3Config, PhantomConfig, PlaybackConfig,
    SimulatedConfig, VrpnConfig, WoodenHapticsConfig,
};
use serde::de::DeserializeOwned;
use std::fmt::Write as _;
use toml::de::ValueDeserializer;

/// What is told of a kind.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    /// As `--device` and `kind` of `[device]` have it.
    pub name: &'static str,
    /// What it is.
    pub what: &'static str,
    /// What it needs.
    pub needs: &'static str,
    /// What it was tried against.
    pub tried: &'static str,
    /// Its keys, each with its default.
    pub default: fn() -> DeviceConfig,
    /// Reads its keys, for the place where something is wrong with them.
    pub keys: fn(ValueDeserializer<'_>) -> Result<(), toml::de::Error>,
}

/// All of them.
pub static KINDS: [Kind; 9] = [
    Kind {
        name: "simulated",
        what: "no hardware: a mass held by a hand that follows a path",
        needs: "nothing",
        tried: "itself",
        default: || DeviceConfig::Simulated(SimulatedConfig::default()),
        keys: keys::<SimulatedConfig>,
    },
    Kind {
        name: "hapticmaster",
        what: "HapticMASTER (FCS, Moog), an admittance arm, over TCP",
        needs: "its address in the same network (docs/arms/hapticmaster.md)",
        tried: "palpate-bridge emulate hapticmaster; no hardware yet",
        default: || DeviceConfig::Hapticmaster(HapticMasterConfig::default()),
        keys: keys::<HapticMasterConfig>,
    },
    Kind {
        name: "woodenhaptics",
        what: "WoodenHaptics (open hardware), an impedance arm on a serial line",
        needs: "its port, and the right to open it (docs/arms/woodenhaptics.md)",
        tried: "palpate-bridge emulate woodenhaptics; no hardware yet",
        default: || DeviceConfig::Woodenhaptics(WoodenHapticsConfig::default()),
        keys: keys::<WoodenHapticsConfig>,
    },
    Kind {
        name: "phantom",
        what: "PHANToM, Touch (SensAble, Geomagic, 3D Systems), impedance arms, through OpenHaptics' libHD",
        needs: "OpenHaptics and the arm's driver (docs/arms/phantom.md)",
        tried: "a library in libHD's place and palpate-bridge emulate phantom; no hardware yet",
        default: || DeviceConfig::Phantom(PhantomConfig::default()),
        keys: keys::<PhantomConfig>,
    },
    Kind {
        name: "inverse3",
        what: "Haply Inverse3, an impedance arm behind its maker's service, over a WebSocket",
        needs: "Haply's Inverse service, on this machine or another (docs/arms/inverse3.md)",
        tried: "palpate-bridge emulate inverse3; no hardware yet",
        default: || DeviceConfig::Inverse3(Inverse3Config::default()),
        keys: keys::<Inverse3Config>,
    },
    Kind {
        name: "playback",
        what: "no hardware: a recording of any arm (palpate-bridge --record), played back",
        needs: "the file (docs/arms/playback.md)",
        tried: "recordings of the simulated arm",
        default: || DeviceConfig::Playback(PlaybackConfig::default()),
        keys: keys::<PlaybackConfig>,
    },
    Kind {
        name: "haply-2diy",
        what: "Haply 2diy (open hardware), an impedance arm in a plane, on a serial line",
        needs: "its port, and the right to open it (docs/arms/haply-2diy.md)",
        tried: "palpate-bridge emulate haply-2diy; no hardware yet",
        default: || DeviceConfig::Haply2diy(Haply2diyConfig::default()),
        keys: keys::<Haply2diyConfig>,
    },
    Kind {
        name: "falcon",
        what: "Novint Falcon, an impedance arm on the serial port of its USB chip",
        needs: "its port, the right to open it, and Novint's firmware (docs/arms/falcon.md)",
        tried: "palpate-bridge emulate falcon; no hardware yet",
        default: || DeviceConfig::Falcon(FalconConfig::default()),
        keys: keys::<FalconConfig>,
    },
    Kind {
        name: "vrpn",
        what: "any arm behind a VRPN server, over TCP",
        needs: "the server's address and the arm's names there (docs/arms/vrpn.md)",
        tried: "palpate-bridge emulate vrpn; no hardware yet",
        default: || DeviceConfig::Vrpn(VrpnConfig::default()),
        keys: keys::<VrpnConfig>,
    },
];

fn keys<Keys: DeserializeOwned>(table: ValueDeserializer<'_>) -> Result<(), toml::de::Error> {
    Keys::deserialize(table).map(|_| ())
}

/// The one with this name.
pub fn named(name: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.name == name)
}

/// A list of them.
pub fn list() -> String {
    let mut text = String::new();
    for Kind { name, what, needs, tried, .. } in &KINDS {
        // Writing into a String cannot fail.
        let _ = writeln!(
            text,
            "{name}\n    {what}\n    needs   {needs}\n    tried   against {tried}\n    check   palpate-bridge probe --device {name}\n\
             \x20   keys    palpate-bridge --device {name} --print-config"
        );
    }
    text
}
