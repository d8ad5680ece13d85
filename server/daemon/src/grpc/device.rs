//! `palpate.v1.Device`: an arm takes a tool, sends poses, receives forces.
//!
//! The way down is pulled: whenever the transport takes a message, the newest command is made into one. Nothing queues but a
//! few faults.
use super::{
    convert,
    uplink::{Ended, FAULTS_WAITING, Lent, Uplink},
};
use crate::{
    session::{ActiveSession, Daemon, DeviceRecord, ToolSeat},
    sim::exchange::{DeviceInput, ToolEnd, ToolOutput},
};
use futures_util::{Stream, stream};
use glam::DVec3;
use palpate_physics::contact::Coupling;
use palpate_proto::v1::{self, DeviceFaultCode, device_down::Message, device_server::Device};
use std::{pin::Pin, sync::Arc, time::Duration};
use tokio::{
    sync::{mpsc, oneshot},
    task::JoinHandle,
    time::{Instant, timeout, timeout_at},
};
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status, Streaming};
use triple_buffer::Input;

/// How long a device may take to say hello.
const HELLO_WITHIN: Duration = Duration::from_secs(5);
/// Between two reports that the force is being limited.
const LIMITED_EVERY: Duration = Duration::from_secs(1);
/// How long a stream waits for forces to reach zero before it ends.
const RELEASE_WITHIN: Duration = Duration::from_millis(500);

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
        let start = Phase::Hello(Arc::clone(&self.daemon), Box::new(request.into_inner()));
        Ok(Response::new(Box::pin(stream::unfold(start, next))))
    }
}

enum Phase {
    Hello(Arc<Daemon>, Box<Streaming<v1::DeviceUp>>),
    Live(Box<Attachment>),
    Over,
}

async fn next(phase: Phase) -> Option<(Result<v1::DeviceDown, Status>, Phase)> {
    let (result, phase) = match phase {
        Phase::Hello(daemon, messages) => match Attachment::begin(daemon, *messages).await {
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

/// A device on its tool.
struct Attachment {
    daemon: Arc<Daemon>,
    session: Arc<ActiveSession>,
    tool: usize,
    number: u64,
    record: Arc<DeviceRecord>,
    /// Everything of the tool but the sample slot, which the way up has.
    end: Option<ToolEnd>,
    uplink: JoinHandle<Ended>,
    /// Comes when the way up has ended.
    samples: Option<oneshot::Receiver<Input<Option<DeviceInput>>>>,
    over: CancellationToken,
    faults: mpsc::Receiver<v1::DeviceFault>,
    told: Told,
    /// Force of the last command (N).
    sent_n: DVec3,
    stage: Stage,
}

/// How far an attachment is.
#[derive(Debug, Clone, Copy)]
enum Stage {
    Live,
    /// The daemon ends it: commands go on until one carries zero force.
    Releasing {
        why: &'static str,
        until: Instant,
    },
    Ended,
}

/// What the device was told already.
#[derive(Debug, Default)]
struct Told {
    stale: bool,
    quarantined: Option<u64>,
    limited: Option<Instant>,
    counts: [u64; 3],
}

impl Attachment {
    async fn begin(
        daemon: Arc<Daemon>,
        mut messages: Streaming<v1::DeviceUp>,
    ) -> Result<(v1::DeviceWelcome, Self), Status> {
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
        let attachment = daemon.numbers.next_attachment();
        let max_force_n = hello.max_force_n.min(daemon.settings.limits.force.max_force_n);
        end.shared.attach(attachment, max_force_n);
        let welcome = welcome(&daemon, &session, tool, max_force_n);
        tracing::info!(device = hello.device_name, tool = seat.name, "device attached");
        Ok((welcome, Self::live(daemon, session, (tool, attachment), record, end, messages)))
    }

    fn live(
        daemon: Arc<Daemon>,
        session: Arc<ActiveSession>,
        (tool, number): (usize, u64),
        record: Arc<DeviceRecord>,
        end: ToolEnd,
        messages: Streaming<v1::DeviceUp>,
    ) -> Self {
        let over = CancellationToken::new();
        let (fault_in, faults) = mpsc::channel(FAULTS_WAITING);
        // The way up has the real slot; what stands in its place is never read.
        let ToolEnd { samples, outputs, ear, shared } = end;
        let (placeholder, _) = triple_buffer::triple_buffer(&None);
        let (lent, samples) = Lent::new(samples);
        let uplink = Uplink {
            messages,
            samples: lent,
            attachment: number,
            record: Arc::clone(&record),
            daemon: Arc::clone(&daemon),
            faults: fault_in,
            over: over.clone(),
        };
        let uplink = tokio::spawn(uplink.run(over.clone().drop_guard()));
        let end = Some(ToolEnd { samples: placeholder, outputs, ear, shared });
        Self {
            daemon,
            session,
            tool,
            number,
            record,
            end,
            uplink,
            samples: Some(samples),
            over,
            faults,
            told: Told::default(),
            sent_n: DVec3::ZERO,
            stage: Stage::Live,
        }
    }

    /// The next message, `None` when the device has gone.
    async fn next(&mut self) -> Option<Result<Message, Status>> {
        if let Stage::Live = self.stage {
            let why = match self.next_of_live().await {
                Ok(message) => return Some(Ok(message)),
                Err(End::WayUp) => return self.how_the_way_up_ended().await,
                Err(End::Daemon(why)) => why,
            };
            self.stage = Stage::Releasing { why, until: Instant::now() + RELEASE_WITHIN };
        }
        match self.stage {
            Stage::Releasing { why, until } => Some(Ok(self.release(why, until).await)),
            Stage::Live | Stage::Ended => None,
        }
    }

    async fn next_of_live(&mut self) -> Result<Message, End> {
        let (stop, replaced) = (self.daemon.stop.clone(), self.session.ended.clone());
        let over = self.over.clone();
        loop {
            let Some(end) = self.end.as_mut() else { return Err(End::WayUp) };
            tokio::select! {
                biased;
                () = stop.cancelled() => return Err(End::Daemon("the daemon is shutting down")),
                () = replaced.cancelled() => return Err(End::Daemon("another scene was loaded: attach again")),
                () = over.cancelled() => return Err(End::WayUp),
                fault = self.faults.recv() => if let Some(fault) = fault { return Ok(Message::Fault(fault)) },
                rung = end.ear.rung() => if rung.is_err() { return Err(End::Daemon("the simulation loop cannot be heard")) },
            }
            if let Some(message) = self.newest() {
                return Ok(message);
            }
        }
    }

    /// The newest command, or what has to be told before it.
    fn newest(&mut self) -> Option<Message> {
        let end = self.end.as_mut()?;
        end.outputs.update();
        let output = *end.outputs.output_buffer();
        if output.attachment != self.number {
            return None;
        }
        if let Some(fault) = self.told.news(&output) {
            return Some(Message::Fault(fault));
        }
        Some(self.command(&output))
    }

    fn command(&mut self, output: &ToolOutput) -> Message {
        self.sent_n = output.force_n;
        self.record.sent_force_n(output.force_n.length());
        Message::Command(convert::device_command(output))
    }

    /// The next command on the way to zero force; once zero was sent, or time is up, the goodbye.
    async fn release(&mut self, why: &str, until: Instant) -> Message {
        loop {
            if let Some(output) = self.unsent() {
                return self.command(&output);
            }
            if self.sent_n == DVec3::ZERO {
                break;
            }
            let rung = async {
                match self.end.as_mut() {
                    Some(end) => end.ear.rung().await.is_ok(),
                    None => false,
                }
            };
            if !matches!(timeout_at(until, rung).await, Ok(true)) {
                // The last output may have come without a ring that was heard.
                if let Some(output) = self.unsent() {
                    return self.command(&output);
                }
                break;
            }
        }
        self.stage = Stage::Ended;
        Message::Fault(fault(DeviceFaultCode::Detached, farewell(why, self.sent_n), 1))
    }

    /// An output that was not sent yet.
    fn unsent(&mut self) -> Option<ToolOutput> {
        let (number, sent_n) = (self.number, self.sent_n);
        let end = self.end.as_mut()?;
        let fresh = end.outputs.update();
        let output = *end.outputs.output_buffer();
        // Before the first sample of this attachment the slot may hold another's.
        (output.attachment == number && (fresh || output.force_n != sent_n)).then_some(output)
    }

    async fn how_the_way_up_ended(&mut self) -> Option<Result<Message, Status>> {
        self.stage = Stage::Ended;
        // By reference: a stream that is dropped here still gives its tool back.
        let ended = (&mut self.uplink).await.unwrap_or_else(|_| Err(Status::internal("reading samples failed")));
        ended.err().map(Err)
    }
}

/// Who ends a live attachment.
enum End {
    /// The device.
    WayUp,
    /// The daemon, and why.
    Daemon(&'static str),
}

impl Drop for Attachment {
    fn drop(&mut self) {
        self.over.cancel();
        tracing::info!(device = self.record.name, tool = self.session.tools[self.tool].name, "device detached");
        let (Some(end), Some(samples)) = (self.end.take(), self.samples.take()) else { return };
        end.shared.detach();
        let (session, tool) = (Arc::clone(&self.session), self.tool);
        // The slot is with the way up, which ends now.
        tokio::spawn(async move {
            if let Ok(samples) = samples.await {
                session.tools[tool].give_back(ToolEnd { samples, ..end });
            }
        });
    }
}

impl Told {
    fn news(&mut self, output: &ToolOutput) -> Option<v1::DeviceFault> {
        if output.quarantined != self.quarantined {
            self.quarantined = output.quarantined;
            if let Some(tick) = output.quarantined {
                let text = format!(
                    "the body's state became non-finite in tick {tick}; the force is zero until Reset or Restore"
                );
                return Some(self.count(0, DeviceFaultCode::Quarantined, text));
            }
        }
        if output.stale != self.stale {
            self.stale = output.stale;
            if output.stale {
                let text = "no fresh sample: the force ramps to zero until samples come again".to_owned();
                return Some(self.count(1, DeviceFaultCode::Stale, text));
            }
        }
        if output.limited && self.limited.is_none_or(|told| told.elapsed() > LIMITED_EVERY) {
            self.limited = Some(Instant::now());
            return Some(self.count(
                2,
                DeviceFaultCode::Limited,
                "the force is being limited (see the welcome)".to_owned(),
            ));
        }
        None
    }

    fn count(&mut self, which: usize, code: DeviceFaultCode, message: String) -> v1::DeviceFault {
        self.counts[which] += 1;
        fault(code, message, self.counts[which])
    }
}

fn farewell(why: &str, sent_n: DVec3) -> String {
    if sent_n == DVec3::ZERO {
        return format!("{why}; the force has been ramped to zero");
    }
    let (force_n, within_s) = (sent_n.length(), RELEASE_WITHIN.as_secs_f64());
    format!(
        "{why}; the force did not reach zero within {within_s} s (last sent: {force_n:.3} N): ramp it down yourself"
    )
}

fn fault(code: DeviceFaultCode, message: String, count: u64) -> v1::DeviceFault {
    v1::DeviceFault { code: code.into(), message, sample_sequence: 0, count }
}

/// The tool by name, or the first that the scene leaves to a device.
fn find_tool(session: &ActiveSession, name: &str) -> Result<usize, Status> {
    let known = || session.tools.iter().map(|tool| format!("\"{}\"", tool.name)).collect::<Vec<_>>().join(", ");
    if name.is_empty() {
        let first = session.tools.iter().position(|tool| tool.for_devices);
        let text = || format!("scene \"{}\" has no tool for a device (tools: {})", session.scene_name, known());
        return first.ok_or_else(|| Status::failed_precondition(text()));
    }
    let shown: String = name.chars().take(64).collect();
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

fn welcome(daemon: &Daemon, session: &ActiveSession, tool: usize, max_force_n: f64) -> v1::DeviceWelcome {
    let spec = &session.model.spec().tools[tool];
    let (stiffness, damping) = match spec.coupling {
        Coupling::Rigid => (0.0, 0.0),
        Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, .. } => (stiffness_n_per_m, damping_n_s_per_m),
    };
    let limits = &daemon.settings.limits;
    v1::DeviceWelcome {
        session_id: session.id.clone(),
        tool_name: spec.name.clone(),
        tick_period_s: session.model.spec().settings.tick_period_s,
        limits: Some(v1::DeviceLimits {
            max_force_n,
            max_force_rate_n_per_s: limits.force.max_force_rate_n_per_s,
            coupling_stiffness_n_per_m: stiffness,
            coupling_damping_n_s_per_m: damping,
            stale_after_s: limits.watchdog.stale_after_s,
            ramp_to_zero_s: limits.watchdog.ramp_to_zero_s,
        }),
        tool_radius_m: spec.radius_m,
    }
}
