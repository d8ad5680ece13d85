//! A Haply 2diy that is not there, on a pseudo terminal: a board that has to be set up, encoders that count in steps, torques, a hand that holds the tool.
use super::{
    Faults,
    board::{Board, Held, Port},
};
use crate::device::haply_2diy::{Settings as Constants, wire};
use glam::{DVec2, DVec3, Vec3Swizzles as _};
use palpate_control::{ArmSpec, HandPath, ParameterError};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

/// No force of its motors is larger (N): where the links are in line it would be.
const MOST_N: f64 = 100.0;

/// What it is, and who holds it.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Its constants; the port's name does not count. No torque is larger than its largest, whatever is asked for.
    pub constants: Constants,
    /// Its angles are right wherever it is, as if the hand had held it in its home when it was set up; else encoders begin at their offsets wherever it is, as real ones do.
    pub knows_home: bool,
    /// Without a request for so long its motors are off; the published firmware keeps the last torques for ever.
    pub watchdog: Option<Duration>,
    /// Mass, friction and hand.
    pub arm: ArmSpec,
    /// Where the hand goes (m, the arm's axes; z is 0), from the first request on.
    pub path: HandPath,
}

/// It runs until dropped.
#[derive(Debug)]
pub struct Haply2diy {
    /// What it does wrong.
    pub faults: Arc<Faults>,
    port: Port<Machine>,
}

impl Haply2diy {
    /// Opens a pseudo terminal, with a thread of its own.
    ///
    /// # Errors
    /// When there is none to have, or the arm's constants are out of range.
    pub fn start(settings: Settings) -> std::io::Result<Self> {
        let port = Port::start("haply-2diy", Machine::new(settings))?;
        Ok(Self { faults: port.faults(), port })
    }

    /// Path of the port to open.
    pub fn port(&self) -> &str {
        self.port.path()
    }

    /// Force (N, the arm's axes) of its motors now.
    pub fn force_n(&self) -> DVec3 {
        let machine = self.port.board();
        force_n(&machine.settings.constants, machine.torques_nm, machine.held.position_m())
    }

    /// Where it is (m, its own axes).
    pub fn position_m(&self) -> DVec3 {
        self.port.board().held.position_m()
    }

    /// Requests that it heard.
    pub fn requests(&self) -> u64 {
        self.port.board().requests
    }
}

/// What a board knows once it is set up.
#[derive(Debug, Clone, Copy)]
struct SetUp {
    id: u8,
    /// In the order of ports.
    counts_per_turn: [f64; 2],
    /// What each angle (degrees) is less than it says.
    slip_deg: [f64; 2],
}

#[derive(Debug)]
struct Machine {
    settings: Settings,
    held: Held,
    heard: Vec<u8>,
    set_up: Option<SetUp>,
    torques_nm: DVec2,
    last: Option<Instant>,
    requests: u64,
    due: bool,
    /// Of the links (degrees), in the order of ports.
    angles_deg: [f64; 2],
}

/// `F = J⁻ᵀ τ`.
fn force_n(constants: &Constants, torques_nm: DVec2, tool_m: DVec3) -> DVec3 {
    let place = constants.kinematics.angles_rad(tool_m.xy()).and_then(|angles| constants.kinematics.place(angles));
    let Some(place) = place else { return DVec3::ZERO };
    let force_n = place.jacobian_m_per_rad.transpose().inverse() * torques_nm;
    if force_n.is_finite() { force_n.clamp_length_max(MOST_N).extend(0.0) } else { DVec3::ZERO }
}

impl Machine {
    fn new(settings: Settings) -> Result<Self, ParameterError> {
        let mut machine = Self {
            held: Held::new(settings.arm, settings.path.clone())?,
            heard: Vec::new(),
            set_up: None,
            torques_nm: DVec2::ZERO,
            last: None,
            requests: 0,
            due: false,
            angles_deg: [0.0; 2],
            settings,
        };
        machine.look();
        Ok(machine)
    }

    /// Out of reach the angles stay what they were.
    fn look(&mut self) {
        let constants = &self.settings.constants;
        if let Some(angles_rad) = constants.kinematics.angles_rad(self.held.position_m().xy()) {
            self.angles_deg = constants.swapped(angles_rad.map(f64::to_degrees).to_array());
        }
    }

    fn go_on(&mut self) {
        let is_late = |watchdog| self.last.is_some_and(|last| last.elapsed() > watchdog);
        if self.settings.watchdog.is_some_and(is_late) {
            self.torques_nm = DVec2::ZERO;
        }
        let Self { settings, torques_nm, .. } = self;
        self.held.go_on(|tool_m| force_n(&settings.constants, *torques_nm, tool_m));
        self.look();
    }

    /// Takes one whole message off what was heard; whether there was one. What it does not know it skips, as the firmware does.
    fn obey(&mut self) -> bool {
        let Some(&kind) = self.heard.first() else { return false };
        let length = match kind {
            wire::RESET => 2,
            wire::PARAMETERS => wire::SETUP,
            // Without motors there are no torques.
            wire::TORQUES => self.set_up.map_or(2, |_| wire::REQUEST),
            _ => 1,
        };
        if self.heard.len() < length {
            return false;
        }
        let message: Vec<u8> = self.heard.drain(..length).collect();
        self.go_on();
        match kind {
            // The published firmware forgets its motors, and leaves them the torques they have.
            wire::RESET => self.set_up = None,
            wire::PARAMETERS => self.set_up(&message),
            wire::TORQUES => self.push(&message),
            _ => {}
        }
        true
    }

    fn set_up(&mut self, message: &[u8]) {
        let numbers = |at: usize| message[at..at + 8].try_into().map(wire::numbers).unwrap_or_default();
        let [[a_deg, a_counts], [b_deg, b_counts]] = [numbers(10), numbers(18)];
        let constants = &self.settings.constants;
        let home_deg = constants.swapped(constants.axes.map(|axis| axis.offset_deg));
        let [a_now_deg, b_now_deg] = if self.settings.knows_home { home_deg } else { self.angles_deg };
        let slip_deg = [a_deg - a_now_deg, b_deg - b_now_deg];
        self.set_up = Some(SetUp { id: message[1], counts_per_turn: [a_counts, b_counts], slip_deg });
    }

    fn push(&mut self, message: &[u8]) {
        if self.set_up.is_none_or(|set_up| set_up.id != message[1]) {
            return;
        }
        let sent_nm = message[2..].try_into().map(wire::numbers).unwrap_or_default();
        let most_nm = self.settings.constants.max_torque_nm;
        let limited_nm = sent_nm.map(|nm: f64| if nm.is_nan() { 0.0 } else { nm.clamp(-most_nm, most_nm) });
        self.torques_nm = self.settings.constants.torques_nm(limited_nm);
        self.last = Some(Instant::now());
        self.held.begin();
        self.requests += 1;
        self.due = true;
    }
}

impl Board for Machine {
    fn hear(&mut self, bytes: &[u8], _baud: u32) {
        self.heard.extend_from_slice(bytes);
        while self.obey() {}
        self.go_on();
    }

    fn say(&mut self, bytes: &mut Vec<u8>) {
        if !std::mem::take(&mut self.due) {
            return;
        }
        let Some(set_up) = self.set_up else { return };
        let said_deg = std::array::from_fn(|axis| {
            let step_deg = 360.0 / set_up.counts_per_turn[axis];
            let angle_deg = self.angles_deg[axis] + set_up.slip_deg[axis];
            ((angle_deg / step_deg).round() * step_deg) as f32
        });
        bytes.extend_from_slice(&wire::reply(set_up.id, said_deg));
    }

    fn lose_power(&mut self) {
        self.torques_nm = DVec2::ZERO;
    }
}
