//! One arm of each kind that is not there, held by the same hand.
#[path = "../../../../device-bridge/tests/common/arms.rs"]
mod emulated;

pub use emulated::Emulated;
use emulated::SILENCE_S;
use glam::DVec3;
use palpate_bridge::{
    config::{
        DeviceConfig, HapticMasterContact, Inverse3Config, KeyframeConfig, PhantomConfig, PlaybackConfig,
        SimulatedConfig, WorkspaceConfig,
    },
    emulate::{hapticmaster, inverse3, phantom, vrpn},
};
use palpate_control::{HandPath, Keyframe};
use std::path::Path;

/// Where in the world the middle of the arms' workspaces is (m): 5 mm outside the place where the finger touches the ventricle.
pub const MIDDLE_M: DVec3 = DVec3::new(0.045, 0.0, 0.0);

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
    let settings = hapticmaster::Settings { path: hand.path(), homing: None, ..Default::default() };
    emulated::hapticmaster(settings, if plane { HapticMasterContact::Plane } else { HapticMasterContact::Bias })
}

pub fn woodenhaptics(hand: &Hand) -> Emulated {
    emulated::woodenhaptics(hand.path())
}

/// The press is in its plane.
pub fn haply_2diy(hand: &Hand) -> Emulated {
    emulated::haply_2diy(hand.path())
}

pub fn falcon(hand: &Hand) -> Emulated {
    emulated::falcon(hand.path())
}

pub fn inverse3(hand: &Hand) -> Emulated {
    let settings = inverse3::Settings { path: hand.path(), ..inverse3::Settings::default() };
    let arm = inverse3::Inverse3::listen("127.0.0.1:0", settings).unwrap();
    let keys = Inverse3Config { url: arm.url(), silence_s: SILENCE_S, ..Inverse3Config::default() };
    Emulated::new(DeviceConfig::Inverse3(keys), arm, inverse3::Inverse3::force_n)
}

pub fn vrpn(hand: &Hand) -> Emulated {
    emulated::vrpn(vrpn::Settings { path: hand.path(), ..vrpn::Settings::default() })
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
