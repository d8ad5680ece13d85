//! What arms on serial lines share: a pseudo terminal with a board at its end, and a hand that holds the arm.
use super::{Faults, Running, Shared};
use glam::DVec3;
use palpate_control::{ArmSpec, HandPath, ParameterError, SimulatedArm};
use serialport::{SerialPort as _, TTYPort};
use std::{
    fmt::Debug,
    io::{ErrorKind, Read as _, Write as _},
    sync::{Arc, MutexGuard, atomic::Ordering},
    time::{Duration, Instant},
};

/// Step of an arm's motion (s).
const STEP_S: f64 = 1e-3;
/// How often a board looks what came.
const LOOK_EVERY: Duration = Duration::from_micros(200);

/// A board, as its line sees it.
pub(super) trait Board: Debug + Send + 'static {
    /// These bytes came, or none, while the line had a rate (bit/s).
    fn hear(&mut self, bytes: &[u8], baud: u32);
    /// What it says now, if anything; called after each [`Self::hear`].
    fn say(&mut self, bytes: &mut Vec<u8>);
    /// Its motors have no power any more.
    fn lose_power(&mut self);
}

/// A board at the end of a pseudo terminal. It runs until dropped.
#[derive(Debug)]
pub(super) struct Port<M> {
    path: String,
    shared: Shared<M>,
    _running: Running,
}

impl<M: Board> Port<M> {
    /// Opens a pseudo terminal, with a thread of its own.
    pub(super) fn start(name: &str, board: Result<M, ParameterError>) -> std::io::Result<Self> {
        let (ours, theirs) = TTYPort::pair()?;
        let path = theirs.name().ok_or_else(|| std::io::Error::other("the pseudo terminal has no name"))?;
        let shared = Shared::new(board.map_err(|error| std::io::Error::new(ErrorKind::InvalidInput, error))?);
        let line = Line(shared.clone());
        // Their end stays open here, or ours would end with whoever closes it.
        let running = Running::start(name, &shared.stop, move || line.run(ours, theirs))?;
        Ok(Self { path, shared, _running: running })
    }

    pub(super) fn path(&self) -> &str {
        &self.path
    }

    pub(super) fn faults(&self) -> Arc<Faults> {
        Arc::clone(&self.shared.faults)
    }

    pub(super) fn board(&self) -> MutexGuard<'_, M> {
        self.shared.machine()
    }
}

struct Line<M>(Shared<M>);

impl<M: Board> Line<M> {
    /// Both ends are closed when it is over, or its cable is pulled.
    fn run(&self, mut ours: TTYPort, _theirs: TTYPort) {
        let mut said = Vec::new();
        while !self.0.is_over() {
            let heard = hear(&mut ours);
            // Both ends of a pseudo terminal have one rate.
            let baud = ours.baud_rate().unwrap_or(0);
            said.clear();
            {
                let mut board = self.0.machine();
                board.hear(&heard, baud);
                board.say(&mut said);
            }
            if said.is_empty() {
                std::thread::sleep(LOOK_EVERY);
            } else {
                self.say(&mut ours, &said);
            }
        }
        // A pulled cable is noticed.
        self.0.machine().lose_power();
    }

    fn say(&self, ours: &mut TTYPort, said: &[u8]) {
        std::thread::sleep(Duration::from_micros(self.0.faults.slow_us.load(Ordering::Relaxed).into()));
        if Faults::is(&self.0.faults.silence) {
            return;
        }
        let garbage = Faults::is(&self.0.faults.garbage);
        let noise: Vec<u8> = (0..64_u8).map(|i| i.wrapping_mul(37).wrapping_add(129)).chain([b'\n']).collect();
        let bytes = if garbage { &noise } else { said };
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

/// An arm in a hand, which moves in real time once it has begun.
#[derive(Debug)]
pub(super) struct Held {
    arm: SimulatedArm,
    began: Option<Instant>,
    steps: u64,
}

impl Held {
    pub(super) fn new(arm: ArmSpec, path: HandPath) -> Result<Self, ParameterError> {
        Ok(Self { arm: SimulatedArm::new(arm, path, STEP_S)?, began: None, steps: 0 })
    }

    pub(super) fn begin(&mut self) {
        self.began.get_or_insert_with(Instant::now);
    }

    /// Where it is (m, its own axes).
    pub(super) fn position_m(&self) -> DVec3 {
        self.arm.motion().position_m
    }

    /// Steps (ms) that it has made.
    pub(super) fn steps(&self) -> u64 {
        self.steps
    }

    /// Moves on to now, under forces (N) that depend on where it is (m).
    pub(super) fn go_on(&mut self, force_n: impl Fn(DVec3) -> DVec3) {
        let Some(began) = self.began else { return };
        let due = (began.elapsed().as_secs_f64() / STEP_S) as u64;
        while self.steps < due {
            self.arm.step(force_n(self.position_m()));
            self.steps += 1;
        }
    }
}
