//! A WoodenHaptics that is not there, on a pseudo terminal: encoders that count in steps, currents that become torques, a hand that holds the tool.
use super::{Faults, Running, Shared};
use crate::device::{
    serial::Lines,
    woodenhaptics::{Settings as Constants, wire},
};
use glam::DVec3;
use palpate_control::{ArmSpec, HandPath, ParameterError, SimulatedArm};
use serialport::{SerialPort as _, TTYPort};
use std::{
    io::{ErrorKind, Read as _, Write as _},
    sync::{Arc, atomic::Ordering},
    time::{Duration, Instant},
};

/// Step of its motion, and between its lines when it sends by itself (s).
const STEP_S: f64 = 1e-3;
/// Without a line for so long its motors are off, and it says nothing.
const PATIENCE: Duration = Duration::from_millis(500);
/// How often it looks what came.
const LOOK_EVERY: Duration = Duration::from_micros(200);

/// What it is, and who holds it.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Its constants; the port's name does not count.
    pub constants: Constants,
    /// Says a line for each that it hears; else one every millisecond, once it heard one.
    pub answers: bool,
    /// Mass, friction and hand.
    pub arm: ArmSpec,
    /// Where the hand goes (m, the arm's axes), from the first line on.
    pub path: HandPath,
}

/// It runs until dropped.
#[derive(Debug)]
pub struct WoodenHaptics {
    port: String,
    /// What it does wrong.
    pub faults: Arc<Faults>,
    shared: Shared<Machine>,
    _running: Running,
}

impl WoodenHaptics {
    /// Opens a pseudo terminal, with a thread of its own.
    ///
    /// # Errors
    /// When there is none to have, or the arm's constants are out of range.
    pub fn start(settings: Settings) -> std::io::Result<Self> {
        let (ours, theirs) = TTYPort::pair()?;
        let port = theirs.name().ok_or_else(|| std::io::Error::other("the pseudo terminal has no name"))?;
        let machine = Machine::new(settings).map_err(|error| std::io::Error::new(ErrorKind::InvalidInput, error))?;
        let shared = Shared::new(machine);
        let board = Board(shared.clone());
        // Their end stays open here, or ours would end with whoever closes it.
        let running = Running::start("woodenhaptics", &shared.stop, move || board.run(ours, theirs))?;
        Ok(Self { port, faults: Arc::clone(&shared.faults), shared, _running: running })
    }

    /// Path of the port to open.
    pub fn port(&self) -> &str {
        &self.port
    }

    /// Force (N, the arm's axes) of its motors now.
    pub fn force_n(&self) -> DVec3 {
        self.shared.machine().force_n()
    }

    /// Where it is (m, its own axes).
    pub fn position_m(&self) -> DVec3 {
        self.shared.machine().arm.motion().position_m
    }

    /// Lines that it heard.
    pub fn lines(&self) -> u64 {
        self.shared.machine().lines
    }
}

struct Board(Shared<Machine>);

impl Board {
    /// Both ends are closed when it is over, or its cable is pulled.
    fn run(&self, mut ours: TTYPort, _theirs: TTYPort) {
        let mut lines = Lines::default();
        // The first byte it hears begins a line.
        let _ = lines.take(b'\n');
        let (mut said, mut text) = (0, Vec::new());
        while !self.0.is_over() {
            let heard = hear(&mut ours);
            let line = {
                let mut machine = self.0.machine();
                let mut answers = 0;
                for byte in heard {
                    if let Ok(Some(line)) = lines.take(byte) {
                        answers += u64::from(machine.obey(line));
                    }
                }
                machine.go_on();
                let due = if machine.settings.answers { answers > 0 } else { machine.steps > said };
                said = machine.steps;
                (due && machine.is_on()).then(|| machine.counts())
            };
            match line {
                Some(counts) => {
                    let [a, b, c] = counts;
                    wire::write([a, b, c, 0, 0, 0, 0], &mut text);
                    self.say(&mut ours, &text);
                }
                None => std::thread::sleep(LOOK_EVERY),
            }
        }
        // A pulled cable is noticed; its machine has no power.
        self.0.machine().currents_ma = [0; 3];
    }

    fn say(&self, ours: &mut TTYPort, text: &[u8]) {
        std::thread::sleep(Duration::from_micros(self.0.faults.slow_us.load(Ordering::Relaxed).into()));
        if Faults::is(&self.0.faults.silence) {
            return;
        }
        let garbage = Faults::is(&self.0.faults.garbage);
        let noise: Vec<u8> = (0..64_u8).map(|i| i.wrapping_mul(37).wrapping_add(129)).chain([b'\n']).collect();
        let bytes = if garbage { &noise } else { text };
        let at_once = if Faults::is(&self.0.faults.split) { 1 } else { bytes.len() };
        // Nobody there to hear it is no matter.
        let _ = bytes.chunks(at_once).try_for_each(|part| ours.write_all(part));
    }
}

fn hear(ours: &mut TTYPort) -> Vec<u8> {
    let there = ours.bytes_to_read().unwrap_or(0);
    let mut bytes = vec![0; there as usize];
    let count = if there == 0 { 0 } else { ours.read(&mut bytes).unwrap_or(0) };
    bytes.truncate(count);
    bytes
}

#[derive(Debug)]
struct Machine {
    settings: Settings,
    arm: SimulatedArm,
    currents_ma: [i16; 3],
    heard: Option<Instant>,
    began: Option<Instant>,
    steps: u64,
    lines: u64,
    counts: [i16; 3],
}

impl Machine {
    fn new(settings: Settings) -> Result<Self, ParameterError> {
        Ok(Self {
            arm: SimulatedArm::new(settings.arm, settings.path.clone(), STEP_S)?,
            currents_ma: [0; 3],
            heard: None,
            began: None,
            steps: 0,
            lines: 0,
            counts: [0; 3],
            settings,
        })
    }

    fn obey(&mut self, line: &[u8]) -> bool {
        let Ok([a, b, c, ..]) = wire::parse(line) else { return false };
        self.go_on();
        self.currents_ma = [a, b, c];
        self.heard = Some(Instant::now());
        self.began.get_or_insert_with(Instant::now);
        self.lines += 1;
        true
    }

    fn is_on(&self) -> bool {
        self.heard.is_some_and(|heard| heard.elapsed() < PATIENCE)
    }

    /// `F = J⁻ᵀ τ`.
    fn force_n(&self) -> DVec3 {
        let constants = &self.settings.constants;
        let tool_m = self.arm.motion().position_m;
        let Some(angles_rad) = constants.kinematics.angles_rad(tool_m) else { return DVec3::ZERO };
        let jacobian = constants.kinematics.jacobian_m_per_rad(angles_rad);
        let force_n = jacobian.transpose().inverse() * constants.torques_nm(self.currents_ma);
        if force_n.is_finite() { force_n } else { DVec3::ZERO }
    }

    fn go_on(&mut self) {
        if !self.is_on() {
            self.currents_ma = [0; 3];
        }
        let Some(began) = self.began else { return };
        let due = (began.elapsed().as_secs_f64() / STEP_S) as u64;
        while self.steps < due {
            let force_n = self.force_n();
            self.arm.step(force_n);
            self.steps += 1;
        }
    }

    /// Out of reach they stay where they were.
    fn counts(&mut self) -> [i16; 3] {
        let constants = &self.settings.constants;
        if let Some(angles_rad) = constants.kinematics.angles_rad(self.arm.motion().position_m) {
            let counts = (angles_rad / constants.rad_per_count()).round().to_array();
            let home = constants.home_counts;
            self.counts = std::array::from_fn(|axis| (counts[axis] as i16).saturating_add(home[axis]));
        }
        self.counts
    }
}
