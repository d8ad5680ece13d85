//! What the configuration means: checked, in the types that the loop and the uplink use.
pub mod arm;
mod servo;
mod stiffness;
mod torque;
mod vrpn_server;

use crate::{
    BridgeError, Config,
    device::workspace::{ClutchSettings, Workspace},
    recording::recorder::RecordSettings,
};
pub use arm::ArmSettings;
use glam::DVec3;
use palpate_control::{ParameterError, StiffnessBound, WatchdogSettings};
use palpate_proto::connect::{self, Bearer, ConnectError, Credentials};
use palpate_realtime::OsMeasures;
pub use servo::ServoSettings;
use std::{path::PathBuf, time::Duration};
use tonic::transport::Endpoint;
pub use vrpn_server::VrpnServerSettings;

/// The whole bridge.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The uplink.
    pub uplink: UplinkSettings,
    /// The servo's law.
    pub servo: ServoSettings,
    /// The arm.
    pub device: DeviceSettings,
    /// For programs that read by VRPN.
    pub vrpn_server: Option<VrpnServerSettings>,
    /// What to ask of the operating system.
    pub measures: OsMeasures,
    /// A second process takes the force away when this one is killed.
    pub guard: bool,
    /// The loop moves its ticks to where their poses are used soon after they reach the daemon.
    pub follow_phase: bool,
    /// Where a latched fault is remembered.
    pub latch_file: Option<PathBuf>,
    /// Pause between lines of counters.
    pub report_every: Option<Duration>,
}

/// The uplink.
#[derive(Debug, Clone)]
pub struct UplinkSettings {
    /// Where to connect.
    pub endpoint: Endpoint,
    /// What shows the token, if there is one.
    pub bearer: Bearer,
    /// The same, for people.
    pub address: String,
    /// Tool of the scene.
    pub tool: String,
    /// Name of the arm.
    pub device_name: String,
    /// Shortest and longest pause between attempts.
    pub pauses: (Duration, Duration),
    /// Seed of the pauses.
    pub seed: u64,
    /// Time without any connection after which to stop.
    pub give_up_after: Option<Duration>,
    /// Told to the daemon: peak force (N) and rate (Hz).
    pub hello: (f64, f64),
    /// What a loop across the network may be as stiff as; `None`: the stiff loop is beside the arm.
    pub across_network: Option<StiffnessBound>,
    /// And peak torque (N m).
    pub max_torque_nm: f64,
}

/// Which arm, and where it is.
#[derive(Debug, Clone)]
pub struct DeviceSettings {
    /// The arm.
    pub arm: ArmSettings,
    /// Where in the world it is.
    pub workspace: Workspace,
    /// Its clutch.
    pub clutch: Option<ClutchSettings>,
    /// Where to write what it does.
    pub record: Option<RecordSettings>,
}

impl Settings {
    /// Checks a configuration, and reads the certificate it names.
    ///
    /// # Errors
    /// [`BridgeError`] naming the key.
    pub fn new(config: &Config) -> Result<Self, BridgeError> {
        let rate_hz = config.servo.rate_hz;
        if !(10.0..=10_000.0).contains(&rate_hz) {
            return Err(value("servo.rate_hz", format!("{rate_hz} is out of range: use 10 to 10000")));
        }
        let workspace = workspace(config)?;
        let servo = servo::checked(config, 1.0 / rate_hz, workspace.scale())?;
        let every_s = config.servo.report_every_s;
        let report_every = seconds("servo.report_every_s", every_s)?;
        Ok(Self {
            uplink: UplinkSettings {
                across_network: (!config.render.local_model).then_some(servo.stiffness),
                ..uplink(config)?
            },
            device: DeviceSettings {
                arm: arm::checked(config, servo.period_s)?,
                workspace,
                clutch: clutch(config, &servo.watchdog)?,
                record: record(config)?,
            },
            vrpn_server: vrpn_server::checked(&config.vrpn_server, rate_hz)?,
            servo,
            measures: measures(config)?,
            guard: config.servo.guard,
            follow_phase: config.servo.follow_phase,
            latch_file: config.servo.latch_file.clone(),
            report_every: (!report_every.is_zero()).then_some(report_every),
        })
    }
}

fn workspace(config: &Config) -> Result<Workspace, BridgeError> {
    let workspace = &config.workspace;
    Workspace::new(&workspace.axes, DVec3::from_array(workspace.origin_m), workspace.scale)
        .map_err(|error| value(error.key(), error.to_string()))
}

fn clutch(config: &Config, times: &WatchdogSettings) -> Result<Option<ClutchSettings>, BridgeError> {
    let ramps_s = (times.ramp_to_zero_s, times.ramp_up_s);
    match config.workspace.clutch_button {
        Some(button) if button >= u32::BITS => {
            Err(value("workspace.clutch_button", format!("{button} is out of range: use 0 to 31")))
        }
        button => Ok(button.map(|button| ClutchSettings { button, ramps_s })),
    }
}

fn record(config: &Config) -> Result<Option<RecordSettings>, BridgeError> {
    let overwrite = config.record.overwrite;
    config.record.path.clone().map(|path| RecordSettings { path, overwrite }.checked()).transpose()
}

fn uplink(config: &Config) -> Result<UplinkSettings, BridgeError> {
    let server = &config.server;
    let first = seconds("server.first_pause_s", server.first_pause_s)?;
    let longest = seconds("server.longest_pause_s", server.longest_pause_s)?;
    if first.is_zero() || longest < first {
        let reason = "pauses must be larger than 0, the longest not shorter than the first".to_owned();
        return Err(value("server.longest_pause_s", reason));
    }
    if server.device_name.len() > 64 {
        return Err(value("server.device_name", format!("is {} bytes long, at most 64", server.device_name.len())));
    }
    for (key, text) in [("server.device_name", &server.device_name), ("server.tool", &server.tool)] {
        if text.chars().any(char::is_control) {
            return Err(value(key, format!("\"{}\" holds a control character", text.escape_debug())));
        }
    }
    let give_up_after = server.give_up_after_s.map(|s| seconds("server.give_up_after_s", s)).transpose()?;
    let certificate = match (&server.tls_cert, &server.tls_key) {
        (Some(certificate), Some(key)) => Some((certificate.clone(), key.clone())),
        (None, None) => None,
        _ => {
            let reason = "a certificate and its key are given together: server.tls_cert and server.tls_key";
            return Err(value("server.tls_cert", reason.to_owned()));
        }
    };
    let credentials = Credentials { authority: server.tls_ca.clone(), certificate, token: server.token.clone() };
    Ok(UplinkSettings {
        endpoint: connect::endpoint(&server.url, &credentials).map_err(unusable)?,
        bearer: credentials.bearer(&server.url).map_err(unusable)?,
        address: server.url.clone(),
        tool: server.tool.clone(),
        device_name: server.device_name.clone(),
        pauses: (first, longest),
        seed: server.pause_seed.unwrap_or_else(seed_of_this_process),
        give_up_after,
        hello: (config.limits.max_force_n, config.servo.rate_hz),
        across_network: None,
        max_torque_nm: config.limits.max_torque_nm,
    })
}

fn unusable(error: ConnectError) -> BridgeError {
    match error {
        ConnectError::Address { address, reason } => BridgeError::Address { address, reason },
        ConnectError::Authority { path, source } => {
            BridgeError::Read { what: "the certificate authority", path, source }
        }
        ConnectError::Token => value("PALPATE_TOKEN", error.to_string()),
        ConnectError::Own { path, source, .. } => {
            BridgeError::Read { what: "the bridge's certificate or key", path, source }
        }
    }
}

fn measures(config: &Config) -> Result<OsMeasures, BridgeError> {
    let realtime = &config.realtime;
    if realtime.fifo_priority > 99 {
        let reason = format!("{} is out of range: use 1 to 99, or 0 for normal scheduling", realtime.fifo_priority);
        return Err(value("realtime.fifo_priority", reason));
    }
    Ok(OsMeasures {
        fifo_priority: (realtime.fifo_priority > 0).then_some(realtime.fifo_priority),
        lock_memory: realtime.lock_memory,
        processor: realtime.processor,
        stay_awake: realtime.stay_awake,
    })
}

fn seed_of_this_process() -> u64 {
    palpate_realtime::Clock::Monotonic.now_ns() ^ (u64::from(std::process::id()) << 32)
}

fn seconds(key: &'static str, s: f64) -> Result<Duration, BridgeError> {
    Duration::try_from_secs_f64(s)
        .map_err(|_| value(key, format!("{s} is no time: it must be finite and not negative")))
}

fn value(key: &str, reason: String) -> BridgeError {
    BridgeError::Value { key: key.to_owned(), reason }
}

fn parameter(section: &str, error: &ParameterError) -> BridgeError {
    value(&format!("{section}.{}", error.name), format!("{} {}", error.value, error.rule))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{
        DeviceConfig, HapticMasterConfig, HapticMasterContact, KeyframeConfig, PlaybackConfig, SimulatedConfig,
        WoodenHapticsConfig,
    };
    use proptest::prelude::*;

    fn refused(change: impl FnOnce(&mut Config)) -> String {
        let mut config = Config::default();
        change(&mut config);
        Settings::new(&config).unwrap_err().to_string()
    }

    #[tokio::test]
    async fn the_default_renders_what_sampling_allows() {
        let settings = Settings::new(&Config::default()).unwrap();
        // 2 b/T = 2 · 0.4/1e-3
        assert!((settings.servo.render.unwrap().max_stiffness_n_per_m - 800.0).abs() < 1e-9);
    }

    /// What the hand feels is s K: the same stiffness is borne at the arm in any world.
    #[tokio::test]
    async fn a_magnified_world_is_rendered_as_stiff_at_the_arm_as_any() {
        let mut config = Config::default();
        for scale in [0.25, 1.0, 4.0] {
            config.workspace.scale = scale;
            let servo = Settings::new(&config).unwrap().servo;
            assert!((scale * servo.render.unwrap().max_stiffness_n_per_m - 800.0).abs() < 1e-9);
            let passivity = servo.passivity.unwrap();
            assert!((scale * passivity.arm_mass_kg - config.passivity.arm_mass_kg).abs() < 1e-12);
            assert!((passivity.max_stored_j / scale - config.passivity.max_stored_j).abs() < 1e-12);
        }
    }

    #[test]
    fn every_refusal_names_the_key() {
        let by_plane = HapticMasterConfig { contact: HapticMasterContact::Plane, ..HapticMasterConfig::default() };
        let without_model = refused(|c| {
            (c.device, c.render.local_model) = (DeviceConfig::Hapticmaster(by_plane), false);
        });
        assert!(without_model.starts_with("device.contact: the plane is the local model's"), "{without_model}");
        assert!(refused(|c| c.servo.rate_hz = 0.0).starts_with("servo.rate_hz: 0 is out of range"));
        assert!(refused(|c| c.servo.report_every_s = f64::NAN).starts_with("servo.report_every_s"));
        assert!(refused(|c| c.limits.max_force_n = -1.0).starts_with("limits.max_force_n: -1 must be"));
        assert!(refused(|c| c.limits.continuous_force_n = Some(4.0)).starts_with("limits.continuous_force_n: 4 must"));
        assert!(refused(|c| c.watchdog.ramp_to_zero_s = 0.0).starts_with("watchdog.ramp_to_zero_s"));
        assert!(refused(|c| c.watchdog.fading_damping_n_s_per_m = -1.0).starts_with("watchdog.fading"));
        assert!(refused(|c| c.passivity.max_stored_j = f64::INFINITY).starts_with("passivity.max_stored_j"));
        assert!(refused(|c| c.render.forget_s = 0.0).starts_with("render.forget_s"));
        let too_stiff = refused(|c| c.render.max_stiffness_n_per_m = Some(801.0));
        assert!(
            too_stiff.starts_with("render.max_stiffness_n_per_m: 801 N/m") && too_stiff.contains("800 N/m"),
            "{too_stiff}"
        );
        assert!(refused(|c| c.render.max_stiffness_n_per_m = Some(f64::NAN)).starts_with("render.max_stiffness"));
        assert!(refused(|c| c.servo.least_success_rate = 1.1).starts_with("servo.least_success_rate: 1.1"));
        assert!(refused(|c| c.render.damping_n_s_per_m = 0.5).starts_with("render.damping_n_s_per_m"));
        assert!(refused(|c| c.realtime.fifo_priority = 100).starts_with("realtime.fifo_priority"));
        assert!(refused(|c| c.server.longest_pause_s = 0.0).starts_with("server.longest_pause_s"));
        assert!(refused(|c| c.server.device_name = "x".repeat(65)).starts_with("server.device_name"));
        assert!(refused(|c| c.server.device_name = "a\u{1b}b".into()).starts_with("server.device_name"));
        assert!(refused(|c| c.workspace.axes[0] = "up".into()).starts_with("workspace.axes: \"up\""));
        assert!(refused(|c| c.workspace.scale = 0.0).starts_with("workspace.scale"));
        assert!(refused(|c| c.workspace.clutch_button = Some(32)).starts_with("workspace.clutch_button: 32"));
        assert!(refused(|c| c.server.tool = "a\n".into()).starts_with("server.tool"));
        let simulated = SimulatedConfig::default();
        let bad = KeyframeConfig { time_s: -1.0, position_m: [0.0; 3] };
        let device = SimulatedConfig { keyframes: vec![bad], ..simulated };
        assert!(refused(|c| c.device = DeviceConfig::Simulated(device)).starts_with("device.keyframes: keyframe 0"));
        let arm = WoodenHapticsConfig { max_current_a: 40.0, ..WoodenHapticsConfig::default() };
        assert!(
            refused(|c| c.device = DeviceConfig::Woodenhaptics(arm)).starts_with("device.max_current_a: 40 is out")
        );
        let arm = WoodenHapticsConfig { body_diameters_m: [0.1, 0.0, 0.1], ..WoodenHapticsConfig::default() };
        assert!(
            refused(|c| c.device = DeviceConfig::Woodenhaptics(arm)).starts_with("device.body_diameters_m: 0 is out")
        );
    }

    #[test]
    fn a_playback_and_a_recording_are_refused_by_their_keys() {
        let played = |speed, rest_s| {
            let arm = PlaybackConfig { speed, rest_s, ..PlaybackConfig::default() };
            refused(|c| c.device = DeviceConfig::Playback(arm))
        };
        assert!(played(0.0, 1.0).starts_with("device.speed: 0 is out of range: use 0.01 to 10"));
        assert!(played(f64::NAN, 1.0).starts_with("device.speed: NaN"));
        assert!(played(1.0, 0.0).starts_with("device.rest_s: 0 is out of range"));
        assert!(
            refused(|c| c.record.path = Some("/dev/null".into())).starts_with("record.path: cannot write /dev/null")
        );
    }

    #[test]
    fn a_bad_address_and_a_missing_authority_are_told_apart() {
        assert!(refused(|c| c.server.url = "ftp://host".into()).contains("no address of a daemon"));
        let missing = refused(|c| {
            c.server.url = "https://host:7411".into();
            c.server.tls_ca = Some("/nowhere/ca.pem".into());
        });
        assert!(missing.contains("cannot read the certificate authority /nowhere/ca.pem"), "{missing}");
    }

    proptest! {
        #[test]
        fn no_number_panics(rate_hz in any::<f64>(), pause_s in any::<f64>(), force_n in any::<f64>()) {
            let mut config = Config::default();
            config.servo.rate_hz = rate_hz;
            config.server.first_pause_s = pause_s;
            config.limits.max_force_n = force_n;
            let _ = Settings::new(&config);
        }
    }
}
