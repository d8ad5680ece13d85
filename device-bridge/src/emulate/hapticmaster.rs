//! A HapticMASTER that is not there. `m a = F_hand + Σ F_effects − b v`, in steps of 0.4 ms of real time; its effects end with the connection, unless it keeps them.
mod effects;

use super::{Faults, Running, Shared};
use crate::device::hapticmaster::{grammar, plane::DampFactor};
use effects::Effects;
use glam::DVec3;
use palpate_control::{ArmSpec, HandPath, ParameterError, SimulatedArm};
use std::{
    io::{ErrorKind, Read as _, Write as _},
    net::{SocketAddr, TcpListener, TcpStream},
    sync::{Arc, atomic::Ordering},
    time::{Duration, Instant},
};

/// Step of its motion (s): its inner loop is said to run at 2.5 kHz.
const STEP_S: f64 = 4e-4;
/// What it bears at most (N).
const MAX_FORCE_N: f64 = 100.0;
/// The inertia it cannot be set below (kg).
const LEAST_INERTIA_KG: f64 = 2.0;
/// Its answer to everything, when it is to refuse.
const REFUSAL: &str = "--- ERROR: not now";
/// How often it looks whether it shall stop, when nothing comes.
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// How it speaks, and who holds it.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Answers begin with a header as requests do.
    pub headers: bool,
    /// Words and truth values in quotation marks, as in older versions; else with `;` behind.
    pub quoted: bool,
    /// Refuses `set` and `get` in one request.
    pub apart: bool,
    /// Effects stay when a connection ends, and act until the next one removes them.
    pub keeps_effects: bool,
    /// A `dampfactor` is a share of critical damping; else N s/m.
    pub damping_is_ratio: bool,
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
            keeps_effects: false,
            damping_is_ratio: true,
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
                    if !machine.settings.keeps_effects {
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

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Off,
    Init(Instant),
    Stop,
    Force,
}

#[derive(Debug)]
struct Machine {
    settings: Settings,
    arm: SimulatedArm,
    state: State,
    homed: bool,
    stopped: bool,
    effects: Effects,
    peak_n: f64,
    began: Option<Instant>,
    steps: u64,
    requests: u64,
}

impl Machine {
    fn new(settings: Settings) -> Result<Self, ParameterError> {
        Ok(Self {
            arm: SimulatedArm::new(settings.arm, settings.path.clone(), STEP_S)?,
            state: State::Off,
            homed: settings.homing.is_none(),
            stopped: false,
            effects: Effects::new(damp_factor(&settings)),
            peak_n: 0.0,
            began: None,
            steps: 0,
            requests: 0,
            settings,
        })
    }

    fn effect_n(&self) -> DVec3 {
        if self.state != State::Force || self.stopped {
            return DVec3::ZERO;
        }
        self.effects.force_n(&self.arm.motion()).clamp_length_max(MAX_FORCE_N)
    }

    /// Motion up to now; the hand begins on its path with the first force.
    fn go_on(&mut self) {
        if let State::Init(since) = self.state
            && since.elapsed() >= self.settings.homing.unwrap_or_default()
        {
            (self.state, self.homed) = (State::Stop, true);
        }
        let Some(began) = self.began else { return };
        let due = (began.elapsed().as_secs_f64() / STEP_S) as u64;
        while self.steps < due {
            let force_n = self.effect_n();
            self.peak_n = self.peak_n.max(force_n.length());
            self.arm.step(force_n);
            self.steps += 1;
        }
    }

    fn obey(&mut self, text: &str) -> String {
        let commands: Vec<&str> = text.split(';').map(str::trim).collect();
        let is_get = |command: &&str| command.starts_with("get ");
        if self.settings.apart && commands.iter().any(is_get) && !commands.iter().all(is_get) {
            return "--- ERROR: set and get in one request".into();
        }
        let answers: Vec<String> = commands.into_iter().map(|command| self.command(command)).collect();
        // One `;` between two answers, whatever each ends with.
        let trimmed = |answer: &String| answer.trim_end_matches(';').to_owned();
        match &answers[..] {
            [one] => one.clone(),
            _ => answers.iter().map(trimmed).collect::<Vec<_>>().join(";"),
        }
    }

    fn command(&mut self, command: &str) -> String {
        let words: Vec<&str> = command.split_whitespace().collect();
        match words[..] {
            ["get", what] => self.get(what),
            ["remove", "all"] => {
                self.effects.clear();
                "Removed".into()
            }
            ["create", kind, name] => self.effects.create(kind, name).unwrap_or_else(|| unknown(command)),
            ["set", "state", state] => self.set_state(state),
            ["set", "inertia", kg] => self.set_inertia(kg),
            ["set", name, ref what @ ..] => self.effects.set(name, what).unwrap_or_else(|| unknown(command)),
            _ => unknown(command),
        }
    }

    fn get(&self, what: &str) -> String {
        let motion = self.arm.motion();
        // Six digits, as C's `%g` gives them.
        let vector = |v: DVec3| format!("[{:.5e},{:.5e},{:.5e}]", v.x, v.y, v.z);
        let word = |text: &str| if self.settings.quoted { format!("\"{text}\"") } else { format!("{text};") };
        match what {
            "modelpos" | "measpos" => vector(motion.position_m),
            "modelvel" => vector(motion.velocity_m_per_s),
            "measforce" => vector(self.arm.hand_force_n()),
            "os" => word("palpate emulator"),
            "emergencybuttonpushed" => word(if self.stopped { "true" } else { "false" }),
            "position_calibrated" => word(if self.homed { "true" } else { "false" }),
            "state" => word(match self.state {
                State::Off => "off",
                State::Init(_) => "init",
                State::Stop => "stop",
                State::Force => "force",
            }),
            _ => unknown(what),
        }
    }

    fn set_state(&mut self, state: &str) -> String {
        self.state = match state {
            "init" => State::Init(Instant::now()),
            "stop" => State::Stop,
            "off" => State::Off,
            "force" if self.homed => State::Force,
            "force" => return "--- ERROR: position not calibrated".into(),
            _ => return unknown(state),
        };
        if self.state == State::Force {
            self.began.get_or_insert_with(Instant::now);
        }
        format!("state set to '{state}'")
    }

    fn set_inertia(&mut self, kg: &str) -> String {
        let kg: f64 = kg.parse().unwrap_or(f64::NAN);
        let spec = ArmSpec { mass_kg: kg, ..self.settings.arm };
        match SimulatedArm::new(spec, self.settings.path.clone(), STEP_S) {
            Ok(arm) if kg >= LEAST_INERTIA_KG && self.began.is_none() => {
                self.arm = arm;
                self.settings.arm.mass_kg = kg;
                self.effects.mean(damp_factor(&self.settings));
                "Inertia set".into()
            }
            // The next one to start it finds it moving.
            Ok(_) if kg == self.settings.arm.mass_kg => "Inertia set".into(),
            _ => format!("--- ERROR: inertia must be at least {LEAST_INERTIA_KG}"),
        }
    }
}

fn damp_factor(settings: &Settings) -> DampFactor {
    let inertia_kg = settings.arm.mass_kg;
    if settings.damping_is_ratio { DampFactor::Ratio { inertia_kg } } else { DampFactor::Coefficient }
}

fn unknown(command: &str) -> String {
    format!("--- ERROR: unknown command {command}")
}
