//! The Inverse3's driver against its emulator, over real WebSockets: beneath a bridge, and alone.

use crate::common;
use crate::common::press::{self, PRESSED_N, lost_by, pressed, simulated};
use glam::{DQuat, DVec3};
use palpate_bridge::{
    config::{DeviceConfig, Inverse3Config, Inverse3Dialect, RealtimeConfig},
    device::{
        Arm as _, Effort, Fault,
        inverse3::{self as driver, Dialect},
    },
    emulate::{
        Faults,
        inverse3::{DEVICE_ID, GRIP_ID, Garbage, Grip, Inverse3, Settings},
    },
    settings::arm,
};
use palpate_control::{HandPath, Keyframe};
use std::{
    io::{Read as _, Write as _},
    net::TcpListener,
    sync::atomic::Ordering,
    time::{Duration, Instant},
};

/// Patient with a busy test machine.
fn keys(url: &str) -> Inverse3Config {
    Inverse3Config { url: url.to_owned(), silence_s: 0.4, ..Inverse3Config::default() }
}

fn emulator(settings: Settings) -> Inverse3 {
    Inverse3::listen("127.0.0.1:0", settings).unwrap()
}

fn resting() -> Settings {
    Settings { path: HandPath::resting_at(DVec3::new(0.01, 0.02, 0.03)), ..Settings::default() }
}

fn device(arm: &Inverse3) -> DeviceConfig {
    DeviceConfig::Inverse3(keys(&arm.url()))
}

fn started(keys: &Inverse3Config) -> Result<driver::Inverse3, driver::StartError> {
    let realtime = RealtimeConfig { fifo_priority: 0, ..RealtimeConfig::default() };
    driver::Inverse3::start(&arm::inverse3::checked(keys, &realtime).unwrap())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_ends_at_the_force_of_the_simulated_arm() {
    let expected_n = pressed(2e-4, simulated()).await.force_n;
    assert!((expected_n - PRESSED_N).abs() < 0.01, "{expected_n}");
    for (dialect, told, streams) in [
        (Dialect::Values, Inverse3Dialect::Values, false),
        (Dialect::Vector, Inverse3Dialect::Vector, false),
        (Dialect::Vector, Inverse3Dialect::Vector, true),
    ] {
        let arm = emulator(Settings { dialect: Some(dialect), streams, path: press::path(), ..Settings::default() });
        let keys = Inverse3Config { dialect: told, ..keys(&arm.url()) };
        let pressed = pressed(0.01, DeviceConfig::Inverse3(keys)).await;
        let found_n = pressed.force_n;
        assert!((found_n / expected_n - 1.0).abs() < 0.02, "{found_n} N, {expected_n} N: {dialect:?}, {streams}");
        pressed.assert_peak_below(1.1, expected_n);
        common::until("the bridge took its force away when it ended", || arm.force_n() == DVec3::ZERO).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_fault_of_the_arm_takes_the_force_away_and_is_named() {
    type Cause = fn(&Faults);
    let causes: [(Cause, Fault); 3] = [
        (|faults| Faults::set(&faults.silence, true), Fault::Silent),
        (|faults| Faults::set(&faults.cut, true), Fault::Disconnected),
        (|faults| faults.slow_us.store(900_000, Ordering::Relaxed), Fault::Silent),
    ];
    for (cause, fault) in causes {
        let arm = emulator(resting());
        let found = lost_by(device(&arm), || arm.force_n(), || cause(&arm.faults)).await;
        assert_eq!(found, (fault, 0.0));
        common::until("the arm has no force", || arm.force_n() == DVec3::ZERO).await;
    }
    for garbage in Garbage::ALL {
        let arm = emulator(Settings { garbage, ..resting() });
        let found = lost_by(device(&arm), || arm.force_n(), || Faults::set(&arm.faults.garbage, true)).await;
        assert_eq!(found, (Fault::Garbled, 0.0), "{garbage:?}");
        common::until("the arm has no force", || arm.force_n() == DVec3::ZERO).await;
    }
}

/// A service that is stopped says so.
#[test]
fn a_service_that_closes_is_disconnected_every_time_from_then_on() {
    let emulated = emulator(resting());
    let mut arm = started(&keys(&emulated.url())).unwrap();
    press::hold(&mut arm, DVec3::Z);
    drop(emulated);
    let began = Instant::now();
    while arm.read(1).is_ok() {
        assert!(began.elapsed() < Duration::from_secs(5));
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!([arm.read(1), arm.read(1)], [Err(Fault::Disconnected); 2]);
    arm.apply(&Effort::force(DVec3::Z));
}

/// The thread of the socket takes the force away when the loop says none, and goes on asking; and gives it back.
#[test]
fn a_loop_that_falls_silent_leaves_no_force() {
    let emulated = emulator(resting());
    let mut arm = started(&keys(&emulated.url())).unwrap();
    for _ in 0..2 {
        let began = Instant::now();
        while emulated.force_n() != DVec3::Z {
            assert!(began.elapsed() < Duration::from_secs(5), "{}", emulated.force_n());
            press::hold(&mut arm, DVec3::Z);
        }
        let held = Instant::now();
        while emulated.force_n() != DVec3::ZERO {
            assert!(held.elapsed() < Duration::from_secs(5));
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(held.elapsed() > Duration::from_millis(300), "{:?}", held.elapsed());
        let before = emulated.commands();
        std::thread::sleep(Duration::from_millis(200));
        assert!(emulated.commands() > before + 5, "it is still asked");
        assert!(arm.read(1).is_ok());
    }
}

/// With an answer on its way that does not come: a force that ends is told all the same.
#[test]
fn letting_go_does_not_wait_for_an_answer() {
    let emulated = emulator(resting());
    let mut arm = started(&keys(&emulated.url())).unwrap();
    press::hold(&mut arm, DVec3::Z);
    Faults::set(&emulated.faults.silence, true);
    let mut before = u64::MAX;
    // The last command before the silence was answered or not; then nothing more is asked.
    while emulated.commands() != before {
        before = emulated.commands();
        arm.apply(&Effort::force(DVec3::Z));
        std::thread::sleep(Duration::from_millis(30));
    }
    arm.apply(&Effort::NONE);
    let began = Instant::now();
    while emulated.commands() == before {
        assert!(began.elapsed() < Duration::from_secs(5));
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(emulated.force_n(), DVec3::ZERO);
}

#[test]
fn a_dropped_arm_has_no_force_at_once() {
    let emulated = emulator(resting());
    let mut arm = started(&keys(&emulated.url())).unwrap();
    press::hold(&mut arm, DVec3::Z);
    drop(arm);
    assert_eq!(emulated.force_n(), DVec3::ZERO);
}

#[test]
fn a_probe_says_where_the_arm_is() {
    let arm = emulator(Settings { others: 1, ..resting() });
    arm.hold_grip(DQuat::IDENTITY, 0b101);
    let keys = Inverse3Config { device_id: DEVICE_ID.into(), ..keys(&arm.url()) };
    let report = common::probed(DeviceConfig::Inverse3(keys.clone()), Duration::from_millis(400)).unwrap();
    assert!(report.position_m.distance(DVec3::new(0.01, 0.02, 0.03)) < 1e-6, "{report}");
    assert!(report.measured_force_n.is_none() && report.buttons == 0b101 && report.poses_per_s > 50.0, "{report}");
    Faults::set(&arm.faults.cut, true);
    std::thread::sleep(Duration::from_millis(20));
    assert!(common::probed(DeviceConfig::Inverse3(keys), Duration::from_millis(100)).is_err());
}

/// Frames split into bytes, messages split into frames, several at once, slow ones: place and velocity follow the arm, as far as their age allows.
#[test]
fn poses_follow_the_arm_however_its_messages_come() {
    for (split, copies, streams, slow_us) in
        [(false, 1, false, 0), (true, 1, false, 0), (false, 3, false, 0), (false, 2, true, 0), (false, 1, false, 8000)]
    {
        let keys_of = [(0.0, 0.0), (0.3, 0.03)].map(|(time_s, x)| Keyframe { time_s, position_m: DVec3::X * x });
        let path = HandPath::new(keys_of.to_vec(), None).unwrap();
        let emulated = emulator(Settings { copies, streams, path, ..Settings::default() });
        Faults::set(&emulated.faults.split, split);
        emulated.faults.slow_us.store(slow_us, Ordering::Relaxed);
        // Patient with a busy test machine.
        let mut arm = started(&Inverse3Config { silence_s: 5.0, ..keys(&emulated.url()) }).unwrap();
        let mut began = Instant::now();
        press::follow(&mut arm, |reading, _| {
            let apart_m = reading.motion.position_m.distance(emulated.position_m());
            // The hand is at 15/8 of 0.1 m/s at most. A velocity is believed for 5 ms; a state that nobody asked for may be older than it seems.
            let late_s = reading.age_s + 5e-3 + began.elapsed().as_secs_f64() + if streams { 30e-3 } else { 2e-3 };
            assert!(apart_m < 0.2 * late_s, "{apart_m} m, {late_s} s: {split}, {copies}, {streams}, {slow_us}");
            began = Instant::now();
        });
        let end = arm.read(0).unwrap();
        assert!(end.motion.position_m.distance(emulated.position_m()) < 1e-4, "{:?}", end.motion);
        assert!(emulated.position_m().x > 0.02 && emulated.commands() > 5, "{}", emulated.commands());
        assert!(end.motion.velocity_m_per_s.length() < 5e-3, "{:?}", end.motion);
        // An answer that takes 8 ms is 8 ms old when it comes.
        assert!(slow_us == 0 || end.age_s > 7e-3, "{}", end.age_s);
    }
}

#[test]
fn the_grip_turns_the_tool_and_its_buttons_are_told() {
    for (grip, buttons) in [(Grip::Wireless, 0b110), (Grip::Wired, 1), (Grip::None, 0)] {
        let emulated = emulator(Settings { grip, ..resting() });
        let mut arm = started(&keys(&emulated.url())).unwrap();
        let turned = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.0);
        emulated.hold_grip(turned, if grip == Grip::Wired { 1 } else { 0b110 });
        press::hold(&mut arm, DVec3::ZERO);
        std::thread::sleep(Duration::from_millis(50));
        let reading = arm.read(1).unwrap();
        let expected = if grip == Grip::None { DQuat::IDENTITY } else { turned };
        assert!(reading.motion.orientation.angle_between(expected) < 1e-6, "{grip:?}, {:?}", reading.motion);
        assert_eq!(reading.buttons, buttons, "{grip:?}");
    }
    // Another grip than the one asked for is none.
    let emulated = emulator(resting());
    emulated.hold_grip(DQuat::IDENTITY, 0b111);
    for (grip_id, buttons) in [("other", 0), (GRIP_ID, 0b111)] {
        let mut arm = started(&Inverse3Config { grip_id: grip_id.into(), ..keys(&emulated.url()) }).unwrap();
        assert_eq!(arm.read(1).unwrap().buttons, buttons);
    }
}

/// Told in a dialect that the service does not obey a force is none, as the page of the arm says.
#[test]
fn forces_in_another_dialect_are_none() {
    let emulated = emulator(Settings { dialect: Some(Dialect::Values), ..resting() });
    let mut arm = started(&keys(&emulated.url())).unwrap();
    press::hold(&mut arm, DVec3::Z);
    assert_eq!(emulated.force_n(), DVec3::ZERO);
    assert!(emulated.commands() > 2);
}

#[test]
fn an_arm_that_cannot_be_started_says_why() {
    let said = |keys: &Inverse3Config| started(keys).unwrap_err().to_string();
    for url in ["localhost:10001", "http://localhost:10001", "ws://", "wss://localhost:1", "\u{0}"] {
        assert!(said(&keys(url)).contains("is no address of an Inverse service: write ws://HOST:10001"), "{url}");
    }
    let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    assert!(said(&keys(&format!("ws://{closed}"))).contains("is Haply's Inverse service running there?"));

    let arm = emulator(Settings { others: 2, uncalibrated: true, ..resting() });
    let named = |device_id: &str| Inverse3Config { device_id: device_id.into(), ..keys(&arm.url()) };
    assert!(said(&named("049D")).contains("has no Inverse3 \"049D\"; it has 0000, 0001, 04BA"));
    assert!(said(&named(DEVICE_ID)).starts_with("the Inverse3 04BA is not calibrated"));
    assert!(started(&Inverse3Config { uncalibrated: true, ..named(DEVICE_ID) }).is_ok());

    let arm = emulator(resting());
    Faults::set(&arm.faults.silence, true);
    assert!(said(&keys(&arm.url())).contains("says nothing within 2 s"));
    Faults::set(&arm.faults.silence, false);
    Faults::set(&arm.faults.garbage, true);
    assert!(said(&keys(&arm.url())).contains("what it sends is not its protocol; is it the Inverse service?"));
}

/// Something else listens at the port.
#[test]
fn who_speaks_no_websocket_is_named() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("ws://{}", listener.local_addr().unwrap());
    let other = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let _ = stream.read(&mut [0; 1024]);
        stream.write_all(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n").unwrap();
        let (silent, _) = listener.accept().unwrap();
        std::thread::sleep(Duration::from_secs(3));
        drop(silent);
    });
    let said = || started(&keys(&url)).unwrap_err().to_string();
    let refused = said();
    assert!(refused.contains("does not speak WebSocket") && refused.contains("404"), "{refused}");
    assert!(said().contains("says nothing within 2 s"));
    other.join().unwrap();
}
