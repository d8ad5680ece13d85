//! The configuration file, as written; [`crate::settings::Settings`] is what it means.
mod device;
mod record;
mod workspace;

use crate::{BridgeError, error::ConfigError};
pub use device::{
    DeviceConfig, FalconConfig, Haply2diyConfig, HapticMasterConfig, HapticMasterContact, Inverse3Config,
    Inverse3Dialect, KeyframeConfig, PhantomConfig, PlaybackConfig, SimulatedConfig, VrpnConfig, WoodenHapticsConfig,
};
mod vrpn_server;

use miette::NamedSource;
pub use record::RecordConfig;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
pub use vrpn_server::VrpnServerConfig;
pub use workspace::WorkspaceConfig;

/// All of it. Every key has a default; unknown keys are refused.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The daemon.
    pub server: ServerConfig,
    /// The loop beside the arm.
    pub servo: ServoConfig,
    /// What the arm may be asked for.
    pub limits: LimitsConfig,
    /// When the daemon falls silent.
    pub watchdog: WatchdogConfig,
    /// Rendering of local contact models.
    pub render: RenderConfig,
    /// Energy.
    pub passivity: PassivityConfig,
    /// What to ask of the operating system.
    pub realtime: RealtimeConfig,
    /// Where in the world the arm is.
    pub workspace: WorkspaceConfig,
    /// What the arm does, written down.
    pub record: RecordConfig,
    /// For programs that read poses and forces by VRPN.
    pub vrpn_server: VrpnServerConfig,
    /// The arm.
    pub device: DeviceConfig,
}

/// The daemon, and how to come back to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServerConfig {
    /// `http://HOST:PORT`, `https://HOST:PORT` or `unix:///path/to/socket`.
    pub url: String,
    /// Certificate authority (PEM) to trust for `https://`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls_ca: Option<PathBuf>,
    /// Certificate to show (PEM), of the role device: `palpated pki issue`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls_cert: Option<PathBuf>,
    /// Its key (PEM).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls_key: Option<PathBuf>,
    /// Token to show in a certificate's place; from the environment only.
    #[serde(skip)]
    pub token: Option<String>,
    /// Tool of the scene to drive; empty: the first that waits for a device.
    pub tool: String,
    /// Name of this arm for people and logs.
    pub device_name: String,
    /// Shortest pause (s) between attempts to connect.
    pub first_pause_s: f64,
    /// Longest pause (s).
    pub longest_pause_s: f64,
    /// Seed of the random part of pauses; absent: from the process and the clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pause_seed: Option<u64>,
    /// Stop with an error when no daemon was ever reached for so long (s); absent: wait for ever.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub give_up_after_s: Option<f64>,
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self {
            url: "http://127.0.0.1:7411".into(),
            tls_ca: None,
            tls_cert: None,
            tls_key: None,
            token: None,
            tool: String::new(),
            device_name: "simulated".into(),
            first_pause_s: 0.1,
            longest_pause_s: 5.0,
            pause_seed: None,
            give_up_after_s: None,
        }
    }
}

/// The loop beside the arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServoConfig {
    /// Rate (Hz).
    pub rate_hz: f64,
    /// Let the force come back by itself after a latched fault, once the daemon has answered for half a second.
    pub auto_recover: bool,
    /// File that remembers a latched fault, so that it is latched after the next start as well; absent: a start forgets it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latch_file: Option<PathBuf>,
    /// Share of ticks, over the last thousand, in which the newest answer must have been in time; with fewer the force is taken away. 0: any.
    pub least_success_rate: f64,
    /// Move the loop's ticks to where a pose reaches the daemon right before it is used; false: they stay where the start put them.
    pub follow_phase: bool,
    /// A second process takes the force away when this one is killed or hangs; for arms whose connection outlives it.
    pub guard: bool,
    /// Pause (s) between lines of counters; 0: only at exit.
    pub report_every_s: f64,
}

impl Default for ServoConfig {
    fn default() -> Self {
        Self {
            rate_hz: 1000.0,
            auto_recover: false,
            latch_file: None,
            least_success_rate: 0.9,
            follow_phase: true,
            guard: true,
            report_every_s: 10.0,
        }
    }
}

/// What the arm may be asked for. The daemon's own limits hold too.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LimitsConfig {
    /// Peak force (N).
    pub max_force_n: f64,
    /// Largest change of force per second (N/s).
    pub max_force_rate_n_per_s: f64,
    /// Peak torque (N m); 0: the arm has no motors for torque.
    pub max_torque_nm: f64,
    /// Largest change of torque per second (N m/s).
    pub max_torque_rate_nm_per_s: f64,
    /// Force (N) that the arm's motors bear for ever; absent: the peak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub continuous_force_n: Option<f64>,
    /// Time constant (s) of the motors' warmth, with `continuous_force_n`.
    pub thermal_time_s: f64,
}

impl Default for LimitsConfig {
    fn default() -> Self {
        Self {
            max_force_n: 3.3,
            max_force_rate_n_per_s: 1000.0,
            max_torque_nm: 0.0,
            max_torque_rate_nm_per_s: 20.0,
            continuous_force_n: None,
            thermal_time_s: 10.0,
        }
    }
}

/// When the daemon falls silent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WatchdogConfig {
    /// Age (s) up to which a command is fresh.
    pub fresh_for_s: f64,
    /// Age (s) beyond which the force ramps down.
    pub stale_after_s: f64,
    /// Time (s) the ramp to zero takes.
    pub ramp_to_zero_s: f64,
    /// Time (s) the ramp up takes.
    pub ramp_up_s: f64,
    /// Damping (N s/m) that replaces the fading force on the way down.
    pub fading_damping_n_s_per_m: f64,
}

impl Default for WatchdogConfig {
    fn default() -> Self {
        let times = palpate_control::WatchdogSettings::default();
        Self {
            fresh_for_s: times.fresh_for_s,
            stale_after_s: times.stale_after_s,
            ramp_to_zero_s: times.ramp_to_zero_s,
            ramp_up_s: times.ramp_up_s,
            fading_damping_n_s_per_m: 1.0,
        }
    }
}

/// Rendering of local contact models.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RenderConfig {
    /// Render the local model beside the arm; false: the daemon's force as it comes.
    pub local_model: bool,
    /// Age (s) up to which a model counts fully.
    pub hold_s: f64,
    /// Age (s) from which it counts nothing.
    pub forget_s: f64,
    /// Damping (N s/m) along the normal.
    pub damping_n_s_per_m: f64,
    /// Physical damping (N s/m) of the arm: with the rate, and the age of its poses, it bounds the stiffness that is rendered.
    pub arm_damping_n_s_per_m: f64,
    /// Largest stiffness (N/m) that is rendered; absent: what the arm's damping allows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_stiffness_n_per_m: Option<f64>,
}

impl Default for RenderConfig {
    fn default() -> Self {
        Self {
            local_model: true,
            hold_s: 0.02,
            forget_s: 0.1,
            damping_n_s_per_m: 0.0,
            arm_damping_n_s_per_m: 0.4,
            max_stiffness_n_per_m: None,
        }
    }
}

/// The passivity observer and controller. Switch it off for a body that moves by itself: a beating heart does work on the hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PassivityConfig {
    /// Use it.
    pub enabled: bool,
    /// Largest damping (N s/m) it may add.
    pub max_damping_n_s_per_m: f64,
    /// Energy (J) it remembers at most.
    pub max_stored_j: f64,
    /// Mass (kg) of the arm at the tool, or less.
    pub arm_mass_kg: f64,
    /// Give the hand no energy at all that it did not put in; a force on an arm at rest that was never pressed is none then.
    pub strict: bool,
}

impl Default for PassivityConfig {
    fn default() -> Self {
        let settings = palpate_control::PassivitySettings::default();
        Self {
            enabled: true,
            max_damping_n_s_per_m: settings.max_damping_n_s_per_m,
            max_stored_j: settings.max_stored_j,
            arm_mass_kg: settings.arm_mass_kg,
            strict: settings.strict,
        }
    }
}

/// What to ask of the operating system; what it refuses is said, and the bridge runs all the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RealtimeConfig {
    /// `SCHED_FIFO` priority of the servo thread, 1 to 99; 0: normal scheduling.
    pub fifo_priority: u8,
    /// Lock all memory.
    pub lock_memory: bool,
    /// Processor of the servo thread; absent: any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub processor: Option<usize>,
    /// Keep processors out of deep sleep.
    pub stay_awake: bool,
}

impl Default for RealtimeConfig {
    fn default() -> Self {
        Self { fifo_priority: 80, lock_memory: true, processor: None, stay_awake: false }
    }
}

impl Config {
    /// Reads a file.
    ///
    /// # Errors
    /// [`BridgeError::Read`] or [`BridgeError::Config`], with the place in the file.
    pub fn read(path: &Path) -> Result<Self, BridgeError> {
        let text = std::fs::read_to_string(path).map_err(|source| BridgeError::Read {
            what: "the configuration",
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Parses a text; `name` is for messages.
    ///
    /// # Errors
    /// [`BridgeError::Config`], with the place in the text.
    pub fn parse(text: &str, name: &str) -> Result<Self, BridgeError> {
        toml::from_str(text).map_err(|error| {
            let error = device::wrong_key(text).unwrap_or(error);
            BridgeError::Config(Box::new(ConfigError {
                help: nearest_key(error.message()),
                message: error.message().to_owned(),
                text: NamedSource::new(name, text.to_owned()),
                at: error.span().map(Into::into),
            }))
        })
    }
}

/// From "unknown field `rate_hz2`, expected one of `rate_hz`, …": the nearest of the known ones. Words that a key may have are variants.
fn nearest_key(message: &str) -> Option<String> {
    let unknown = ["unknown field `", "unknown variant `"].into_iter().find_map(|start| message.strip_prefix(start));
    let (unknown, expected) = unknown?.split_once('`')?;
    let (nearest, distance) = expected
        .split('`')
        .skip(1)
        .step_by(2)
        .map(|known| {
            // A key without its unit is as good as near.
            let distance = if known.starts_with(unknown) { 0 } else { strsim::damerau_levenshtein(known, unknown) };
            (known, distance)
        })
        .min_by_key(|(_, distance)| *distance)?;
    (distance <= unknown.len().div_ceil(2)).then(|| format!("did you mean `{nearest}`?"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::kinds;

    fn mistake(text: &str) -> ConfigError {
        match Config::parse(text, "t") {
            Err(BridgeError::Config(error)) => *error,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn an_empty_file_is_the_default_and_the_default_survives_the_file() {
        assert_eq!(Config::parse("", "empty").unwrap(), Config::default());
        let text = toml::to_string(&Config::default()).unwrap();
        assert_eq!(Config::parse(&text, "default").unwrap(), Config::default());
    }

    #[test]
    fn the_examples_are_valid() {
        // The simulated arm's has another name.
        for example in kinds::KINDS.iter().map(|kind| kind.name.replace("simulated", "bridge")) {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy").join(example).with_extension("toml");
            let config = Config::read(&path).unwrap();
            crate::settings::Settings::new(&config).unwrap();
        }
    }

    #[test]
    fn an_unknown_key_is_refused_with_its_place_and_the_nearest_known_one() {
        let text = "[servo]\nrate_hz = 1000.0\nauto_recovery = true\n";
        let ConfigError { message, at, help, .. } = mistake(text);
        assert!(message.contains("auto_recovery"), "{message}");
        assert_eq!(at.unwrap().offset(), text.find("auto_recovery").unwrap());
        assert_eq!(help.unwrap(), "did you mean `auto_recover`?");
    }

    #[test]
    fn what_is_wrong_with_the_device_is_said_with_its_place() {
        for (text, wrong, advice) in [
            ("[device]\nkind = \"simulated\"\nmass = 0.1\n", "mass", Some("mass_kg")),
            ("[device]\nkind = \"hapticmaster\"\ncontact = \"plain\"\n", "\"plain\"", Some("plane")),
            ("[device]\nsilence_s = \"long\"\nkind = \"haply-2diy\"\n", "\"long\"", None),
            ("[device]\nkind = \"falcons\"\n", "\"falcons\"", Some("falcon")),
            ("[device]\nport = \"x\"\n", "[device]", None),
        ] {
            let ConfigError { at, help, .. } = mistake(text);
            let found = at.map(|at| &text[at.offset()..at.offset() + at.len()]);
            assert_eq!(found, Some(wrong));
            assert_eq!(help, advice.map(|word| format!("did you mean `{word}`?")), "{text}");
        }
        // Of the rest, although nothing is wrong with the device.
        let text = "[device]\nkind = \"falcon\"\n[servo]\nrate_hz = true\n";
        assert_eq!(mistake(text).at.unwrap().offset(), text.find("true").unwrap());
    }

    #[test]
    fn an_unknown_device_names_the_known_ones() {
        let error = Config::parse("[device]\nkind = \"phantasm\"\n", "t").unwrap_err();
        assert!(error.to_string().contains("simulated"), "{error}");
    }

    #[test]
    fn nothing_near_gives_no_advice() {
        assert_eq!(nearest_key("unknown field `xyz`, expected one of `rate_hz`, `auto_recover`"), None);
        assert_eq!(nearest_key("invalid type"), None);
    }
}
