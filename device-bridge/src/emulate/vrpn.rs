//! A VRPN server that is not there, with an arm whose force device renders fields of force. One client at a time; all goes by TCP.
use super::{Faults, Listening, Shared};
use crate::device::vrpn::{
    payload::{self, ForceField, Pose, Velocity},
    peer::{self, Kind, Peer},
    wire::{self, Header, Outgoing, Time},
};
use glam::{DQuat, DVec3};
use palpate_control::{ArmSpec, HandPath, ParameterError, SimulatedArm};
use std::{
    io::{Error, ErrorKind, Read as _, Result, Write as _},
    net::{SocketAddr, TcpStream},
    sync::{Arc, atomic::Ordering},
    time::{Duration, Instant},
};

/// Step of its motion (s).
const STEP_S: f64 = 1e-3;
/// How often it looks what came.
const LOOK_EVERY: Duration = Duration::from_micros(200);
/// Like VRPN's driver of PHANToMs: no field gives more (N).
const MAX_FORCE_N: f64 = 10.0;
/// Its buttons.
const BUTTONS: u32 = 2;

/// How it speaks, and who holds the arm.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Names of its tracker, its buttons and its force device.
    pub names: [String; 3],
    /// The sensor that is the arm; those below it are told too, and rest elsewhere.
    pub sensor: i32,
    /// What it says first.
    pub cookie: [u8; wire::COOKIE_BYTES],
    /// It tells velocities.
    pub velocities: bool,
    /// The force that it reports is the hand's; else that of its motors.
    pub measures: bool,
    /// Its field stays when the connection ends, as it does where other clients are left.
    pub keeps: bool,
    /// A report comes every so many steps of 1 ms.
    pub every: u64,
    /// Mass, friction and hand.
    pub arm: ArmSpec,
    /// Where the hand goes (m, the arm's axes), from the first client on.
    pub path: HandPath,
    /// How the tool is turned, always.
    pub orientation: DQuat,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            names: ["Phantom0"; 3].map(str::to_owned),
            sensor: 0,
            cookie: wire::cookie(),
            velocities: true,
            measures: false,
            keeps: false,
            every: 1,
            arm: ArmSpec::default(),
            path: HandPath::resting_at(DVec3::ZERO),
            orientation: DQuat::IDENTITY,
        }
    }
}

/// It runs until dropped.
#[derive(Debug)]
pub struct Vrpn {
    /// What it does wrong.
    pub faults: Arc<Faults>,
    listening: Listening<Machine>,
}

impl Vrpn {
    /// Listens at an address, with a thread of its own.
    ///
    /// # Errors
    /// When the address is taken, or the arm's constants are out of range.
    pub fn listen(address: &str, settings: Settings) -> Result<Self> {
        let listening = Listening::start("vrpn", address, Machine::new(settings), |shared, stream| {
            let _ = Server(shared).serve(stream);
            let mut machine = shared.machine();
            if !machine.settings.keeps {
                machine.field = ForceField::NONE;
            }
        })?;
        Ok(Self { faults: Arc::clone(&listening.shared.faults), listening })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.listening.address
    }

    /// Force (N, the arm's axes) of its field on it now.
    pub fn force_n(&self) -> DVec3 {
        self.listening.machine().force_n()
    }

    /// The newest field.
    pub fn field(&self) -> ForceField {
        self.listening.machine().field
    }

    /// Where it is (m, its own axes).
    pub fn position_m(&self) -> DVec3 {
        self.listening.machine().arm.motion().position_m
    }

    /// Presses buttons, bit i for button i, and lets go of the others.
    pub fn press(&self, buttons: u32) {
        self.listening.machine().buttons = buttons;
    }

    /// Fields that came.
    pub fn fields(&self) -> u64 {
        self.listening.machine().fields
    }

    /// Answers to its pings, which it sends every 100 ms.
    pub fn pongs(&self) -> u64 {
        self.listening.machine().pongs
    }
}

struct Server<'a>(&'a Shared<Machine>);

impl Server<'_> {
    fn serve(&self, mut stream: TcpStream) -> Result<()> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let Settings { names, cookie, .. } = self.0.machine().settings.clone();
        let (mut peer, mut out) = (Peer::new(names.to_vec()), Outgoing::default());
        self.say(&mut stream, &cookie)?;
        peer::describe(&names, &mut out);
        // Where it would take UDP; no client has to.
        let header = Header { time: Time::now(), sender: 3883, kind: wire::UDP_DESCRIPTION };
        out.message(header, |into| into.extend_from_slice(b"127.0.0.1\0"));
        let (mut greeted, mut told) = (false, Reported { steps: 0, buttons: None });
        while !self.0.is_over() {
            match stream.read(peer.received.room()) {
                Ok(0) => return Ok(()),
                Ok(count) => peer.received.came(count),
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
            if !greeted {
                greeted = peer.received.cookie().is_some_and(|cookie| wire::is_cookie(&cookie));
                std::thread::sleep(LOOK_EVERY);
                continue;
            }
            {
                let mut machine = self.0.machine();
                while let Some(message) = peer.next_told().map_err(Error::other)? {
                    machine.obey(message.sender, message.kind, peer.payload(&message));
                }
                machine.go_on();
                machine.report(&mut told, Faults::is(&self.0.faults.refusal), &mut out);
            }
            if out.bytes().is_empty() {
                std::thread::sleep(LOOK_EVERY);
            } else {
                self.say(&mut stream, out.bytes())?;
                out.clear();
            }
        }
        Ok(())
    }

    fn say(&self, stream: &mut TcpStream, bytes: &[u8]) -> Result<()> {
        std::thread::sleep(Duration::from_micros(self.0.faults.slow_us.load(Ordering::Relaxed).into()));
        if Faults::is(&self.0.faults.silence) {
            return Ok(());
        }
        let noise: Vec<u8> = (0..64_u8).map(|i| i.wrapping_mul(37).wrapping_add(129)).collect();
        let bytes = if Faults::is(&self.0.faults.garbage) { &noise } else { bytes };
        let at_once = if Faults::is(&self.0.faults.split) { 1 } else { bytes.len() };
        for mut part in bytes.chunks(at_once) {
            while !part.is_empty() && !self.0.is_over() {
                match stream.write(part) {
                    Ok(count) => part = &part[count..],
                    Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(LOOK_EVERY),
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(())
    }
}

/// What a client knows.
struct Reported {
    /// The step that was told last.
    steps: u64,
    buttons: Option<u32>,
}

#[derive(Debug)]
struct Machine {
    settings: Settings,
    arm: SimulatedArm,
    field: ForceField,
    buttons: u32,
    began: Option<Instant>,
    steps: u64,
    fields: u64,
    pongs: u64,
}

impl Machine {
    fn new(settings: Settings) -> std::result::Result<Self, ParameterError> {
        Ok(Self {
            arm: SimulatedArm::new(settings.arm, settings.path.clone(), STEP_S)?,
            field: ForceField::NONE,
            buttons: 0,
            began: None,
            steps: 0,
            fields: 0,
            pongs: 0,
            settings,
        })
    }

    fn force_n(&self) -> DVec3 {
        self.field.force_at_n(self.arm.motion().position_m).clamp_length_max(MAX_FORCE_N)
    }

    fn obey(&mut self, sender: usize, kind: Kind, bytes: &[u8]) {
        let is_force_device = self.settings.names.get(sender) == Some(&self.settings.names[2]);
        match kind {
            Kind::ForceField if is_force_device => {
                if let Some(field) = ForceField::parse(bytes) {
                    self.go_on();
                    self.field = field;
                    self.fields += 1;
                }
            }
            Kind::Pong => self.pongs += 1,
            _ => {}
        }
    }

    fn go_on(&mut self) {
        let began = *self.began.get_or_insert_with(Instant::now);
        let due = (began.elapsed().as_secs_f64() / STEP_S) as u64;
        while self.steps < due {
            self.arm.step(self.force_n());
            self.steps += 1;
        }
    }

    fn report(&self, told: &mut Reported, has_failed: bool, out: &mut Outgoing) {
        if self.steps < told.steps + self.settings.every {
            return;
        }
        if self.steps / 100 > told.steps / 100 {
            out.message(Kind::Ping.header(0, Time::now()), |_| ());
        }
        told.steps = self.steps;
        let Settings { sensor, orientation, .. } = self.settings;
        let (motion, time) = (self.arm.motion(), Time::now());
        // Numbers 0, 1 and 2 are the tracker, the buttons and the force device, whatever their names.
        let mut message =
            |sender, kind: Kind, write: &dyn Fn(&mut Vec<u8>)| out.message(kind.header(sender, time), write);
        for resting in 0..sensor {
            let pose = Pose { sensor: resting, position_m: DVec3::ONE, orientation: DQuat::IDENTITY };
            message(0, Kind::Pose, &|into| pose.write(into));
        }
        message(0, Kind::Pose, &|into| Pose { sensor, position_m: motion.position_m, orientation }.write(into));
        if self.settings.velocities {
            let velocity_m_per_s = motion.velocity_m_per_s;
            let velocity = Velocity { sensor, velocity_m_per_s, angular_velocity_rad_per_s: DVec3::ZERO };
            message(0, Kind::Velocity, &|into| velocity.write(into));
        }
        match told.buttons.replace(self.buttons) {
            None => message(1, Kind::ButtonStates, &|into| payload::write_states(self.buttons, BUTTONS, into)),
            Some(before) => {
                for button in (0..BUTTONS).filter(|button| (before ^ self.buttons) >> button & 1 == 1) {
                    let is_pressed = self.buttons >> button & 1 == 1;
                    message(1, Kind::ButtonChange, &|into| payload::write_change(button as i32, is_pressed, into));
                }
            }
        }
        let force_n = if self.settings.measures { self.arm.hand_force_n() } else { self.force_n() };
        message(2, Kind::Force, &|into| payload::write_force(force_n, into));
        if has_failed {
            message(2, Kind::ForceError, &payload::write_error);
        }
    }
}
