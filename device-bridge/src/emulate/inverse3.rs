//! A Haply Inverse3 that is not there, behind a service of its own: a WebSocket server, the motion of an arm in a hand, and a grip.
use super::{Faults, Listening, Shared};
use crate::device::inverse3::Dialect;
use glam::{DQuat, DVec3};
use palpate_control::{ArmSpec, HandPath, ParameterError, SimulatedArm};
use serde_json::{Value, json};
use std::{
    io::{ErrorKind, Read, Write},
    net::TcpStream,
    sync::{Arc, atomic::Ordering},
    time::{Duration, Instant},
};
use tungstenite::{
    Error, Message, WebSocket,
    protocol::frame::{
        Frame,
        coding::{Data, OpCode},
    },
};

/// Name of the arm.
pub const DEVICE_ID: &str = "04BA";
/// Name of its grip.
pub const GRIP_ID: &str = "61548";
/// Step of its motion, and between its states when they come by themselves (s).
const STEP_S: f64 = 1e-3;
/// Without a command for so long the arm has no force, and says nothing by itself. How long it is for the real one is not known.
const PATIENCE: Duration = Duration::from_millis(100);
/// How often it looks whether it shall stop, when nothing comes.
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// What turns the tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grip {
    /// Nothing.
    None,
    /// One without a cable: three buttons.
    Wireless,
    /// One with a cable: one button.
    Wired,
}

/// What comes when it sends garbage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Garbage {
    /// Bytes that are no WebSocket.
    Bytes,
    /// A message that is no JSON.
    Text,
    /// JSON without a velocity.
    Lacking,
    /// A position out of all reach.
    Huge,
}

impl Garbage {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Bytes, Self::Text, Self::Lacking, Self::Huge];
}

/// How it speaks, and who holds it.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Forces told otherwise are none; `None`: it obeys both.
    pub dialect: Option<Dialect>,
    /// What turns the tool.
    pub grip: Grip,
    /// States come by themselves, as long as commands do; else one for each command.
    pub streams: bool,
    /// So many copies of each state, at once.
    pub copies: usize,
    /// Other arms of the service, named before this one.
    pub others: usize,
    /// Says that it is not calibrated.
    pub uncalibrated: bool,
    /// What comes when it sends garbage.
    pub garbage: Garbage,
    /// Mass, friction and hand.
    pub arm: ArmSpec,
    /// Where the hand goes (m, the service's axes), from the first command on.
    pub path: HandPath,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            dialect: None,
            grip: Grip::Wireless,
            streams: false,
            copies: 1,
            others: 0,
            uncalibrated: false,
            garbage: Garbage::Text,
            arm: ArmSpec::default(),
            path: HandPath::resting_at(DVec3::ZERO),
        }
    }
}

/// It runs until dropped.
#[derive(Debug)]
pub struct Inverse3 {
    /// What it does wrong.
    pub faults: Arc<Faults>,
    listening: Listening<Machine>,
}

impl Inverse3 {
    /// Listens at an address, with a thread of its own.
    ///
    /// # Errors
    /// When the address is taken, or the arm's constants are out of range.
    pub fn listen(address: &str, settings: Settings) -> std::io::Result<Self> {
        let listening = Listening::start("inverse3", address, Machine::new(settings), |shared, stream| {
            // Who hangs up is served no more; the arm has no force then.
            let _ = Server(shared).serve(stream);
            shared.machine().force_n = DVec3::ZERO;
        })?;
        Ok(Self { faults: Arc::clone(&listening.shared.faults), listening })
    }

    /// Where it listens.
    pub fn url(&self) -> String {
        format!("ws://{}", self.listening.address)
    }

    /// Force (N, the service's axes) on the arm now.
    pub fn force_n(&self) -> DVec3 {
        let mut machine = self.listening.machine();
        machine.go_on();
        machine.force_n
    }

    /// Where it is (m, the service's axes).
    pub fn position_m(&self) -> DVec3 {
        let mut machine = self.listening.machine();
        machine.go_on();
        machine.arm.motion().position_m
    }

    /// Turns the grip, and presses its buttons (a, b and c are the bits 0, 1 and 2).
    pub fn hold_grip(&self, orientation: DQuat, buttons: u32) {
        self.listening.machine().held = (orientation, buttons);
    }

    /// Commands that it heard.
    pub fn commands(&self) -> u64 {
        self.listening.machine().commands
    }
}

/// A stream whose bytes go one by one when they are to be split and it is open: a handshake in hundreds of pieces is taken for
/// an attack.
struct Splitting {
    stream: TcpStream,
    faults: Arc<Faults>,
    is_open: bool,
}

impl Read for Splitting {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        self.stream.read(into)
    }
}

impl Write for Splitting {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let most = if self.is_open && Faults::is(&self.faults.split) { 1 } else { bytes.len() };
        self.stream.write(&bytes[..most])
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.stream.flush()
    }
}

struct Server<'a>(&'a Shared<Machine>);

impl Server<'_> {
    fn serve(&self, stream: TcpStream) -> Result<(), Error> {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(Duration::from_secs(2)))?;
        let splitting = Splitting { stream, faults: Arc::clone(&self.0.faults), is_open: false };
        let mut socket = tungstenite::accept(splitting).map_err(|_| Error::ConnectionClosed)?;
        socket.get_mut().is_open = true;
        socket.get_ref().stream.set_read_timeout(Some(LOOK_EVERY))?;
        let first = self.0.machine().state(true);
        self.say(&mut socket, &first)?;
        while !self.0.is_over() {
            let heard = match socket.read() {
                Ok(message) => message.into_data(),
                Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    tungstenite::Bytes::new()
                }
                Err(error) => return Err(error),
            };
            let (states, streams) = {
                let mut machine = self.0.machine();
                let answers = u64::from(machine.obey(&heard));
                machine.go_on();
                // Whoever looks at the arm moves it on, too.
                let passed = u64::from(machine.steps > machine.told_steps);
                machine.told_steps = machine.steps;
                (if machine.settings.streams { passed } else { answers }, machine.settings.streams)
            };
            if states > 0 && !(streams && self.0.machine().is_idle()) {
                let state = self.0.machine().state(false);
                self.say(&mut socket, &state)?;
            }
        }
        if Faults::is(&self.0.faults.cut) {
            return Ok(());
        }
        socket.close(None)?;
        while socket.read().is_ok() {}
        Ok(())
    }

    fn say(&self, socket: &mut WebSocket<Splitting>, state: &Value) -> Result<(), Error> {
        std::thread::sleep(Duration::from_micros(self.0.faults.slow_us.load(Ordering::Relaxed).into()));
        if Faults::is(&self.0.faults.silence) {
            return Ok(());
        }
        let (copies, garbage) = {
            let settings = &self.0.machine().settings;
            (settings.copies, settings.garbage)
        };
        if Faults::is(&self.0.faults.garbage) {
            return say_garbage(socket, garbage);
        }
        let text = state.to_string();
        for _ in 0..copies {
            if Faults::is(&self.0.faults.split) {
                write_in_parts(socket, &text)?;
            } else {
                socket.write(Message::text(text.as_str()))?;
            }
        }
        socket.flush()
    }
}

/// Three frames make the message.
fn write_in_parts(socket: &mut WebSocket<Splitting>, text: &str) -> Result<(), Error> {
    let part = text.len() / 3 + 1;
    let last = text.len().div_ceil(part) - 1;
    for (index, bytes) in text.as_bytes().chunks(part).enumerate() {
        let kind = if index == 0 { Data::Text } else { Data::Continue };
        socket.write(Message::Frame(Frame::message(bytes.to_vec(), OpCode::Data(kind), index == last)))?;
    }
    Ok(())
}

fn say_garbage(socket: &mut WebSocket<Splitting>, garbage: Garbage) -> Result<(), Error> {
    let vector = |x: f64| json!({ "x": x, "y": 0.0, "z": 0.0 });
    let arm = |state: Value| json!({ "inverse3": [{ "device_id": DEVICE_ID, "state": state }] }).to_string();
    match garbage {
        Garbage::Bytes => {
            let noise: Vec<u8> = (0..64_u8).map(|i| i.wrapping_mul(37).wrapping_add(129)).collect();
            Ok(socket.get_mut().write_all(&noise)?)
        }
        Garbage::Text => socket.send(Message::text("{\"inverse3\": [NaN]}")),
        Garbage::Lacking => socket.send(Message::text(arm(json!({ "cursor_position": vector(0.1) })))),
        Garbage::Huge => {
            let state = json!({ "cursor_position": vector(1e300), "cursor_velocity": vector(0.0) });
            socket.send(Message::text(arm(state)))
        }
    }
}

#[derive(Debug)]
struct Machine {
    settings: Settings,
    arm: SimulatedArm,
    force_n: DVec3,
    /// How the grip is turned, and its buttons.
    held: (DQuat, u32),
    heard: Option<Instant>,
    began: Option<Instant>,
    steps: u64,
    /// Those that a stream of states has told of.
    told_steps: u64,
    commands: u64,
}

impl Machine {
    fn new(settings: Settings) -> Result<Self, ParameterError> {
        Ok(Self {
            arm: SimulatedArm::new(settings.arm, settings.path.clone(), STEP_S)?,
            force_n: DVec3::ZERO,
            held: (DQuat::IDENTITY, 0),
            heard: None,
            began: None,
            steps: 0,
            told_steps: 0,
            commands: 0,
            settings,
        })
    }

    fn is_idle(&self) -> bool {
        self.heard.is_none_or(|heard| heard.elapsed() > PATIENCE)
    }

    /// Whether it was a command, to be answered.
    fn obey(&mut self, heard: &[u8]) -> bool {
        let Ok(message) = serde_json::from_slice::<Value>(heard) else { return false };
        self.go_on();
        self.heard = Some(Instant::now());
        self.began.get_or_insert_with(Instant::now);
        self.commands += 1;
        let ours = |device: &&Value| device["device_id"] == DEVICE_ID;
        let device = message["inverse3"].as_array().and_then(|devices| devices.iter().find(ours));
        let force = device.map_or(&Value::Null, |device| &device["commands"]["set_cursor_force"]);
        let old = (self.settings.dialect != Some(Dialect::Vector)).then(|| vector(&force["values"])).flatten();
        let new = (self.settings.dialect != Some(Dialect::Values) && force["execute"] != false)
            .then(|| vector(&force["vector"]))
            .flatten();
        self.force_n = old.or(new).unwrap_or(DVec3::ZERO);
        true
    }

    /// Motion up to now.
    fn go_on(&mut self) {
        if self.is_idle() {
            self.force_n = DVec3::ZERO;
        }
        let due = self.began.map_or(0, |began| (began.elapsed().as_secs_f64() / STEP_S) as u64);
        while self.steps < due {
            self.arm.step(self.force_n);
            self.steps += 1;
        }
    }

    fn state(&self, with_config: bool) -> Value {
        let motion = self.arm.motion();
        let vector = |v: DVec3| json!({ "x": v.x, "y": v.y, "z": v.z });
        let state =
            |x: DVec3, v: DVec3| json!({ "cursor_position": vector(x), "cursor_velocity": vector(v), "mode": "idle" });
        let status =
            json!({ "calibrated": !self.settings.uncalibrated, "in_use": true, "power_supply": true, "ready": true });
        let mut devices: Vec<Value> = (0..self.settings.others)
            .map(|i| json!({ "device_id": format!("{i:04X}"), "state": state(DVec3::X, DVec3::ZERO), "status": {} }))
            .collect();
        let ours = state(motion.position_m, motion.velocity_m_per_s);
        devices.push(json!({ "device_id": DEVICE_ID, "state": ours, "status": status }));
        if with_config {
            for device in &mut devices {
                device["config"] = json!({ "type": "inverse3", "handedness": "right" });
            }
        }
        let (q, buttons) = self.held;
        let orientation = json!({ "w": q.w, "x": q.x, "y": q.y, "z": q.z });
        let pressed = |bit: u32| buttons >> bit & 1 == 1;
        let three = json!({ "a": pressed(0), "b": pressed(1), "c": pressed(2) });
        let grip = |state: Value| json!([{ "device_id": GRIP_ID, "state": state }]);
        let mut message = json!({ "inverse3": devices, "verse_grip": [], "wireless_verse_grip": [] });
        match self.settings.grip {
            Grip::None => {}
            Grip::Wireless => {
                message["wireless_verse_grip"] = grip(json!({ "buttons": three, "orientation": orientation }));
            }
            Grip::Wired => {
                message["verse_grip"] = grip(json!({ "button": pressed(0), "hall": 0, "orientation": orientation }));
            }
        }
        message
    }
}

fn vector(value: &Value) -> Option<DVec3> {
    let part = |name: &str| value[name].as_f64();
    Some(DVec3::new(part("x")?, part("y")?, part("z")?))
}
