//! Starts servo and uplink, watches both, and ends them in order: force to zero, then the stream, then the program.
use crate::{
    BridgeError, Config, Stats, Summary, device,
    guard::Guard,
    latch::Latch,
    recording::recorder::Failure,
    servo::{Servo, ServoLaw, Waits},
    settings::{ServoSettings, Settings},
    uplink::{SampleSource, Uplink},
    vrpn_server,
    watcher::{WATCH_PERIOD, Watcher},
};
use palpate_control::{EnergyMeter, Link, PhaseLock, StiffnessBound};
use palpate_realtime::{Clock, Doorbell, Note, OsMeasures, TickLoop, slot};
use std::{
    path::PathBuf,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};
use tokio::{
    sync::oneshot::{self, error::RecvError},
    time,
};
use tokio_util::sync::CancellationToken;
use tracing::Instrument as _;

/// Beyond the ramp, how long the servo may take to stop.
const STOP_MARGIN: Duration = Duration::from_secs(1);
/// How long the uplink may take to end its stream.
const END_TIMEOUT: Duration = Duration::from_secs(6);

/// What servo, uplink and the rest of the program share: flags and counters, all atomic.
#[derive(Debug, Default)]
pub struct Shared {
    /// Counters.
    pub stats: Stats,
    /// A stream stands: the servo publishes samples.
    pub attached: AtomicBool,
    /// The servo ramps to zero and ends.
    pub stop: AtomicBool,
    /// Somebody asks to leave a latched fault.
    pub recover: AtomicBool,
    /// The daemon asks for zero force.
    pub peer_fault: AtomicBool,
    /// The arm gets no force: it is measured.
    pub without_force: AtomicBool,
    /// This program, to be started as a guard.
    pub guard_program: OnceLock<PathBuf>,
    /// How stiff contacts may be on the arm, once it is open.
    pub stiffness: OnceLock<StiffnessBound>,
    /// The connection to the daemon ended.
    pub lost: AtomicBool,
    /// There was a guard, and it is gone.
    pub unguarded: AtomicBool,
    /// How long poses wait for the daemon's ticks.
    pub waits: Waits,
    /// The daemon's force crosses the network, and nobody knows yet whether that is stable.
    pub unmeasured: AtomicBool,
}

/// A running bridge, from outside.
#[derive(Debug, Clone, Default)]
pub struct Handle {
    shared: Arc<Shared>,
}

impl Handle {
    /// For [`run_with`].
    pub fn new() -> Self {
        Self::default()
    }

    /// Leaves a latched fault; the force comes back slowly, with the next command.
    pub fn recover(&self) {
        self.shared.recover.store(true, Ordering::Relaxed);
    }

    /// With `servo.guard` this program (the bridge's own) stands guard beside the arm; without a program nobody does.
    pub fn guarded_by(&self, program: PathBuf) {
        let _ = self.shared.guard_program.set(program);
    }

    /// From now on the arm gets no force: it is measured.
    pub fn without_force(&self) {
        self.shared.without_force.store(true, Ordering::Relaxed);
    }

    /// How stiff contacts may be on the arm, once it is open; of the first run with this handle.
    pub fn stiffness(&self) -> Option<StiffnessBound> {
        self.shared.stiffness.get().copied()
    }

    /// Counters, live.
    pub fn stats(&self) -> &Stats {
        &self.shared.stats
    }

    /// Whether the arm is attached to a tool now.
    pub fn is_attached(&self) -> bool {
        self.shared.attached.load(Ordering::Relaxed)
    }
}

/// Runs a bridge until `shutdown` is cancelled. Then the force ramps to zero, the stream ends, and the counters are returned.
///
/// # Errors
/// [`BridgeError`], for a bad configuration, or a daemon that can never be attached to.
pub async fn run(config: Config, shutdown: CancellationToken) -> Result<Summary, BridgeError> {
    run_with(&config, shutdown, Handle::new()).await
}

/// As [`run`], with a handle made by the caller.
///
/// # Errors
/// As [`run`].
pub async fn run_with(config: &Config, shutdown: CancellationToken, handle: Handle) -> Result<Summary, BridgeError> {
    let settings = Settings::new(config)?;
    let shared = handle.shared;
    let (server, told) = vrpn_server::open(settings.vrpn_server.as_ref(), &shared)?.unzip();
    let recording = Failure::default();
    let device = open(&settings, &shutdown, &recording).await?;
    let Some(device) = device else { return Ok(shared.stats.summary()) };
    let settings = settings.bearable(device.stiffest_wall_n_per_m());
    let _ = shared.stiffness.set(settings.servo.stiffness);
    let (commands, down) = slot(&None);
    let (up, samples) = slot(&None);
    let bell = Doorbell::new().map_err(|source| BridgeError::System { what: "create an eventfd", source })?;
    let heard = bell.clone();
    let guard = start_guard(&*device, &settings, shared.guard_program.get());
    let mut latch = latch(&settings)?;
    let mut law = ServoLaw::new(settings.servo);
    if let Some(fault) = latch.as_ref().and_then(Latch::remembered).filter(|_| !settings.servo.auto_recover) {
        law.begin_latched(fault);
        // Before the first tick, too, it is what is so.
        shared.stats.set_link(Link::Latched(fault));
    }
    let servo = Servo {
        law,
        device,
        last: None,
        down,
        up,
        bell,
        told,
        shared: Arc::clone(&shared),
        sequence: 0,
        energy: EnergyMeter::default(),
        guard,
        phase: settings.follow_phase.then(|| PhaseLock::new((settings.servo.period_s * 1e9).round() as u64)),
    };
    shared.unmeasured.store(settings.uplink.across_network.is_some(), Ordering::Relaxed);
    let _no_servo_alone = StopOnDrop(Arc::clone(&shared));
    let mut servo_done = start_servo(servo, &settings).await?;
    let end = CancellationToken::new();
    let _no_stream_alone = end.clone().drop_guard();
    let server = server.map(|server| tokio::spawn(server.run(end.clone())));
    let uplink = {
        let (settings, shared, end) = (settings.uplink.clone(), Arc::clone(&shared), end.clone());
        move || {
            let source = SampleSource::new(&heard, samples)?;
            Ok(Uplink::new(settings, source, commands, shared, end))
        }
    };
    let mut uplink = start_uplink(uplink, &settings.uplink.device_name, settings.measures)?;
    let mut watcher = Watcher::new(&settings);
    let mut every = time::interval(WATCH_PERIOD);
    let outcome = loop {
        tokio::select! {
            () = shutdown.cancelled() => break Outcome::Asked,
            ended = &mut uplink => break Outcome::UplinkEnded(ended),
            _ = &mut servo_done => break Outcome::ServoDied,
            _ = every.tick() => {
                watcher.look(&shared);
                remember(latch.as_mut(), &shared);
            }
        }
    };
    // The force first; then the stream that carries it.
    let stopped = match outcome {
        Outcome::ServoDied => {
            Err(shared.stats.device_fault().map_or(BridgeError::ServoDied, |fault| BridgeError::DeviceLost { fault }))
        }
        _ => stop_servo(&shared, &settings.servo, servo_done).await,
    };
    remember(latch.as_mut(), &shared);
    end.cancel();
    let ended = match outcome {
        Outcome::UplinkEnded(ended) => ended,
        _ => time::timeout(END_TIMEOUT, uplink).await.unwrap_or(Ok(Ok(()))),
    };
    if let Some(server) = server {
        let _ = time::timeout(END_TIMEOUT, server).await;
    }
    stopped?;
    if let (Ok(Ok(())), Some(failure)) = (&ended, recording.get()) {
        return Err(BridgeError::Recording { failure: failure.clone() });
    }
    match ended {
        Ok(result) => result.map(|()| shared.stats.summary()),
        Err(panic) => Err(BridgeError::System { what: "run the uplink", source: std::io::Error::other(panic) }),
    }
}

/// Where a latched fault is remembered, if it is to be.
fn latch(settings: &Settings) -> Result<Option<Latch>, BridgeError> {
    let at = |path: &PathBuf| {
        Latch::at(path.clone()).map_err(|source| BridgeError::Read {
            what: "or write beside the file that remembers a latched fault,",
            path: path.clone(),
            source,
        })
    };
    settings.latch_file.as_ref().map(at).transpose()
}

/// Writes down what is latched now. Before the first tick nothing is known of the link.
fn remember(latch: Option<&mut Latch>, shared: &Shared) {
    let Some(latch) = latch.filter(|_| shared.stats.summary().ticks > 0) else { return };
    latch.follow(shared.stats.link());
}

/// Starts the thread that the stream to the daemon is on, with a priority right below the servo's: other programs of the machine, and
/// what else this one does, do not delay it. Where that is refused, the servo has said so. What comes back is how the stream ended.
fn start_uplink(
    make: impl FnOnce() -> std::io::Result<Uplink> + Send + 'static,
    device_name: &str,
    of_servo: OsMeasures,
) -> Result<oneshot::Receiver<Result<(), BridgeError>>, BridgeError> {
    let system = |source| BridgeError::System { what: "start the thread of the stream", source };
    let measures = of_servo.of_stream();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(system)?;
    let (tell, ended) = oneshot::channel();
    let span = tracing::info_span!("arm", name = device_name);
    let body = move || {
        let granted = measures.apply();
        for note in granted.notes.iter().filter(|note| note.granted) {
            tracing::info!("stream to the daemon: {note}");
        }
        let run = async {
            match make() {
                Ok(uplink) => uplink.run().instrument(span).await,
                Err(source) => Err(BridgeError::System { what: "watch an eventfd", source }),
            }
        };
        let outcome = runtime.block_on(run);
        // A name that is being looked up is not waited for.
        runtime.shutdown_background();
        let _ = tell.send(outcome);
    };
    std::thread::Builder::new().name("palpate-stream".to_owned()).spawn(body).map_err(system)?;
    Ok(ended)
}

/// A guard, where it can help; without one the arm's own patience is all there is, which is said.
fn start_guard(device: &dyn device::Arm, settings: &Settings, program: Option<&PathBuf>) -> Option<Guard> {
    let program = program.filter(|_| settings.guard)?;
    let Some(words) = device.last_words() else {
        if settings.device.arm.has_motors() {
            tracing::info!(
                "no guard stands beside this arm: nobody else can speak to it should this process be killed"
            );
        }
        return None;
    };
    let watchdog = &settings.servo.watchdog;
    let patience = Duration::from_secs_f64(watchdog.stale_after_s + watchdog.ramp_to_zero_s);
    Guard::start(program, words, patience, &settings.measures)
        .inspect_err(|error| tracing::warn!("no guard stands beside the arm, should this process be killed: {error}"))
        .ok()
}

/// The arm, opened on a thread that may wait; `None` when the bridge was told to stop meanwhile.
async fn open(
    settings: &Settings,
    shutdown: &CancellationToken,
    recording: &Failure,
) -> Result<Option<Box<dyn device::Arm>>, BridgeError> {
    let (settings, stop, failure) = (settings.clone(), shutdown.clone(), recording.clone());
    let opening = tokio::task::spawn_blocking(move || {
        device::open(&settings.device, settings.servo.period_s, &stop, &failure, |stiffest| {
            settings.demand_bearable(stiffest)
        })
    });
    tokio::select! {
        () = shutdown.cancelled() => Ok(None),
        opened = opening => match opened {
            Ok(opened) => opened.map(Some),
            Err(panic) => Err(BridgeError::System { what: "open the arm", source: std::io::Error::other(panic) }),
        },
    }
}

/// Whoever drops a running bridge drops it whole: the servo's thread ramps to zero and ends too.
struct StopOnDrop(Arc<Shared>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.stop.store(true, Ordering::Relaxed);
    }
}

/// Why a bridge stops.
enum Outcome {
    Asked,
    UplinkEnded(Result<Result<(), BridgeError>, RecvError>),
    ServoDied,
}

/// Starts the servo thread, logs what the operating system granted, and returns what ends with the thread.
async fn start_servo(mut servo: Servo, settings: &Settings) -> Result<oneshot::Receiver<()>, BridgeError> {
    let mut tick_loop = TickLoop::new(Clock::Monotonic, settings.servo.period_s)
        .map_err(|error| BridgeError::Value { key: "servo.rate_hz".to_owned(), reason: error.to_string() })?;
    servo.shared.stats.set_servo(tick_loop.monitor());
    let (done, servo_done) = oneshot::channel();
    let (say, notes) = oneshot::channel::<Vec<Note>>();
    let measures = settings.measures;
    std::thread::Builder::new()
        .name("palpate-servo".to_owned())
        .spawn(move || {
            let mut granted = measures.apply();
            let _ = say.send(std::mem::take(&mut granted.notes));
            servo.run(&mut tick_loop);
            // The arm is without force before anybody is told.
            drop(servo);
            let _ = done.send(());
        })
        .map_err(|source| BridgeError::System { what: "start the servo thread", source })?;
    for note in notes.await.unwrap_or_default() {
        if note.granted {
            tracing::info!("{note}");
        } else {
            tracing::warn!("{note}");
        }
    }
    if settings.measures == OsMeasures::NONE {
        tracing::info!("no real-time measures asked for");
    }
    Ok(servo_done)
}

async fn stop_servo(
    shared: &Shared,
    settings: &ServoSettings,
    servo_done: oneshot::Receiver<()>,
) -> Result<(), BridgeError> {
    shared.stop.store(true, Ordering::Relaxed);
    let ramp = Duration::from_secs_f64(settings.watchdog.ramp_to_zero_s);
    match time::timeout(ramp + STOP_MARGIN, servo_done).await {
        Ok(Ok(())) => Ok(()),
        _ => Err(BridgeError::ServoDied),
    }
}
