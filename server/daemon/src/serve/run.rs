//! The process: load, start, tell, wait for a signal, say goodbye.
use super::{Runner, ServeConfig, ServeError, args::ServeArgs, report, start_with};
use crate::{doors::descriptors, load, progress::Progress, sim::thread::Loop, telemetry};
use miette::IntoDiagnostic;
use palpate_scene::Scene;
use sd_notify::NotifyState;
use std::{io::Write as _, process::ExitCode};
use tokio::{
    runtime,
    signal::unix::{Signal, SignalKind, signal},
};
use tokio_util::sync::CancellationToken;

/// Serves a scene until it is told to stop.
///
/// # Errors
/// A scene that does not load, a setting out of range, or an address that cannot be bound.
pub fn run(args: &ServeArgs) -> miette::Result<ExitCode> {
    run_with(args, Loop::run)
}

/// The same with a loop that runs otherwise: see [`start_with`].
///
/// # Errors
/// As [`run`].
pub fn run_with(args: &ServeArgs, runner: Runner) -> miette::Result<ExitCode> {
    telemetry::init();
    let mut config = args.config()?;
    config.bounds.connections = config.bounds.connections.min(descriptors::raise());
    let mut bar = Progress::new(&args.scene);
    let scene = load::from_argument(&args.scene, &mut |fraction, what| bar.show(fraction, what));
    bar.finish();
    let scene = scene?;
    let runtime = runtime::Builder::new_multi_thread().enable_all().build().into_diagnostic()?;
    let code = runtime.block_on(serve(config, scene, runner))?;
    // What still hangs on a socket is not waited for.
    runtime.shutdown_background();
    Ok(code)
}

async fn serve(config: ServeConfig, scene: Scene, runner: Runner) -> Result<ExitCode, ServeError> {
    let description = scene.description.clone();
    let stop = CancellationToken::new();
    let signals = Signals::new().map_err(|source| ServeError::System { what: "signal handlers", source })?;
    let running = start_with(config.clone(), scene, stop.clone(), runner).await?;
    // Readers that have gone miss what is said, no more.
    let _ = writeln!(std::io::stdout(), "{}", report::startup(&running, &config, &description));
    notify(&[NotifyState::Ready]);
    let told = stop.clone();
    tokio::spawn(async move {
        signals.first().await;
        told.cancel();
        let _ = writeln!(std::io::stderr(), "stopping: forces ramp to zero");
        notify(&[NotifyState::Stopping]);
    });
    let Some(summary) = running.finished().await else {
        tracing::error!("the daemon ended by a panic");
        return Ok(ExitCode::FAILURE);
    };
    let _ = writeln!(std::io::stdout(), "{}", report::farewell(&summary));
    if let Some(failure) = summary.failure {
        let _ = writeln!(std::io::stderr(), "stopped without being told to: {failure}");
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

/// Tells systemd, if it is there.
fn notify(states: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!(%error, "no service manager was told");
    }
}

struct Signals {
    terminate: Signal,
    interrupt: Signal,
}

impl Signals {
    fn new() -> std::io::Result<Self> {
        Ok(Self { terminate: signal(SignalKind::terminate())?, interrupt: signal(SignalKind::interrupt())? })
    }

    async fn first(mut self) {
        tokio::select! {
            _ = self.terminate.recv() => {}
            _ = self.interrupt.recv() => {}
        }
    }
}
