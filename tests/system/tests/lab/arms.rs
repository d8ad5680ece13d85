//! One arm of each kind that is not there, held by the same hand.
use glam::DVec3;
use palpate_bridge::{
    config::{
        DeviceConfig, FalconConfig, Haply2diyConfig, HapticMasterConfig, HapticMasterContact, Inverse3Config,
        KeyframeConfig, PhantomConfig, PlaybackConfig, SimulatedConfig, VrpnConfig, WoodenHapticsConfig,
        WorkspaceConfig,
    },
    emulate::{falcon, haply_2diy, hapticmaster, inverse3, phantom, vrpn, woodenhaptics},
    settings::arm,
};
use palpate_control::{ArmSpec, HandPath, Keyframe};
use std::{path::Path, time::Duration};

/// Where in the world the middle of the arms' workspaces is (m): 5 mm outside the place where the finger touches the ventricle.
pub const MIDDLE_M: DVec3 = DVec3::new(0.045, 0.0, 0.0);
/// Without an answer for so long an arm is lost: patient with a busy test machine.
const SILENCE_S: f64 = 0.4;

/// A hand that goes along the world's x: times (s) and places (m), again and again.
#[derive(Debug, Clone)]
pub struct Hand {
    pub keys: Vec<(f64, f64)>,
    pub period_s: f64,
}

impl Hand {
    fn keyframes(&self) -> Vec<Keyframe> {
        let key = |&(time_s, x)| Keyframe { time_s, position_m: DVec3::X * x - MIDDLE_M };
        self.keys.iter().map(key).collect()
    }

    fn path(&self) -> HandPath {
        HandPath::new(self.keyframes(), Some(self.period_s)).unwrap()
    }
}

/// It is there until dropped.
pub struct Emulated {
    pub device: DeviceConfig,
    /// Of its motors, in its own axes (N); of one that lives in the bridge, none.
    motors_n: Box<dyn Fn() -> DVec3>,
}

impl Emulated {
    /// `there` is what `force_n` looks at.
    fn new<T: 'static>(device: DeviceConfig, there: T, force_n: fn(&T) -> DVec3) -> Self {
        Self { device, motors_n: Box::new(move || force_n(&there)) }
    }

    /// Its motors' force (N).
    pub fn force_n(&self) -> f64 {
        (self.motors_n)().length()
    }
}

/// In the world: as it is turned, where it has room.
pub fn workspace() -> WorkspaceConfig {
    WorkspaceConfig { origin_m: MIDDLE_M.to_array(), ..WorkspaceConfig::default() }
}

pub fn simulated(hand: &Hand) -> Emulated {
    let key = |key: Keyframe| KeyframeConfig { time_s: key.time_s, position_m: key.position_m.to_array() };
    let keyframes = hand.keyframes().into_iter().map(key).collect();
    let device = SimulatedConfig { period_s: Some(hand.period_s), keyframes, ..SimulatedConfig::default() };
    Emulated::new(DeviceConfig::Simulated(device), (), |()| DVec3::ZERO)
}

/// `plane`: it renders the contact itself.
pub fn hapticmaster(hand: &Hand, plane: bool) -> Emulated {
    let mut settings = hapticmaster::Settings { path: hand.path(), homing: None, ..Default::default() };
    // A hand that holds two kilograms.
    settings.arm.hand_damping_n_s_per_m = 40.0;
    let arm = hapticmaster::HapticMaster::listen("127.0.0.1:0", settings).unwrap();
    let address = arm.address().to_string();
    let contact = if plane { HapticMasterContact::Plane } else { HapticMasterContact::Bias };
    let keys = HapticMasterConfig { address, contact, silence_s: SILENCE_S, ..HapticMasterConfig::default() };
    Emulated::new(DeviceConfig::Hapticmaster(keys), arm, hapticmaster::HapticMaster::effect_n)
}

pub fn woodenhaptics(hand: &Hand) -> Emulated {
    let keys = |port: &str| WoodenHapticsConfig {
        port: port.to_owned(),
        centre_m: [0.22, 0.0, 0.08],
        silence_s: SILENCE_S,
        ..WoodenHapticsConfig::default()
    };
    let constants = arm::woodenhaptics::checked(&keys("")).unwrap();
    let settings = woodenhaptics::Settings { constants, answers: false, arm: ArmSpec::default(), path: hand.path() };
    let arm = woodenhaptics::WoodenHaptics::start(settings).unwrap();
    let device = DeviceConfig::Woodenhaptics(keys(arm.port()));
    Emulated::new(device, arm, woodenhaptics::WoodenHaptics::force_n)
}

pub fn haply_2diy(hand: &Hand) -> Emulated {
    let keys = |port: &str| Haply2diyConfig {
        port: port.to_owned(),
        // The press is in its plane, and asks for more than the motors of the kit.
        counts_per_turn: [40_000.0; 2],
        max_torque_nm: 0.4,
        silence_s: SILENCE_S,
        ..Haply2diyConfig::default()
    };
    let constants = arm::haply_2diy::checked(&keys("")).unwrap();
    let (arm, path) = (ArmSpec::default(), hand.path());
    let settings = haply_2diy::Settings { constants, knows_home: true, watchdog: None, arm, path };
    let arm = haply_2diy::Haply2diy::start(settings).unwrap();
    let device = DeviceConfig::Haply2diy(keys(arm.port()));
    Emulated::new(device, arm, haply_2diy::Haply2diy::force_n)
}

pub fn falcon(hand: &Hand) -> Emulated {
    let keys = |port: &str| FalconConfig { port: port.to_owned(), silence_s: SILENCE_S, ..FalconConfig::default() };
    let constants = arm::falcon::checked(&keys("")).unwrap();
    let (arm, path) = (ArmSpec::default(), hand.path());
    let settings = falcon::Settings { constants, firmware: None, homing: Duration::ZERO, watchdog: None, arm, path };
    let arm = falcon::Falcon::start(settings).unwrap();
    Emulated::new(DeviceConfig::Falcon(keys(arm.port())), arm, falcon::Falcon::force_n)
}

pub fn inverse3(hand: &Hand) -> Emulated {
    let settings = inverse3::Settings { path: hand.path(), ..inverse3::Settings::default() };
    let arm = inverse3::Inverse3::listen("127.0.0.1:0", settings).unwrap();
    let keys = Inverse3Config { url: arm.url(), silence_s: SILENCE_S, ..Inverse3Config::default() };
    Emulated::new(DeviceConfig::Inverse3(keys), arm, inverse3::Inverse3::force_n)
}

pub fn vrpn(hand: &Hand) -> Emulated {
    let settings = vrpn::Settings { path: hand.path(), ..vrpn::Settings::default() };
    let names = settings.names.clone();
    let arm = vrpn::Vrpn::listen("127.0.0.1:0", settings).unwrap();
    let [tracker, button, force_device] = names;
    let address = arm.address().to_string();
    let keys = VrpnConfig { address, tracker, button, force_device, silence_s: SILENCE_S, ..VrpnConfig::default() };
    Emulated::new(DeviceConfig::Vrpn(keys), arm, vrpn::Vrpn::force_n)
}

/// `libhd`: what stands in libHD's place.
pub fn phantom(hand: &Hand, libhd: &Path) -> Emulated {
    let folder = tempfile::tempdir().unwrap();
    let settings = phantom::Settings { path: hand.path(), ..phantom::Settings::default() };
    let arm = phantom::Phantom::listen(&folder.path().join("arm"), settings).unwrap();
    let (library, name) = (libhd.to_str().unwrap().to_owned(), arm.socket().to_str().unwrap().to_owned());
    let keys = PhantomConfig { library, name, silence_s: SILENCE_S, ..PhantomConfig::default() };
    Emulated::new(DeviceConfig::Phantom(keys), (arm, folder), |(arm, _)| arm.force_n())
}

/// What another arm did, again.
pub fn playback(recording: &Path) -> Emulated {
    let keys = PlaybackConfig { file: recording.to_owned(), ..PlaybackConfig::default() };
    Emulated::new(DeviceConfig::Playback(keys), (), |()| DVec3::ZERO)
}
