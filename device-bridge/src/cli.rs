//! The command line.
use crate::{
    BridgeError, Config, Handle,
    device::kinds::{self, KINDS, Kind},
    emulate::cli::Emulate,
    guard::stand,
    measure::{bars, measure, svg},
    probe::probe,
    run::run_with,
};
use clap::{
    Parser, Subcommand,
    builder::{PossibleValue, PossibleValuesParser, TypedValueParser},
};
use palpate_realtime::OsMeasures;
use std::{
    io::{IsTerminal, Write as _},
    mem::discriminant,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tracing_subscriber::EnvFilter;

const EXAMPLES: &str = "\
Examples:
  palpate-bridge                                   the simulated arm, on a daemon on this machine
  palpate-bridge --config bridge.toml              your arm, limits and path: see deploy/bridge.toml
  palpate-bridge --server https://lab:7411 --tls-ca ca.pem
  palpate-bridge --server unix:///run/palpate/palpate.sock --tool left
  palpate-bridge --print-config > bridge.toml      every key with its default
  palpate-bridge --device hapticmaster --print-config   the same for another arm
  palpate-bridge --record press.csv                what the arm does, to be played back (docs/arms/playback.md)
  palpate-bridge devices                           the arms that there are drivers for
  palpate-bridge probe --config bridge.toml        is the arm there, and how well does it answer?
  palpate-bridge measure --config bridge.toml      arm, loop and network together, without force: good enough for one?
  palpate-bridge emulate hapticmaster              an arm that is not there, to try a configuration

Signals: SIGTERM or Ctrl-C ramps the force to zero, ends the stream and exits with 0; SIGUSR1 recovers from a latched fault.
PALPATE_LOG=debug says more, PALPATE_LOG_FORMAT=json in lines of JSON.";

/// Connects a haptic arm to a Palpate daemon.
///
/// A servo loop beside the arm renders the newest contact model at 1 kHz, limits the force, and ramps it to zero when the
/// daemon falls silent; the stream to the daemon reconnects by itself.
#[derive(Debug, Parser)]
#[command(name = "palpate-bridge", version, after_help = EXAMPLES, args_conflicts_with_subcommands = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    /// Configuration file (TOML); flags win over it
    #[arg(long, value_name = "FILE", env = "PALPATE_BRIDGE_CONFIG")]
    config: Option<PathBuf>,
    /// The daemon: http://HOST:PORT, https://HOST:PORT or unix:///path/to/socket [default: http://127.0.0.1:7411]
    #[arg(long, value_name = "ADDRESS", env = "PALPATE_SERVER")]
    server: Option<String>,
    /// Certificate authority to trust for https:// (PEM file)
    #[arg(long, value_name = "FILE")]
    tls_ca: Option<PathBuf>,
    /// Certificate to show, of the role device (PEM file, `palpated pki issue`)
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Its key (PEM file)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Token to show in a certificate's place; better in the environment, where others do not see it
    #[arg(long, env = "PALPATE_TOKEN", hide_env_values = true, value_name = "TOKEN")]
    token: Option<String>,
    /// Tool of the scene to drive [default: the first that waits for a device]
    #[arg(long, value_name = "NAME")]
    tool: Option<String>,
    /// Name of this arm in the daemon's status
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// The arm
    #[arg(long, value_name = "KIND", value_parser = kind_parser())]
    device: Option<&'static Kind>,
    /// Largest force on the arm (N)
    #[arg(long, value_name = "N")]
    max_force_n: Option<f64>,
    /// Write what the arm does into this file (CSV), a row a tick; `--device playback` plays it back
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Record over a file that is there
    #[arg(long)]
    overwrite: bool,
    /// File that remembers a latched fault: after the next start it is latched as well, until SIGUSR1 recovers it
    #[arg(long, value_name = "FILE")]
    latch_file: Option<PathBuf>,
    /// Let the force come back by itself after a latched fault
    #[arg(long)]
    auto_recover: bool,
    /// Stop with an error when no daemon answers for so long (s) [default: wait for ever]
    #[arg(long, value_name = "S")]
    give_up_after_s: Option<f64>,
    /// Pause between lines of counters (s), 0: only at exit
    #[arg(long, value_name = "S")]
    report_every_s: Option<f64>,
    /// Print the configuration that would be used, and stop
    #[arg(long)]
    print_config: bool,
}

/// What else it does.
#[derive(Debug, Subcommand)]
enum Command {
    /// An arm that is not there: its bytes over a real socket, with faults on request
    Emulate {
        #[command(subcommand)]
        kind: Emulate,
    },
    /// The kinds of arms, what they need and how to check them
    Devices,
    /// Read an arm for a while without any force, and say how it does
    Probe {
        /// Configuration file (TOML)
        #[arg(long, value_name = "FILE", env = "PALPATE_BRIDGE_CONFIG")]
        config: Option<PathBuf>,
        /// The arm
        #[arg(long, value_name = "KIND", value_parser = kind_parser())]
        device: Option<&'static Kind>,
        /// How long (s)
        #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = parse_seconds)]
        time_s: f64,
    },
    /// Stands beside a bridge; started by it alone
    #[command(hide = true)]
    Guard {
        #[arg(long)]
        patience_us: u64,
        #[arg(long)]
        fifo_priority: u8,
    },
    /// Drive a tool without any force, and judge loop and network
    ///
    /// Says how well they keep time, and how stiff a contact may be. Ends with code 2 when they are not good enough for a force.
    Measure {
        /// Configuration file (TOML)
        #[arg(long, value_name = "FILE", env = "PALPATE_BRIDGE_CONFIG")]
        config: Option<PathBuf>,
        /// The arm
        #[arg(long, value_name = "KIND", value_parser = kind_parser())]
        device: Option<&'static Kind>,
        /// The daemon
        #[arg(long, value_name = "ADDRESS", env = "PALPATE_SERVER")]
        server: Option<String>,
        /// How long (s)
        #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = parse_seconds)]
        time_s: f64,
        /// Write the histograms as a picture, too
        #[arg(long, value_name = "FILE")]
        svg: Option<PathBuf>,
    },
}

/// Of a link that is no good for a force.
const NOT_GOOD_ENOUGH: u8 = 2;

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|error| format!("{error}"))?;
    if (1e-3..=3600.0).contains(&seconds) { Ok(seconds) } else { Err("must be between 0.001 and 3600 s".into()) }
}

fn kind_parser() -> impl TypedValueParser<Value = &'static Kind> {
    let names = KINDS.iter().map(|kind| PossibleValue::new(kind.name).help(kind.what));
    PossibleValuesParser::new(names)
        .try_map(|name| kinds::named(&name).ok_or_else(|| format!("\"{name}\" is no kind of arm")))
}

impl Cli {
    /// Runs the bridge until it is told to stop.
    ///
    /// # Errors
    /// What stops it.
    pub fn run(self) -> Result<ExitCode, BridgeError> {
        match self.command {
            Some(Command::Emulate { kind }) => return kind.run(),
            Some(Command::Guard { patience_us, fifo_priority }) => {
                let fifo_priority = (fifo_priority > 0).then_some(fifo_priority);
                let measures = OsMeasures { fifo_priority, lock_memory: fifo_priority.is_some(), ..OsMeasures::NONE };
                return stand(Duration::from_micros(patience_us), &measures).map(|()| ExitCode::SUCCESS);
            }
            Some(Command::Devices) => return Ok(say(&kinds::list())),
            Some(Command::Probe { config, device, time_s }) => {
                let mut config = read(config.as_deref())?;
                choose(&mut config, device);
                start_logs();
                let runtime = runtime()?;
                let _context = runtime.enter();
                return Ok(say(&format!("{}\n", probe(&config, Duration::from_secs_f64(time_s))?)));
            }
            Some(Command::Measure { config, device, server, time_s, svg }) => {
                let mut config = read(config.as_deref())?;
                choose(&mut config, device);
                replace(&mut config.server.url, server);
                return measured(&config, Duration::from_secs_f64(time_s), svg.as_deref());
            }
            None => {}
        }
        let config = self.config()?;
        if self.print_config {
            print!("{}", printed(&config)?);
            return Ok(ExitCode::SUCCESS);
        }
        start_logs();
        let runtime = runtime()?;
        runtime.block_on(async {
            let (shutdown, handle) = (CancellationToken::new(), Handle::new());
            // The guard is this program; where it cannot be found there is none.
            if let Ok(program) = std::env::current_exe() {
                handle.guarded_by(program);
            }
            obey_signals(shutdown.clone(), handle.clone())?;
            let ended = run_with(&config, shutdown, handle.clone()).await;
            // The counters are wanted most where a run ended badly. A reader that has gone misses them, no more.
            let summary = handle.stats().summary();
            if ended.is_ok() || summary.ticks > 0 {
                let _ = writeln!(std::io::stdout(), "{summary}");
            }
            ended.map(|_| ExitCode::SUCCESS)
        })
    }

    /// The file, then the flags.
    fn config(&self) -> Result<Config, BridgeError> {
        let mut config = read(self.config.as_deref())?;
        let server = &mut config.server;
        replace(&mut server.url, self.server.clone());
        replace(&mut server.tool, self.tool.clone());
        replace(&mut server.device_name, self.name.clone());
        server.tls_ca = self.tls_ca.clone().or(server.tls_ca.take());
        server.tls_cert = self.tls_cert.clone().or(server.tls_cert.take());
        server.tls_key = self.tls_key.clone().or(server.tls_key.take());
        server.token.clone_from(&self.token);
        server.give_up_after_s = self.give_up_after_s.or(server.give_up_after_s);
        replace(&mut config.servo.report_every_s, self.report_every_s);
        replace(&mut config.limits.max_force_n, self.max_force_n);
        config.servo.auto_recover |= self.auto_recover;
        config.servo.latch_file = self.latch_file.clone().or(config.servo.latch_file.take());
        config.record.path = self.record.clone().or(config.record.path.take());
        config.record.overwrite |= self.overwrite;
        choose(&mut config, self.device);
        Ok(config)
    }
}

fn measured(config: &Config, time: Duration, picture: Option<&Path>) -> Result<ExitCode, BridgeError> {
    start_logs();
    let handle = Handle::new();
    let report = runtime()?.block_on(measure(config, time, handle.clone()))?;
    let stats = handle.stats();
    let mut charts = vec![
        ("from a pose to the force that answers it", &stats.round_trip),
        ("age of the arm's poses", &stats.pose_age),
    ];
    charts.extend(stats.servo().map(|servo| ("how late the loop's ticks began", &servo.wakeup_lateness)));
    for (title, times) in &charts {
        say(&bars(title, times));
    }
    if let Some(path) = picture {
        std::fs::write(path, svg(&charts)).map_err(|source| BridgeError::Write {
            what: "the picture",
            path: path.to_owned(),
            source,
        })?;
    }
    say(&format!("{report}\n"));
    Ok(if report.is_good_enough() { ExitCode::SUCCESS } else { ExitCode::from(NOT_GOOD_ENOUGH) })
}

/// One thread: the stream's reader, writer and transport wake each other without crossing processors.
fn runtime() -> Result<tokio::runtime::Runtime, BridgeError> {
    let built = tokio::runtime::Builder::new_current_thread().enable_all().build();
    built.map_err(|source| BridgeError::System { what: "start the runtime", source })
}

fn read(path: Option<&Path>) -> Result<Config, BridgeError> {
    path.map_or_else(|| Ok(Config::default()), Config::read)
}

/// Another arm than the file's has its own defaults.
fn choose(config: &mut Config, kind: Option<&Kind>) {
    if let Some(default) = kind.map(|kind| (kind.default)())
        && discriminant(&default) != discriminant(&config.device)
    {
        config.device = default;
    }
}

/// A reader that has gone misses it, no more.
fn say(text: &str) -> ExitCode {
    let _ = write!(std::io::stdout(), "{text}");
    ExitCode::SUCCESS
}

/// Logs go to standard error, by the daemon's variables: `PALPATE_LOG` filters, `PALPATE_LOG_FORMAT=json` makes lines of JSON.
fn start_logs() {
    let filter = EnvFilter::try_from_env("PALPATE_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    let logs = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(colours_wanted())
        // They would be told on standard error, and one of them is that it has no reader: a panic.
        .log_internal_errors(false)
        .with_target(false);
    match std::env::var("PALPATE_LOG_FORMAT").as_deref() {
        Ok("json") => logs.json().flatten_event(true).init(),
        _ => logs.init(),
    }
}

/// Logs have colours on a terminal only, and not when `NO_COLOR` asks for none.
fn colours_wanted() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

fn replace<T>(value: &mut T, with: Option<T>) {
    if let Some(with) = with {
        *value = with;
    }
}

fn printed(config: &Config) -> Result<String, BridgeError> {
    toml::to_string(config)
        .map_err(|error| BridgeError::Value { key: "configuration".to_owned(), reason: error.to_string() })
}

fn obey_signals(shutdown: CancellationToken, handle: Handle) -> Result<(), BridgeError> {
    let listen = |kind| signal(kind).map_err(|source| BridgeError::System { what: "listen for signals", source });
    let mut terminate = listen(SignalKind::terminate())?;
    let mut interrupt = listen(SignalKind::interrupt())?;
    let mut recover = listen(SignalKind::user_defined1())?;
    tokio::spawn(async move {
        loop {
            tokio::select! {
                _ = terminate.recv() => shutdown.cancel(),
                _ = interrupt.recv() => shutdown.cancel(),
                _ = recover.recv() => handle.recover(),
            }
        }
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn flags_win_over_the_file() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "[server]\nurl = \"http://file:1\"\ntool = \"left\"\n").unwrap();
        let path = file.path().to_str().unwrap();
        let flags =
            ["--server", "http://flag:2", "--max-force-n", "2.5", "--give-up-after-s", "3", "--report-every-s", "7"];
        let cli = Cli::try_parse_from([["palpate-bridge", "--config", path].as_slice(), &flags].concat()).unwrap();
        let config = cli.config().unwrap();
        assert_eq!((config.server.url.as_str(), config.server.tool.as_str()), ("http://flag:2", "left"));
        assert_eq!((config.limits.max_force_n, config.server.give_up_after_s), (2.5, Some(3.0)));
        assert!(config.servo.report_every_s == 7.0 && !config.servo.auto_recover);
    }

    #[test]
    fn what_is_printed_can_be_read() {
        let text = printed(&Config::default()).unwrap();
        assert_eq!(Config::parse(&text, "printed").unwrap(), Config::default());
    }

    #[test]
    fn every_kind_of_arm_is_listed_and_chosen_by_its_name() {
        for Kind { name, .. } in &KINDS {
            let cli = Cli::try_parse_from(["palpate-bridge", "--device", name]).unwrap();
            let text = printed(&cli.config().unwrap()).unwrap();
            assert!(text.contains(&format!("kind = \"{name}\"")), "{text}");
            assert!(kinds::list().contains(&format!("probe --device {name}")));
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let cli = Cli::try_parse_from(["palpate-bridge", "--config", "/nowhere/bridge.toml"]).unwrap();
        assert!(cli.config().unwrap_err().to_string().contains("cannot read the configuration /nowhere/bridge.toml"));
    }
}
