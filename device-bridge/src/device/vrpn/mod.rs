//! Any arm behind a VRPN server: its tracker tells the pose, its buttons what is pressed, its force device gets the force.
//!
//! A VRPN server has no message for a force as such. It renders fields of force: every tick a field goes out that is the tick's force everywhere within [`Settings::field_radius_m`]
//! round where the arm was last. The server holds the last one; the radius bounds what a field that nobody renews can do. Messages are described in [`wire`], [`payload`] and
//! [`peer`]. All goes by TCP: a server that is told no UDP port sends everything there.
//!
//! What public sources do not settle is an option: whether the server's velocities are to be believed ([`Settings::velocity_from_poses`]), and whether the force that it
//! reports is a sensor's ([`Settings::force_is_measured`]); VRPN's own driver of PHANToMs reports that of its motors.
pub mod heard;
pub mod payload;
pub mod peer;
pub mod sender_clock;
pub mod start;
pub mod wire;

use super::{Arm, Effort, Fault, LONGEST_EXTRAPOLATION_S, LastWords, Reading, tcp};
use glam::{DMat3, DVec3};
use heard::Heard;
use palpate_control::{Motion, Velocity, extrapolate};
use payload::{ForceField, Pose};
use peer::{Kind, Peer};
use sender_clock::SenderClock;
use start::StartError;
use std::{
    io::{ErrorKind, Read as _, Write as _},
    net::{Shutdown, TcpStream},
    time::Duration,
};
use wire::{Outgoing, Time};

/// How long the end of the program waits for the server to take the last message.
const FAREWELL: Duration = Duration::from_millis(100);
/// At most so many times a tick it is read what came: a server that sends without end must not hold the loop.
const MOST_READS: usize = 8;
/// Room for a field and the answers to pings of all names.
const OUT_BYTES: usize = 512;

/// Which arm of which server, and how its words are taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Host and port.
    pub address: String,
    /// Name of its tracker.
    pub tracker: String,
    /// Sensor of the tracker.
    pub sensor: i32,
    /// Name of its buttons; empty: none.
    pub button: String,
    /// Name of its force device; empty: the arm is read only.
    pub force_device: String,
    /// So far from where it was last the arm still has the tick's force (m).
    pub field_radius_m: f64,
    /// Largest force (N) asked of it.
    pub max_force_n: f64,
    /// Velocities are made from poses, even when the server sends some.
    pub velocity_from_poses: bool,
    /// How far apart two measurements of one place may be (m), such as a step of its encoders: for velocities from poses.
    pub position_step_m: f64,
    /// The force that the server reports is the hand's on the arm.
    pub force_is_measured: bool,
    /// Without a pose for so long the arm is lost.
    pub silence: Duration,
}

/// The arm.
#[derive(Debug)]
pub struct Vrpn {
    stream: TcpStream,
    peer: Peer,
    heard: Heard,
    settings: Settings,
    /// Place of the force device among our names.
    force_device: Option<usize>,
    period_s: f64,
    silence_periods: u64,
    /// Rates of x, y and z (m/s), for a server that sends none.
    rates: [Velocity; 3],
    sender_clock: SenderClock,
    motion: Motion,
    force_n: DVec3,
    /// Since the newest pose came.
    quiet_periods: u64,
    out: Outgoing,
    /// Sent bytes of `out`.
    sent: usize,
    /// Since the server last took all of it.
    unsent_periods: u64,
    lost: Option<Fault>,
}

impl Vrpn {
    /// Connects, and waits for a first pose. Blocks.
    ///
    /// # Errors
    /// [`StartError`].
    pub fn start(settings: &Settings, period_s: f64) -> Result<Self, StartError> {
        let started = start::start(settings)?;
        let broken = |reason| StartError::Broken { address: settings.address.clone(), reason };
        started.stream.set_nonblocking(true).map_err(broken)?;
        let mut arm = Self {
            stream: started.stream,
            peer: started.peer,
            heard: started.heard,
            force_device: start::names(settings).1.force,
            period_s,
            silence_periods: (settings.silence.as_secs_f64() / period_s).ceil() as u64,
            // Poses are told at ticks.
            rates: std::array::from_fn(|_| Velocity::new(settings.position_step_m, period_s)),
            sender_clock: SenderClock::default(),
            motion: Motion::at(DVec3::ZERO),
            force_n: DVec3::ZERO,
            quiet_periods: 0,
            out: Outgoing::with_capacity(OUT_BYTES),
            sent: 0,
            unsent_periods: 0,
            lost: None,
            settings: settings.clone(),
        };
        arm.renew(&started.pose, period_s);
        Ok(arm)
    }

    /// A new pose, which came `arrived_s` after the one before.
    fn renew(&mut self, pose: &Pose, arrived_s: f64) {
        let passed_s = self.sender_clock.passed_s(self.heard.pose_time(), arrived_s);
        let mut rates = DVec3::ZERO;
        for axis in 0..3 {
            rates[axis] = self.rates[axis].push(pose.position_m[axis], passed_s);
        }
        let told = self.heard.velocity().filter(|_| !self.settings.velocity_from_poses);
        self.motion = Motion {
            position_m: pose.position_m,
            orientation: pose.orientation,
            velocity_m_per_s: told.map_or(rates, |told| told.velocity_m_per_s),
            angular_velocity_rad_per_s: told.map_or(DVec3::ZERO, |told| told.angular_velocity_rad_per_s),
        };
    }

    fn receive(&mut self) -> Result<(), Fault> {
        for _ in 0..MOST_READS {
            match self.stream.read(self.peer.received.room()) {
                Ok(0) => return Err(Fault::Disconnected),
                Ok(count) => self.peer.received.came(count),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(Fault::Disconnected),
            }
            start::hear(&mut self.peer, &mut self.heard)?;
        }
        if let Some(pose) = self.heard.new_pose() {
            let arrived_s = self.quiet_periods as f64 * self.period_s;
            self.quiet_periods = 0;
            self.renew(&pose, arrived_s);
        }
        // A server that hears nothing holds an old force.
        let is_silent = self.quiet_periods.max(self.unsent_periods) > self.silence_periods;
        if is_silent { Err(Fault::Silent) } else { Ok(()) }
    }

    /// Sends a field, when the last one is sent.
    fn send(&mut self) -> Result<(), Fault> {
        if self.sent == self.out.bytes().len() {
            self.unsent_periods = 0;
            self.compose();
        }
        while self.sent < self.out.bytes().len() {
            match self.stream.write(&self.out.bytes()[self.sent..]) {
                Ok(0) => return Err(Fault::Disconnected),
                Ok(count) => self.sent += count,
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(Fault::Disconnected),
            }
        }
        Ok(())
    }

    fn compose(&mut self) {
        self.out.clear();
        self.sent = 0;
        let time = Time::now();
        if let Some(device) = self.force_device {
            let field = ForceField {
                origin_m: self.motion.position_m,
                force_n: self.force_n.clamp_length_max(self.settings.max_force_n),
                jacobian_n_per_m: DMat3::ZERO,
                radius_m: self.settings.field_radius_m,
            };
            self.out.message(Kind::ForceField.header(device, time), |into| field.write(into));
        }
        let pings = self.heard.take_pings();
        for name in (0..u32::BITS).filter(|name| pings >> name & 1 == 1) {
            self.out.message(Kind::Pong.header(name as usize, time), |_| ());
        }
    }

    fn lose(&mut self, fault: Fault) -> Fault {
        *self.lost.get_or_insert(fault)
    }
}

impl Arm for Vrpn {
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        if let Some(fault) = self.lost {
            return Err(fault);
        }
        self.quiet_periods = self.quiet_periods.saturating_add(periods);
        if self.sent < self.out.bytes().len() {
            self.unsent_periods = self.unsent_periods.saturating_add(periods);
        }
        self.receive().map_err(|fault| self.lose(fault))?;
        let quiet_s = self.quiet_periods as f64 * self.period_s;
        Ok(Reading {
            motion: extrapolate(&self.motion, quiet_s, LONGEST_EXTRAPOLATION_S),
            buttons: self.heard.buttons(),
            measured_force_n: self.heard.force_n().filter(|_| self.settings.force_is_measured),
            // It came since the last tick.
            age_s: quiet_s + self.period_s,
            force_share: 1.0,
        })
    }

    /// A lost arm is still told to let go, should it hear.
    fn apply(&mut self, effort: &Effort) {
        self.force_n = effort.unless(self.lost.is_some()).force_n;
        if let Err(fault) = self.send() {
            self.lose(fault);
        }
    }

    fn last_words(&self) -> Option<LastWords> {
        let mut words = Outgoing::with_capacity(OUT_BYTES);
        words.message(Kind::ForceField.header(self.force_device?, Time::now()), |into| ForceField::NONE.write(into));
        Some(LastWords { to: self.stream.try_clone().ok()?.into(), bytes: words.bytes().to_vec() })
    }
}

impl Drop for Vrpn {
    /// Takes the field away, if the server still listens.
    fn drop(&mut self) {
        let _ = self.stream.set_nonblocking(false);
        let _ = self.stream.set_write_timeout(Some(FAREWELL));
        // What is left of the last message first, or the server would take this for its end.
        let _ = self.stream.write_all(&self.out.bytes()[self.sent..]);
        if let Some(device) = self.force_device {
            self.out.clear();
            let header = Kind::ForceField.header(device, Time::now());
            self.out.message(header, |into| ForceField::NONE.write(into));
            let _ = self.stream.write_all(self.out.bytes());
        }
        let _ = self.stream.shutdown(Shutdown::Write);
        tcp::hear_out(&self.stream, FAREWELL);
    }
}
