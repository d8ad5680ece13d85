//! The real program is killed, or stopped, with a force on each arm whose connection outlives it: the second process, its guard, takes the force away.
#![allow(clippy::unwrap_used)]
#[path = "common/arms.rs"]
mod arms;
mod common;

use arms::Emulated;
use common::{
    Mock,
    press::{self, bridged, elsewhere, wall},
    until,
};
use glam::DVec3;
use palpate_bridge::{
    Config,
    config::{DeviceConfig, HapticMasterContact, RecordConfig, WorkspaceConfig},
    emulate::{hapticmaster, vrpn},
};
use palpate_control::HandPath;
use rustix::process::{Pid, Signal, kill_process};
use std::{
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

/// An arm, where it is, and its force when nobody says anything any more.
struct Arm {
    emulated: Emulated,
    workspace: WorkspaceConfig,
    holds: Holds,
    /// Its force (N) where nobody holds it back: 1 N is asked for.
    full_n: f64,
}

impl Arm {
    fn force_n(&self) -> DVec3 {
        self.emulated.force_n()
    }
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
    Arm { emulated: arms::falcon(resting()), workspace: here(), holds: Holds::ForEver, full_n: 1.0 }
}

fn a_2diy() -> Arm {
    // Its plane stands upright.
    let axes = ["+x", "+z", "-y"].map(str::to_owned);
    let workspace = WorkspaceConfig { axes, ..WorkspaceConfig::default() };
    Arm { emulated: arms::haply_2diy(resting()), workspace, holds: Holds::ForEver, full_n: 1.0 }
}

fn a_vrpn_server() -> Arm {
    let settings = vrpn::Settings { keeps: true, path: resting(), ..vrpn::Settings::default() };
    Arm { emulated: arms::vrpn(settings), workspace: here(), holds: Holds::ForEver, full_n: 1.0 }
}

fn a_hapticmaster() -> Arm {
    let settings = hapticmaster::Settings { path: resting(), ..hapticmaster::Settings::default() };
    let emulated = arms::hapticmaster(settings, HapticMasterContact::Bias);
    Arm { emulated, workspace: here(), holds: Holds::WhileConnected, full_n: 1.0 }
}

/// It keeps its effects when a connection ends, and renders the wall by itself.
fn a_hapticmaster_with_a_plane() -> Arm {
    let mut settings = hapticmaster::Settings { path: press::path(), ..hapticmaster::Settings::default() };
    settings.effects.kept = true;
    let emulated = arms::hapticmaster(settings, HapticMasterContact::Plane);
    // Of the wall of the press, were the hand in it to the end.
    Arm { emulated, workspace: elsewhere(), holds: Holds::ForEver, full_n: 2.0 }
}

fn a_woodenhaptics() -> Arm {
    Arm { emulated: arms::woodenhaptics(resting()), workspace: here(), holds: Holds::NotForLong, full_n: 1.0 }
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
        program.arg("--config").arg(&file).stdin(Stdio::null()).stdout(Stdio::null()).env("PALPATE_LOG", "error");
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
        matches!(&arm.emulated.device, DeviceConfig::Hapticmaster(keys) if keys.contact == HapticMasterContact::Plane);
    mock.set(|behaviour| behaviour.local_model = by_plane.then(wall));
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let mut config = bridged(&format!("http://{address}"), arm.emulated.device.clone());
    config.workspace = arm.workspace.clone();
    change(&mut config);
    let mut bridge = Bridge::start(&config);
    let enough_n = if by_plane { 0.8 } else { 0.9 };
    until("it pushes", || {
        bridge.assert_runs();
        arm.force_n().length() > enough_n
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
            until(&format!("a {name} whose bridge was {what} lets go"), || arm.force_n() == DVec3::ZERO).await;
        }
    }
}

/// The arm's answers to the guard were taken for its answers to the bridge, which ended. Nor may the force be back at once, or twice over.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bridge_that_hung_goes_on_and_its_force_comes_back() {
    for (name, start) in ARMS {
        let arm = start();
        let ramp_up_s = 0.5;
        let mut bridge = pushed(
            &arm,
            |_| (),
            |config| {
                config.servo.auto_recover = true;
                config.watchdog.ramp_up_s = ramp_up_s;
            },
        )
        .await;
        // The full force, with what encoders' steps and the arm's movements make of it.
        let (began, mut full_n) = (Instant::now(), arm.full_n);
        while began.elapsed() < Duration::from_secs_f64(ramp_up_s) {
            full_n = full_n.max(arm.force_n().length());
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        assert!(full_n <= 1.25 * arm.full_n, "a {name}: {full_n} N where {} N is asked for", arm.full_n);
        bridge.stop();
        until(&format!("a {name} lets go"), || arm.force_n() == DVec3::ZERO).await;
        for _ in 0..2 {
            let mut without_force = Instant::now();
            bridge.go_on();
            until(&format!("a {name} is pushed again"), || {
                bridge.assert_runs();
                let looked = Instant::now();
                let force_n = arm.force_n().length();
                // F <= t/ramp_up F_full, with what encoders' steps make of it where the arm is now.
                let ramp = (without_force.elapsed().as_secs_f64() / ramp_up_s).min(1.0);
                assert!(force_n <= ramp * full_n + 0.1, "a {name}: {force_n} N at {ramp} of the ramp");
                if force_n == 0.0 {
                    without_force = looked;
                }
                ramp == 1.0 && force_n > 0.8
            })
            .await;
            bridge.stop();
            until(&format!("a {name} lets go again"), || arm.force_n() == DVec3::ZERO).await;
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
            let force_n = arm.force_n();
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
    until("it lets go", || arm.force_n() == DVec3::ZERO).await;
}
