//! A device's way down. It is pulled: whenever the transport takes a message, the newest command is made into one, and after it
//! what the device has to be told beside it. Nothing queues but a few faults of the way up.
use super::{
    convert,
    news::{News, fault},
    uplink::{Ended, FAULTS_WAITING, Lent, Uplink},
};
use crate::{
    session::{ActiveSession, Daemon, DeviceRecord, Dismissal},
    sim::exchange::{DeviceInput, ToolEnd, ToolOutput},
    sparing::Sparing,
};
use glam::DVec3;
use palpate_control::ForceLimits;
use palpate_proto::v1::{self, DeviceFaultCode, device_down::Message};
use std::{sync::Arc, time::Duration};
use tokio::{
    sync::{mpsc, oneshot},
    task::JoinHandle,
    time::{Instant, sleep, timeout_at},
};
use tokio_util::sync::CancellationToken;
use tonic::{Status, Streaming};
use tracing::{Instrument as _, Span};
use triple_buffer::Input;

/// How long a stream waits for the loop to bring the force to zero before it does so itself.
const RELEASE_WITHIN: Duration = Duration::from_millis(500);
/// Between two commands of a stream that brings the force to zero itself.
const FADE_STEP: Duration = Duration::from_millis(1);

/// A tool that was taken, and by whom.
#[derive(Debug)]
pub struct Taken {
    /// Session of the tool.
    pub session: Arc<ActiveSession>,
    /// Which tool.
    pub tool: usize,
    /// Number of the attachment.
    pub number: u64,
    /// Who took it.
    pub record: Arc<DeviceRecord>,
    /// Its end.
    pub end: ToolEnd,
    /// Time without a sample after which it is taken from the device.
    pub lease: Duration,
    /// Of what is logged of the device.
    pub span: Span,
}

/// What a device is told when the daemon ends its attachment.
#[derive(Debug, Clone, Copy)]
struct Goodbye {
    code: DeviceFaultCode,
    why: &'static str,
}

impl Goodbye {
    const fn detached(why: &'static str) -> Self {
        Self { code: DeviceFaultCode::Detached, why }
    }

    const fn to(dismissed: Dismissal) -> Self {
        match dismissed {
            Dismissal::Silent => Self::detached(
                "no sample has come for the time of the lease, and others may take the tool: attach again",
            ),
            Dismissal::Expired => Self {
                code: DeviceFaultCode::Dismissed,
                why: "what this device was issued has ended or was revoked: it needs another certificate or token",
            },
            Dismissal::Ordered => Self {
                code: DeviceFaultCode::Dismissed,
                why: "the tool was taken from this device by an order (`palpate-view detach`)",
            },
        }
    }
}

/// A device on its tool.
pub struct Attachment {
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
    span: Span,
    over: CancellationToken,
    faults: mpsc::Receiver<v1::DeviceFault>,
    news: News,
    /// The output of the last command, as long as it has news.
    untold: Option<ToolOutput>,
    /// What the last command was made of.
    sent: ToolOutput,
    stage: Stage,
}

/// How far an attachment is.
#[derive(Debug, Clone, Copy)]
enum Stage {
    Live,
    /// The daemon ends it: the loop's commands go on until one carries zero force.
    Releasing {
        why: Goodbye,
        until: Instant,
    },
    /// The loop does not bring the force (N) to zero: the stream does, since then.
    Fading {
        why: Goodbye,
        from_n: DVec3,
        from_nm: DVec3,
        since: Instant,
    },
    Ended,
}

/// Who ends a live attachment.
enum End {
    /// The device.
    WayUp,
    /// The daemon, and why.
    Daemon(Goodbye),
}

impl Attachment {
    /// Begins both ways.
    pub fn live(daemon: Arc<Daemon>, taken: Taken, messages: Streaming<v1::DeviceUp>) -> Self {
        let Taken { session, tool, number, record, end, lease, span } = taken;
        let over = CancellationToken::new();
        let (fault_in, faults) = mpsc::channel(FAULTS_WAITING);
        // The way up has the real slot; what stands in its place is never read.
        let ToolEnd { samples, outputs, ear, shared } = end;
        let limits = ForceLimits { max_force_n: shared.max_force_n(), ..daemon.settings.limits.force };
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
            lease,
            of_latches: Sparing::default(),
        };
        let uplink = tokio::spawn(uplink.run(over.clone().drop_guard()).instrument(span.clone()));
        Self {
            daemon,
            session,
            tool,
            number,
            record,
            end: Some(ToolEnd { samples: placeholder, outputs, ear, shared }),
            uplink,
            samples: Some(samples),
            span,
            over,
            faults,
            news: News::new(limits),
            untold: None,
            sent: ToolOutput::default(),
            stage: Stage::Live,
        }
    }

    /// The next message, `None` when the device has gone.
    pub async fn next(&mut self) -> Option<Result<Message, Status>> {
        let span = self.span.clone();
        self.next_of_all().instrument(span).await
    }

    async fn next_of_all(&mut self) -> Option<Result<Message, Status>> {
        if let Stage::Live = self.stage {
            let why = match self.next_of_live().await {
                Ok(message) => return Some(Ok(message)),
                Err(End::WayUp) => return self.how_the_way_up_ended().await,
                Err(End::Daemon(why)) => why,
            };
            if let Some(end) = &self.end {
                end.shared.release();
            }
            self.stage = Stage::Releasing { why, until: Instant::now() + RELEASE_WITHIN };
        }
        if let Stage::Releasing { why, until } = self.stage {
            if let Some(output) = self.released(until).await {
                return Some(Ok(self.command(&output)));
            }
            self.stage =
                Stage::Fading { why, from_n: self.sent.force_n, from_nm: self.sent.torque_nm, since: Instant::now() };
        }
        match self.stage {
            Stage::Fading { why, from_n, from_nm, since } => Some(Ok(self.fade(why, (from_n, from_nm), since).await)),
            _ => None,
        }
    }

    async fn next_of_live(&mut self) -> Result<Message, End> {
        let (stop, replaced) = (self.daemon.stop.clone(), self.session.ended.clone());
        let (over, loop_gone) = (self.over.clone(), self.daemon.sign.gone());
        let record = Arc::clone(&self.record);
        let ends = |why| Err(End::Daemon(Goodbye::detached(why)));
        loop {
            if let Some(fault) = self.untold.and_then(|output| self.news.of(&output, Instant::now().into_std())) {
                return Ok(Message::Fault(fault));
            }
            self.untold = None;
            let Some(end) = self.end.as_mut() else { return Err(End::WayUp) };
            tokio::select! {
                biased;
                () = loop_gone.cancelled() => return ends(self.why_the_loop_is_gone()),
                () = stop.cancelled() => return ends("the daemon is shutting down"),
                () = replaced.cancelled() => return ends("another scene was loaded: attach again"),
                dismissed = record.dismissed() => return Err(End::Daemon(Goodbye::to(dismissed))),
                () = over.cancelled() => return Err(End::WayUp),
                // Before faults: a device whose samples are refused faster than it reads would hear of nothing else.
                rung = end.ear.rung() => if rung.is_err() { return ends("the simulation loop cannot be heard") },
                fault = self.faults.recv() => if let Some(fault) = fault { return Ok(Message::Fault(fault)) },
            }
            if let Some(output) = self.newest() {
                self.untold = Some(output);
                return Ok(self.command(&output));
            }
        }
    }

    fn why_the_loop_is_gone(&self) -> &'static str {
        // A loop that ends as it should says first that it has released all arms.
        if self.daemon.sign.is_released() {
            return "the daemon is shutting down";
        }
        "the simulation loop failed and the daemon is shutting down"
    }

    fn newest(&mut self) -> Option<ToolOutput> {
        let end = self.end.as_mut()?;
        end.outputs.update();
        // Before the first tick of this attachment the slot may hold another's.
        Some(*end.outputs.output_buffer()).filter(|output| output.attachment == self.number)
    }

    fn command(&mut self, output: &ToolOutput) -> Message {
        self.sent = *output;
        self.record.sent_force_n(output.force_n.length());
        Message::Command(convert::device_command(output))
    }

    /// The loop's next output on the way to zero force; `None` once zero was sent, or when it does not come.
    async fn released(&mut self, until: Instant) -> Option<ToolOutput> {
        loop {
            if let Some(output) = self.unsent() {
                return Some(output);
            }
            if self.sent.force_n == DVec3::ZERO {
                return None;
            }
            let loop_gone = self.daemon.sign.gone();
            let end = self.end.as_mut()?;
            let rung = async {
                tokio::select! {
                    rung = end.ear.rung() => rung.is_ok(),
                    () = loop_gone.cancelled() => false,
                }
            };
            if !matches!(timeout_at(until, rung).await, Ok(true)) {
                // The last output may have come without a ring that was heard.
                return self.unsent();
            }
        }
    }

    /// An output that was not sent yet.
    fn unsent(&mut self) -> Option<ToolOutput> {
        let fresh = self.end.as_mut()?.outputs.update();
        let sent = (self.sent.force_n, self.sent.torque_nm);
        self.newest().filter(|output| fresh || (output.force_n, output.torque_nm) != sent)
    }

    /// The last force, ramped to zero over the time the loop takes for it; then the goodbye.
    async fn fade(&mut self, goodbye: Goodbye, (from_n, from_nm): (DVec3, DVec3), since: Instant) -> Message {
        if (self.sent.force_n, self.sent.torque_nm) == (DVec3::ZERO, DVec3::ZERO) {
            self.stage = Stage::Ended;
            let text = format!("{}; the force has been ramped to zero", goodbye.why);
            return Message::Fault(fault(goodbye.code, text, 1));
        }
        sleep(FADE_STEP).await;
        let ramp_s = self.daemon.settings.limits.watchdog.ramp_to_zero_s;
        let left = (1.0 - since.elapsed().as_secs_f64() / ramp_s).max(0.0);
        self.command(&ToolOutput { force_n: from_n * left, torque_nm: from_nm * left, local_model: None, ..self.sent })
    }

    async fn how_the_way_up_ended(&mut self) -> Option<Result<Message, Status>> {
        self.stage = Stage::Ended;
        // By reference: a stream that is dropped here still gives its tool back.
        let ended = (&mut self.uplink).await.unwrap_or_else(|_| Err(Status::internal("reading samples failed")));
        ended.err().map(Err)
    }
}

impl Drop for Attachment {
    fn drop(&mut self) {
        self.over.cancel();
        self.span.in_scope(|| tracing::info!("device detached"));
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
