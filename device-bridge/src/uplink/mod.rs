//! The stream to the daemon: newest samples up, newest commands down, and back again when it breaks.
mod source;
pub use source::SampleSource;

use crate::{
    BridgeError,
    backoff::Backoff,
    convert::{self, Command, Welcome},
    run::Shared,
    settings::UplinkSettings,
};
use palpate_control::Wait;
use palpate_proto::{
    connect::{connect_arm, is_nobody_there, is_transport, why_no_answer, why_unreachable, words_of},
    v1::{self, device_client::DeviceClient, device_down::Message},
};
use palpate_realtime::{Clock, Histogram, SlotWriter};
use source::UpStream;
use std::{
    sync::{Arc, Mutex, atomic::Ordering},
    time::{Duration, Instant},
};
use tokio_util::sync::CancellationToken;
use tonic::{Code, Status, Streaming, transport::Channel};

/// Longest wait for the daemon's welcome, and for its end of a stream that we ended.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// Why a connection ended.
enum Ended {
    /// The daemon cannot be reached.
    Unreachable(String),
    /// Something is there, and does not speak as a daemon does.
    Misunderstood(String),
    /// It answered, and refused.
    Refused(Status),
    /// It was attached, and is no longer.
    Lost(String),
    /// It was attached, and is not to come back by itself.
    Dismissed(String),
    /// We ended it.
    ByUs,
}

/// The uplink task.
pub struct Uplink {
    settings: UplinkSettings,
    source: Arc<Mutex<SampleSource>>,
    commands: SlotWriter<Option<Command>>,
    shared: Arc<Shared>,
    end: CancellationToken,
    last_said: String,
}

impl Uplink {
    /// Ends its stream when `end` is cancelled.
    pub fn new(
        settings: UplinkSettings,
        source: SampleSource,
        commands: SlotWriter<Option<Command>>,
        shared: Arc<Shared>,
        end: CancellationToken,
    ) -> Self {
        let source = Arc::new(Mutex::new(source));
        Self { settings, source, commands, shared, end, last_said: String::new() }
    }

    /// Connects, and connects again, until ended.
    ///
    /// # Errors
    /// [`BridgeError::Unreachable`] and [`BridgeError::Refused`], before the arm was ever attached.
    pub async fn run(mut self) -> Result<(), BridgeError> {
        let (first, longest) = self.settings.pauses;
        let mut backoff = Backoff::new(first, longest, self.settings.seed);
        let began = Instant::now();
        loop {
            let attached_before = self.shared.stats.attached.get();
            let ended = self.connection().await;
            self.shared.attached.store(false, Ordering::Relaxed);
            if self.shared.stats.attached.get() > attached_before {
                // Nothing more will be answered: no need to wait until the last answer is old.
                self.shared.lost.store(true, Ordering::Relaxed);
                backoff.reset();
            }
            if self.end.is_cancelled() || matches!(ended, Ended::ByUs) {
                return Ok(());
            }
            self.shared.stats.failures.increment();
            self.say_or_stop(&ended, began.elapsed())?;
            tokio::select! {
                () = self.end.cancelled() => return Ok(()),
                () = tokio::time::sleep(backoff.pause()) => {}
            }
        }
    }

    /// Logs each reason once, however often it repeats.
    fn say_or_stop(&mut self, ended: &Ended, since_start: Duration) -> Result<(), BridgeError> {
        let address = &self.settings.address;
        let never_attached = self.shared.stats.attached.get() == 0;
        let text = match ended {
            Ended::ByUs => return Ok(()),
            Ended::Dismissed(message) => {
                let (address, message) = (address.clone(), message.clone());
                return Err(BridgeError::Dismissed { address, message });
            }
            Ended::Refused(status) => {
                if let (true, Some(help)) = (never_attached, final_refusal(status.code())) {
                    return Err(refused(address, status, help));
                }
                format!("the daemon at {address} refused the arm: {}", status.message())
            }
            Ended::Unreachable(reason) | Ended::Misunderstood(reason) | Ended::Lost(reason) => {
                if let Some(limit) = self.settings.give_up_after.filter(|limit| never_attached && since_start > *limit)
                {
                    let (address, reason) = (address.clone(), reason.clone());
                    return Err(BridgeError::Unreachable { address, seconds: limit.as_secs_f64(), reason });
                }
                match ended {
                    Ended::Lost(_) => format!("lost the daemon at {address} ({reason}); the force is ramped to zero"),
                    _ => format!("no daemon answers at {address}: {reason}"),
                }
            }
        };
        if text != self.last_said {
            tracing::warn!("{text}; trying again, at least every {:?}", self.settings.pauses.1);
            self.last_said = text;
        }
        Ok(())
    }

    /// One connection, with an arm's sign first. What stands between, and daemons of before, may know nothing of it: then without.
    async fn connection(&mut self) -> Ended {
        match self.connection_signed(true).await {
            Ended::Misunderstood(reason) if !self.end.is_cancelled() => {
                tracing::debug!("an arm's sign was not understood ({reason}): trying without");
                self.connection_signed(false).await
            }
            ended => ended,
        }
    }

    async fn connection_signed(&mut self, is_signed: bool) -> Ended {
        // Ends the outbound half whichever way this function returns, so that two streams never share the source.
        let stream_end = self.end.child_token();
        let _ended_on_return = stream_end.clone().drop_guard();
        let connected = tokio::select! {
            () = self.end.cancelled() => return Ended::ByUs,
            connected = self.connect(is_signed) => connected,
        };
        let channel = match connected {
            Ok(channel) => channel,
            Err(error) if is_nobody_there(&error) => return Ended::Unreachable(why_unreachable(&error)),
            Err(error) => return Ended::Misunderstood(why_unreachable(&error)),
        };
        let up = UpStream {
            hello: Some(convert::hello(&self.settings)),
            source: Arc::clone(&self.source),
            end: Box::pin(stream_end.cancelled_owned()),
            shared: Arc::clone(&self.shared),
        };
        let mut client = DeviceClient::with_interceptor(channel, self.settings.bearer.clone());
        let attach = async {
            let mut down = client.attach(up).await?.into_inner();
            let first = down.message().await?;
            Ok::<_, Status>((down, first))
        };
        let attached = tokio::select! {
            () = self.end.cancelled() => return Ended::ByUs,
            attached = tokio::time::timeout(ANSWER_TIMEOUT, attach) => attached,
        };
        match attached {
            Err(_) => Ended::Unreachable(format!("it sent no welcome within {ANSWER_TIMEOUT:?}")),
            Ok(Err(status)) if is_transport(&status) => Ended::Misunderstood(why_no_answer(&status)),
            // What stands before a daemon that is down says so in these.
            Ok(Err(status)) if matches!(status.code(), Code::Unavailable | Code::Unknown) => {
                Ended::Unreachable(status.message().to_owned())
            }
            Ok(Err(status)) => Ended::Refused(status),
            Ok(Ok((down, first))) => match welcome_of(first) {
                Ok(welcome) => {
                    if !is_signed {
                        tracing::warn!(
                            "what answers at {} does not know an arm's sign: its viewers may delay the force",
                            self.settings.address
                        );
                    }
                    self.attached(down, &welcome).await
                }
                Err(reason) => Ended::Refused(Status::failed_precondition(reason)),
            },
        }
    }

    async fn connect(&self, is_signed: bool) -> Result<Channel, tonic::transport::Error> {
        if is_signed {
            return connect_arm(&self.settings.endpoint, &self.settings.address).await;
        }
        self.settings.endpoint.connect().await
    }

    async fn attached(&mut self, mut down: Streaming<v1::DeviceDown>, welcome: &Welcome) -> Ended {
        tracing::info!(
            "attached to tool \"{}\" of session {} at {}: tick {} ms, force at most {} N, changing by at most {} N/s",
            welcome.tool_name,
            welcome.session_id,
            self.settings.address,
            welcome.tick_period_s * 1e3,
            welcome.limits.max_force_n,
            welcome.limits.max_force_rate_n_per_s
        );
        self.last_said.clear();
        self.shared.stats.attached.increment();
        // Another connection, another tool: nothing is known of them.
        self.shared.unmeasured.store(self.settings.across_network.is_some(), Ordering::Relaxed);
        self.shared.attached.store(true, Ordering::Relaxed);
        let mut told = Told::default();
        loop {
            let message = tokio::select! {
                biased;
                message = down.message() => message,
                () = self.end.cancelled() => return self.ended_by_us(down).await,
            };
            match message {
                Ok(Some(message)) => self.take(message, welcome, &mut told),
                Ok(None) | Err(_) if told.dismissed.is_some() => {
                    return Ended::Dismissed(told.dismissed.unwrap_or_default());
                }
                Ok(None) => return Ended::Lost("it ended the stream".to_owned()),
                Err(status) => return Ended::Lost(words_of(&status)),
            }
        }
    }

    /// Our half is ended already; waits for the daemon to end its own.
    async fn ended_by_us(&self, mut down: Streaming<v1::DeviceDown>) -> Ended {
        self.shared.attached.store(false, Ordering::Relaxed);
        let drain = async { while let Ok(Some(_)) = down.message().await {} };
        if tokio::time::timeout(ANSWER_TIMEOUT, drain).await.is_err() {
            tracing::warn!("the daemon did not end the stream within {ANSWER_TIMEOUT:?}");
        }
        Ended::ByUs
    }

    fn take(&mut self, message: v1::DeviceDown, welcome: &Welcome, told: &mut Told) {
        let now_ns = Clock::Monotonic.now_ns();
        match message.message {
            Some(Message::Command(wire)) => match convert::command(&wire, welcome, now_ns) {
                // Nothing was answered: no force comes of it, and no time.
                Ok(None) => {}
                Ok(Some(command)) => {
                    self.shared.stats.received.increment();
                    if wire.sample_sequence > told.newest_sequence {
                        told.newest_sequence = wire.sample_sequence;
                        let trip_ns = now_ns.saturating_sub(wire.echo_device_time_ns);
                        self.shared.stats.round_trip.record(trip_ns);
                        self.hear_of_phase(&wire, trip_ns, welcome);
                        told.trips.record(trip_ns);
                        self.judge_stiffness(welcome, told);
                    }
                    self.commands.publish(Some(command));
                }
                Err(rejection) => {
                    self.shared.stats.rejected.increment();
                    let text = format!("a command of the daemon was refused: {rejection}");
                    told.once(&text, &text);
                }
            },
            Some(Message::Fault(fault)) => self.take_fault(&fault, told),
            Some(Message::Welcome(_)) | None => {
                self.shared.stats.rejected.increment();
                let text = "the daemon sent a message that has no place here";
                told.once(text, text);
            }
        }
    }

    /// For how long a pose had waited for its tick.
    fn hear_of_phase(&self, wire: &v1::DeviceCommand, answered_after_ns: u64, welcome: &Welcome) {
        let Some(waited_ns) = wire.sample_waited_ns else { return };
        self.shared.stats.waited.record(waited_ns);
        let tick_period_ns = (welcome.tick_period_s * 1e9).round() as u64;
        self.shared.waits.tell(&Wait { waited_ns, answered_after_ns, tick_period_ns });
    }

    /// Without a local model the stiff loop crosses the network: no force before it is known to be stable there.
    fn judge_stiffness(&self, welcome: &Welcome, told: &mut Told) {
        let Some(bound) = self.settings.across_network else { return };
        let trips = &told.trips;
        if !self.shared.unmeasured.load(Ordering::Relaxed) || trips.count() < TRIPS_MEASURED || told.is_judged {
            return;
        }
        told.is_judged = true;
        let trip_s = trips.value_at(0.99) as f64 * 1e-9;
        let (is_n_per_m, may_be_n_per_m) = (welcome.coupling_n_per_m, bound.at_delay(trip_s).largest_n_per_m());
        if is_n_per_m <= may_be_n_per_m {
            self.shared.unmeasured.store(false, Ordering::Relaxed);
        } else {
            tracing::error!(
                "no force: the tool's coupling has {is_n_per_m:.0} N/m, and across this network, {:.1} ms to and fro, {may_be_n_per_m:.0} N/m \
                 are stable on this arm. Set render.local_model = true, or give the tool of the scene a softer coupling",
                1e3 * trip_s
            );
        }
    }

    fn take_fault(&self, fault: &v1::DeviceFault, told: &mut Told) {
        use v1::DeviceFaultCode::{Detached, Dismissed, Quarantined};
        self.shared.stats.peer_faults.increment();
        let text = format!("the daemon reports: {}", fault.message);
        if fault.code() == Dismissed {
            // It is what the bridge ends with, and says then; the force is gone already.
            told.dismissed = Some(fault.message.clone());
            return;
        }
        let stops = matches!(fault.code(), Detached | Quarantined);
        if stops {
            // It tells each of these once itself.
            tracing::warn!("{text}");
        } else {
            // A count or a time in it makes no other message of it.
            told.once(&text.replace(|c: char| c.is_ascii_digit(), ""), &text);
        }
        if stops {
            self.shared.peer_fault.store(true, Ordering::Relaxed);
        }
    }
}

/// Round trips that are looked at before a force crosses the network.
const TRIPS_MEASURED: u64 = 200;

/// What was said already on this connection, and the newest sample answered.
#[derive(Debug, Default)]
struct Told {
    /// Its round trips (ns).
    trips: Histogram,
    /// Whether a force may cross the network was decided.
    is_judged: bool,
    newest_sequence: u64,
    said: Vec<String>,
    /// Why the arm is not to come back by itself.
    dismissed: Option<String>,
}

impl Told {
    /// More different subjects than this are not from a healthy peer.
    const MOST: usize = 32;

    fn once(&mut self, subject: &str, text: &str) {
        if self.said.len() < Self::MOST && !self.said.iter().any(|said| said == subject) {
            tracing::warn!("{text}");
            self.said.push(subject.to_owned());
        }
    }
}

fn welcome_of(first: Option<v1::DeviceDown>) -> Result<Welcome, String> {
    match first.and_then(|down| down.message) {
        Some(Message::Welcome(wire)) => {
            convert::welcome(&wire).map_err(|rejection| format!("its welcome: {rejection}"))
        }
        Some(Message::Fault(fault)) => Err(fault.message),
        Some(Message::Command(_)) | None => Err("its first message was no welcome".to_owned()),
    }
}

/// What to do about refusals that trying again does not change.
fn final_refusal(code: Code) -> Option<&'static str> {
    match code {
        Code::NotFound => Some("give a tool that the scene has, with --tool; `palpate-view status` lists them"),
        Code::InvalidArgument => Some("check device_name, tool and limits in the configuration"),
        Code::Unauthenticated | Code::PermissionDenied => Some("ask whoever runs the daemon for access"),
        Code::Unimplemented => Some("this is no Palpate daemon, or another version: check --server"),
        _ => None,
    }
}

fn refused(address: &str, status: &Status, help: &'static str) -> BridgeError {
    BridgeError::Refused {
        address: address.to_owned(),
        code: format!("{:?}", status.code()),
        message: status.message().to_owned(),
        help,
    }
}
