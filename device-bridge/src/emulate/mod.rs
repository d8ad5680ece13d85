//! Devices that are not there: their bytes over real sockets, with the motion of an arm and a hand, and faults on request.
mod board;
pub mod cli;
pub mod falcon;
pub mod haply_2diy;
pub mod hapticmaster;
pub mod inverse3;
pub mod phantom;
pub mod vrpn;
pub mod woodenhaptics;

use palpate_control::ParameterError;
use std::{
    io::{Error, ErrorKind},
    net::{SocketAddr, TcpListener, TcpStream},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU32, Ordering},
    },
    thread::JoinHandle,
    time::Duration,
};

/// How often a listener looks who came.
const LOOK_EVERY: Duration = Duration::from_micros(200);

/// What an emulator does wrong. Set while it runs.
#[derive(Debug, Default)]
pub struct Faults {
    /// Answers nothing, and goes on.
    pub silence: AtomicBool,
    /// Answers bytes without meaning.
    pub garbage: AtomicBool,
    /// Answers byte by byte.
    pub split: AtomicBool,
    /// Answers after so long (us).
    pub slow_us: AtomicU32,
    /// Refuses every command.
    pub refusal: AtomicBool,
    /// The emergency stop is pressed.
    pub emergency_stop: AtomicBool,
    /// The cable is pulled: the connection is cut.
    pub cut: AtomicBool,
    /// The code of an error that it reports; 0: none.
    pub error_code: AtomicU32,
}

impl Faults {
    /// Sets one of them.
    pub fn set(flag: &AtomicBool, on: bool) {
        flag.store(on, Ordering::Relaxed);
    }

    fn is(flag: &AtomicBool) -> bool {
        flag.load(Ordering::Relaxed)
    }
}

/// What the thread of an emulator shares with whoever looks at it: the machine, what it does wrong, and whether it is over.
#[derive(Debug)]
struct Shared<M> {
    machine: Arc<Mutex<M>>,
    faults: Arc<Faults>,
    stop: Arc<AtomicBool>,
}

impl<M> Shared<M> {
    fn new(machine: M) -> Self {
        Self { machine: Arc::new(Mutex::new(machine)), faults: Arc::default(), stop: Arc::default() }
    }

    fn machine(&self) -> MutexGuard<'_, M> {
        self.machine.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Told to stop, or its cable is pulled.
    fn is_over(&self) -> bool {
        Faults::is(&self.stop) || Faults::is(&self.faults.cut)
    }
}

impl<M> Clone for Shared<M> {
    fn clone(&self) -> Self {
        let Self { machine, faults, stop } = self;
        Self { machine: Arc::clone(machine), faults: Arc::clone(faults), stop: Arc::clone(stop) }
    }
}

/// A thread that is told to stop, and waited for, when this is dropped.
#[derive(Debug)]
struct Running {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    fn start(name: &str, stop: &Arc<AtomicBool>, run: impl FnOnce() + Send + 'static) -> std::io::Result<Self> {
        let thread = std::thread::Builder::new().name(name.into()).spawn(run)?;
        Ok(Self { stop: Arc::clone(stop), thread: Some(thread) })
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A machine behind a TCP port, for one client after the other. It runs until dropped.
#[derive(Debug)]
struct Listening<M> {
    address: SocketAddr,
    shared: Shared<M>,
    _running: Running,
}

impl<M: Send + 'static> Listening<M> {
    /// Listens, with a thread of its own, on which `serve` has each client until that is over.
    fn start(
        name: &str,
        address: &str,
        machine: Result<M, ParameterError>,
        serve: impl Fn(&Shared<M>, TcpStream) + Send + 'static,
    ) -> std::io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let shared = Shared::new(machine.map_err(|error| Error::new(ErrorKind::InvalidInput, error))?);
        let served = shared.clone();
        let running = Running::start(name, &shared.stop, move || {
            while !Faults::is(&served.stop) {
                match listener.accept() {
                    Ok((stream, _)) => serve(&served, stream),
                    Err(_) => std::thread::sleep(LOOK_EVERY),
                }
            }
        })?;
        Ok(Self { address, shared, _running: running })
    }

    fn machine(&self) -> MutexGuard<'_, M> {
        self.shared.machine()
    }
}
