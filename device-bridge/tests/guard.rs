//! The real program is killed, or stopped, with a force on each arm whose connection outlives it: the second process, its guard, takes the force away.
#![allow(clippy::unwrap_used)]
mod common;

use common::{
    Mock,
    press::{self, bridged, elsewhere, wall},
    until,
};
use glam::DVec3;
use palpate_bridge::{
    Config,
    config::{
        DeviceConfig, FalconConfig, Haply2diyConfig, HapticMasterConfig, HapticMasterContact, RecordConfig, VrpnConfig,
        WoodenHapticsConfig, WorkspaceConfig,
    },
    emulate::{falcon, haply_2diy, hapticmaster, vrpn, woodenhaptics},
    settings::arm,
};
use palpate_control::{ArmSpec, HandPath};
use rustix::process::{Pid, Signal, kill_process};
use std::{
    process::{Child, Command, Stdio},
    time::Duration,
};

/// Patient with a busy test machine.
const SILENCE_S: f64 = 0.4;

/// An arm, and what a bridge is told of it.
struct Arm {
    device: DeviceConfig,
    workspace: WorkspaceConfig,
    force_n: Box<dyn Fn() -> DVec3>,
    /// Its force, when nobody says anything any more.
    holds: Holds,
}

/// How long an emulator holds its last force.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Holds {
    /// It lets go when no message came for a while.
    NotForLong,
    /// It lets go when the connection ends.
    WhileConnected,
    /// It does not let go.
    ForEver,
}

fn resting() -> HandPath {
    HandPath::resting_at(DVec3::new(0.01, 0.02, 0.0))
}

/// The world's origin is the middle of its workspace.
fn here() -> WorkspaceConfig {
    WorkspaceConfig { origin_m: [0.0; 3], ..elsewhere() }
}

fn a_falcon() -> Arm {
    let keys = FalconConfig { silence_s: SILENCE_S, ..FalconConfig::default() };
    let constants = arm::falcon::checked(&FalconConfig { port: "-".into(), ..keys.clone() }).unwrap();
    let emulated = falcon::Falcon::start(falcon::Settings {
        constants,
        firmware: None,
        homing: Duration::ZERO,
        watchdog: None,
        arm: ArmSpec::default(),
        path: resting(),
    });
    let emulated = emulated.unwrap();
    let device = DeviceConfig::Falcon(FalconConfig { port: emulated.port().into(), ..keys });
    Arm { device, workspace: here(), force_n: Box::new(move || emulated.force_n()), holds: Holds::ForEver }
}

fn a_2diy() -> Arm {
    let keys = Haply2diyConfig { silence_s: SILENCE_S, max_torque_nm: 0.4, ..Haply2diyConfig::default() };
    let constants = arm::haply_2diy::checked(&Haply2diyConfig { port: "-".into(), ..keys.clone() }).unwrap();
    let emulated = haply_2diy::Haply2diy::start(haply_2diy::Settings {
        constants,
        knows_home: true,
        watchdog: None,
        arm: ArmSpec::default(),
        path: resting(),
    });
    let emulated = emulated.unwrap();
    let device = DeviceConfig::Haply2diy(Haply2diyConfig { port: emulated.port().into(), ..keys });
    // Its plane stands upright.
    let axes = ["+x", "+z", "-y"].map(str::to_owned);
    let workspace = WorkspaceConfig { axes, ..WorkspaceConfig::default() };
    Arm { device, workspace, force_n: Box::new(move || emulated.force_n()), holds: Holds::ForEver }
}

fn a_vrpn_server() -> Arm {
    let settings = vrpn::Settings { keeps: true, path: resting(), ..vrpn::Settings::default() };
    let names = settings.names.clone();
    let emulated = vrpn::Vrpn::listen("127.0.0.1:0", settings).unwrap();
    let [tracker, button, force_device] = names;
    let device = DeviceConfig::Vrpn(VrpnConfig {
        address: emulated.address().to_string(),
        tracker,
        button,
        force_device,
        silence_s: SILENCE_S,
        ..VrpnConfig::default()
    });
    Arm { device, workspace: here(), force_n: Box::new(move || emulated.force_n()), holds: Holds::ForEver }
}

fn a_hapticmaster() -> Arm {
    let settings = hapticmaster::Settings { path: resting(), ..hapticmaster::Settings::default() };
    hapticmaster_of(settings, HapticMasterContact::Bias, (here(), Holds::WhileConnected))
}

/// It keeps its effects when a connection ends, and renders the wall by itself.
fn a_hapticmaster_with_a_plane() -> Arm {
    let mut settings = hapticmaster::Settings { path: press::path(), ..hapticmaster::Settings::default() };
    settings.effects.kept = true;
    hapticmaster_of(settings, HapticMasterContact::Plane, (elsewhere(), Holds::ForEver))
}

fn hapticmaster_of(
    mut settings: hapticmaster::Settings,
    contact: HapticMasterContact,
    (workspace, holds): (WorkspaceConfig, Holds),
) -> Arm {
    settings.arm.hand_damping_n_s_per_m = 40.0;
    let emulated = hapticmaster::HapticMaster::listen("127.0.0.1:0", settings).unwrap();
    let device = DeviceConfig::Hapticmaster(HapticMasterConfig {
        address: emulated.address().to_string(),
        contact,
        silence_s: SILENCE_S,
        ..HapticMasterConfig::default()
    });
    Arm { device, workspace, force_n: Box::new(move || emulated.effect_n()), holds }
}

fn a_woodenhaptics() -> Arm {
    let keys = WoodenHapticsConfig { silence_s: SILENCE_S, ..WoodenHapticsConfig::default() };
    let constants = arm::woodenhaptics::checked(&WoodenHapticsConfig { port: "-".into(), ..keys.clone() }).unwrap();
    let (arm, path) = (ArmSpec::default(), resting());
    let settings = woodenhaptics::Settings { constants, answers: false, arm, path };
    let emulated = woodenhaptics::WoodenHaptics::start(settings).unwrap();
    let device = DeviceConfig::Woodenhaptics(WoodenHapticsConfig { port: emulated.port().into(), ..keys });
    Arm { device, workspace: here(), force_n: Box::new(move || emulated.force_n()), holds: Holds::NotForLong }
}

type Start = fn() -> Arm;

const ARMS: [(&str, Start); 6] = [
    ("Falcon", a_falcon),
    ("2diy", a_2diy),
    ("VRPN", a_vrpn_server),
    ("HapticMASTER", a_hapticmaster),
    ("HapticMASTER with a plane", a_hapticmaster_with_a_plane),
    ("WoodenHaptics", a_woodenhaptics),
];

/// The program; killed when the test ends, whatever its state.
struct Bridge {
    child: Child,
    _folder: tempfile::TempDir,
}

impl Bridge {
    fn start(config: &Config) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("bridge.toml");
        std::fs::write(&file, toml::to_string(config).unwrap()).unwrap();
        let mut program = Command::new(env!("CARGO_BIN_EXE_palpate-bridge"));
        program.arg("--config").arg(&file).stdin(Stdio::null()).stdout(Stdio::null()).env("RUST_LOG", "error");
        Self { child: program.spawn().unwrap(), _folder: folder }
    }

    fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// It hangs, and its connection stands.
    fn stop(&mut self) {
        kill_process(Pid::from_child(&self.child), Signal::STOP).unwrap();
    }

    fn go_on(&mut self) {
        kill_process(Pid::from_child(&self.child), Signal::CONT).unwrap();
    }

    fn assert_runs(&mut self) {
        assert!(self.child.try_wait().unwrap().is_none(), "the bridge has ended");
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A bridge that pushes with 1 N, or into the wall of the press where the arm renders it, until this happens to it.
async fn pushed(arm: &Arm, happens: Happens, change: impl FnOnce(&mut Config)) -> Bridge {
    let mock = Mock::default();
    let by_plane =
        matches!(&arm.device, DeviceConfig::Hapticmaster(keys) if keys.contact == HapticMasterContact::Plane);
    mock.set(|behaviour| behaviour.local_model = by_plane.then(wall));
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let mut config = bridged(&format!("http://{address}"), arm.device.clone());
    config.workspace = arm.workspace.clone();
    change(&mut config);
    let mut bridge = Bridge::start(&config);
    let enough_n = if by_plane { 0.8 } else { 0.9 };
    until("it pushes", || {
        bridge.assert_runs();
        (arm.force_n)().length() > enough_n
    })
    .await;
    happens(&mut bridge);
    bridge
}

type Happens = fn(&mut Bridge);

/// A bridge that is killed, whose connection ends with it, and one that hangs, whose connection stands.
const ENDS: [(&str, Happens); 2] = [("killed", Bridge::kill), ("stopped", Bridge::stop)];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_force_is_taken_away_when_the_bridge_is_killed_or_hangs() {
    for (name, start) in ARMS {
        for (what, happens) in ENDS {
            let arm = start();
            let _bridge = pushed(&arm, happens, |_| ()).await;
            until(&format!("a {name} whose bridge was {what} lets go"), || (arm.force_n)() == DVec3::ZERO).await;
        }
    }
}

/// The arm's answers to the guard were taken for its answers to the bridge, which ended.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bridge_that_hung_goes_on_and_its_force_comes_back() {
    for (name, start) in ARMS {
        let arm = start();
        let mut bridge = pushed(&arm, Bridge::stop, |config| config.servo.auto_recover = true).await;
        until(&format!("a {name} lets go"), || (arm.force_n)() == DVec3::ZERO).await;
        for _ in 0..2 {
            bridge.go_on();
            until(&format!("a {name} is pushed again"), || {
                bridge.assert_runs();
                (arm.force_n)().length() > 0.8
            })
            .await;
            bridge.stop();
            until(&format!("a {name} lets go again"), || (arm.force_n)() == DVec3::ZERO).await;
        }
    }
}

/// Else the emulators would have done it, and not the guard.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_a_guard_the_force_stays_where_the_arm_itself_does_not_let_go() {
    for (name, start) in ARMS {
        for (what, happens) in ENDS {
            let arm = start();
            let _bridge = pushed(&arm, happens, |config| config.servo.guard = false).await;
            // Longer than a guard is patient, and an arm with a watchdog of its own.
            tokio::time::sleep(Duration::from_millis(1500)).await;
            let holds = match arm.holds {
                Holds::NotForLong => false,
                Holds::WhileConnected => what == "stopped",
                Holds::ForEver => true,
            };
            let force_n = (arm.force_n)();
            // It moves meanwhile, and with it what its torques are worth.
            assert_eq!(force_n.length() > 0.5, holds, "a {name} whose bridge was {what}: {force_n}");
        }
    }
}

/// An arm that is recorded had no guard.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_arm_that_is_recorded_is_guarded_too() {
    let folder = tempfile::tempdir().unwrap();
    let arm = a_falcon();
    let record = RecordConfig { path: Some(folder.path().join("arm.csv")), overwrite: false };
    let _bridge = pushed(&arm, Bridge::kill, |config| config.record = record).await;
    until("it lets go", || (arm.force_n)() == DVec3::ZERO).await;
}
