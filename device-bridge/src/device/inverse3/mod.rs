//! Haply Inverse3: an impedance arm behind a service of its maker, which speaks JSON over a WebSocket.
//!
//! The socket has a thread of its own, [`line`], which allocates; the loop exchanges newest values with it and waits for nothing. A new force wakes it, and it takes
//! the force away when the loop has said none for [`Settings::silence`].
//!
//! The service's axes are x right, y forward, z up. A grip with an orientation turns the tool; how fast it turns is not told.
//! What only hardware can tell is named here: which dialect a service obeys ([`Dialect`]), how soon it takes the force away when nothing more comes.
pub mod line;
pub mod wire;

use super::{Arm, Effort, Fault, LONGEST_EXTRAPOLATION_S, Reading};
use glam::{DQuat, DVec3};
use line::{Line, Names, Told};
use palpate_control::{Motion, extrapolate};
use palpate_realtime::{Doorbell, OsMeasures, SlotReader, SlotWriter, slot};
use std::{
    net::{TcpStream, ToSocketAddrs},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};
use thiserror::Error;
use tungstenite::{Bytes, HandshakeError, WebSocket, http::Uri, protocol::WebSocketConfig};

/// How long connecting, and the first message, may take.
const PATIENCE: Duration = Duration::from_secs(2);
/// How often it is looked whether the first message has come.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// No state of a few devices is longer (bytes).
const LONGEST_MESSAGE: usize = 1 << 20;
/// Port of the service, where the address names none.
const PORT: u16 = 10001;

/// How forces are told to the service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dialect {
    /// `"values": {…}`, as of version 3.1.
    Values,
    /// `"vector": {…}, "execute": true`, as of version 3.5.
    Vector,
}

/// Which arm, and how to speak to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// `ws://HOST:PORT` of the service.
    pub url: String,
    /// The arm's name; empty: the first.
    pub device_id: String,
    /// The grip's name; empty: the first, if there is one.
    pub grip_id: String,
    /// How forces are told.
    pub dialect: Dialect,
    /// Take an arm that says it is not calibrated.
    pub uncalibrated: bool,
    /// Without a state for so long the arm is lost; without a force of the loop for so long it is let go.
    pub silence: Duration,
    /// `SCHED_FIFO` priority of the socket's thread.
    pub fifo_priority: Option<u8>,
}

/// Why the arm could not be started.
#[derive(Debug, Error)]
pub enum StartError {
    /// Not an address.
    #[error("\"{url}\" is no address of an Inverse service: write ws://HOST:{PORT}")]
    Address {
        /// As given.
        url: String,
    },
    /// Nobody there.
    #[error("no service answers at {url}: {reason}; is Haply's Inverse service running there?")]
    Connect {
        /// Its address.
        url: String,
        /// Why.
        reason: std::io::Error,
    },
    /// Somebody else there.
    #[error("{url} does not speak WebSocket: {reason}; is it the Inverse service's port?")]
    Handshake {
        /// Its address.
        url: String,
        /// What went wrong.
        reason: String,
    },
    /// Not a word.
    #[error("the service at {url} says nothing within {} s", PATIENCE.as_secs())]
    Silent {
        /// Its address.
        url: String,
    },
    /// Something else.
    #[error("the service at {url}: {fault}; is it the Inverse service?")]
    Strange {
        /// Its address.
        url: String,
        /// What went wrong.
        fault: Fault,
    },
    /// No arm.
    #[error("the service at {url} has no Inverse3: is it plugged in and switched on?")]
    NoArm {
        /// Its address.
        url: String,
    },
    /// Another arm.
    #[error("the service at {url} has no Inverse3 \"{device_id}\"; it has {known}")]
    Unknown {
        /// Its address.
        url: String,
        /// The name asked for.
        device_id: String,
        /// Those that there are.
        known: String,
    },
    /// It does not know where it is.
    #[error(
        "the Inverse3 {device_id} is not calibrated: calibrate it as its maker says, or set `uncalibrated = true` to take it as it is"
    )]
    Uncalibrated {
        /// Its name.
        device_id: String,
    },
    /// The operating system refused something.
    #[error("cannot {what}: {reason}")]
    System {
        /// What.
        what: &'static str,
        /// Why.
        reason: std::io::Error,
    },
}

/// The arm.
#[derive(Debug)]
pub struct Inverse3 {
    states: SlotReader<Result<Told, Fault>>,
    forces: SlotWriter<DVec3>,
    bell: Doorbell,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    silence: Duration,
    /// The grip's last: one that falls silent does not turn the tool back.
    orientation: DQuat,
    lost: Option<Fault>,
}

impl Inverse3 {
    /// Connects, finds the arm and starts the socket's thread. Blocks.
    ///
    /// # Errors
    /// [`StartError`].
    pub fn start(settings: &Settings) -> Result<Self, StartError> {
        let system = |what| move |reason| StartError::System { what, reason };
        let mut socket = connect(&settings.url)?;
        let first = first_message(&mut socket, &settings.url)?;
        let names = Names { arm: choose(&first, settings)?, grip: settings.grip_id.clone(), dialect: settings.dialect };
        let strange = |fault| StartError::Strange { url: settings.url.clone(), fault };
        let state = wire::state(&first, &names.arm, &names.grip).map_err(strange)?;
        tracing::info!("the Inverse3 {} at {} is there", names.arm, settings.url);
        let now = Instant::now();
        let (states, told) = slot(&Ok(Told { state, since: now, came: now }));
        let (forces, wanted) = slot(&DVec3::ZERO);
        let bell = Doorbell::new().map_err(system("create an eventfd"))?;
        let line = Line::new(socket, names, settings.silence, wanted, states, bell.clone())
            .map_err(system("read the socket without waiting"))?;
        let stop = Arc::new(AtomicBool::new(false));
        let measures = OsMeasures { fifo_priority: settings.fifo_priority, ..OsMeasures::NONE };
        let thread = std::thread::Builder::new()
            .name("palpate-inverse3".to_owned())
            .spawn({
                let stop = Arc::clone(&stop);
                move || {
                    // The servo says what is granted.
                    let _granted = measures.apply();
                    line.run(&stop);
                }
            })
            .map_err(system("start the socket's thread"))?;
        Ok(Self {
            states: told,
            forces,
            bell,
            stop,
            thread: Some(thread),
            silence: settings.silence,
            orientation: DQuat::IDENTITY,
            lost: None,
        })
    }

    fn newest(&mut self) -> Result<Told, Fault> {
        let told = (*self.states.newest())?;
        if told.came.elapsed() > self.silence { Err(Fault::Silent) } else { Ok(told) }
    }
}

impl Arm for Inverse3 {
    /// Ages are of the clock: states come on another thread, whatever the loop does.
    fn read(&mut self, _: u64) -> Result<Reading, Fault> {
        if let Some(fault) = self.lost {
            return Err(fault);
        }
        let Told { state, since, .. } = self.newest().map_err(|fault| *self.lost.get_or_insert(fault))?;
        self.orientation = state.grip.and_then(|grip| grip.orientation).unwrap_or(self.orientation);
        let motion = Motion {
            orientation: self.orientation,
            velocity_m_per_s: state.velocity_m_per_s,
            ..Motion::at(state.position_m)
        };
        let age_s = since.elapsed().as_secs_f64();
        Ok(Reading {
            motion: extrapolate(&motion, age_s, LONGEST_EXTRAPOLATION_S),
            buttons: state.grip.map_or(0, |grip| grip.buttons),
            measured_force_n: None,
            age_s,
            force_share: 1.0,
        })
    }

    /// A lost arm is still told to let go, should it hear.
    fn apply(&mut self, effort: &Effort) {
        self.forces.publish(effort.unless(self.lost.is_some()).force_n);
        self.bell.ring();
    }
}

impl Drop for Inverse3 {
    /// The thread takes the force away and closes.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.bell.ring();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Host and port.
fn place(url: &str) -> Option<(String, u16)> {
    let uri: Uri = url.parse().ok()?;
    let host = uri.host().filter(|host| !host.is_empty() && uri.scheme_str() == Some("ws"))?;
    Some((host.trim_matches(['[', ']']).to_owned(), uri.port_u16().unwrap_or(PORT)))
}

/// The first of the addresses of `localhost` may be one where nobody listens: all are tried.
fn connect(url: &str) -> Result<WebSocket<TcpStream>, StartError> {
    let host_and_port = place(url).ok_or_else(|| StartError::Address { url: url.to_owned() })?;
    let refused = |reason| StartError::Connect { url: url.to_owned(), reason };
    let mut last = std::io::ErrorKind::NotFound.into();
    for address in host_and_port.to_socket_addrs().map_err(refused)? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => return shake_hands(stream, url),
            Err(error) => last = error,
        }
    }
    Err(refused(last))
}

fn shake_hands(stream: TcpStream, url: &str) -> Result<WebSocket<TcpStream>, StartError> {
    let refused = |reason| StartError::Connect { url: url.to_owned(), reason };
    stream.set_nodelay(true).map_err(refused)?;
    stream.set_read_timeout(Some(PATIENCE)).map_err(refused)?;
    stream.set_write_timeout(Some(PATIENCE)).map_err(refused)?;
    let config = WebSocketConfig::default()
        .max_message_size(Some(LONGEST_MESSAGE))
        .max_frame_size(Some(LONGEST_MESSAGE))
        .read_buffer_size(16 << 10)
        .write_buffer_size(0);
    match tungstenite::client::client_with_config(url, stream, Some(config)) {
        Ok((socket, _)) => Ok(socket),
        Err(HandshakeError::Interrupted(_)) => Err(StartError::Silent { url: url.to_owned() }),
        Err(HandshakeError::Failure(error)) => {
            Err(StartError::Handshake { url: url.to_owned(), reason: error.to_string() })
        }
    }
}

fn first_message(socket: &mut WebSocket<TcpStream>, url: &str) -> Result<Bytes, StartError> {
    let refused = |reason| StartError::Connect { url: url.to_owned(), reason };
    socket.get_ref().set_read_timeout(Some(LOOK_EVERY)).map_err(refused)?;
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        let next = line::next(socket).map_err(|fault| StartError::Strange { url: url.to_owned(), fault })?;
        if let Some(message) = next {
            return Ok(message);
        }
    }
    Err(StartError::Silent { url: url.to_owned() })
}

/// The name of the arm that is meant.
fn choose(first: &[u8], settings: &Settings) -> Result<String, StartError> {
    let url = || settings.url.clone();
    let arms = wire::arms(first).map_err(|fault| StartError::Strange { url: url(), fault })?;
    let wanted = &settings.device_id;
    let chosen = arms.iter().find(|arm| wanted.is_empty() || arm.device_id == *wanted);
    match chosen {
        Some(arm) if arm.is_calibrated || settings.uncalibrated => Ok(arm.device_id.clone()),
        Some(arm) => Err(StartError::Uncalibrated { device_id: arm.device_id.clone() }),
        None if arms.is_empty() => Err(StartError::NoArm { url: url() }),
        None => {
            let known = arms.iter().map(|arm| arm.device_id.as_str()).collect::<Vec<_>>().join(", ");
            Err(StartError::Unknown { url: url(), device_id: wanted.clone(), known })
        }
    }
}
