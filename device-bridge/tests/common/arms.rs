//! Arms that are not there, and what a bridge is told of them.
#![allow(unreachable_pub, missing_docs, clippy::unwrap_used)] // helpers of tests
use glam::DVec3;
use palpate_bridge::{
    config::{
        DeviceConfig, FalconConfig, Haply2diyConfig, HapticMasterConfig, HapticMasterContact, VrpnConfig,
        WoodenHapticsConfig,
    },
    emulate::{falcon, haply_2diy, hapticmaster, vrpn, woodenhaptics},
    settings::arm,
};
use palpate_control::{ArmSpec, HandPath};
use std::time::Duration;

/// Without an answer for so long an arm is lost: patient with a busy test machine.
pub const SILENCE_S: f64 = 0.4;

/// It is there until dropped.
pub struct Emulated {
    pub device: DeviceConfig,
    /// Of its motors, in its own axes (N); of one that lives in the bridge, none.
    motors_n: Box<dyn Fn() -> DVec3>,
}

impl Emulated {
    /// `there` is what `force_n` looks at.
    pub fn new<T: 'static>(device: DeviceConfig, there: T, force_n: fn(&T) -> DVec3) -> Self {
        Self { device, motors_n: Box::new(move || force_n(&there)) }
    }

    /// Its motors' force (N), in its own axes.
    pub fn force_n(&self) -> DVec3 {
        (self.motors_n)()
    }
}

pub fn falcon(path: HandPath) -> Emulated {
    let keys = |port: &str| FalconConfig { port: port.to_owned(), silence_s: SILENCE_S, ..FalconConfig::default() };
    let constants = arm::falcon::checked(&keys("")).unwrap();
    let arm = ArmSpec::default();
    let settings = falcon::Settings { constants, firmware: None, homing: Duration::ZERO, watchdog: None, arm, path };
    let arm = falcon::Falcon::start(settings).unwrap();
    Emulated::new(DeviceConfig::Falcon(keys(arm.port())), arm, falcon::Falcon::force_n)
}

pub fn haply_2diy(path: HandPath) -> Emulated {
    let keys = |port: &str| Haply2diyConfig {
        port: port.to_owned(),
        counts_per_turn: [40_000.0; 2],
        // Presses ask for more than the motors of the kit.
        max_torque_nm: 0.4,
        silence_s: SILENCE_S,
        ..Haply2diyConfig::default()
    };
    let constants = arm::haply_2diy::checked(&keys("")).unwrap();
    let arm = ArmSpec::default();
    let settings = haply_2diy::Settings { constants, knows_home: true, watchdog: None, arm, path };
    let arm = haply_2diy::Haply2diy::start(settings).unwrap();
    Emulated::new(DeviceConfig::Haply2diy(keys(arm.port())), arm, haply_2diy::Haply2diy::force_n)
}

/// In a hand that holds two kilograms.
pub fn hapticmaster(mut settings: hapticmaster::Settings, contact: HapticMasterContact) -> Emulated {
    settings.arm.hand_damping_n_s_per_m = 40.0;
    let arm = hapticmaster::HapticMaster::listen("127.0.0.1:0", settings).unwrap();
    let address = arm.address().to_string();
    let keys = HapticMasterConfig { address, contact, silence_s: SILENCE_S, ..HapticMasterConfig::default() };
    Emulated::new(DeviceConfig::Hapticmaster(keys), arm, hapticmaster::HapticMaster::effect_n)
}

pub fn vrpn(settings: vrpn::Settings) -> Emulated {
    let [tracker, button, force_device] = settings.names.clone();
    let arm = vrpn::Vrpn::listen("127.0.0.1:0", settings).unwrap();
    let address = arm.address().to_string();
    let keys = VrpnConfig { address, tracker, button, force_device, silence_s: SILENCE_S, ..VrpnConfig::default() };
    Emulated::new(DeviceConfig::Vrpn(keys), arm, vrpn::Vrpn::force_n)
}

pub fn woodenhaptics(path: HandPath) -> Emulated {
    let keys = |port: &str| WoodenHapticsConfig {
        port: port.to_owned(),
        centre_m: [0.22, 0.0, 0.08],
        silence_s: SILENCE_S,
        ..WoodenHapticsConfig::default()
    };
    let constants = arm::woodenhaptics::checked(&keys("")).unwrap();
    let settings = woodenhaptics::Settings { constants, answers: false, arm: ArmSpec::default(), path };
    let arm = woodenhaptics::WoodenHaptics::start(settings).unwrap();
    let device = DeviceConfig::Woodenhaptics(keys(arm.port()));
    Emulated::new(device, arm, woodenhaptics::WoodenHaptics::force_n)
}
