//! A daemon's Device service on a real socket, whose behaviour a test scripts.
#![allow(dead_code, unreachable_pub, missing_docs, clippy::unwrap_used)] // helpers of tests; each file uses a part
pub mod press;

use palpate_bridge::{
    BridgeError, Config, Handle,
    config::{DeviceConfig, KeyframeConfig, RealtimeConfig, SimulatedConfig},
    probe::{Report, probe},
};
use palpate_proto::v1::{
    self, DeviceDown, DeviceUp,
    device_down::Message,
    device_server::{Device, DeviceServer},
};
use std::{
    net::SocketAddr,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};
use tokio::{net::TcpListener, sync::mpsc, task::JoinHandle};
use tokio_stream::{StreamExt, wrappers::ReceiverStream};
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status, Streaming};

/// What the mock answers to every sample; changed by tests while it runs.
#[derive(Debug, Clone)]
pub struct Behaviour {
    pub wrench_n: v1::Vec3,
    pub local_model: Option<v1::LocalContactModel>,
    /// Answer nothing at all.
    pub silent: bool,
    /// End the stream at the next sample.
    pub hang_up: bool,
    /// Refuse the next attach.
    pub refuse: Option<Status>,
    /// Sent once, before the next command.
    pub fault: Option<v1::DeviceFaultCode>,
    pub max_force_n: f64,
    /// How long each answer is on its way; the next ones are sent meanwhile.
    pub delay: Duration,
}

impl Default for Behaviour {
    fn default() -> Self {
        Self {
            wrench_n: v1::Vec3 { x: 0.0, y: 0.0, z: 1.0 },
            local_model: None,
            silent: false,
            hang_up: false,
            refuse: None,
            fault: None,
            max_force_n: 100.0,
            delay: Duration::ZERO,
        }
    }
}

#[derive(Debug, Default)]
pub struct Seen {
    pub hellos: Vec<v1::DeviceHello>,
    pub sequences: Vec<u64>,
    pub last_sample: Option<v1::DeviceSample>,
    /// Streams that the bridge ended itself.
    pub ended: usize,
}

#[derive(Debug, Clone, Default)]
pub struct Mock {
    pub behaviour: Arc<Mutex<Behaviour>>,
    pub seen: Arc<Mutex<Seen>>,
}

impl Mock {
    pub fn set(&self, change: impl FnOnce(&mut Behaviour)) {
        change(&mut self.behaviour.lock().unwrap());
    }

    pub fn seen<T>(&self, look: impl FnOnce(&Seen) -> T) -> T {
        look(&self.seen.lock().unwrap())
    }

    /// Serves on `address` until the token is cancelled; every connection is cut then.
    pub async fn serve(&self, address: &str) -> (SocketAddr, CancellationToken, JoinHandle<()>) {
        let listener = TcpListener::bind(address).await.unwrap();
        let address = listener.local_addr().unwrap();
        let stop = CancellationToken::new();
        let stopped = stop.clone();
        let server = tonic::transport::Server::builder().add_service(DeviceServer::new(self.clone()));
        let incoming = tonic::transport::server::TcpIncoming::from(listener).with_nodelay(Some(true));
        let serving = tokio::spawn(async move {
            tokio::select! {
                served = server.serve_with_incoming(incoming) => served.unwrap(),
                () = stopped.cancelled() => {}
            }
        });
        (address, stop, serving)
    }

    fn answer(&self, sample: &v1::DeviceSample, tick: u64) -> Option<Vec<DeviceDown>> {
        {
            let mut seen = self.seen.lock().unwrap();
            seen.sequences.push(sample.sequence);
            seen.last_sample = Some(*sample);
        }
        let mut behaviour = self.behaviour.lock().unwrap();
        if std::mem::take(&mut behaviour.hang_up) {
            return None;
        }
        if behaviour.silent {
            return Some(Vec::new());
        }
        let mut answers = Vec::new();
        if let Some(code) = behaviour.fault.take() {
            let fault = v1::DeviceFault { code: code.into(), message: "scripted".into(), ..Default::default() };
            answers.push(DeviceDown { message: Some(Message::Fault(fault)) });
        }
        let command = v1::DeviceCommand {
            tick,
            wrench: Some(v1::Wrench { force_n: Some(behaviour.wrench_n), torque_nm: Some(v1::Vec3::default()) }),
            sample_sequence: sample.sequence,
            echo_device_time_ns: sample.device_time_ns,
            local_model: behaviour.local_model.clone(),
            proxy_position_m: Some(v1::Vec3::default()),
            proxy_orientation: None,
            sample_waited_ns: None,
        };
        answers.push(DeviceDown { message: Some(Message::Command(command)) });
        Some(answers)
    }
}

#[tonic::async_trait]
impl Device for Mock {
    type AttachStream = ReceiverStream<Result<DeviceDown, Status>>;

    async fn attach(&self, request: Request<Streaming<DeviceUp>>) -> Result<Response<Self::AttachStream>, Status> {
        if let Some(status) = self.behaviour.lock().unwrap().refuse.take() {
            return Err(status);
        }
        let max_force_n = self.behaviour.lock().unwrap().max_force_n;
        let (down, answers) = mpsc::channel(16);
        let mock = self.clone();
        let mut up = request.into_inner();
        tokio::spawn(async move {
            let mut tick = 0;
            while let Some(Ok(message)) = up.next().await {
                let answers = match message.message {
                    Some(v1::device_up::Message::Hello(hello)) => {
                        mock.seen.lock().unwrap().hellos.push(hello);
                        Some(vec![welcome(max_force_n)])
                    }
                    Some(v1::device_up::Message::Sample(sample)) => {
                        tick += 1;
                        mock.answer(&sample, tick)
                    }
                    None => Some(Vec::new()),
                };
                let Some(answers) = answers else { return };
                let (delay, down) = (mock.behaviour.lock().unwrap().delay, down.clone());
                if !delay.is_zero() {
                    tokio::spawn(async move {
                        tokio::time::sleep(delay).await;
                        for answer in answers {
                            let _ = down.send(Ok(answer)).await;
                        }
                    });
                    continue;
                }
                for answer in answers {
                    if down.send(Ok(answer)).await.is_err() {
                        return;
                    }
                }
            }
            mock.seen.lock().unwrap().ended += 1;
        });
        Ok(Response::new(ReceiverStream::new(answers)))
    }
}

fn welcome(max_force_n: f64) -> DeviceDown {
    let limits = v1::DeviceLimits {
        max_force_n,
        max_force_rate_n_per_s: 1e4,
        coupling_stiffness_n_per_m: 300.0,
        coupling_damping_n_s_per_m: 1.0,
        stale_after_s: 0.05,
        ramp_to_zero_s: 0.05,
        max_torque_nm: 0.0,
        lease_s: 0.2,
        max_torque_rate_nm_per_s: 0.0,
    };
    let welcome = v1::DeviceWelcome {
        protocol_version: palpate_proto::PROTOCOL_VERSION,
        session_id: "mock".into(),
        tool_name: "probe".into(),
        tick_period_s: 1e-3,
        limits: Some(limits),
        tool_radius_m: 5e-3,
        tool_half_length_m: 0.0,
    };
    DeviceDown { message: Some(Message::Welcome(welcome)) }
}

/// A bridge to `url` whose hand rests at the origin, patient enough for a busy test machine and quick to come back.
pub fn config(url: &str) -> Config {
    let mut config = Config::default();
    config.server.url = url.into();
    config.server.first_pause_s = 0.02;
    config.server.longest_pause_s = 0.1;
    config.server.pause_seed = Some(1);
    config.servo.report_every_s = 0.0;
    config.watchdog.stale_after_s = 0.25;
    config.watchdog.ramp_to_zero_s = 0.05;
    config.watchdog.ramp_up_s = 0.05;
    // The force that is asked for is on an arm at rest: nobody worked for it.
    config.passivity.strict = false;
    // Beside the arm the hand damps.
    config.render.arm_damping_n_s_per_m = 40.0;
    let keyframes = vec![KeyframeConfig { time_s: 0.0, position_m: [0.0; 3] }];
    config.device = DeviceConfig::Simulated(SimulatedConfig { keyframes, ..SimulatedConfig::default() });
    config.realtime = RealtimeConfig { fifo_priority: 0, lock_memory: false, processor: None, stay_awake: false };
    config
}

/// A bridge running beside the test.
pub struct Running {
    pub handle: Handle,
    pub shutdown: CancellationToken,
    pub task: JoinHandle<Result<palpate_bridge::Summary, BridgeError>>,
}

pub fn start(config: Config) -> Running {
    let (handle, shutdown) = (Handle::new(), CancellationToken::new());
    let task = tokio::spawn({
        let (handle, shutdown) = (handle.clone(), shutdown.clone());
        async move { palpate_bridge::run_with(&config, shutdown, handle).await }
    });
    Running { handle, shutdown, task }
}

/// A daemon and a bridge, whose configuration is changed before, with the force up: 1 N.
pub async fn pushing(change: impl FnOnce(&mut Config)) -> (Mock, Running) {
    let mock = Mock::default();
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let mut config = config(&format!("http://{address}"));
    change(&mut config);
    let bridge = start(config);
    until("the force is up", || bridge.handle.stats().force_n() > 0.99).await;
    (mock, bridge)
}

impl Running {
    /// Stops it and returns its counters.
    pub async fn stop(self) -> palpate_bridge::Summary {
        self.shutdown.cancel();
        self.task.await.unwrap().unwrap()
    }
}

/// What people are told of an error: itself and its causes.
pub fn told(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(Some(error), |error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// Waits until `condition` holds; fails the test when it does not within 20 s.
pub async fn until(what: &str, mut condition: impl FnMut() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(began.elapsed() < Duration::from_secs(20), "waited in vain until {what}");
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
}

/// The same where nothing else goes on.
pub fn wait(what: &str, mut condition: impl FnMut() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(began.elapsed() < Duration::from_secs(20), "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Probes an arm for so long.
pub fn probed(device: DeviceConfig, time: Duration) -> Result<Report, BridgeError> {
    let config = Config { device, ..config("http://127.0.0.1:1") };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let _context = runtime.enter();
    probe(&config, time)
}
