//! A press on a wall, and an arm's end, the same for every driver.
use super::{Mock, config, start, until};
use glam::DVec3;
use palpate_bridge::{
    BridgeError, Config, Summary,
    config::{DeviceConfig, KeyframeConfig, SimulatedConfig, WorkspaceConfig},
    device::{Arm, Effort, Fault, Reading},
};
use palpate_control::{HandPath, Keyframe};
use palpate_proto::v1;
use std::time::{Duration, Instant};

const ORIGIN_M: DVec3 = DVec3::new(0.1, 0.0, -0.2);

/// The arm's x, y, z point along the world's −y, +x, +z, and its origin is elsewhere.
pub fn elsewhere() -> WorkspaceConfig {
    let axes = ["-y", "+x", "+z"].map(str::to_owned);
    WorkspaceConfig { axes, origin_m: ORIGIN_M.to_array(), ..WorkspaceConfig::default() }
}

/// A place of the world for an arm [`elsewhere`].
pub fn to_arm(world_m: DVec3) -> DVec3 {
    let d = world_m - ORIGIN_M;
    DVec3::new(-d.y, d.x, d.z)
}

pub fn bridged(url: &str, device: DeviceConfig) -> Config {
    Config { device, workspace: elsewhere(), ..config(url) }
}

/// A wall of 400 N/m whose surface is at z = 0.
pub fn wall() -> v1::LocalContactModel {
    let vec = |x, y, z| Some(v1::Vec3 { x, y, z });
    v1::LocalContactModel {
        point_m: vec(0.0, 0.0, 0.0),
        normal: vec(0.0, 0.0, 1.0),
        force_n: vec(0.0, 0.0, 0.0),
        stiffness_n_per_m: Some(v1::Mat3 { column_major: vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -400.0] }),
        validity_radius_m: 0.05,
        tick: 1_000_000,
        max_force_n: 3.0,
        torque: None,
    }
}

/// From above the wall into it, where it stays; the hand is the same on every arm. Time (s) and height (m).
pub const PRESS: [(f64, f64); 3] = [(0.0, 2e-3), (0.5, 2e-3), (1.5, -5e-3)];
/// What it ends at (N): 300 (5 mm − d) = 400 d, hand and wall as springs in series.
pub const PRESSED_N: f64 = 400.0 * 300.0 * 5e-3 / 700.0;

/// The press for a hand on an emulated arm, in the arm's axes.
pub fn path() -> HandPath {
    let key = |(time_s, z)| Keyframe { time_s, position_m: to_arm(DVec3::new(0.0, 0.0, z)) };
    HandPath::new(PRESS.map(key).to_vec(), None).unwrap()
}

pub fn simulated() -> DeviceConfig {
    let key = |(time_s, z)| KeyframeConfig { time_s, position_m: to_arm(DVec3::new(0.0, 0.0, z)).to_array() };
    DeviceConfig::Simulated(SimulatedConfig {
        period_s: None,
        keyframes: PRESS.map(key).to_vec(),
        ..SimulatedConfig::default()
    })
}

/// Presses; the force (N) once it no longer moves by more than `flicker_n` (N) within half a second: its mean over that.
pub async fn pressed_n(flicker_n: f64, device: DeviceConfig) -> (f64, Summary) {
    pressed_by(flicker_n, device, |_| {}).await
}

/// The same for an arm that is somewhere else.
pub async fn pressed_in_n(flicker_n: f64, workspace: WorkspaceConfig, device: DeviceConfig) -> (f64, Summary) {
    pressed_by(flicker_n, device, |config| config.workspace = workspace).await
}

/// The same, by a bridge whose configuration is changed before.
pub async fn pressed_by(flicker_n: f64, device: DeviceConfig, change: impl FnOnce(&mut Config)) -> (f64, Summary) {
    let mock = Mock::default();
    mock.set(|behaviour| behaviour.local_model = Some(wall()));
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let mut config = bridged(&format!("http://{address}"), device);
    config.passivity.strict = true;
    change(&mut config);
    let bridge = start(config);
    let stats = bridge.handle.stats();
    until("it presses", || stats.force_n() > 0.5).await;
    let mut last = std::collections::VecDeque::new();
    until("it has come to rest", || {
        last.push_back(stats.force_n());
        if last.len() > 250 {
            last.pop_front();
        }
        let (least, most) = last.iter().fold((f64::MAX, 0.0_f64), |(a, b), &n| (a.min(n), b.max(n)));
        last.len() == 250 && most - least <= flicker_n
    })
    .await;
    (last.iter().sum::<f64>() / 250.0, bridge.stop().await)
}

/// A bridge in full force (1 N along the world's z, and so the arm's); `fault` happens then. The fault it ended by, and its force (N) then.
pub async fn lost_by(device: DeviceConfig, arm_n: impl Fn() -> DVec3, fault: impl FnOnce()) -> (Fault, f64) {
    lost_in(elsewhere(), device, arm_n, fault).await
}

/// The same for an arm that is somewhere else; `arm_n` is in the world's axes then.
pub async fn lost_in(
    workspace: WorkspaceConfig,
    device: DeviceConfig,
    arm_n: impl Fn() -> DVec3,
    fault: impl FnOnce(),
) -> (Fault, f64) {
    let mock = Mock::default();
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let bridge = start(Config { workspace, ..bridged(&format!("http://{address}"), device) });
    let stats = bridge.handle.stats();
    until("the force is up", || stats.force_n() > 0.99 && (arm_n() - DVec3::Z).length() < 0.02).await;
    fault();
    let error = tokio::time::timeout(Duration::from_secs(20), bridge.task).await.unwrap().unwrap().unwrap_err();
    let force_n = bridge.handle.stats().force_n();
    until("the daemon saw the end", || mock.seen(|seen| seen.ended == 1)).await;
    match error {
        BridgeError::DeviceLost { fault } => (fault, force_n),
        other => panic!("{other}"),
    }
}

/// Drives an arm without a bridge and without force, tick by tick in real time, for 0.8 s; `look` sees every reading, and how long (s) it is since the one before.
pub fn follow(arm: &mut dyn Arm, mut look: impl FnMut(&Reading, f64)) {
    let (began, mut ticks) = (Instant::now(), 0);
    while began.elapsed() < Duration::from_millis(800) {
        // A machine that is busy skips ticks, as the loop does.
        let due = began.elapsed().as_millis() as u64 + 1;
        look(&arm.read(due - ticks).unwrap(), (due - ticks) as f64 * 1e-3);
        ticks = due;
        arm.apply(&Effort::NONE);
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// What following an arm showed.
pub struct Followed {
    /// How far from the arm its readings were at most, m.
    pub farthest_m: f64,
    /// The way that the velocities of all readings make, m.
    pub way_m: DVec3,
    /// The longest time for which nothing new came while the arm moved, s.
    pub silent_s: f64,
}

impl Followed {
    /// The way (m) that the arm makes at its fastest in that time. Both lengths above may be wrong by as much: a machine that
    /// is busy stops the arm's thread or this one for tens of milliseconds, and a velocity then stands for a time in which it
    /// was another.
    pub fn late_m(&self) -> f64 {
        FASTEST_M_PER_S * self.silent_s
    }
}

/// The hand of these tests moves no faster, m/s.
const FASTEST_M_PER_S: f64 = 0.2;

/// Follows an arm that is at `position_m`; `look` sees every reading.
///
/// One velocity says nothing where a busy machine tells lines late; all together make the way.
pub fn followed(arm: &mut dyn Arm, position_m: impl Fn() -> DVec3, mut look: impl FnMut(&Reading)) -> Followed {
    let (mut farthest_m, mut way_m) = (0.0_f64, DVec3::ZERO);
    let (mut silent_s, mut moved_at, mut last_m) = (0.0_f64, None, None);
    follow(arm, |reading, passed_s| {
        let at_m = reading.motion.position_m;
        farthest_m = farthest_m.max(at_m.distance(position_m()));
        way_m += passed_s * reading.motion.velocity_m_per_s;
        silent_s = silent_s.max(passed_s);
        if last_m.replace(at_m).is_some_and(|last_m| last_m != at_m) {
            let before = moved_at.replace(Instant::now());
            silent_s = silent_s.max(before.map_or(0.0, |before| before.elapsed().as_secs_f64()));
        }
        look(reading);
    });
    Followed { farthest_m, way_m, silent_s }
}

/// Puts a force on an arm for 30 ticks.
pub fn hold(arm: &mut dyn Arm, force_n: DVec3) {
    for _ in 0..30 {
        arm.read(1).unwrap();
        arm.apply(&Effort::force(force_n));
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// A weak force (N) is felt as it is; one that is far too strong in its direction, and as less than `most_n`; and none that is no number.
pub fn bounded(arm: &mut dyn Arm, felt_n: impl Fn() -> DVec3, weak_n: DVec3, most_n: f64) {
    let mut apply = |force_n: DVec3| {
        hold(arm, force_n);
        felt_n()
    };
    let weak = apply(weak_n);
    assert!((weak - weak_n).length() < 0.01, "{weak}");
    let strong = apply(weak_n * 1e6);
    assert!(strong.normalize().distance(weak_n.normalize()) < 0.02 && strong.length() < most_n, "{strong}");
    assert_eq!(apply(DVec3::new(f64::NAN, 0.0, 0.0)), DVec3::ZERO);
}
