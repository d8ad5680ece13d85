//! The session outside the loop: its body, its tools and who drives them, and how one session replaces another.
use crate::{
    bodies::served,
    doors::refusals::Refusals,
    kept::{autosave::Autosave, folder::Source},
    sim::{
        command::{Copy, Done, Orders, Refusal, Request},
        exchange::{SurfaceEnd, ToolEnd},
        simulation::{Parts, Simulation},
        thread::StopSign,
        timing::Timing,
        tool::ArmLimits,
    },
    stream::hub::Hub,
    tick_budget::{self, BudgetError},
};
use palpate_physics::{Model, ModelError};
use palpate_proto::v1;
use palpate_scene::{Driver, Probe, Scene};
use std::{
    io,
    path::PathBuf,
    sync::{
        Arc, Mutex, MutexGuard, OnceLock, PoisonError, RwLock,
        atomic::{AtomicI32, AtomicU64, Ordering},
    },
};
use thiserror::Error;
use tokio::sync::OwnedSemaphorePermit;
use tokio_util::sync::CancellationToken;

/// What every session is run with.
#[derive(Debug, Clone)]
pub struct SessionSettings {
    /// Limits of arms.
    pub limits: ArmLimits,
    /// Whether the scene's simulated arm drives a tool to which no device is attached.
    pub simulated_arm: bool,
    /// Folders below which scene files may be loaded by viewers.
    pub scene_folders: Vec<PathBuf>,
    /// Where streams of arms are served, and tools' bells heard.
    pub arms: tokio::runtime::Handle,
}

/// Why a scene cannot be run.
#[derive(Debug, Error)]
pub enum PrepareError {
    /// The physics refused it.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The loop cannot keep its tick.
    #[error(transparent)]
    Period(#[from] palpate_realtime::PeriodError),
    /// Its ticks take too long.
    #[error(transparent)]
    Budget(#[from] BudgetError),
    /// The operating system.
    #[error("no descriptors for the session's slots: {0}")]
    Slots(io::Error),
}

/// A running session.
#[derive(Debug)]
pub struct ActiveSession {
    /// Its id on the wire.
    pub id: String,
    /// Its number in the loop.
    pub number: u64,
    /// The scene's name.
    pub scene_name: String,
    /// Where the scene comes from; `None`: nobody can load it again.
    pub source: Option<Source>,
    /// The body.
    pub model: Arc<Model>,
    /// What the scene measures.
    pub probes: Vec<Probe>,
    /// Remarks.
    pub warnings: Vec<String>,
    /// One per tool.
    pub tools: Vec<ToolSeat>,
    /// Cancelled when another session replaces it, or the daemon stops.
    pub ended: CancellationToken,
}

/// A tool that a device can take.
#[derive(Debug)]
pub struct ToolSeat {
    /// Name in the scene.
    pub name: String,
    /// Whether the scene leaves it to a device.
    pub for_devices: bool,
    end: Mutex<Option<ToolEnd>>,
    device: Mutex<Option<Arc<DeviceRecord>>>,
}

/// What is known of an attached device.
#[derive(Debug)]
pub struct DeviceRecord {
    /// Its name.
    pub name: String,
    /// Samples taken.
    pub accepted: AtomicU64,
    /// Samples dropped.
    pub rejected: AtomicU64,
    /// What becomes of the force on its side, as it says (`SafetyState`).
    pub safety_state: AtomicI32,
    /// When the newest sample came (ns, monotonic), 0: none yet.
    pub newest_ns: AtomicU64,
    force_n_bits: AtomicU64,
    dismissal: OnceLock<Dismissal>,
    dismissed: CancellationToken,
    gone: CancellationToken,
}

/// Why a device loses its tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dismissal {
    /// It sent no samples for the time of its lease.
    Silent,
    /// Somebody ordered it.
    Ordered,
    /// Its identity has ended.
    Expired,
}

impl DeviceRecord {
    /// A device that has sent nothing yet.
    pub fn new(name: String) -> Arc<Self> {
        Arc::new(Self {
            name,
            accepted: AtomicU64::new(0),
            rejected: AtomicU64::new(0),
            safety_state: AtomicI32::new(0),
            newest_ns: AtomicU64::new(0),
            force_n_bits: AtomicU64::new(0),
            dismissal: OnceLock::new(),
            dismissed: CancellationToken::new(),
            gone: CancellationToken::new(),
        })
    }

    /// Takes the tool from it, with the first reason that is given.
    pub fn dismiss(&self, why: Dismissal) {
        let _ = self.dismissal.set(why);
        self.dismissed.cancel();
    }

    /// Why it loses its tool, as soon as it does.
    pub async fn dismissed(&self) -> Dismissal {
        self.dismissed.cancelled().await;
        self.dismissal.get().copied().unwrap_or(Dismissal::Ordered)
    }

    /// Waits until its tool is free.
    pub async fn gone(&self) {
        self.gone.cancelled().await;
    }

    /// Notes the magnitude of the last force sent (N).
    pub fn sent_force_n(&self, force_n: f64) {
        self.force_n_bits.store(force_n.to_bits(), Ordering::Relaxed);
    }

    /// Magnitude of the last force sent (N).
    pub fn force_n(&self) -> f64 {
        f64::from_bits(self.force_n_bits.load(Ordering::Relaxed))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ToolSeat {
    /// Takes the tool for a device; `None` when another has it.
    pub fn take(&self, record: &Arc<DeviceRecord>) -> Option<ToolEnd> {
        let end = lock(&self.end).take()?;
        *lock(&self.device) = Some(Arc::clone(record));
        Some(end)
    }

    /// Gives it back.
    pub fn give_back(&self, end: ToolEnd) {
        end.shared.detach();
        let device = lock(&self.device).take();
        *lock(&self.end) = Some(end);
        if let Some(device) = device {
            device.gone.cancel();
        }
    }

    /// The device that has it.
    pub fn device(&self) -> Option<Arc<DeviceRecord>> {
        lock(&self.device).clone()
    }
}

impl ActiveSession {
    /// The session as the wire tells it.
    pub fn info(&self) -> v1::SessionInfo {
        let model = &self.model;
        v1::SessionInfo {
            session_id: self.id.clone(),
            scene_name: self.scene_name.clone(),
            node_count: model.rest_positions_m().len() as u32,
            tet_count: model.body().tets().map_or(0, |mesh| mesh.tets().len()) as u32,
            surface_triangle_count: model.surface().triangles.len() as u32,
            substeps_per_tick: model.substeps(),
            tick_period_s: model.settings().tick_period_s,
            mass_kg: model.body().total_mass_kg(),
            max_natural_frequency_rad_per_s: model.body().max_natural_frequency_rad_per_s(),
            tool_names: self.tools.iter().map(|tool| tool.name.clone()).collect(),
            particle_count: model.body().particle_count() as u32,
            most_active_particles: model.body().most_awake_particles() as u32,
        }
    }
}

/// A session that is ready to go into the loop.
#[derive(Debug)]
pub struct Prepared {
    /// For the loop.
    pub simulation: Box<Simulation>,
    /// For everybody else.
    pub session: Arc<ActiveSession>,
    /// For the hub.
    pub surface: SurfaceEnd,
}

/// All that the services share.
#[derive(Debug)]
pub struct Daemon {
    /// To the loop.
    pub orders: Orders,
    /// To the viewers.
    pub hub: Arc<Hub>,
    /// Of the loop.
    pub timing: Arc<Timing>,
    /// What the operating system granted or refused, a line each.
    pub realtime_notes: Vec<String>,
    /// What sessions are run with.
    pub settings: SessionSettings,
    /// Cancelled when the daemon begins to stop.
    pub stop: CancellationToken,
    /// Tells when forces are zero.
    pub sign: StopSign,
    /// Whoever was refused at the doors.
    pub refusals: Arc<Refusals>,
    /// Keeps the session, if it is kept.
    pub autosave: Option<Arc<Autosave>>,
    /// Samples dropped over all devices.
    pub samples_rejected: AtomicU64,
    pub(crate) current: RwLock<Arc<ActiveSession>>,
    pub(crate) numbers: Numbers,
    pub(crate) loading: Arc<tokio::sync::Mutex<()>>,
    /// One permit per state that requests may hold beside the running one.
    pub(crate) room_for_states: Arc<tokio::sync::Semaphore>,
}

/// Counters that name things.
#[derive(Debug)]
pub struct Numbers {
    started_unix_s: u64,
    session: AtomicU64,
    attachment: AtomicU64,
}

impl Numbers {
    /// `started_unix_s` tells sessions of one start of the daemon from those of another.
    pub fn new(started_unix_s: u64) -> Self {
        Self { started_unix_s, session: AtomicU64::new(0), attachment: AtomicU64::new(0) }
    }

    fn next_session(&self) -> (u64, String) {
        let number = self.session.fetch_add(1, Ordering::Relaxed) + 1;
        (number, format!("{:x}-{number}", self.started_unix_s))
    }

    /// A number for an attachment, from 1.
    pub fn next_attachment(&self) -> u64 {
        self.attachment.fetch_add(1, Ordering::Relaxed) + 1
    }
}

/// Builds all of a session; `progress` is told the part done of what takes long. Takes as long as the mesh is large; needs a runtime's context.
///
/// # Errors
/// [`PrepareError`].
pub fn prepare(
    (scene, source): (Scene, Option<Source>),
    settings: &SessionSettings,
    numbers: &Numbers,
    hub: &Hub,
    progress: &mut dyn FnMut(f64),
) -> Result<Prepared, PrepareError> {
    let model = Arc::new(Model::build_with(scene.model, progress)?);
    let period_s = model.settings().tick_period_s;
    palpate_realtime::Deadlines::new(palpate_realtime::Clock::Monotonic, period_s)?;
    tick_budget::check(&model)?;
    let mut warnings = scene.warnings;
    warnings.extend(served(&model).warnings(&model));
    warnings.extend(tick_budget::warning(&model));
    let (number, id) = numbers.next_session();
    let for_devices: Vec<bool> = scene.drivers.iter().map(|driver| matches!(driver, Driver::Device)).collect();
    let (simulation, ends) = Simulation::build(Parts {
        session: number,
        model: Arc::clone(&model),
        timeline: scene.timeline,
        drivers: scene.drivers,
        arm: scene.arm.filter(|_| settings.simulated_arm),
        limits: settings.limits,
        demand: Arc::clone(&hub.demand),
        arms: settings.arms.clone(),
    })
    .map_err(PrepareError::Slots)?;
    let seat = |((end, spec), for_devices): ((ToolEnd, &palpate_physics::contact::ToolSpec), bool)| ToolSeat {
        name: spec.name.clone(),
        for_devices,
        end: Mutex::new(Some(end)),
        device: Mutex::new(None),
    };
    let tools = ends.tools.into_iter().zip(model.tools()).zip(for_devices).map(seat).collect();
    let session = ActiveSession {
        id,
        number,
        scene_name: scene.name,
        source,
        model,
        probes: scene.probes,
        warnings,
        tools,
        ended: CancellationToken::new(),
    };
    Ok(Prepared { simulation, session: Arc::new(session), surface: ends.surface })
}

impl Daemon {
    /// How many states requests may still hold beside the running one.
    pub fn room_for_states_left(&self) -> usize {
        self.room_for_states.available_permits()
    }

    /// A copy of a session's state, and how time stands, with its room. The room is taken before the memory is, and goes with it: a
    /// caller that goes away while memory is being got frees neither.
    ///
    /// # Errors
    /// [`Refusal`].
    pub async fn copy(&self, session: &ActiveSession) -> Result<(Box<Copy>, Done, OwnedSemaphorePermit), Refusal> {
        let (room, model) = (self.room().await?, Arc::clone(&session.model));
        let empty = tokio::task::spawn_blocking(move || (Copy::of(&model), room));
        let (copy, room) = empty.await.map_err(|_| Refusal::Silent)?;
        match self.orders.give(session.number, Request::Copy(Box::new(copy)), false).await? {
            (Request::Copy(copy), done) => Ok((copy, done, room)),
            _ => Err(Refusal::Silent),
        }
    }

    /// Waits for room for one more state beside the running one.
    ///
    /// # Errors
    /// [`Refusal::Stopping`].
    pub async fn room(&self) -> Result<OwnedSemaphorePermit, Refusal> {
        Arc::clone(&self.room_for_states).acquire_owned().await.map_err(|_| Refusal::Stopping)
    }

    /// The running session.
    pub fn session(&self) -> Arc<ActiveSession> {
        Arc::clone(&self.current.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// Lets a prepared session take the place of the running one. Forces on arms go to zero first.
    ///
    /// # Errors
    /// [`Refusal`]; the running session goes on.
    pub async fn replace(&self, prepared: Prepared) -> Result<Arc<ActiveSession>, Refusal> {
        let Prepared { simulation, session, surface } = prepared;
        let old = self.session();
        // However long the release takes: a caller that gave up would not know which session runs.
        let (old_simulation, _) = self.orders.give(old.number, Request::Load(simulation), true).await?;
        *self.current.write().unwrap_or_else(PoisonError::into_inner) = Arc::clone(&session);
        old.ended.cancel();
        self.show(&session, surface);
        // Freeing a large body takes its time: not on a thread that serves streams.
        tokio::task::spawn_blocking(move || drop(old_simulation));
        Ok(session)
    }

    /// Lets the hub serve a session's surface.
    pub fn show(&self, session: &Arc<ActiveSession>, surface: SurfaceEnd) {
        tokio::spawn(Arc::clone(&self.hub).serve(
            session.id.clone(),
            session.scene_name.clone(),
            Arc::clone(&session.model),
            surface,
            session.ended.clone(),
        ));
    }
}
