//! A HapticMASTER that is not there. `m a = F_hand + Σ F_effects − b v`, in steps of 0.4 ms of real time; its effects end with the connection, unless it keeps them.
mod effects;
mod machine;

use super::{Faults, Running, Shared};
use crate::device::hapticmaster::grammar;
use glam::DVec3;
use machine::Machine;
use palpate_control::{ArmSpec, HandPath};
use std::{
    io::{ErrorKind, Read as _, Write as _},
    net::{SocketAddr, TcpListener, TcpStream},
    sync::{Arc, atomic::Ordering},
    time::Duration,
};

/// The inertia it cannot be set below (kg).
const LEAST_INERTIA_KG: f64 = 2.0;
/// Its answer to everything, when it is to refuse.
const REFUSAL: &str = "--- ERROR: not now";
/// How often it looks whether it shall stop, when nothing comes.
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// What public sources do not settle of its effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EffectSettings {
    /// They stay when a connection ends, and act until the next one removes them.
    pub kept: bool,
    /// It has flat planes; else it refuses to create one.
    pub planes: bool,
    /// A `dampfactor` is a share of critical damping; else N s/m.
    pub damping_is_ratio: bool,
}

/// How it speaks, and who holds it.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Answers begin with a header as requests do.
    pub headers: bool,
    /// Words and truth values in quotation marks, as in older versions; else with `;` behind.
    pub quoted: bool,
    /// Refuses `set` and `get` in one request.
    pub apart: bool,
    /// What it does with its effects.
    pub effects: EffectSettings,
    /// How long finding home takes; `None`: it knows where it is.
    pub homing: Option<Duration>,
    /// Friction (N s/m) and hand; the mass is set over the wire.
    pub arm: ArmSpec,
    /// Where the hand goes (m, the arm's axes).
    pub path: HandPath,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            headers: true,
            quoted: false,
            apart: false,
            effects: EffectSettings { kept: false, planes: true, damping_is_ratio: true },
            homing: Some(Duration::from_millis(300)),
            arm: ArmSpec { mass_kg: LEAST_INERTIA_KG, damping_n_s_per_m: 8.0, ..ArmSpec::default() },
            path: HandPath::resting_at(DVec3::ZERO),
        }
    }
}

/// It runs until dropped.
#[derive(Debug)]
pub struct HapticMaster {
    address: SocketAddr,
    /// What it does wrong.
    pub faults: Arc<Faults>,
    shared: Shared<Machine>,
    _running: Running,
}

impl HapticMaster {
    /// Listens at an address, with a thread of its own.
    ///
    /// # Errors
    /// When the address is taken, or the arm's constants are out of range.
    pub fn listen(address: &str, settings: Settings) -> std::io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let machine = Machine::new(settings).map_err(|error| std::io::Error::new(ErrorKind::InvalidInput, error))?;
        let shared = Shared::new(machine);
        let server = Server(shared.clone());
        let running = Running::start("hapticmaster", &shared.stop, move || server.run(&listener))?;
        Ok(Self { address, faults: Arc::clone(&shared.faults), shared, _running: running })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Force (N, the arm's axes) of all effects on it now.
    pub fn effect_n(&self) -> DVec3 {
        let mut machine = self.shared.machine();
        machine.go_on();
        machine.effect_n()
    }

    /// Force (N) of one effect on it now.
    pub fn effect_of_n(&self, name: &str) -> DVec3 {
        let mut machine = self.shared.machine();
        machine.go_on();
        machine.effects.force_of_n(name, &machine.arm.motion())
    }

    /// Whether it has an effect of that name, and it is enabled.
    pub fn is_enabled(&self, name: &str) -> bool {
        self.shared.machine().effects.is_enabled(name)
    }

    /// The longest that all effects together pushed (N), since this was last asked.
    pub fn peak_n(&self) -> f64 {
        let mut machine = self.shared.machine();
        machine.go_on();
        std::mem::take(&mut machine.peak_n)
    }

    /// The commands of a connection that is none: for tests of what it answers.
    pub fn obey(&self, text: &str) -> String {
        let mut machine = self.shared.machine();
        machine.go_on();
        machine.obey(text)
    }

    /// Where it is (m, its own axes).
    pub fn position_m(&self) -> DVec3 {
        let mut machine = self.shared.machine();
        machine.go_on();
        machine.arm.motion().position_m
    }

    /// Requests answered so far.
    pub fn requests(&self) -> u64 {
        self.shared.machine().requests
    }
}

struct Server(Shared<Machine>);

impl Server {
    fn run(&self, listener: &TcpListener) {
        while !Faults::is(&self.0.stop) {
            match listener.accept() {
                Ok((stream, _)) => {
                    let _ = self.serve(stream);
                    let mut machine = self.0.machine();
                    machine.go_on();
                    if !machine.settings.effects.kept {
                        machine.effects.clear();
                    }
                }
                Err(_) => std::thread::sleep(LOOK_EVERY),
            }
        }
    }

    fn serve(&self, mut stream: TcpStream) -> std::io::Result<()> {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(LOOK_EVERY))?;
        let mut waiting = Vec::new();
        let mut bytes = [0; 1024];
        while !self.0.is_over() {
            match stream.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(count) => waiting.extend_from_slice(&bytes[..count]),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => continue,
                Err(error) => return Err(error),
            }
            while let Some(text) = next_request(&mut waiting) {
                self.answer(&mut stream, &text)?;
            }
        }
        Ok(())
    }

    fn answer(&self, stream: &mut TcpStream, text: &str) -> std::io::Result<()> {
        let (answer, headers) = {
            let mut machine = self.0.machine();
            machine.go_on();
            machine.stopped = Faults::is(&self.0.faults.emergency_stop);
            machine.requests += 1;
            let answer = if Faults::is(&self.0.faults.refusal) { REFUSAL.to_owned() } else { machine.obey(text) };
            (answer, machine.settings.headers)
        };
        let slow = self.0.faults.slow_us.load(Ordering::Relaxed);
        std::thread::sleep(Duration::from_micros(slow.into()));
        if Faults::is(&self.0.faults.silence) {
            return Ok(());
        }
        let mut bytes = Vec::new();
        if Faults::is(&self.0.faults.garbage) {
            bytes.extend((0..64_u8).map(|i| i.wrapping_mul(37).wrapping_add(129)));
        } else if headers {
            grammar::frame(answer.as_bytes(), &mut bytes);
        } else {
            bytes.extend_from_slice(answer.as_bytes());
        }
        if Faults::is(&self.0.faults.split) {
            return bytes.iter().try_for_each(|byte| stream.write_all(&[*byte]).and_then(|()| stream.flush()));
        }
        stream.write_all(&bytes)
    }
}

/// Takes a whole request out of what came.
fn next_request(waiting: &mut Vec<u8>) -> Option<String> {
    let length = usize::from(*waiting.get(3)?);
    let end = grammar::HEADER_BYTES + length;
    if waiting.len() < end {
        return None;
    }
    let text = String::from_utf8_lossy(&waiting[grammar::HEADER_BYTES..end]).into_owned();
    waiting.drain(..end);
    Some(text)
}
