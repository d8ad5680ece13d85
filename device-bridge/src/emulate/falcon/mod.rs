//! A Falcon that is not there, on a pseudo terminal: a loader, a firmware that knows no home at first, encoders that count in steps, torques, a hand that holds the grip.
mod loader;

use super::{
    Faults,
    board::{Board, Held, Port},
};
use crate::device::falcon::{
    BAUD, RAD_PER_COUNT, Settings as Constants, kinematics,
    wire::{self, Frame, Frames},
};
use glam::DVec3;
use loader::Loader;
use palpate_control::{ArmSpec, HandPath, ParameterError};
use std::{
    sync::{Arc, atomic::Ordering},
    time::{Duration, Instant},
};

/// Its stops: so far from the middle (m) they begin, and are so stiff (N/m).
const STOPS_M: f64 = 0.05;
const STOPS_N_PER_M: f64 = 5000.0;

/// What it is, and who holds it.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Its constants; the port's name, the firmware and the time for homing do not count.
    pub constants: Constants,
    /// What has to be loaded before it runs; absent: it runs.
    pub firmware: Option<Vec<u8>>,
    /// How long the hand takes to show it its home, from the first frame that asks for that on.
    pub homing: Duration,
    /// Without a frame for so long its motors are off; whether real ones do so is not public.
    pub watchdog: Option<Duration>,
    /// Mass, friction and hand.
    pub arm: ArmSpec,
    /// Where the hand goes (m, the arm's axes), from the moment on when it knows its home.
    pub path: HandPath,
}

/// It runs until dropped.
#[derive(Debug)]
pub struct Falcon {
    /// What it does wrong.
    pub faults: Arc<Faults>,
    port: Port<Machine>,
}

impl Falcon {
    /// Opens a pseudo terminal, with a thread of its own.
    ///
    /// # Errors
    /// When there is none to have, or the arm's constants are out of range.
    pub fn start(settings: Settings) -> std::io::Result<Self> {
        let port = Port::start("falcon", Machine::new(settings))?;
        let faults = port.faults();
        port.board().faults = Arc::clone(&faults);
        Ok(Self { faults, port })
    }

    /// Path of the port to open.
    pub fn port(&self) -> &str {
        self.port.path()
    }

    /// Force (N, the arm's axes) of its motors now.
    pub fn force_n(&self) -> DVec3 {
        let machine = self.port.board();
        force_n(&machine.settings.constants, machine.units, machine.held.position_m())
    }

    /// Where it is (m, its own axes).
    pub fn position_m(&self) -> DVec3 {
        self.port.board().held.position_m()
    }

    /// Frames that it heard.
    pub fn frames(&self) -> u64 {
        self.port.board().heard_frames
    }

    /// Lights that are on ([`wire::RED`] and so on).
    pub fn lights(&self) -> u8 {
        self.port.board().lights
    }

    /// Presses these of its buttons, and lets go of all others.
    pub fn press(&self, buttons: u8) {
        self.port.board().buttons = buttons & wire::BUTTONS;
    }

    /// Without power for a moment: it forgets its home, though not its firmware.
    pub fn lose_home(&self) {
        let mut machine = self.port.board();
        (machine.units, machine.looking_since) = ([0; 3], None);
    }
}

#[derive(Debug)]
struct Machine {
    settings: Settings,
    faults: Arc<Faults>,
    held: Held,
    loader: Option<Loader>,
    frames: Frames,
    units: [i16; 3],
    lights: u8,
    buttons: u8,
    heard: Option<Instant>,
    heard_frames: u64,
    /// Frames to answer.
    due: u64,
    looking_since: Option<Instant>,
    counts: [i16; 3],
    /// What a loader says.
    said: Vec<u8>,
}

/// `F = Wᵀ τ`.
fn force_n(constants: &Constants, units: [i16; 3], grip_m: DVec3) -> DVec3 {
    let legs = kinematics::legs(grip_m + constants.centre_m);
    legs.map_or(DVec3::ZERO, |legs| legs.slope_rad_per_m.transpose() * constants.torques_nm(units))
}

/// What its stops push with (N).
fn stops_n(constants: &Constants, grip_m: DVec3) -> DVec3 {
    let from_middle_m = grip_m + constants.centre_m - kinematics::MIDDLE_M;
    STOPS_N_PER_M * (from_middle_m.clamp_length_max(STOPS_M) - from_middle_m)
}

impl Machine {
    fn new(settings: Settings) -> Result<Self, ParameterError> {
        Ok(Self {
            faults: Arc::default(),
            held: Held::new(settings.arm, settings.path.clone())?,
            loader: settings.firmware.clone().map(Loader::new),
            frames: Frames::default(),
            units: [0; 3],
            lights: 0,
            buttons: 0,
            heard: None,
            heard_frames: 0,
            due: 0,
            looking_since: None,
            counts: [0; 3],
            said: Vec::new(),
            settings,
        })
    }

    fn obey(&mut self, frame: Frame) {
        self.go_on();
        self.units = frame.numbers;
        self.lights = frame.flags & (wire::GREEN | wire::BLUE | wire::RED);
        if frame.flags & wire::HOMING != 0 {
            self.looking_since.get_or_insert_with(Instant::now);
        }
        self.heard = Some(Instant::now());
        self.heard_frames += 1;
        self.due += 1;
    }

    /// Legs come home one after another.
    fn homed(&self) -> u8 {
        let Some(since) = self.looking_since else { return 0 };
        let legs = 3.0 * since.elapsed().as_secs_f64() / self.settings.homing.as_secs_f64().max(1e-9);
        match legs {
            0.0..1.0 => 0x00,
            1.0..2.0 => 0x10,
            2.0..3.0 => 0x30,
            _ => wire::HOMED,
        }
    }

    fn go_on(&mut self) {
        let is_late = |watchdog| self.heard.is_none_or(|heard| heard.elapsed() > watchdog);
        if self.settings.watchdog.is_some_and(is_late) {
            self.units = [0; 3];
        }
        if self.homed() == wire::HOMED {
            self.held.begin();
        }
        let Self { settings: Settings { constants, .. }, units, .. } = self;
        self.held.go_on(|grip_m| force_n(constants, *units, grip_m) + stops_n(constants, grip_m));
    }

    /// Out of reach they stay where they were.
    fn counts(&mut self) -> [i16; 3] {
        let constants = &self.settings.constants;
        if let Some(legs) = kinematics::legs(self.held.position_m() + constants.centre_m) {
            let counts = (legs.angles_rad - constants.zero_rad) / RAD_PER_COUNT;
            self.counts = counts.round().to_array().map(|count| count as i16);
        }
        let homed = self.homed();
        // A leg counts from wherever it was until it comes home.
        std::array::from_fn(|leg| if homed & 0x10 << leg == 0 { 0 } else { self.counts[leg] })
    }
}

impl Board for Machine {
    fn hear(&mut self, bytes: &[u8], baud: u32) {
        let is_deaf = self.faults.refusal.load(Ordering::Relaxed);
        for &byte in bytes {
            if let Some(loader) = &mut self.loader {
                self.said.extend(loader.take(byte, baud, is_deaf));
                if loader.is_loaded() && baud == BAUD {
                    self.loader = None;
                }
            }
            // At another rate they are no letters.
            if self.loader.is_none() && baud == BAUD {
                match self.frames.take(byte) {
                    Ok(Some(frame)) => self.obey(frame),
                    Ok(None) => {}
                    Err(_) => self.frames = Frames::default(),
                }
            }
        }
        self.go_on();
    }

    fn say(&mut self, bytes: &mut Vec<u8>) {
        bytes.append(&mut self.said);
        for _ in 0..std::mem::take(&mut self.due) {
            let frame = Frame { numbers: self.counts(), flags: self.homed() | self.buttons };
            bytes.extend_from_slice(&frame.bytes());
        }
    }

    fn lose_power(&mut self) {
        self.units = [0; 3];
    }
}
