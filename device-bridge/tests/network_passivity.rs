//! Does the hand ever get energy out of a wall behind a bad network? Arm, hand, servo law, network and daemon in simulated time; the energy is counted at the arm, not by the controller.
use glam::{DMat3, DVec3};
use palpate_bridge::{Config, convert::Command, servo::ServoLaw, settings::Settings};
use palpate_control::{ArmSpec, ForceLimits, HandPath, Keyframe, LocalModel, SimulatedArm};
use std::collections::BTreeMap;

const MS: u64 = 1_000_000;
const TICKS: u64 = 6000;

/// What happens to a message on its way.
#[derive(Debug, Clone, Copy)]
struct Network {
    /// Each way (ticks).
    delay: u64,
    /// Up to so many ticks more, drawn anew for each: messages overtake one another.
    jitter: u64,
    /// Lost, of 100.
    loss_percent: u64,
}

/// A linear congruential generator (Knuth's MMIX constants); its high bits.
struct Random(u64);

impl Random {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }
}

impl Network {
    fn arrival(&self, now: u64, random: &mut Random) -> Option<u64> {
        let lost = random.below(100) < self.loss_percent;
        let late = random.below(self.jitter + 1);
        // The next tick at the soonest.
        (!lost).then_some(now + 1 + self.delay + late)
    }
}

/// What a run did.
#[derive(Debug, Clone, Copy)]
struct Found {
    /// Least energy (J) that the arm had put into the wall, over all ticks.
    least_j: f64,
    /// Of the force on the arm (N s).
    impulse_n_s: f64,
    damped_ticks: u32,
}

/// A hand that goes into the wall and out of it, and shakes there.
fn hand() -> HandPath {
    let depths_m = [3e-3, -4e-3, -2e-3, -6e-3, 3e-3, -5e-3, -1e-3, -3e-3, 4e-3];
    let key = |(n, z): (usize, &f64)| Keyframe { time_s: 0.5 * n as f64, position_m: DVec3::new(0.0, 0.0, *z) };
    HandPath::new(depths_m.iter().enumerate().map(key).collect(), Some(4.5)).unwrap()
}

/// `wall_n_per_m` at z = 0, felt through `network`.
fn run(network: Network, wall_n_per_m: f64, seed: u64, change: impl Fn(&mut Config)) -> Found {
    let mut config = Config::default();
    config.servo.auto_recover = true;
    change(&mut config);
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let mut law = ServoLaw::new(runtime.block_on(async { Settings::new(&config).unwrap() }).servo);
    let spec = ArmSpec { hand_stiffness_n_per_m: 100.0, hand_damping_n_s_per_m: 1.0, ..ArmSpec::default() };
    let mut arm = SimulatedArm::new(spec, hand(), 1e-3).unwrap();
    let mut random = Random(seed);
    // By tick of arrival: tick of the pose, and the pose.
    let mut up: BTreeMap<u64, Vec<(u64, DVec3)>> = BTreeMap::new();
    let mut down: BTreeMap<u64, Vec<Command>> = BTreeMap::new();
    let (mut newest_pose, mut newest_command) = (0, 0);
    let mut found = Found { least_j: 0.0, impulse_n_s: 0.0, damped_ticks: 0 };
    let mut energy_j = 0.0;
    for tick in 1..=TICKS {
        for (of_tick, position_m) in up.remove(&tick).into_iter().flatten() {
            // Both ends drop what is older than what they have.
            if of_tick > newest_pose {
                newest_pose = of_tick;
                if let Some(arrives) = network.arrival(tick, &mut random) {
                    down.entry(arrives).or_default().push(answer(of_tick, tick, position_m, wall_n_per_m));
                }
            }
        }
        for command in down.remove(&tick).into_iter().flatten() {
            if command.tick > newest_command {
                newest_command = command.tick;
                law.receive(&command);
            }
        }
        let before_m = arm.motion().position_m;
        let out = law.tick(tick * MS, &arm.motion());
        let force_n = out.limited.force_n;
        let after_m = arm.step(force_n).position_m;
        // The force is held over the tick: it does F·Δx on the arm.
        energy_j -= force_n.dot(after_m - before_m);
        found.least_j = found.least_j.min(energy_j);
        found.impulse_n_s += force_n.length() * 1e-3;
        found.damped_ticks += u32::from(out.added_damping_n_s_per_m > 0.0 || out.is_capped);
        if let Some(arrives) = network.arrival(tick, &mut random) {
            up.entry(arrives).or_default().push((tick, after_m));
        }
    }
    found
}

fn answer(of_tick: u64, tick: u64, position_m: DVec3, wall_n_per_m: f64) -> Command {
    let force_n = DVec3::Z * (-wall_n_per_m * position_m.z).max(0.0);
    let model = LocalModel {
        point_m: position_m,
        normal: DVec3::Z,
        force_n,
        stiffness_n_per_m: DMat3::from_diagonal(DVec3::new(0.0, 0.0, -wall_n_per_m)),
        validity_radius_m: 5e-3,
        max_force_n: 8.0,
    };
    Command {
        answers_ns: of_tick * MS,
        tick,
        force_n,
        local_model: (position_m.z < 0.0).then_some(model),
        local_torque: None,
        model_age_s: 0.0,
        limits: ForceLimits { max_force_n: 8.0, max_force_rate_n_per_s: 1e5 },
        torque: (DVec3::ZERO, palpate_control::TorqueLimits::NONE),
    }
}

fn networks() -> impl Iterator<Item = Network> {
    [0, 1, 2, 5, 10, 20].into_iter().flat_map(|delay| {
        [0, 3, 10].into_iter().flat_map(move |jitter| {
            [0, 5, 20].into_iter().map(move |loss_percent| Network { delay, jitter, loss_percent })
        })
    })
}

/// Old answers are believed, so that the controller alone stands between a bad network and the hand.
fn credulous(config: &mut Config) {
    config.watchdog.fresh_for_s = 0.1;
    config.watchdog.stale_after_s = 0.2;
    config.limits.max_force_n = 8.0;
    config.limits.max_force_rate_n_per_s = 1e5;
}

/// Walls as stiff as this arm may be given (2 b/T), rendered beside the arm or as they come.
fn walls() -> impl Iterator<Item = (f64, bool)> {
    [200.0, 400.0, 800.0].into_iter().flat_map(|n_per_m| [(n_per_m, true), (n_per_m, false)])
}

#[test]
fn the_hand_gets_no_energy_out_of_a_wall_behind_any_network() {
    let (mut damped, mut worst_without_j, mut worst_lenient_j, mut worst_j) = (0, 0.0_f64, 0.0_f64, 0.0_f64);
    for (network, (wall_n_per_m, local)) in networks().flat_map(|network| walls().map(move |wall| (network, wall))) {
        for watchdog in [credulous as fn(&mut Config), |_: &mut Config| ()] {
            let of = |enabled: bool, strict: bool| {
                run(network, wall_n_per_m, 7 + network.delay, |config| {
                    watchdog(config);
                    config.render.local_model = local;
                    (config.passivity.enabled, config.passivity.strict) = (enabled, strict);
                })
            };
            let found = of(true, true);
            assert!(found.least_j >= -1e-6, "{network:?} {wall_n_per_m} N/m, local model {local}: {found:?}");
            damped += u64::from(found.damped_ticks);
            worst_j = worst_j.min(found.least_j);
            worst_lenient_j = worst_lenient_j.min(of(true, false).least_j);
            worst_without_j = worst_without_j.min(of(false, false).least_j);
        }
    }
    println!("least energy: strict {worst_j:e} J, lenient {worst_lenient_j:e} J, without {worst_without_j:e} J");
    // The same without the controller, or with the lenient one: this test can fail.
    assert!(worst_without_j < -1e-2 && worst_lenient_j < -1e-4 && damped > 100_000, "{damped} ticks");
}

/// A controller that takes the force away is passive, too. On a good network it must hardly be felt.
#[test]
fn on_a_good_network_the_controller_is_not_felt() {
    for (delay, most) in [(0, 0.02), (1, 0.03)] {
        let network = Network { delay, jitter: 0, loss_percent: 0 };
        let impulse_n_s = |enabled: bool| {
            run(network, 400.0, 1, |config| (config.passivity.enabled, config.passivity.strict) = (enabled, true))
                .impulse_n_s
        };
        let (with, without) = (impulse_n_s(true), impulse_n_s(false));
        println!("{delay}: {with} {without}");
        assert!((with / without - 1.0).abs() < most && without > 0.5, "{delay} ms: {with} of {without} N s");
    }
}
