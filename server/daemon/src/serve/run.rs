//! The process: load, start, tell, wait for a signal, say goodbye.
use super::{Runner, ServeConfig, ServeError, args::ServeArgs, manager::notify, report, start_with};
use crate::{
    doors::descriptors,
    kept::folder::{KeptError, KeptFolder, Slot},
    load,
    progress::Progress,
    sim::thread::Loop,
    telemetry::{self, causes},
    who::keeper::Keeper,
};
use miette::IntoDiagnostic;
use palpate_realtime::give_large_blocks_back;
use palpate_scene::Scene;
use sd_notify::NotifyState;
use std::{io::Write as _, process::ExitCode, sync::Arc};
use tokio::{
    runtime,
    signal::unix::{Signal, SignalKind, signal},
};
use tokio_util::sync::CancellationToken;

/// Threads for what takes long: copies of states, scenes that are loaded, files.
const MOST_BLOCKING_THREADS: usize = 12;

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
    give_large_blocks_back();
    config.bounds.connections = config.bounds.connections.min(descriptors::raise());
    let mut bar = Progress::new(&args.scene);
    if let Some(autosave) = &config.autosave {
        autosave.folder.prepare()?;
        if args.resume {
            config.resume = match autosave.folder.read(Slot::Newest) {
                Err(error @ KeptError::Content { .. }) => {
                    set_aside(&autosave.folder, &error)?;
                    None
                }
                read => read?,
            };
        }
    }
    let mut show = |fraction: f64, what: &str| bar.show(fraction, what);
    let kept = match (&config.resume, &config.autosave) {
        (Some(kept), Some(autosave)) => match load::from_kept(&kept.source, &mut show) {
            Ok(scene) => Some((scene, kept.source.clone())),
            Err(error) => {
                set_aside(&autosave.folder, &*error)?;
                None
            }
        },
        _ => None,
    };
    let loaded = if let Some(loaded) = kept {
        Ok(loaded)
    } else {
        config.resume = None;
        load::from_argument(&args.scene, &mut show)
    };
    bar.finish();
    let (scene, source) = loaded?;
    config.source = Some(source);
    // Their stacks are locked in memory, and each has a heap of its own: no more than there is work for at a time.
    let runtime = runtime::Builder::new_multi_thread()
        .max_blocking_threads(MOST_BLOCKING_THREADS)
        .enable_all()
        .build()
        .into_diagnostic()?;
    let code = runtime.block_on(serve(config, scene, runner))?;
    // What still hangs on a socket is not waited for.
    runtime.shutdown_background();
    Ok(code)
}

async fn serve(mut config: ServeConfig, scene: Scene, runner: Runner) -> Result<ExitCode, ServeError> {
    let description = scene.description.clone();
    let stop = CancellationToken::new();
    let signals = Signals::new().map_err(|source| ServeError::System { what: "signal handlers", source })?;
    let resume = config.resume.take();
    let running = start_with(ServeConfig { resume, ..config.clone() }, scene, stop.clone(), runner).await?;
    // Readers that have gone miss what is said, no more.
    let _ = writeln!(std::io::stdout(), "{}", report::startup(&running, &config, &description));
    notify(&[NotifyState::Ready]);
    let told = stop.clone();
    let keeper = Arc::clone(&running.keeper);
    tokio::spawn(async move {
        signals.first(|| reload(&keeper)).await;
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

/// A kept session that cannot be taken up is no reason to serve nothing, and none to lose it.
pub(super) fn set_aside(folder: &KeptFolder, error: &dyn std::error::Error) -> Result<(), KeptError> {
    let aside = folder.set_aside()?;
    let (error, aside) = (causes(error), aside.display().to_string());
    tracing::error!(
        error,
        aside,
        "the kept session cannot be taken up again: it is set aside, and the scene begins at rest"
    );
    Ok(())
}

/// Reads again what may change while the daemon runs.
fn reload(keeper: &Keeper) {
    match keeper.reload() {
        Ok(()) => tracing::info!("the key of tokens and the revoked names are read again"),
        Err(error) => tracing::error!(
            error = causes(&error),
            "the key of tokens and the revoked names cannot be read again: those of before stay"
        ),
    }
}

struct Signals {
    terminate: Signal,
    interrupt: Signal,
    hangup: Signal,
}

impl Signals {
    fn new() -> std::io::Result<Self> {
        Ok(Self {
            terminate: signal(SignalKind::terminate())?,
            interrupt: signal(SignalKind::interrupt())?,
            hangup: signal(SignalKind::hangup())?,
        })
    }

    /// Waits for one that ends the daemon; others ask it to `reload`.
    async fn first(mut self, reload: impl Fn()) {
        loop {
            tokio::select! {
                _ = self.terminate.recv() => return,
                _ = self.interrupt.recv() => return,
                _ = self.hangup.recv() => reload(),
            }
        }
    }
}
