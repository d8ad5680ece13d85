//! A WoodenHaptics that is not there, on a pseudo terminal: encoders that count in steps, currents that become torques, a hand that holds the tool.
use super::{
    Faults,
    board::{Board, Held, Port},
};
use crate::device::{
    serial::Lines,
    woodenhaptics::{Settings as Constants, wire},
};
use glam::DVec3;
use palpate_control::{ArmSpec, HandPath, ParameterError};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

/// Without a line for so long its motors are off, and it says nothing.
const PATIENCE: Duration = Duration::from_millis(500);

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
    /// What it does wrong.
    pub faults: Arc<Faults>,
    port: Port<Machine>,
}

impl WoodenHaptics {
    /// Opens a pseudo terminal, with a thread of its own.
    ///
    /// # Errors
    /// When there is none to have, or the arm's constants are out of range.
    pub fn start(settings: Settings) -> std::io::Result<Self> {
        let port = Port::start("woodenhaptics", Machine::new(settings))?;
        Ok(Self { faults: port.faults(), port })
    }

    /// Path of the port to open.
    pub fn port(&self) -> &str {
        self.port.path()
    }

    /// Force (N, the arm's axes) of its motors now.
    pub fn force_n(&self) -> DVec3 {
        let machine = self.port.board();
        force_n(&machine.settings.constants, machine.currents_ma, machine.held.position_m())
    }

    /// Where it is (m, its own axes).
    pub fn position_m(&self) -> DVec3 {
        self.port.board().held.position_m()
    }

    /// Lines that it heard.
    pub fn lines(&self) -> u64 {
        self.port.board().heard_lines
    }
}

#[derive(Debug)]
struct Machine {
    settings: Settings,
    held: Held,
    lines: Lines,
    currents_ma: [i16; 3],
    heard: Option<Instant>,
    heard_lines: u64,
    /// Lines to answer, if it answers.
    due: u64,
    /// Steps of the arm when it last said where it is.
    said: u64,
    counts: [i16; 3],
    text: Vec<u8>,
}

/// `F = J⁻ᵀ τ`.
fn force_n(constants: &Constants, currents_ma: [i16; 3], tool_m: DVec3) -> DVec3 {
    let Some(angles_rad) = constants.kinematics.angles_rad(tool_m) else { return DVec3::ZERO };
    let jacobian = constants.kinematics.jacobian_m_per_rad(angles_rad);
    let force_n = jacobian.transpose().inverse() * constants.torques_nm(currents_ma);
    if force_n.is_finite() { force_n } else { DVec3::ZERO }
}

impl Machine {
    fn new(settings: Settings) -> Result<Self, ParameterError> {
        let mut lines = Lines::default();
        // The first byte it hears begins a line.
        let _ = lines.take(b'\n');
        Ok(Self {
            held: Held::new(settings.arm, settings.path.clone())?,
            lines,
            currents_ma: [0; 3],
            heard: None,
            heard_lines: 0,
            due: 0,
            said: 0,
            counts: [0; 3],
            text: Vec::new(),
            settings,
        })
    }

    fn is_on(&self) -> bool {
        self.heard.is_some_and(|heard| heard.elapsed() < PATIENCE)
    }

    fn go_on(&mut self) {
        if !self.is_on() {
            self.currents_ma = [0; 3];
        }
        let Self { settings, currents_ma, .. } = self;
        self.held.go_on(|tool_m| force_n(&settings.constants, *currents_ma, tool_m));
    }

    /// Out of reach they stay where they were.
    fn counts(&mut self) -> [i16; 3] {
        let constants = &self.settings.constants;
        if let Some(angles_rad) = constants.kinematics.angles_rad(self.held.position_m()) {
            let counts = (angles_rad / constants.rad_per_count()).round().to_array();
            let home = constants.home_counts;
            self.counts = std::array::from_fn(|axis| (counts[axis] as i16).saturating_add(home[axis]));
        }
        self.counts
    }
}

impl Board for Machine {
    fn hear(&mut self, bytes: &[u8], _baud: u32) {
        for &byte in bytes {
            let Ok(Some(line)) = self.lines.take(byte) else { continue };
            let Ok([a, b, c, ..]) = wire::parse(line) else { continue };
            self.go_on();
            self.currents_ma = [a, b, c];
            self.heard = Some(Instant::now());
            self.held.begin();
            self.heard_lines += 1;
            self.due += 1;
        }
        self.go_on();
    }

    fn say(&mut self, bytes: &mut Vec<u8>) {
        let steps = self.held.steps();
        let is_due = if self.settings.answers { self.due > 0 } else { steps > self.said };
        (self.due, self.said) = (0, steps);
        if is_due && self.is_on() {
            let [a, b, c] = self.counts();
            wire::write([a, b, c, 0, 0, 0, 0], &mut self.text);
            bytes.extend_from_slice(&self.text);
        }
    }

    fn lose_power(&mut self) {
        self.currents_ma = [0; 3];
    }
}
