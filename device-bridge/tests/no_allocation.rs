//! The servo thread touches no heap: device, law, slots, bell, counters.
#![allow(clippy::unwrap_used)]
#[path = "common/libhd.rs"]
mod libhd;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use glam::{DMat3, DVec3};
use palpate_bridge::recording::recorder::Failure;
use palpate_bridge::{
    Config,
    config::{
        DeviceConfig, FalconConfig, Haply2diyConfig, HapticMasterConfig, HapticMasterContact, Inverse3Config,
        PlaybackConfig, RecordConfig, VrpnConfig, WoodenHapticsConfig,
    },
    convert::Command,
    device::{
        self, Effort, LastWords,
        phantom::{
            ffi::Hd,
            frame::{Frame, Guard as FrameGuard, Next},
        },
    },
    emulate::{
        falcon::{self, Falcon},
        haply_2diy::{self, Haply2diy},
        hapticmaster::{self, HapticMaster},
        inverse3::{self, Inverse3},
        phantom,
        vrpn::{self, Vrpn},
        woodenhaptics::{self, WoodenHaptics},
    },
    guard::Guard,
    run::Shared,
    servo::{Servo, ServoLaw},
    settings::{Settings, arm},
    vrpn_server::moment::moments,
};
use palpate_control::{ArmSpec, ContactPlane, ForceLimits, HandPath, LocalModel, PhaseLock, TorqueLimits, Wait};
use palpate_realtime::{Clock, Doorbell, OsMeasures, TickLoop, slot};
use std::{
    sync::{Arc, atomic::Ordering},
    time::Duration,
};
use tokio_util::sync::CancellationToken;

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn the_servo_allocates_nothing() {
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let mut config = Config::default();
    // The force is on an arm that nobody pressed.
    config.passivity.strict = false;
    config.limits.max_torque_nm = 0.1;
    let settings = runtime.block_on(async { Settings::new(&config).unwrap() });
    let (mut commands, down) = slot(&None);
    let (up, mut samples) = slot(&None);
    let (told, mut moments, _bell) = moments(3).unwrap();
    let shared = Arc::new(Shared::default());
    shared.attached.store(true, Ordering::Relaxed);
    let words = LastWords { to: std::fs::File::create("/dev/null").unwrap().into(), bytes: b"stop".to_vec() };
    let program = std::path::Path::new(env!("CARGO_BIN_EXE_palpate-bridge"));
    let guard = Guard::start(program, words, Duration::from_mins(1), &OsMeasures::NONE).unwrap();
    let mut servo = Servo {
        law: ServoLaw::new(settings.servo),
        device: device::open(&settings.device, 1e-3, &CancellationToken::new(), &Failure::default(), |_| Ok(()))
            .unwrap(),
        last: None,
        down,
        up,
        bell: Doorbell::new().unwrap(),
        told: Some(told),
        shared: Arc::clone(&shared),
        sequence: 0,
        energy: palpate_control::EnergyMeter::default(),
        guard: Some(guard),
        phase: Some(PhaseLock::new(1_000_000)),
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
        std::thread::sleep(Duration::from_millis(1));
        shared.waits.tell(&Wait { waited_ns: 500_000, answered_after_ns: 900_000, tick_period_ns: 1_000_000 });
        commands.publish(Some(Command {
            answers_ns: Clock::Monotonic.now_ns(),
            tick,
            force_n: DVec3::Z,
            local_model: (tick % 100 < 50).then_some(model),
            local_torque: None,
            model_age_s: 0.0,
            limits: ForceLimits { max_force_n: 3.0, max_force_rate_n_per_s: 1000.0 },
            torque: (DVec3::Y * 0.05, TorqueLimits { max_torque_nm: 0.1, max_torque_rate_nm_per_s: 20.0 }),
        }));
    }
    shared.stop.store(true, Ordering::Relaxed);
    thread.join().unwrap();
    assert!(samples.take().is_some_and(|sample| sample.is_some_and(|sample| sample.sequence > 10)));
    assert!(shared.stats.summary().peak_force_n > 0.1);
    assert!(moments.take().is_some_and(|moment| moment.is_some_and(|moment| moment.number > 10)));
}

/// An arm's driver: its sockets, its text, its numbers.
fn drive(device: DeviceConfig) {
    // A busy machine is late: nothing is told here of how long an answer took.
    drive_by(&Config { device, ..Config::default() }, 0);
}

fn drive_by(config: &Config, periods: u64) {
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let settings = runtime.block_on(async { Settings::new(config).unwrap() });
    let mut arm =
        device::open(&settings.device, 1e-3, &CancellationToken::new(), &Failure::default(), |_| Ok(())).unwrap();
    for tick in 0..300 {
        std::thread::sleep(Duration::from_millis(1));
        std::thread::sleep(Duration::from_millis(1));
        // A busy machine is late: nothing is told here of how long an answer took.
        assert_no_alloc(|| {
            if tick == 100 {
                arm.last_words_were_said();
            }
            arm.read(periods).unwrap();
            // The plane moves, grows stiffer than any is, and goes now and then.
            let plane = ContactPlane {
                point_m: DVec3::new(-1.0 / 3.0, 1e-7, f64::from(tick) * 0.05),
                normal: DVec3::new(0.6, f64::from(tick) * 1e-9, -0.8),
                stiffness_n_per_m: 10.0_f64.powi(tick / 30),
                damping_n_s_per_m: f64::from(tick) / 7.0,
                max_force_n: 3.0,
            };
            let force_n = DVec3::new(1e-7, -1.0 / 3.0, f64::from(tick));
            arm.apply(&Effort { plane: (tick % 10 < 8).then_some(plane), ..Effort::force(force_n) });
        });
    }
}

#[test]
fn the_hapticmasters_driver_allocates_nothing() {
    let emulated = HapticMaster::listen("127.0.0.1:0", hapticmaster::Settings::default()).unwrap();
    for contact in [HapticMasterContact::Bias, HapticMasterContact::Plane] {
        let (address, before) = (emulated.address().to_string(), emulated.requests());
        drive(DeviceConfig::Hapticmaster(HapticMasterConfig { address, contact, ..HapticMasterConfig::default() }));
        assert!(emulated.requests() > before + 40);
    }
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

#[test]
fn the_phantoms_driver_allocates_nothing() {
    let emulated = libhd::Emulated::new(phantom::Settings::default());
    drive(DeviceConfig::Phantom(emulated.keys()));
    assert!(emulated.arm.frames() > 100);
}

/// What is done on libHD's own thread.
#[test]
fn a_phantoms_frame_allocates_nothing() {
    let emulated = libhd::Emulated::new(phantom::Settings { turns: true, ..phantom::Settings::default() });
    let hd = Hd::load(std::slice::from_ref(&emulated.library)).unwrap();
    let name = std::ffi::CString::new(emulated.arm.socket().to_str().unwrap()).unwrap();
    let device = hd.init_device(Some(&name)).unwrap();
    let ((poses, mut newest), (mut efforts, efforts_out)) = (slot(&None), slot(&Effort::NONE));
    let (guard, shared) = (FrameGuard::new(3.0, 0.1), Arc::default());
    let mut frame = Frame { hd, device, turns: true, guard, poses, efforts: efforts_out, shared };
    for _ in 0..100 {
        assert_no_alloc(|| {
            efforts.publish(Effort::force(DVec3::splat(0.1)));
            assert_eq!(frame.run(), Next::Again);
        });
    }
    assert!(newest.take().is_some_and(Option::is_some) && frame.shared.error().is_none());
}

/// Its socket's thread allocates; the loop beside it does not.
#[test]
fn the_inverse3s_driver_allocates_nothing() {
    let emulated = Inverse3::listen("127.0.0.1:0", inverse3::Settings::default()).unwrap();
    let keys = Inverse3Config { url: emulated.url(), silence_s: 5.0, ..Inverse3Config::default() };
    drive(DeviceConfig::Inverse3(keys));
    assert!(emulated.commands() > 100);
}

/// The first is recorded, and played back while that is recorded.
#[test]
fn recording_and_playback_allocate_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first.csv", "second.csv"].map(|name| folder.path().join(name));
    let record = |path: &std::path::Path| RecordConfig { path: Some(path.to_owned()), overwrite: false };
    drive_by(&Config { record: record(&first), ..Config::default() }, 1);
    let device = DeviceConfig::Playback(PlaybackConfig { file: first, ..PlaybackConfig::default() });
    drive_by(&Config { device, record: record(&second), ..Config::default() }, 1);
    assert_eq!(std::fs::read_to_string(second).unwrap().lines().count(), 301);
}

#[test]
fn the_2diys_driver_allocates_nothing() {
    let keys = Haply2diyConfig::default();
    let constants = arm::haply_2diy::checked(&keys).unwrap();
    let path = HandPath::resting_at(DVec3::ZERO);
    let settings = haply_2diy::Settings { constants, knows_home: true, watchdog: None, arm: ArmSpec::default(), path };
    let emulated = Haply2diy::start(settings).unwrap();
    drive(DeviceConfig::Haply2diy(Haply2diyConfig { port: emulated.port().to_owned(), ..keys }));
    assert!(emulated.requests() > 40);
}

#[test]
fn the_falcons_driver_allocates_nothing() {
    let keys = FalconConfig::default();
    let settings = falcon::Settings {
        constants: arm::falcon::checked(&keys).unwrap(),
        firmware: None,
        homing: Duration::ZERO,
        watchdog: None,
        arm: ArmSpec::default(),
        path: HandPath::resting_at(DVec3::ZERO),
    };
    let emulated = Falcon::start(settings).unwrap();
    drive(DeviceConfig::Falcon(FalconConfig { port: emulated.port().to_owned(), ..keys }));
    assert!(emulated.frames() > 40);
}

#[test]
fn the_vrpn_driver_allocates_nothing() {
    let emulated = Vrpn::listen("127.0.0.1:0", vrpn::Settings::default()).unwrap();
    let address = emulated.address().to_string();
    drive(DeviceConfig::Vrpn(VrpnConfig { address, ..VrpnConfig::default() }));
    assert!(emulated.fields() > 100);
}
