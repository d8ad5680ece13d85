//! A network that is not good, between a bridge and a daemon: the Device service, which hands every message on, late, out of order, or not at all.
//!
//! Both connections are real ones. TCP delays what a network loses; what is lost here is lost, as it is where nobody sends it again.
use super::Random;
use palpate_proto::v1::{
    self, DeviceDown, DeviceUp,
    device_client::DeviceClient,
    device_down,
    device_server::{Device, DeviceServer},
    device_up,
};
use std::{
    net::SocketAddr,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use tokio::{net::TcpListener, runtime::Runtime, sync::mpsc};
use tokio_stream::{StreamExt, wrappers::ReceiverStream};
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status, Streaming};

/// What happens to a message on its way, each way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Conditions {
    /// How long it takes (ms).
    pub delay_ms: u64,
    /// Up to so much longer (ms), drawn anew for each: messages overtake one another.
    pub jitter_ms: u64,
    /// Lost, of 100.
    pub loss_percent: u64,
}

/// What happened.
#[derive(Debug, Default)]
pub struct Counts {
    pub carried: AtomicU64,
    pub lost: AtomicU64,
    /// Arrived behind one that was sent later.
    pub overtaken: AtomicU64,
}

struct State {
    conditions: Conditions,
    random: Random,
    /// Of the streams that stand now.
    cut: CancellationToken,
}

/// It carries until dropped.
pub struct Network {
    state: Arc<Mutex<State>>,
    pub counts: Arc<Counts>,
    address: SocketAddr,
    _runtime: Runtime,
}

impl Network {
    /// Between whoever calls it and the daemon at `url`.
    pub fn to(url: &str, seed: u64) -> Self {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let state = State { conditions: Conditions::default(), random: Random(seed), cut: CancellationToken::new() };
        let (state, counts) = (Arc::new(Mutex::new(state)), Arc::new(Counts::default()));
        let service = Carrier { url: url.to_owned(), state: Arc::clone(&state), counts: Arc::clone(&counts) };
        let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0")).unwrap();
        let address = listener.local_addr().unwrap();
        let incoming = tonic::transport::server::TcpIncoming::from(listener).with_nodelay(Some(true));
        let server = tonic::transport::Server::builder().add_service(DeviceServer::new(service));
        runtime.spawn(async move { server.serve_with_incoming(incoming).await.unwrap() });
        Self { state, counts, address, _runtime: runtime }
    }

    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// From the next message on.
    pub fn set(&self, conditions: Conditions) {
        self.state.lock().unwrap().conditions = conditions;
    }

    /// Ends what stands now, as a cable that is pulled; whoever comes again is let through.
    pub fn cut(&self) {
        std::mem::take(&mut self.state.lock().unwrap().cut).cancel();
    }
}

#[derive(Clone)]
struct Carrier {
    url: String,
    state: Arc<Mutex<State>>,
    counts: Arc<Counts>,
}

impl Carrier {
    /// Hands messages on until either end is gone. `sequence` 0: said once, and never lost.
    async fn carry<T: Send + 'static>(
        self,
        mut from: Streaming<T>,
        to: mpsc::Sender<Result<T, Status>>,
        sequence: impl Fn(&T) -> u64,
    ) {
        let cut = self.state.lock().unwrap().cut.clone();
        let newest = Arc::new(AtomicU64::new(0));
        loop {
            let message = tokio::select! {
                () = cut.cancelled() => {
                    let _ = to.send(Err(Status::unavailable("the cable was pulled"))).await;
                    return;
                }
                message = from.next() => message,
            };
            let Some(message) = message else { return };
            let of = message.as_ref().map_or(0, &sequence);
            let way = if of == 0 { Some(Duration::ZERO) } else { self.way() };
            let Some(way) = way else {
                self.counts.lost.fetch_add(1, Ordering::Relaxed);
                continue;
            };
            if way.is_zero() {
                if to.send(message).await.is_err() {
                    return;
                }
                self.counts.carried.fetch_add(1, Ordering::Relaxed);
                continue;
            }
            let (to, counts, newest) = (to.clone(), Arc::clone(&self.counts), Arc::clone(&newest));
            tokio::spawn(async move {
                tokio::time::sleep(way).await;
                if to.send(message).await.is_ok() {
                    counts.carried.fetch_add(1, Ordering::Relaxed);
                    let overtaken = newest.fetch_max(of, Ordering::Relaxed) > of;
                    counts.overtaken.fetch_add(u64::from(overtaken), Ordering::Relaxed);
                }
            });
        }
    }

    /// How long a message takes; `None`: it is lost.
    fn way(&self) -> Option<Duration> {
        let mut state = self.state.lock().unwrap();
        let Conditions { delay_ms, jitter_ms, loss_percent } = state.conditions;
        let lost = state.random.below(100) < loss_percent;
        let late_us = state.random.below(1000 * jitter_ms + 1);
        (!lost).then(|| Duration::from_millis(delay_ms) + Duration::from_micros(late_us))
    }
}

#[tonic::async_trait]
impl Device for Carrier {
    type AttachStream = ReceiverStream<Result<DeviceDown, Status>>;

    async fn attach(&self, request: Request<Streaming<DeviceUp>>) -> Result<Response<Self::AttachStream>, Status> {
        let mut client =
            DeviceClient::connect(self.url.clone()).await.map_err(|error| Status::unavailable(error.to_string()))?;
        let (up, samples) = mpsc::channel(64);
        tokio::spawn(self.clone().carry(request.into_inner(), up, |message: &DeviceUp| match &message.message {
            Some(device_up::Message::Sample(sample)) => sample.sequence,
            _ => 0,
        }));
        // What the bridge's end of the stream failed with ends it here.
        let samples = ReceiverStream::new(samples).map_while(Result::ok);
        let from_daemon = client.attach(samples).await?.into_inner();
        let (down, commands) = mpsc::channel(64);
        tokio::spawn(self.clone().carry(from_daemon, down, |message: &DeviceDown| match &message.message {
            Some(device_down::Message::Command(v1::DeviceCommand { tick, .. })) => *tick,
            _ => 0,
        }));
        Ok(Response::new(ReceiverStream::new(commands)))
    }
}
