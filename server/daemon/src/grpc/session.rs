//! `palpate.v1.Session`.
use super::{convert, current_session, detach};
use crate::{
    doors::answer::Kept,
    kept::folder::Slot,
    load,
    session::{ActiveSession, Daemon, Dismissal, prepare},
    sim::{
        command::{Copy, Done, Refusal, Request as Order},
        inject::InjectRefusal,
    },
    sparing::Sparing,
    status,
    who::{keeper::Caller, role::Role},
};
use palpate_physics::snapshot;
use palpate_proto::{
    MAX_SNAPSHOT_BYTES,
    v1::{self, load_scene_request::Source as WireSource, session_server::Session},
};
use std::sync::Arc;
use tokio::sync::OwnedSemaphorePermit;
use tonic::{Request, Response, Status};
use tracing::Instrument as _;

/// The service.
#[derive(Debug, Clone)]
pub struct SessionService {
    /// Shared by all services.
    pub daemon: Arc<Daemon>,
    /// Its lines of the log.
    pub said: Arc<Said>,
}

/// A line of the log for each order that changes what an arm feels.
#[derive(Debug, Default)]
pub struct Said {
    pause: Sparing,
    go_on: Sparing,
    reset: Sparing,
    restore: Sparing,
    step: Sparing,
    inject: Sparing,
    detach: Sparing,
}

/// Says that an order has come, within the span that says from whom; `times`: such orders since the last line.
fn say(line: &Sparing, order: &'static str) {
    line.say(|times| tracing::info!(order, times, "an order has come"));
}

/// Who gave it: nobody that is known, where the gate did not say.
fn caller<M>(request: &Request<M>) -> Caller {
    request.extensions().get::<Caller>().cloned().unwrap_or(Caller::Unknown)
}

/// A refusal as gRPC tells it.
fn refused(refusal: Refusal) -> Status {
    let text = refusal.to_string();
    match refusal {
        Refusal::OtherSession => Status::not_found(text),
        Refusal::NotPaused | Refusal::Stepping => Status::failed_precondition(text),
        Refusal::Interrupted => Status::aborted(text),
        Refusal::OtherBody => Status::invalid_argument(text),
        Refusal::Inject(InjectRefusal::Past { from_tick, next_tick }) => {
            Status::invalid_argument(format!("from_tick = {from_tick} is over: the next tick is {next_tick}"))
        }
        Refusal::Inject(InjectRefusal::Far { from_tick, last_tick }) => {
            Status::invalid_argument(format!("from_tick = {from_tick} is too far ahead: at most {last_tick}"))
        }
        Refusal::Inject(InjectRefusal::Full { pending }) => {
            Status::resource_exhausted(format!("{pending} injected forces are waiting already: let them act first"))
        }
        Refusal::Busy => Status::resource_exhausted(text),
        Refusal::Stopping | Refusal::Silent => Status::unavailable(text),
    }
}

impl SessionService {
    async fn order(&self, session: &ActiveSession, order: Order) -> Result<(Order, Done), Status> {
        let patient = matches!(order, Order::Step(_));
        tokio::select! {
            result = self.daemon.orders.give(session.number, order, patient) => result.map_err(refused),
            () = self.daemon.stop.cancelled() => Err(refused(Refusal::Stopping)),
        }
    }

    /// A copy of the state, with its room, while the daemon does not stop.
    async fn copy(&self, session: &ActiveSession) -> Result<(Box<Copy>, Done, OwnedSemaphorePermit), Status> {
        tokio::select! {
            copied = self.daemon.copy(session) => copied.map_err(refused),
            () = self.daemon.stop.cancelled() => Err(refused(Refusal::Stopping)),
        }
    }

    /// Loads a scene to the end, whether or not the caller stays: half a replacement would be worse than none.
    async fn load(&self, source: WireSource) -> Result<Arc<ActiveSession>, Status> {
        let one_at_a_time = Arc::clone(&self.daemon.loading)
            .try_lock_owned()
            .map_err(|_| Status::aborted("another scene is being loaded: try again"))?;
        let daemon = Arc::clone(&self.daemon);
        let load = async move {
            let _one_at_a_time = one_at_a_time;
            let session = replace_scene(&daemon, source).await?;
            tracing::info!(scene = session.scene_name, session = session.id, "scene loaded");
            Ok(session)
        };
        tokio::spawn(load.in_current_span()).await.unwrap_or_else(|_| Err(unexpected()))
    }
}

/// What takes as long as the body is large is not done on a thread that serves streams.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Status> {
    tokio::task::spawn_blocking(work).await.map_err(|_| Status::internal("the request failed unexpectedly"))
}

fn unexpected() -> Status {
    Status::internal("loading the scene failed unexpectedly; the running scene goes on")
}

async fn replace_scene(daemon: &Arc<Daemon>, source: WireSource) -> Result<Arc<ActiveSession>, Status> {
    let builder = Arc::clone(daemon);
    let prepared = tokio::task::spawn_blocking(move || {
        let (scene, source) = load::from_wire(source, &builder.settings.scene_folders)?;
        prepare((scene, Some(source)), &builder.settings, &builder.numbers, &builder.hub, &mut |_| ())
            .map_err(|error| Status::invalid_argument(error.to_string()))
    })
    .await
    .map_err(|_| unexpected())??;
    if let Some(autosave) = &daemon.autosave {
        autosave.keep(daemon, Slot::Replaced).await;
    }
    let session = daemon.replace(prepared).await.map_err(refused)?;
    if let Some(autosave) = &daemon.autosave {
        // Or the old scene would come back after a crash.
        autosave.keep(daemon, Slot::Newest).await;
    }
    Ok(session)
}

#[tonic::async_trait]
impl Session for SessionService {
    async fn list(&self, _: Request<v1::ListRequest>) -> Result<Response<v1::ListResponse>, Status> {
        let builtin_scenes = palpate_scene::builtin_names().iter().map(|&name| name.to_owned()).collect();
        Ok(Response::new(v1::ListResponse { sessions: vec![self.daemon.session().info()], builtin_scenes }))
    }

    async fn load_scene(
        &self,
        request: Request<v1::LoadSceneRequest>,
    ) -> Result<Response<v1::LoadSceneResponse>, Status> {
        let Some(source) = request.into_inner().source else {
            return Err(Status::invalid_argument("say which scene: `builtin`, `path` or `toml`"));
        };
        if let WireSource::Toml(text) = &source
            && text.len() > convert::MAX_TOML_BYTES
        {
            let bytes = text.len();
            return Err(Status::invalid_argument(format!(
                "toml has {bytes} bytes; at most {}",
                convert::MAX_TOML_BYTES
            )));
        }
        let session = self.load(source).await?;
        let response = v1::LoadSceneResponse { session: Some(session.info()), warnings: session.warnings.clone() };
        Ok(Response::new(response))
    }

    async fn reset(&self, request: Request<v1::ResetRequest>) -> Result<Response<v1::ResetResponse>, Status> {
        say(&self.said.reset, "reset");
        let session = current_session(&self.daemon, &request.into_inner().session_id)?;
        let (_, done) = self.order(&session, Order::Reset).await?;
        Ok(Response::new(v1::ResetResponse { tick: done.tick }))
    }

    async fn detach(&self, request: Request<v1::DetachRequest>) -> Result<Response<v1::DetachResponse>, Status> {
        say(&self.said.detach, "detach");
        let request = request.into_inner();
        let session = current_session(&self.daemon, &request.session_id)?;
        let (tool, device) = detach::driven(&session, &request.tool_name)?;
        device.dismiss(Dismissal::Ordered);
        detach::until_gone(&device).await?;
        Ok(Response::new(v1::DetachResponse { device_name: device.name.clone(), tool_name: tool.to_owned() }))
    }

    async fn pause(&self, request: Request<v1::PauseRequest>) -> Result<Response<v1::PauseResponse>, Status> {
        let pauses = request.get_ref().paused;
        let line = if pauses { &self.said.pause } else { &self.said.go_on };
        say(line, if pauses { "pause" } else { "go on" });
        let request = request.into_inner();
        let session = current_session(&self.daemon, &request.session_id)?;
        let (_, done) = self.order(&session, Order::Pause(request.paused)).await?;
        Ok(Response::new(v1::PauseResponse { paused: done.paused, tick: done.tick }))
    }

    async fn step(&self, request: Request<v1::StepRequest>) -> Result<Response<v1::StepResponse>, Status> {
        say(&self.said.step, "step");
        let request = request.into_inner();
        let session = current_session(&self.daemon, &request.session_id)?;
        let ticks = convert::step_ticks(request.ticks)?;
        let (_, done) = self.order(&session, Order::Step(ticks)).await?;
        Ok(Response::new(v1::StepResponse { tick: done.tick, time_s: done.time_s }))
    }

    async fn snapshot(&self, request: Request<v1::SnapshotRequest>) -> Result<Response<v1::SnapshotResponse>, Status> {
        let session = current_session(&self.daemon, &request.into_inner().session_id)?;
        let (copy, _, room) = self.copy(&session).await?;
        let (tick, model) = (copy.state.mechanical.tick, Arc::clone(&session.model));
        let save = move || {
            let saved = (snapshot::save(&model, &copy.state), snapshot::state_hash(&copy.state));
            drop(copy);
            (saved, room)
        };
        let ((state, state_hash), room) = blocking(save).await?;
        if state.len() > MAX_SNAPSHOT_BYTES {
            let megabytes = state.len() / 1_000_000;
            return Err(Status::resource_exhausted(format!(
                "the snapshot would have {megabytes} MB; too large to send"
            )));
        }
        let mut response = Response::new(v1::SnapshotResponse { tick, state: state.into(), state_hash });
        // A state on its way is one beside the running one, however slowly it is read.
        response.extensions_mut().insert(Kept::new(room));
        Ok(response)
    }

    async fn restore(&self, request: Request<v1::RestoreRequest>) -> Result<Response<v1::RestoreResponse>, Status> {
        say(&self.said.restore, "restore");
        let request = request.into_inner();
        let session = current_session(&self.daemon, &request.session_id)?;
        let (room, model) = (self.daemon.room().await.map_err(refused)?, Arc::clone(&session.model));
        let read = move || {
            let read = snapshot::restore(&model, &request.state);
            read.map(|state| (snapshot::state_hash(&state), state, room))
        };
        let (state_hash, state, _room) =
            blocking(read).await?.map_err(|error| Status::invalid_argument(error.to_string()))?;
        let response = v1::RestoreResponse { tick: state.mechanical.tick, state_hash };
        self.order(&session, Order::Restore(Box::new(state))).await?;
        Ok(Response::new(response))
    }

    async fn inject_forces(
        &self,
        request: Request<v1::InjectForcesRequest>,
    ) -> Result<Response<v1::InjectForcesResponse>, Status> {
        say(&self.said.inject, "inject forces");
        let is_bounded = !caller(&request).roles().has(Role::Operator);
        let request = request.into_inner();
        let session = current_session(&self.daemon, &request.session_id)?;
        let forces = convert::injections(&session, &request.forces, is_bounded)?;
        let (_, done) = self.order(&session, Order::Inject(forces)).await?;
        Ok(Response::new(v1::InjectForcesResponse { first_tick: done.first_tick, pending: done.pending }))
    }

    async fn status(&self, request: Request<v1::StatusRequest>) -> Result<Response<v1::StatusResponse>, Status> {
        let session = current_session(&self.daemon, &request.into_inner().session_id)?;
        let (copy, done, room) = self.copy(&session).await?;
        let daemon = Arc::clone(&self.daemon);
        let tell = move || {
            let status = status::of(&daemon, &session, &copy, &done);
            drop((copy, room));
            status
        };
        Ok(Response::new(blocking(tell).await?))
    }
}
