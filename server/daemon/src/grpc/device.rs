//! `palpate.v1.Device`: an arm takes a tool, sends poses, receives forces. Here it says hello and gets its tool; then
//! [`super::uplink`] is its way up and [`super::downlink`] its way down.
use super::{
    convert,
    downlink::{Attachment, Taken},
};
use crate::{
    doors::refusals::Peer,
    session::{ActiveSession, Daemon, DeviceRecord, Dismissal, ToolSeat},
    sim::tool::ArmLimits,
    who::gate::Expiry,
};
use futures_util::{Stream, stream};
use palpate_physics::contact::Coupling;
use palpate_proto::{
    PROTOCOL_VERSION,
    v1::{self, device_down::Message, device_server::Device},
};
use std::{pin::Pin, sync::Arc, time::Duration};
use tokio::time::timeout;
use tonic::{Request, Response, Status, Streaming};
use tracing::{Instrument as _, Span, field::Empty};

/// How long a device may take to say hello.
const HELLO_WITHIN: Duration = Duration::from_secs(5);

/// The service.
#[derive(Debug, Clone)]
pub struct DeviceService {
    /// Shared by all services.
    pub daemon: Arc<Daemon>,
}

#[tonic::async_trait]
impl Device for DeviceService {
    type AttachStream = Pin<Box<dyn Stream<Item = Result<v1::DeviceDown, Status>> + Send>>;

    async fn attach(&self, request: Request<Streaming<v1::DeviceUp>>) -> Result<Response<Self::AttachStream>, Status> {
        let expiry = request.extensions().get::<Expiry>().cloned();
        let peer = request.extensions().get::<Peer>().map(tracing::field::display);
        // What a tool and a session are called is known with the hello.
        let span = tracing::info_span!("arm", peer, device = Empty, tool = Empty, session = Empty);
        let start = Phase::Hello(Arc::clone(&self.daemon), Box::new(request.into_inner()), expiry, span);
        Ok(Response::new(Box::pin(stream::unfold(start, next))))
    }
}

enum Phase {
    Hello(Arc<Daemon>, Box<Streaming<v1::DeviceUp>>, Option<Expiry>, Span),
    Live(Box<Attachment>),
    Over,
}

async fn next(phase: Phase) -> Option<(Result<v1::DeviceDown, Status>, Phase)> {
    let (result, phase) = match phase {
        Phase::Hello(daemon, messages, expiry, span) => match begin(daemon, *messages, expiry).instrument(span).await {
            Ok((welcome, attachment)) => (Ok(Message::Welcome(welcome)), Phase::Live(Box::new(attachment))),
            Err(status) => (Err(status), Phase::Over),
        },
        Phase::Live(mut attachment) => match attachment.next().await {
            Some(Ok(message)) => (Ok(message), Phase::Live(attachment)),
            Some(Err(status)) => (Err(status), Phase::Over),
            None => return None,
        },
        Phase::Over => return None,
    };
    Some((result.map(|message| v1::DeviceDown { message: Some(message) }), phase))
}

async fn begin(
    daemon: Arc<Daemon>,
    mut messages: Streaming<v1::DeviceUp>,
    expiry: Option<Expiry>,
) -> Result<(v1::DeviceWelcome, Attachment), Status> {
    let stop = daemon.stop.clone();
    let first = tokio::select! {
        () = stop.cancelled() => return Err(Status::unavailable("the daemon is shutting down")),
        first = timeout(HELLO_WITHIN, messages.message()) => first,
    };
    let first = first.map_err(|_| {
        Status::deadline_exceeded(format!(
            "no hello within {} s; the first message must carry it",
            HELLO_WITHIN.as_secs()
        ))
    })??;
    let hello = convert::device_hello(first)?;
    let session = daemon.session();
    let tool = find_tool(&session, &hello.tool_name)?;
    let record = DeviceRecord::new(hello.device_name.clone());
    let seat = &session.tools[tool];
    let end = seat.take(&record).ok_or_else(|| taken(seat))?;
    if let Some(Expiry(expired)) = expiry {
        let device = Arc::clone(&record);
        tokio::spawn(async move {
            tokio::select! {
                () = expired.cancelled() => device.dismiss(Dismissal::Expired),
                () = device.gone() => {}
            }
        });
    }
    let attachment = daemon.numbers.next_attachment();
    let max_force_n = hello.max_force_n.min(daemon.settings.limits.force.max_force_n);
    let max_torque_nm = hello.max_torque_nm.min(daemon.settings.limits.torque.max_torque_nm);
    let tick_period_s = session.model.settings().tick_period_s;
    let patience = Patience::of(&hello, &daemon.settings.limits, tick_period_s);
    end.shared.set_max_torque_nm(max_torque_nm);
    end.shared.set_stale_after_s(patience.stale_after_s);
    end.shared.attach(attachment, max_force_n);
    let welcome = welcome(&daemon, &session, tool, (max_force_n, max_torque_nm), patience);
    let span = Span::current();
    span.record("device", &hello.device_name).record("tool", &seat.name).record("session", &session.id);
    tracing::info!("device attached");
    let lease = Duration::from_secs_f64(patience.lease_s);
    let taken = Taken { session, tool, number: attachment, record, end, lease, span };
    Ok((welcome, Attachment::live(daemon, taken, messages)))
}

/// A device that sends at least so often may be silent for so long before its tool is taken.
const SHORTEST_LEASE_S: f64 = 0.2;
/// A slower one, for so many of its samples, or so many ticks.
const LEASE_PERIODS: f64 = 5.0;
/// How often a device sends that does not say so (Hz).
const USUAL_RATE_HZ: f64 = 1e3;

/// How long a device may be silent.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Patience {
    /// Before its force goes (s).
    stale_after_s: f64,
    /// Before its tool goes (s).
    lease_s: f64,
}

impl Patience {
    /// What it says of itself, beside the daemon's own patience. Where a button has to be held, a device that says nothing any more
    /// may have been let go of: the daemon's own patience holds.
    fn of(hello: &v1::DeviceHello, limits: &ArmLimits, tick_period_s: f64) -> Self {
        let said = |value: f64, usual: f64| if value > 0.0 { value } else { usual };
        let period_s = said(hello.sample_rate_hz, USUAL_RATE_HZ).recip();
        let own = limits.watchdog;
        let stale_after_s = match limits.hold_to_run {
            Some(_) => own.stale_after_s,
            None => said(hello.pose_valid_for_s, own.stale_after_s.max(2.0 * period_s)),
        };
        let lease_s = SHORTEST_LEASE_S.max(LEASE_PERIODS * period_s.max(tick_period_s));
        // The force is gone before the tool is.
        Self { stale_after_s, lease_s: lease_s.max(stale_after_s + own.ramp_to_zero_s) }
    }
}

/// The tool by name, or the first that the scene leaves to a device.
fn find_tool(session: &ActiveSession, name: &str) -> Result<usize, Status> {
    let known = || session.tools.iter().map(|tool| format!("\"{}\"", tool.name)).collect::<Vec<_>>().join(", ");
    if name.is_empty() {
        let first = session.tools.iter().position(|tool| tool.for_devices);
        let text = || format!("scene \"{}\" has no tool for a device (tools: {})", session.scene_name, known());
        return first.ok_or_else(|| Status::failed_precondition(text()));
    }
    let shown: String = name.chars().take(64).flat_map(char::escape_debug).collect();
    let tool = session.tools.iter().position(|tool| tool.name == name);
    let tool =
        tool.ok_or_else(|| Status::not_found(format!("there is no tool \"{shown}\"; there are: {}", known())))?;
    if session.tools[tool].for_devices {
        return Ok(tool);
    }
    Err(Status::failed_precondition(format!("tool \"{shown}\" is moved by the scene, not by a device")))
}

fn taken(seat: &ToolSeat) -> Status {
    let by = seat.device().map_or_else(|| "another device".to_owned(), |device| format!("device \"{}\"", device.name));
    Status::already_exists(format!("tool \"{}\" is driven by {by} already", seat.name))
}

fn welcome(
    daemon: &Daemon,
    session: &ActiveSession,
    tool: usize,
    (max_force_n, max_torque_nm): (f64, f64),
    patience: Patience,
) -> v1::DeviceWelcome {
    let spec = &session.model.tools()[tool];
    let (stiffness, damping) = match spec.coupling {
        Coupling::Rigid => (0.0, 0.0),
        Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, .. } => (stiffness_n_per_m, damping_n_s_per_m),
    };
    let limits = &daemon.settings.limits;
    v1::DeviceWelcome {
        session_id: session.id.clone(),
        tool_name: spec.name.clone(),
        tick_period_s: session.model.settings().tick_period_s,
        limits: Some(v1::DeviceLimits {
            max_force_n,
            max_force_rate_n_per_s: limits.force.max_force_rate_n_per_s,
            coupling_stiffness_n_per_m: stiffness,
            coupling_damping_n_s_per_m: damping,
            stale_after_s: patience.stale_after_s,
            ramp_to_zero_s: limits.watchdog.ramp_to_zero_s,
            max_torque_nm,
            max_torque_rate_nm_per_s: limits.torque.max_torque_rate_nm_per_s,
            lease_s: patience.lease_s,
        }),
        tool_radius_m: spec.radius_m,
        tool_half_length_m: spec.shape.half_length_m(),
        protocol_version: PROTOCOL_VERSION,
    }
}
