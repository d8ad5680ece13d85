//! Pose to force over loopback at 1 kHz through a real daemon, beside a bare tonic ping-pong of the same messages in the same run.
//!
//! `cargo build --release -p palpated && cargo run --release -p palpate-bridge --example round_trip -- [SECONDS] [SERVER]`
//!
//! Without SERVER it starts the `palpated` built beside it, on its built-in scene. The ping-pong's server is a process of its own too,
//! which answers every sample at once with a command. The daemon answers at its next tick: a bridge whose phase is chance waits up to
//! one period for it, one that follows the daemon's phase hardly at all (`servo.follow_phase`).
use palpate_bridge::{Config, Handle, run_with};
use palpate_proto::v1::{
    self,
    device_client::DeviceClient,
    device_down,
    device_server::{Device, DeviceServer},
    device_up,
    session_client::SessionClient,
};
use palpate_realtime::{Clock, Histogram, Percentiles};
use std::{
    error::Error,
    io::{BufRead, BufReader},
    net::TcpListener,
    process::{Child, Command, Stdio},
    sync::Arc,
    time::Duration,
};
use tokio::sync::mpsc;
use tokio_stream::{StreamExt, wrappers::ReceiverStream};
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status, Streaming, transport::server::TcpIncoming};

type Failure = Box<dyn Error + Send + Sync>;

const WARM_UP: Duration = Duration::from_secs(2);
const PERIOD: Duration = Duration::from_millis(1);
/// Bridges, one after another: in which phase one runs beside the daemon is chance where it follows none.
const RUNS: [(&str, bool); 5] = [
    ("phase by chance", false),
    ("by chance", false),
    ("by chance", false),
    ("phase followed", true),
    ("followed, again", true),
];

/// A process that ends with us.
struct Ending(Child);

impl Drop for Ending {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    if arguments.first().is_some_and(|first| first == "--echo") {
        return runtime.block_on(echo());
    }
    let seconds: u64 = arguments.first().map_or(Ok(10), |s| s.parse())?;
    let (_daemon, server) = match arguments.get(1) {
        Some(server) => (None, server.clone()),
        None => start_daemon()?,
    };
    let (_echo, echo_url) = start_echo()?;
    // The ping-pong on a thread and runtime of its own, as the bridge has.
    let ping_pong = Arc::new(Histogram::new());
    let stop = CancellationToken::new();
    let pinging = std::thread::spawn({
        let (histogram, stop) = (Arc::clone(&ping_pong), stop.clone());
        move || ping(&echo_url, &histogram, &stop)
    });
    let mut rows = Vec::new();
    let mut last = None;
    for (name, follows_phase) in RUNS {
        let (trip, waited, daemon) =
            runtime.block_on(through_the_daemon(&server, seconds, follows_phase, &ping_pong))?;
        rows.push((format!("{name}: pose to force"), trip));
        rows.push(("  of it, waiting for the tick".to_owned(), waited));
        rows.push(("  bare ping-pong meanwhile".to_owned(), ping_pong.percentiles()));
        last = Some(daemon);
    }
    stop.cancel();
    pinging.join().map_err(|_| "the ping-pong panicked")??;
    print(&rows, &last.unwrap_or_default());
    Ok(())
}

fn print(rows: &[(String, Percentiles)], daemon: &v1::StatusResponse) {
    let us = |ns: u64| ns as f64 / 1e3;
    for (name, p) in rows {
        let (p50, p99, max) = (us(p.p50_ns), us(p.p99_ns), us(p.max_ns));
        println!("{name:<36} p50 {p50:>8.1} us   p99 {p99:>8.1} us   max {max:>9.1} us   ({})", p.count);
    }
    let cost = daemon.tick_cost_us.unwrap_or_default();
    let jitter = daemon.wakeup_jitter_us.unwrap_or_default();
    println!(
        "the daemon's tick wakes late p50 {:.1}, p99 {:.1}; works p50 {:.1}, p99 {:.1} us",
        jitter.p50, jitter.p99, cost.p50, cost.p99
    );
}

/// Through a bridge as users run it, and the daemon's own account.
async fn through_the_daemon(
    server: &str,
    seconds: u64,
    follows_phase: bool,
    ping_pong: &Histogram,
) -> Result<(Percentiles, Percentiles, v1::StatusResponse), Failure> {
    let mut config = Config::default();
    config.server.url = server.into();
    config.server.device_name = "round-trip".into();
    config.server.give_up_after_s = Some(20.0);
    config.servo.report_every_s = 0.0;
    config.servo.auto_recover = true;
    config.servo.follow_phase = follows_phase;
    let (handle, shutdown) = (Handle::new(), CancellationToken::new());
    let measuring = {
        let (handle, shutdown) = (handle.clone(), shutdown.clone());
        let server = server.to_owned();
        async move {
            while !handle.is_attached() {
                tokio::time::sleep(PERIOD).await;
            }
            tokio::time::sleep(WARM_UP).await;
            let stats = handle.stats();
            stats.round_trip.clear();
            stats.waited.clear();
            ping_pong.clear();
            tokio::time::sleep(Duration::from_secs(seconds)).await;
            let (trip, waited) = (stats.round_trip.percentiles(), stats.waited.percentiles());
            let status = status(&server).await;
            shutdown.cancel();
            status.map(|status| (trip, waited, status))
        }
    };
    let (summary, measured) =
        tokio::join!(async { run_with(&config, shutdown.clone(), handle).await.inspect_err(stop_with) }, measuring);
    println!("{}\n", summary?);
    measured
}

/// The measurement beside it would wait for ever.
fn stop_with(error: &palpate_bridge::BridgeError) {
    eprintln!("{error}");
    std::process::exit(1);
}

async fn status(server: &str) -> Result<v1::StatusResponse, Failure> {
    let mut client = SessionClient::connect(server.to_owned()).await?;
    Ok(client.status(v1::StatusRequest::default()).await?.into_inner())
}

fn start_daemon() -> Result<(Option<Ending>, String), Failure> {
    let program = std::env::current_exe()?.with_file_name("../palpated");
    let address = TcpListener::bind("127.0.0.1:0")?.local_addr()?;
    let child = Command::new(&program)
        .args(["serve", "--listen", &address.to_string()])
        .stdout(Stdio::null())
        .spawn()
        .map_err(|error| {
            format!("{}: {error}; build it with `cargo build --release -p palpated`", program.display())
        })?;
    Ok((Some(Ending(child)), format!("http://{address}")))
}

fn start_echo() -> Result<(Ending, String), Failure> {
    let mut child = Command::new(std::env::current_exe()?).arg("--echo").stdout(Stdio::piped()).spawn()?;
    let mut line = String::new();
    BufReader::new(child.stdout.take().ok_or("no output")?).read_line(&mut line)?;
    Ok((Ending(child), format!("http://{}", line.trim())))
}

/// One sample a millisecond, one answer each.
fn ping(url: &str, histogram: &Histogram, stop: &CancellationToken) -> Result<(), Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let mut client = DeviceClient::connect(url.to_owned()).await?;
        let (up, samples) = mpsc::channel(1);
        let mut down = client.attach(ReceiverStream::new(samples)).await?.into_inner();
        let mut every = tokio::time::interval(PERIOD);
        let mut sequence = 0;
        while !stop.is_cancelled() {
            every.tick().await;
            sequence += 1;
            let sent_ns = Clock::Monotonic.now_ns();
            up.send(sample(sequence, sent_ns)).await?;
            down.message().await?.ok_or("the echo ended")?;
            histogram.record(Clock::Monotonic.now_ns() - sent_ns);
        }
        Ok(())
    })
}

fn sample(sequence: u64, device_time_ns: u64) -> v1::DeviceUp {
    let vector = Some(v1::Vec3 { x: 0.1, y: 0.2, z: 0.3 });
    let pose = v1::Pose { position_m: vector, orientation: Some(v1::Quaternion { w: 1.0, ..Default::default() }) };
    let twist = v1::Twist { linear_m_per_s: vector, angular_rad_per_s: vector };
    let sample = v1::DeviceSample {
        sequence,
        device_time_ns,
        pose: Some(pose),
        twist: Some(twist),
        measured_force_n: vector,
        ..Default::default()
    };
    v1::DeviceUp { message: Some(device_up::Message::Sample(sample)) }
}

/// The bare server: prints its address, answers until killed.
async fn echo() -> Result<(), Failure> {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await?;
    println!("{}", listener.local_addr()?);
    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
    tonic::transport::Server::builder().add_service(DeviceServer::new(Echo)).serve_with_incoming(incoming).await?;
    Ok(())
}

struct Echo;

#[tonic::async_trait]
impl Device for Echo {
    type AttachStream =
        std::pin::Pin<Box<dyn tokio_stream::Stream<Item = Result<v1::DeviceDown, Status>> + Send + 'static>>;

    async fn attach(&self, request: Request<Streaming<v1::DeviceUp>>) -> Result<Response<Self::AttachStream>, Status> {
        let down = request.into_inner().map(|up| up.map(|up| answer(&up)));
        Ok(Response::new(Box::pin(down)))
    }
}

/// A command as large as a real one in contact.
fn answer(up: &v1::DeviceUp) -> v1::DeviceDown {
    let vector = Some(v1::Vec3 { x: 0.1, y: 0.2, z: 0.3 });
    let (sequence, echo) = match &up.message {
        Some(device_up::Message::Sample(sample)) => (sample.sequence, sample.device_time_ns),
        _ => (0, 0),
    };
    let model = v1::LocalContactModel {
        point_m: vector,
        normal: vector,
        force_n: vector,
        stiffness_n_per_m: Some(v1::Mat3 { column_major: vec![1.0; 9] }),
        validity_radius_m: 0.01,
        max_force_n: 3.0,
        tick: sequence,
        torque: None,
    };
    let command = v1::DeviceCommand {
        tick: sequence,
        wrench: Some(v1::Wrench { force_n: vector, torque_nm: vector }),
        sample_sequence: sequence,
        echo_device_time_ns: echo,
        local_model: Some(model),
        proxy_position_m: vector,
        proxy_orientation: None,
        sample_waited_ns: None,
    };
    v1::DeviceDown { message: Some(device_down::Message::Command(command)) }
}
