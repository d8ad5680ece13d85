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
use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

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

/// What a press came to.
pub struct Pressed {
    /// The mean force (N) of the half second in which it came to rest.
    pub force_n: f64,
    pub summary: Summary,
    /// The longest time (s) for which the machine let a thread wait.
    late_s: f64,
}

impl Pressed {
    /// The force never was above `ratio` times `expected_n` (N), but for what the hand adds while a busy machine lets the loop or
    /// an answer wait: it comes at 7 mm/s, and the force that it meets is one of before.
    pub fn assert_peak_below(&self, ratio: f64, expected_n: f64) {
        let Self { summary, late_s, .. } = self;
        let [.., (from_s, from_m), (to_s, to_m)] = PRESS;
        let added_n = 400.0 * (from_m - to_m) / (to_s - from_s) * late_s;
        let most_n = ratio * expected_n + added_n;
        assert!(summary.peak_force_n < most_n, "at most {most_n} N was right, {late_s} s late:\n{summary}");
    }
}

/// Presses until the force no longer moves by more than `flicker_n` (N) within half a second.
pub async fn pressed(flicker_n: f64, device: DeviceConfig) -> Pressed {
    pressed_by(flicker_n, Duration::ZERO, device, |_| {}).await
}

/// The same for an arm that is somewhere else.
pub async fn pressed_in(flicker_n: f64, workspace: WorkspaceConfig, device: DeviceConfig) -> Pressed {
    pressed_by(flicker_n, Duration::ZERO, device, |config| config.workspace = workspace).await
}

/// The same, by a bridge whose configuration is changed before, and of an arm that is known to move for so long after it touches:
/// a rest on its way is not its end.
pub async fn pressed_by(
    flicker_n: f64,
    moves_for: Duration,
    device: DeviceConfig,
    change: impl FnOnce(&mut Config),
) -> Pressed {
    let sleeper = Sleeper::start();
    let mock = Mock::default();
    mock.set(|behaviour| behaviour.local_model = Some(wall()));
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let mut config = bridged(&format!("http://{address}"), device);
    config.passivity.strict = true;
    change(&mut config);
    let bridge = start(config);
    let stats = bridge.handle.stats();
    until("it presses", || stats.force_n() > 0.5).await;
    tokio::time::sleep(moves_for).await;
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
    let summary = bridge.stop().await;
    let late_ns = summary.round_trip.max_ns.max(summary.wakeup_lateness.max_ns).max(summary.tick_cost.max_ns);
    let late_s = sleeper.longest().as_secs_f64().max(late_ns as f64 * 1e-9);
    Pressed { force_n: last.iter().sum::<f64>() / 250.0, summary, late_s }
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
    /// How far (m) from the arm its readings were at most.
    farthest_m: f64,
    /// The way (m) that the velocities of all readings make.
    way_m: DVec3,
    /// The longest time (s) for which the machine let a thread wait.
    late_s: f64,
}

/// The hand of these tests moves no faster (m/s).
const FASTEST_M_PER_S: f64 = 0.2;

impl Followed {
    /// All readings were within `near_m` (m) of the arm.
    pub fn assert_near(&self, near_m: f64) {
        let Self { farthest_m, late_s, .. } = self;
        assert!(*farthest_m < near_m + self.late_m(), "{farthest_m} m from the arm, {late_s} s late");
    }

    /// The velocities of all readings make this way (m), within `near_m` (m).
    ///
    /// One velocity says nothing where a busy machine tells lines late; all together make the way.
    pub fn assert_way(&self, expected_m: DVec3, near_m: f64) {
        let Self { way_m, late_s, .. } = self;
        let wrong_m = way_m.distance(expected_m);
        assert!(wrong_m < near_m + self.late_m(), "{way_m} in place of {expected_m}, {late_s} s late");
    }

    /// The way (m) that the arm makes at its fastest while the machine lets a thread wait: a busy one stops the arm's thread or
    /// this one for tens of milliseconds, and a reading then stands for a time in which the arm was elsewhere.
    fn late_m(&self) -> f64 {
        FASTEST_M_PER_S * self.late_s
    }
}

/// How long a machine lets threads wait: a thread that sleeps for a millisecond at a time, and knows nothing of any arm, so that
/// no fault of a driver is taken for one of the machine.
struct Sleeper {
    is_over: Arc<AtomicBool>,
    sleeps: JoinHandle<Duration>,
}

impl Sleeper {
    fn start() -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        let ends = Arc::clone(&is_over);
        let sleeps = std::thread::spawn(move || {
            let mut longest = Duration::ZERO;
            while !ends.load(Ordering::Relaxed) {
                let began = Instant::now();
                std::thread::sleep(Duration::from_millis(1));
                longest = longest.max(began.elapsed());
            }
            longest
        });
        Self { is_over, sleeps }
    }

    /// Returns the longest millisecond.
    fn longest(self) -> Duration {
        self.is_over.store(true, Ordering::Relaxed);
        self.sleeps.join().unwrap()
    }
}

/// Follows an arm that is at `position_m`; `look` sees every reading.
pub fn followed(arm: &mut dyn Arm, position_m: impl Fn() -> DVec3, mut look: impl FnMut(&Reading)) -> Followed {
    let sleeper = Sleeper::start();
    let (mut farthest_m, mut way_m, mut late_s) = (0.0_f64, DVec3::ZERO, 0.0_f64);
    follow(arm, |reading, passed_s| {
        farthest_m = farthest_m.max(reading.motion.position_m.distance(position_m()));
        way_m += passed_s * reading.motion.velocity_m_per_s;
        late_s = late_s.max(passed_s);
        look(reading);
    });
    Followed { farthest_m, way_m, late_s: late_s.max(sleeper.longest().as_secs_f64()) }
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
