//! An arm's answers in time while strangers crowd its daemon: alone, beside 1000 viewers, beside 100 connections that ask for the page as
//! fast as it comes, and beside 2000 that ask for nothing.
//!
//! `cargo build --release -p palpated && cargo run --release -p palpate-bridge --example crowds -- [SECONDS] [SCENE]`
//!
//! Every row has a daemon of its own, the `palpated` built beside it, and a bridge as users run it, with its simulated arm. The crowd is in
//! this process, at normal priority. Twice, in turns, since machines are noisy.
use palpate_bridge::{Config, Handle, Summary, run_with};
use palpate_proto::v1::{self, session_client::SessionClient, surface_client::SurfaceClient};
use std::{
    error::Error,
    net::{SocketAddr, TcpListener},
    process::{Child, Command, Stdio},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::Duration,
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    runtime::{Builder, Runtime},
    task::JoinSet,
    time::sleep,
};
use tokio_util::sync::CancellationToken;
use tonic::transport::Channel;

type Failure = Box<dyn Error + Send + Sync>;

/// How long an arm has its daemon for itself before the crowd comes.
const WARM_UP: Duration = Duration::from_secs(1);
/// Connections that viewers share.
const CONNECTIONS: usize = 10;

/// A process that ends with us.
struct Ending(Child);

impl Drop for Ending {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[derive(Debug, Clone, Copy)]
enum Crowd {
    Nobody,
    Viewers(usize),
    Page(usize),
    Silent(usize),
}

impl Crowd {
    fn name(self) -> String {
        match self {
            Self::Nobody => "alone".to_owned(),
            Self::Viewers(count) => format!("{count} viewers"),
            Self::Page(count) => format!("{count} ask for the page"),
            Self::Silent(count) => format!("{count} silent connections"),
        }
    }

    fn does(self) -> &'static str {
        match self {
            Self::Nobody | Self::Silent(_) => "",
            Self::Viewers(_) => "updates",
            Self::Page(_) => "pages",
        }
    }
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let seconds: u64 = arguments.first().map_or(Ok(10), |s| s.parse())?;
    let scene = arguments.get(1).map_or("heart", String::as_str);
    println!("{scene}, {seconds} s each; tick and wake-up are the daemon's, p50 and p99 (us)\n");
    println!("| crowd | answers in time | trip p50, p99 (us) | tick | wake-up | the crowd had (1/s) | refused |");
    println!("|---|---|---|---|---|---|---|");
    for crowd in [Crowd::Nobody, Crowd::Viewers(1000), Crowd::Page(100), Crowd::Silent(2000)].repeat(2) {
        row(crowd, scene, Duration::from_secs(seconds))?;
    }
    Ok(())
}

fn row(crowd: Crowd, scene: &str, time: Duration) -> Result<(), Failure> {
    let address = TcpListener::bind("127.0.0.1:0")?.local_addr()?;
    let _daemon = start_daemon(address, scene)?;
    let (handle, shutdown) = (Handle::new(), CancellationToken::new());
    let bridge = thread::spawn({
        let (handle, shutdown) = (handle.clone(), shutdown.clone());
        move || bridge(address, handle, shutdown)
    });
    let runtime = Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let had = Arc::new(AtomicU64::new(0));
    let told = runtime.block_on(async {
        while !handle.is_attached() {
            if bridge.is_finished() {
                return Err("the bridge ended before it was attached".into());
            }
            sleep(Duration::from_millis(10)).await;
        }
        sleep(WARM_UP).await;
        handle.stats().round_trip.clear();
        let mut members = JoinSet::new();
        come(crowd, address, &had, &mut members).await?;
        sleep(time).await;
        // Asked anew, as somebody who comes late.
        let status =
            SessionClient::connect(format!("http://{address}")).await?.status(v1::StatusRequest::default()).await?;
        shutdown.cancel();
        Ok::<_, Failure>(status.into_inner())
    });
    shutdown.cancel();
    let summary = bridge.join().map_err(|_| "the bridge panicked")??;
    leave(runtime);
    print(crowd, &summary, &told?, had.load(Ordering::Relaxed) as f64 / time.as_secs_f64());
    Ok(())
}

fn leave(runtime: Runtime) {
    runtime.shutdown_timeout(Duration::from_secs(5));
}

fn print(crowd: Crowd, summary: &Summary, status: &v1::StatusResponse, had_per_s: f64) {
    let us = |ns: u64| ns as f64 / 1e3;
    let pair = |p: Option<v1::Percentiles>| p.map_or_else(String::new, |p| format!("{:.0}, {:.0}", p.p50, p.p99));
    let refused: Vec<_> = status.refusals.iter().map(|of| format!("{} {}", of.count, of.reason)).collect();
    println!(
        "| {} | {:.2} % | {:.0}, {:.0} | {} | {} | {had_per_s:.0} {} | {} |",
        crowd.name(),
        1e2 * summary.share_in_time().unwrap_or(0.0),
        us(summary.round_trip.p50_ns),
        us(summary.round_trip.p99_ns),
        pair(status.tick_cost_us),
        pair(status.wakeup_jitter_us),
        crowd.does(),
        refused.join(", "),
    );
}

fn bridge(address: SocketAddr, handle: Handle, shutdown: CancellationToken) -> Result<Summary, Failure> {
    let mut config = Config::default();
    config.server.url = format!("http://{address}");
    config.server.device_name = "crowded".into();
    config.server.give_up_after_s = Some(30.0);
    config.servo.report_every_s = 0.0;
    config.servo.auto_recover = true;
    let runtime = Builder::new_current_thread().enable_all().build()?;
    Ok(runtime.block_on(run_with(&config, shutdown, handle))?)
}

async fn come(
    crowd: Crowd,
    address: SocketAddr,
    had: &Arc<AtomicU64>,
    members: &mut JoinSet<Result<(), Failure>>,
) -> Result<(), Failure> {
    match crowd {
        Crowd::Nobody => {}
        Crowd::Viewers(count) => {
            let mut channels = Vec::new();
            for _ in 0..CONNECTIONS {
                channels.push(Channel::from_shared(format!("http://{address}"))?.connect().await?);
            }
            for n in 0..count {
                members.spawn(view(channels[n % CONNECTIONS].clone(), Arc::clone(had)));
            }
        }
        Crowd::Page(count) => {
            for _ in 0..count {
                members.spawn(ask_for_the_page(address, Arc::clone(had)));
            }
        }
        Crowd::Silent(count) => {
            for _ in 0..count {
                members.spawn(say_nothing(address));
            }
        }
    }
    Ok(())
}

async fn view(channel: Channel, had: Arc<AtomicU64>) -> Result<(), Failure> {
    let mut events = SurfaceClient::new(channel).watch(v1::WatchRequest::default()).await?.into_inner();
    while events.message().await?.is_some() {
        had.fetch_add(1, Ordering::Relaxed);
    }
    Ok(())
}

async fn ask_for_the_page(address: SocketAddr, had: Arc<AtomicU64>) -> Result<(), Failure> {
    let mut socket = TcpStream::connect(address).await?;
    let mut buffer = vec![0; 64 * 1024];
    loop {
        socket.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n").await?;
        let mut answer = Vec::new();
        loop {
            let read = socket.read(&mut buffer).await?;
            if read == 0 {
                return Err("the daemon closed the connection".into());
            }
            answer.extend_from_slice(&buffer[..read]);
            if answer.windows(7).any(|end| end == b"</html>") {
                break;
            }
        }
        had.fetch_add(1, Ordering::Relaxed);
    }
}

/// Again and again: those who say nothing are sent away.
async fn say_nothing(address: SocketAddr) -> Result<(), Failure> {
    loop {
        let mut socket = TcpStream::connect(address).await?;
        let _ = socket.read(&mut [0; 16]).await;
    }
}

fn start_daemon(address: SocketAddr, scene: &str) -> Result<Ending, Failure> {
    let program = std::env::current_exe()?.with_file_name("../palpated");
    let child = Command::new(&program)
        .args(["serve", scene, "--listen", &address.to_string()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let help = |error| format!("{}: {error}; build it with `cargo build --release -p palpated`", program.display());
    Ok(Ending(child.map_err(help)?))
}
