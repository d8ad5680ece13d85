//! What users write, and what the daemon sends.
use glam::DVec3;
use palpate_bridge::{
    BridgeError, Config,
    convert::{self, Command, Welcome},
    device::Effort,
    recording::{
        Row,
        read::{self, RecordingError},
        write_header, write_row,
    },
    servo::ServoLaw,
    settings::{ServoSettings, Settings},
};
use palpate_control::{ForceLimits, Motion, TorqueLimits};
use palpate_proto::v1::{self, device_down::Message};
use prost::Message as _;
use std::sync::OnceLock;
use tokio::runtime::{Builder, Runtime};

/// A recording is finite and its times rise from 0; written again it is the same. Or one line says what is wrong.
pub fn recording(bytes: &[u8]) -> bool {
    let found = match read::poses(bytes, "a.csv") {
        Ok(found) => found,
        Err(error) => {
            assert!(!error.to_string().chars().any(char::is_control), "{error}");
            let RecordingError::At { line, .. } = error else { panic!("{error}: there is no file") };
            assert!((1..=bytes.split(|&byte| byte == b'\n').count()).contains(&line), "{error}");
            return false;
        }
    };
    assert_eq!(found.first().map(|pose| pose.time_s), Some(0.0));
    assert!(found.iter().all(|pose| pose.motion.is_finite()));
    assert!(found.windows(2).all(|pair| pair[1].time_s > pair[0].time_s));
    // What lasts longer than the age of the clock is none that can be read again.
    if found.last().is_some_and(|last| last.time_s > 1e11) {
        return true;
    }
    let mut again = Vec::new();
    let mut written = write_header(&mut again).is_ok();
    for pose in &found {
        let (time_s, motion, buttons) = (pose.time_s, pose.motion, pose.buttons);
        let row = Row { time_s, motion, buttons, measured_force_n: None, effort: Effort::NONE };
        written &= write_row(&mut again, &row).is_ok();
    }
    let again = read::poses(&again, "again.csv").unwrap_or_default();
    assert!(written && again.len() == found.len());
    for (again, first) in again.iter().zip(&found) {
        let orientation = first.motion.orientation;
        assert!(again.motion.orientation.abs_diff_eq(orientation, 1e-12), "{again:?} {first:?}");
        assert_eq!(Motion { orientation, ..again.motion }, first.motion);
        assert_eq!((again.time_s, again.buttons), (first.time_s, first.buttons));
    }
    true
}

/// `Settings` opens an endpoint, which needs a runtime's context.
fn runtime() -> &'static Runtime {
    static RUNTIME: OnceLock<Runtime> = OnceLock::new();
    RUNTIME.get_or_init(|| Builder::new_current_thread().build().unwrap_or_else(|error| panic!("{error}")))
}

/// As a user would see it; it is none.
fn show(error: BridgeError) -> bool {
    assert!(!format!("{:?}", miette::Report::new(error)).is_empty());
    false
}

/// What is read can be printed and read again; what it means has limits. Or a message says what is wrong.
pub fn config(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let mut config = match Config::parse(text, "a.toml") {
        Ok(config) => config,
        Err(error) => return show(error),
    };
    let print = |config: &Config| toml::to_string(config).unwrap_or_else(|error| panic!("{error}"));
    let printed = print(&config);
    let again = Config::parse(&printed, "again.toml").unwrap_or_else(|error| panic!("{error}: {printed}"));
    assert_eq!(print(&again), printed);
    // Files that it names are none of a parser's.
    config.server.tls_ca = None;
    config.record.path = None;
    let _context = runtime().enter();
    match Settings::new(&config) {
        Ok(settings) => {
            let ServoSettings { period_s, limits, torque, .. } = settings.servo;
            assert!((1e-4..=0.1).contains(&period_s));
            assert!(limits.max_force_n.is_finite() && limits.max_force_n > 0.0, "{limits:?}");
            assert!(torque.max_torque_nm.is_finite() && torque.max_torque_nm >= 0.0, "{torque:?}");
            true
        }
        Err(error) => show(error),
    }
}

/// What passes the border is finite; and whatever the daemon says, the arm's force is within the arm's limits.
pub fn daemon(bytes: &[u8]) -> bool {
    let Ok(v1::DeviceDown { message: Some(message) }) = v1::DeviceDown::decode(bytes) else {
        return false;
    };
    let welcomed = match &message {
        Message::Welcome(wire) => match convert::welcome(wire) {
            Ok(welcome) => welcome,
            Err(_) => return false,
        },
        _ => Welcome {
            session_id: "s".into(),
            tool_name: "t".into(),
            tick_period_s: 1e-3,
            limits: ForceLimits { max_force_n: 100.0, max_force_rate_n_per_s: 1e6 },
            coupling_n_per_m: 300.0,
            torque_limits: TorqueLimits { max_torque_nm: 10.0, max_torque_rate_nm_per_s: 1e6 },
        },
    };
    let Welcome { tick_period_s, limits, coupling_n_per_m, torque_limits, .. } = welcomed;
    let numbers = [tick_period_s, limits.max_force_n, coupling_n_per_m, torque_limits.max_torque_nm];
    assert!(numbers.iter().all(|number| number.is_finite() && *number >= 0.0), "{welcomed:?}");
    let wire = match message {
        Message::Command(wire) => wire,
        _ => pushing(),
    };
    let Ok(Some(command)) = convert::command(&wire, &welcomed, u64::MAX) else { return false };
    assert!(command.force_n.is_finite() && command.torque.0.is_finite() && command.model_age_s >= 0.0);
    felt(&command)
}

/// A command of 1 N, for a welcome that is to be tried.
fn pushing() -> v1::DeviceCommand {
    let wrench = v1::Wrench { force_n: Some(v1::Vec3 { x: 0.0, y: 0.0, z: 1.0 }), torque_nm: None };
    v1::DeviceCommand { wrench: Some(wrench), sample_sequence: 1, ..v1::DeviceCommand::default() }
}

/// An arm that moves to and fro while this is all that the daemon says; whether it had a force.
fn felt(command: &Command) -> bool {
    const TICK_NS: u64 = 1_000_000;
    static SETTINGS: OnceLock<ServoSettings> = OnceLock::new();
    let settings = SETTINGS.get_or_init(|| {
        let _context = runtime().enter();
        let mut config = Config::default();
        config.limits.max_torque_nm = 0.1;
        Settings::new(&config).unwrap_or_else(|error| panic!("{error}")).servo
    });
    let (mut law, mut most_n) = (ServoLaw::new(*settings), 0.0_f64);
    for tick in 1..=60_u64 {
        let now_ns = tick * TICK_NS;
        // The last ones ramp down.
        if tick <= 40 {
            law.receive(&Command { answers_ns: now_ns, ..*command });
        }
        let (sin, cos) = (0.3 * tick as f64).sin_cos();
        let motion = Motion { velocity_m_per_s: DVec3::Z * 0.3 * cos, ..Motion::at(DVec3::new(0.1, 0.0, 1e-3 * sin)) };
        let given = law.tick(now_ns, &motion);
        let (force_n, torque_nm) = (given.limited.force_n, given.torque_nm);
        most_n = most_n.max(force_n.length());
        assert!(force_n.length() <= settings.limits.max_force_n * (1.0 + 1e-12), "{force_n} {command:?}");
        assert!(torque_nm.length() <= settings.torque.max_torque_nm * (1.0 + 1e-12), "{torque_nm} {command:?}");
    }
    most_n > 0.0
}
