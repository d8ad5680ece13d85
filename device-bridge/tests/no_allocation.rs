//! The servo thread touches no heap: device, law, slots, bell, counters.
#![allow(clippy::unwrap_used)]
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use glam::{DMat3, DVec3};
use palpate_bridge::{
    Config,
    config::{DeviceConfig, HapticMasterConfig, WoodenHapticsConfig},
    convert::Command,
    device::{self, Effort},
    emulate::{
        hapticmaster::{self, HapticMaster},
        woodenhaptics::{self, WoodenHaptics},
    },
    run::Shared,
    servo::{Servo, ServoLaw},
    settings::{Settings, arm},
};
use palpate_control::{ArmSpec, ForceLimits, HandPath, LocalModel, TorqueLimits};
use palpate_realtime::{Clock, Doorbell, TickLoop, slot};
use std::sync::{Arc, atomic::Ordering};
use tokio_util::sync::CancellationToken;

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn the_servo_allocates_nothing() {
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let mut config = Config::default();
    config.limits.max_torque_nm = 0.1;
    let settings = runtime.block_on(async { Settings::new(&config).unwrap() });
    let (mut commands, down) = slot(&None);
    let (up, mut samples) = slot(&None);
    let shared = Arc::new(Shared::default());
    shared.attached.store(true, Ordering::Relaxed);
    let mut servo = Servo {
        law: ServoLaw::new(settings.servo),
        device: device::open(&settings.device, 1e-3, &CancellationToken::new()).unwrap(),
        last: None,
        down,
        up,
        bell: Doorbell::new().unwrap(),
        shared: Arc::clone(&shared),
        sequence: 0,
    };
    let mut tick_loop = TickLoop::new(Clock::Monotonic, 1e-3).unwrap();
    let thread = std::thread::spawn(move || {
        assert_no_alloc(|| servo.run(&mut tick_loop));
    });
    // The other thread plays the uplink, for half a second.
    let model = LocalModel {
        point_m: DVec3::ZERO,
        normal: DVec3::Z,
        force_n: DVec3::Z,
        stiffness_n_per_m: DMat3::from_diagonal(DVec3::splat(-300.0)),
        validity_radius_m: 0.01,
        max_force_n: 100.0,
    };
    for tick in 0..500 {
        std::thread::sleep(std::time::Duration::from_millis(1));
        commands.publish(Some(Command {
            answers_ns: Clock::Monotonic.now_ns(),
            tick,
            force_n: DVec3::Z,
            local_model: (tick % 100 < 50).then_some(model),
            model_age_s: 0.0,
            limits: ForceLimits { max_force_n: 3.0, max_force_rate_n_per_s: 1000.0 },
            torque: (DVec3::Y * 0.05, TorqueLimits { max_torque_nm: 0.1, max_torque_rate_nm_per_s: 20.0 }),
        }));
    }
    shared.stop.store(true, Ordering::Relaxed);
    thread.join().unwrap();
    assert!(samples.take().is_some_and(|sample| sample.is_some_and(|sample| sample.sequence > 10)));
    assert!(shared.stats.summary().peak_force_n > 0.1);
}

/// An arm's driver: its sockets, its text, its numbers.
fn drive(device: DeviceConfig) {
    let config = Config { device, ..Config::default() };
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let settings = runtime.block_on(async { Settings::new(&config).unwrap() });
    let mut arm = device::open(&settings.device, 1e-3, &CancellationToken::new()).unwrap();
    for tick in 0..300 {
        std::thread::sleep(std::time::Duration::from_millis(1));
        // A busy machine is late: nothing is told here of how long an answer took.
        assert_no_alloc(|| {
            arm.read(0).unwrap();
            arm.apply(&Effort::force(DVec3::new(1e-7, -1.0 / 3.0, f64::from(tick))));
        });
    }
}

#[test]
fn the_hapticmasters_driver_allocates_nothing() {
    let emulated = HapticMaster::listen("127.0.0.1:0", hapticmaster::Settings::default()).unwrap();
    let address = emulated.address().to_string();
    drive(DeviceConfig::Hapticmaster(HapticMasterConfig { address, ..HapticMasterConfig::default() }));
    assert!(emulated.requests() > 40);
}

#[test]
fn the_woodenhaptics_driver_allocates_nothing() {
    let keys = WoodenHapticsConfig::default();
    let constants = arm::woodenhaptics::checked(&keys).unwrap();
    let path = HandPath::resting_at(DVec3::ZERO);
    let settings = woodenhaptics::Settings { constants, answers: false, arm: ArmSpec::default(), path };
    let emulated = WoodenHaptics::start(settings).unwrap();
    drive(DeviceConfig::Woodenhaptics(WoodenHapticsConfig { port: emulated.port().to_owned(), ..keys }));
    assert!(emulated.lines() > 100);
}
