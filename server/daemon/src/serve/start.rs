//! Wiring: prepare the session, start the loop, open the doors; and the way back when told to stop.
use super::{ServeConfig, ServeError, run::set_aside};
use crate::{
    doors::{Doors, lane::Lane, origin::Guard, whole::Gate},
    grpc,
    kept::{autosave::Autosave, folder::Kept},
    progress::{BUILDING, Progress},
    session::{Daemon, Numbers, Prepared, SessionSettings, prepare},
    sim::{
        command::{Desk, desk},
        simulation::Simulation,
        thread::{Loop, StopSign},
        timing::Timing,
    },
    stream::hub::Hub,
    who::{self, keeper::Keeper},
};
use palpate_physics::snapshot;
use palpate_realtime::{Clock, Note, OsMeasures, TickLoop};
use palpate_scene::Scene;
use std::{
    net::SocketAddr,
    sync::{Arc, RwLock, atomic::AtomicU64},
    thread,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tokio::{
    sync::{Semaphore, oneshot},
    task::{JoinHandle, JoinSet},
    time::timeout,
};
use tokio_util::sync::CancellationToken;

/// States that requests may hold beside the running one: copies for status and snapshots, and restored ones.
const MOST_STATES: usize = 8;
/// How long the last copy of the session may take.
const LAST_COPY_WITHIN: Duration = Duration::from_millis(100);
/// How long open streams may take to end once forces are zero.
const STREAMS_END_WITHIN: Duration = Duration::from_secs(2);

/// A daemon at work.
#[derive(Debug)]
pub struct Running {
    /// Where it listens by TCP, if it does.
    pub address: Option<SocketAddr>,
    /// What the operating system granted or refused.
    pub notes: Vec<Note>,
    /// The running session, shared with the services.
    pub daemon: Arc<Daemon>,
    /// Who may do what.
    pub keeper: Arc<Keeper>,
    ended: JoinHandle<Summary>,
}

/// What a daemon leaves behind.
#[derive(Debug)]
pub struct Summary {
    /// Times of the loop.
    pub timing: Arc<Timing>,
    /// Updates dropped over all viewers.
    pub frames_skipped: u64,
    /// Samples dropped over all devices.
    pub samples_rejected: u64,
    /// Connections and requests refused, by reason.
    pub refusals: Vec<(&'static str, u64)>,
    /// Connections that did not end in time and were cut.
    pub cut: bool,
    /// What made the daemon stop without being told to.
    pub failure: Option<&'static str>,
}

impl Running {
    /// Waits until the daemon has stopped (`None`: it panicked).
    pub async fn finished(self) -> Option<Summary> {
        self.ended.await.ok()
    }
}

/// How the loop's thread runs the loop.
pub type Runner = fn(&mut Loop, &mut TickLoop);

/// Starts a daemon on a scene; it stops gracefully when `stop` is cancelled.
///
/// # Errors
/// [`ServeError`]; nothing keeps running.
pub async fn start(config: ServeConfig, scene: Scene, stop: CancellationToken) -> Result<Running, ServeError> {
    start_with(config, scene, stop, Loop::run).await
}

/// The same with a loop that runs otherwise: for tests of what becomes of arms when it fails.
///
/// # Errors
/// [`ServeError`]; nothing keeps running.
pub async fn start_with(
    config: ServeConfig,
    scene: Scene,
    stop: CancellationToken,
    run: Runner,
) -> Result<Running, ServeError> {
    let mut config = config.checked()?;
    let keeper = Arc::new(match &config.keys {
        Some(folder) => Keeper::of(folder.clone())?,
        None => Keeper::open(),
    });
    let doors = Doors::open(config.listen, config.tls.as_ref(), config.unix.as_ref()).await?;
    let system = |source| ServeError::System { what: "thread for arms", source };
    let lane = Lane::start(config.measures.of_stream()).await.map_err(system)?;
    let hub = Hub::new(config.display_rate_hz);
    let numbers = Numbers::new(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()));
    let settings = SessionSettings {
        limits: config.limits,
        simulated_arm: config.simulated_arm,
        scene_folders: config.scene_folders.clone(),
        arms: lane.handle.clone(),
    };
    let mut bar = Progress::new(&scene.name);
    let prepared =
        prepare((scene, config.source.clone()), &settings, &numbers, &hub, &mut |part| bar.show(part, BUILDING));
    bar.finish();
    let Prepared { mut simulation, session, surface } = prepared?;
    // It is not held for as long as the daemon runs.
    let mut paused = false;
    if let Some(kept) = config.resume.take() {
        match (take_up(&mut simulation, &kept), &config.autosave) {
            (Ok(()), _) => paused = kept.paused,
            (Err(error), Some(autosave)) => set_aside(&autosave.folder, &error)?,
            (Err(error), None) => return Err(error),
        }
    }
    let (desk, orders, clerk) = desk().map_err(|source| ServeError::System { what: "order desk", source })?;
    let timing = Arc::new(Timing::default());
    let sign = StopSign::default();
    let (mut notes, the_loop) =
        start_loop((simulation, paused), desk, sign.clone(), Arc::clone(&timing), config.measures, run).await?;
    // A refusal is for the same reason as the loop's, which says what to do.
    let of_arms = lane.notes.iter().filter(|note| note.granted);
    notes.extend(of_arms.map(|note| Note { granted: true, text: format!("streams of arms: {}", note.text) }));
    tokio::spawn(clerk.work());
    let autosave = config.autosave.clone().map(|settings| Arc::new(Autosave::new(settings)));
    let daemon = Arc::new(Daemon {
        orders,
        hub,
        timing,
        realtime_notes: notes.iter().map(ToString::to_string).collect(),
        settings,
        stop,
        sign,
        refusals: Arc::default(),
        autosave: autosave.clone(),
        samples_rejected: AtomicU64::new(0),
        current: RwLock::new(Arc::clone(&session)),
        numbers,
        loading: Arc::default(),
        room_for_states: Arc::new(Semaphore::new(MOST_STATES)),
    });
    daemon.show(&session, surface);
    let gate = Gate::new(config.bounds, &daemon.refusals);
    let guard = Guard::new(&config.host_names, &daemon.refusals);
    let known = who::gate::Gate::new(&keeper, &daemon.refusals);
    let (routers, health) = grpc::routes(&daemon, gate, guard, known).await?;
    if let Some(autosave) = autosave {
        tokio::spawn(autosave.run(Arc::clone(&daemon)));
    }
    tokio::spawn(super::watch::watch(Arc::clone(&daemon), health.clone()));
    let address = doors.address;
    let closing = CancellationToken::new();
    let servers = doors.serve(&routers, &lane.handle, config.bounds, &daemon.refusals, &closing);
    let ended = tokio::spawn(until_stopped(Arc::clone(&daemon), the_loop, health, servers, lane, closing, config));
    Ok(Running { address, notes, daemon, keeper, ended })
}

/// Puts a session where it was when it was kept.
fn take_up(simulation: &mut Simulation, kept: &Kept) -> Result<(), ServeError> {
    let refuse = |reason: String| ServeError::Resume { reason };
    let model = Arc::clone(simulation.model());
    let state = snapshot::restore(&model, &kept.state).map_err(|error| refuse(error.to_string()))?;
    let hash = snapshot::state_hash(&state);
    if hash != kept.state_hash {
        return Err(refuse(format!("the state's hash is {hash:016x}, and {:016x} was kept", kept.state_hash)));
    }
    if simulation.restore(&state) { Ok(()) } else { Err(refuse("the state is another body's".to_owned())) }
}

/// The loop's thread, once it has asked the operating system for its measures.
async fn start_loop(
    (simulation, paused): (Box<Simulation>, bool),
    desk: Desk,
    sign: StopSign,
    timing: Arc<Timing>,
    measures: OsMeasures,
    run: Runner,
) -> Result<(Vec<Note>, thread::JoinHandle<()>), ServeError> {
    let tick_loop = TickLoop::new(Clock::Monotonic, simulation.period_s());
    let mut tick_loop =
        tick_loop.map_err(|error| ServeError::Prepare(error.into()))?.measured_in(Arc::clone(&timing.the_loop));
    let mut the_loop = Loop::new(simulation, desk, sign.clone(), timing, Clock::Monotonic);
    if paused {
        the_loop.pause();
    }
    let (tell, told) = oneshot::channel();
    let body = move || {
        let _gone_when_dropped = sign.hold();
        let granted = measures.apply();
        let _ = tell.send(granted.notes.clone());
        run(&mut the_loop, &mut tick_loop);
        drop(granted);
    };
    let system = |source| ServeError::System { what: "thread", source };
    let thread = thread::Builder::new().name("palpate-loop".into()).spawn(body).map_err(system)?;
    Ok((told.await.unwrap_or_default(), thread))
}

/// Waits for the stop, then: forces to zero, streams end, sockets close, loop joins.
async fn until_stopped(
    daemon: Arc<Daemon>,
    thread: thread::JoinHandle<()>,
    health: tonic_health::server::HealthReporter,
    mut servers: JoinSet<()>,
    lane: Lane,
    closing: CancellationToken,
    config: ServeConfig,
) -> Summary {
    let mut failure = None;
    let gone = daemon.sign.gone();
    tokio::select! {
        () = daemon.stop.cancelled() => {}
        ended = servers.join_next() => {
            tracing::error!(?ended, "a server ended by itself: stopping");
            failure = Some("a server ended by itself");
        }
        () = gone.cancelled() => {
            tracing::error!("the simulation loop ended by itself: stopping");
            failure = Some("the simulation loop ended by itself");
        }
    }
    daemon.stop.cancel();
    for service in ["palpate.v1.Device", "palpate.v1.Surface", "palpate.v1.Session", ""] {
        health.set_service_status(service, tonic_health::ServingStatus::NotServing).await;
    }
    // The loop still takes orders. Forces do not wait for a copy that takes long.
    let last = match &daemon.autosave {
        Some(autosave) => timeout(LAST_COPY_WITHIN, autosave.last(&daemon)).await.unwrap_or_else(|_| {
            tracing::error!("the session could not be copied in time: what was kept before is there still");
            None
        }),
        None => None,
    };
    // Device streams wait for zero force by themselves; the loop ramps now.
    daemon.sign.raise();
    let joined = tokio::task::spawn_blocking(move || thread.join().is_ok());
    if !matches!(joined.await, Ok(true)) {
        tracing::error!("the loop ended by a panic");
        failure = Some("the simulation loop ended by a panic");
    }
    if let (Some(autosave), Some(last)) = (&daemon.autosave, last) {
        autosave.keep_last(last).await;
    }
    daemon.session().ended.cancel();
    closing.cancel();
    let all_ended = async { while servers.join_next().await.is_some() {} };
    let cut = timeout(STREAMS_END_WITHIN, all_ended).await.is_err();
    servers.abort_all();
    drop(lane);
    if let Some(socket) = &config.unix {
        let _ = std::fs::remove_file(&socket.path);
    }
    Summary {
        timing: Arc::clone(&daemon.timing),
        frames_skipped: daemon.hub.frames_skipped(),
        samples_rejected: daemon.samples_rejected.load(std::sync::atomic::Ordering::Relaxed),
        refusals: daemon.refusals.all(),
        cut,
        failure,
    }
}
