//! HapticMASTER (FCS, Moog): an admittance arm over TCP. It measures the hand's force and moves as a mass would; ours goes to it as a bias force, or as the plane of the contact, which it
//! renders itself, and a bias force for the rest ([`plane`]).
//!
//! Beside the loop nothing waits: a tick reads what has come and, when the last request is answered, sends the next one, which sets the force and asks for
//! position, velocity and force. So a pose is a tick old, and at most one request is on its way. A pose's age counts from its request: the arm measured it then or later.
//!
//! What only hardware can tell is named here: whether `set` and `get` go in one request ([`Dialect::Mixed`]) or each in its own, whether the arm lets go when the connection
//! ends, and the sign and zero of its axes ([`super::workspace`]).
pub mod grammar;
pub mod plane;
mod request;
pub mod start;

use super::{Arm, Effort, Fault, LONGEST_EXTRAPOLATION_S, LastWords, Reading, drain::Drain, tcp, unstarted};
use crate::BridgeError;
use glam::DVec3;
use grammar::Answer;
use palpate_control::{ContactPlane, Motion, extrapolate};
use plane::Plane;
use std::{
    io::{ErrorKind, Read as _, Write as _},
    net::{Shutdown, TcpStream},
    time::Duration,
};
use tokio_util::sync::CancellationToken;

/// Name of our effect on the arm.
pub const EFFECT: &str = "palpate";
/// How long the end of the program waits for the arm to take the force away.
const FAREWELL: Duration = Duration::from_millis(100);

/// How commands are put into requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dialect {
    /// `set` and `get` in one.
    Mixed,
    /// `set` and `get` take turns: half as many poses a second.
    Apart,
}

/// What the loop's requests ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    Nothing,
    /// The force was set, and nothing asked for.
    Set,
    /// To let go, whatever it answers.
    Nobody,
    /// Motion and force; and whether the emergency stop is pressed; behind the answers of so many `set`s.
    Motion {
        with_stop: bool,
        sets: usize,
    },
}

/// The arm, started.
#[derive(Debug)]
pub struct HapticMaster {
    stream: TcpStream,
    dialect: Dialect,
    period_s: f64,
    /// Without an answer for so many periods the arm is lost.
    silence_periods: u64,
    /// Largest force (N) that is ever asked of it.
    max_force_n: f64,
    answer: Answer,
    asked: Asked,
    request: Vec<u8>,
    text: Vec<u8>,
    /// Sent bytes of `request`.
    sent: usize,
    force_n: DVec3,
    /// The contact that the arm shall render.
    wanted: Option<ContactPlane>,
    /// The one that it renders, if it does.
    plane: Option<Plane>,
    /// Where the loop was told that the arm is.
    shown: Motion,
    reading: Reading,
    /// Since the newest pose was asked for: it is not older.
    age_periods: u64,
    /// Since the request on its way was made.
    asked_periods: u64,
    /// Since a pose came.
    quiet_periods: u64,
    requests: u64,
    /// Requests that take every force away.
    farewell: Vec<u8>,
    /// Of answers to a guard.
    drain: Drain,
    lost: Option<Fault>,
}

impl HapticMaster {
    /// Starts the arm, which may take a minute. Blocks until told to stop.
    ///
    /// # Errors
    /// [`BridgeError::Start`].
    pub fn open(settings: &start::StartSettings, period_s: f64, stop: &CancellationToken) -> Result<Self, BridgeError> {
        let started = start::start(settings, stop).map_err(unstarted)?;
        tracing::info!("the HapticMASTER at {} is started: {}", settings.address, started.version);
        Self::new(started, settings, period_s)
            .map_err(|source| BridgeError::System { what: "read the arm without waiting", source })
    }

    /// A started arm, whose stream does not block from now on.
    ///
    /// # Errors
    /// When the operating system refuses that.
    pub fn new(started: start::Started, settings: &start::StartSettings, period_s: f64) -> std::io::Result<Self> {
        started.stream.set_nonblocking(true)?;
        let farewell = request::farewell(settings.plane.is_some());
        Ok(Self {
            stream: started.stream,
            dialect: settings.dialect,
            period_s,
            silence_periods: (settings.silence.as_secs_f64() / period_s).ceil() as u64,
            max_force_n: settings.max_force_n,
            answer: Answer::new(),
            asked: Asked::Nothing,
            request: Vec::with_capacity(2 * (grammar::HEADER_BYTES + grammar::LONGEST_TEXT)),
            text: Vec::with_capacity(grammar::LONGEST_TEXT + request::MARGIN_BYTES),
            sent: 0,
            force_n: DVec3::ZERO,
            wanted: None,
            plane: settings.plane.map(Plane::new),
            shown: Motion::at(started.position_m),
            reading: Reading {
                motion: Motion::at(started.position_m),
                buttons: 0,
                measured_force_n: None,
                age_s: 0.0,
                force_share: 1.0,
            },
            age_periods: 0,
            asked_periods: 0,
            quiet_periods: 0,
            requests: 0,
            farewell,
            drain: Drain::default(),
            lost: None,
        })
    }

    /// Drops what has come; when that ends, nothing is on its way.
    fn drop_answers(&mut self) -> Result<(), Fault> {
        let came = tcp::drop_what_came(&self.stream).map_err(|_| Fault::Disconnected)?;
        self.quiet_periods = 0;
        if self.drain.pass(came)? {
            self.asked = Asked::Nothing;
        }
        Ok(())
    }

    /// Takes what has come; a whole answer renews the reading.
    fn receive(&mut self) -> Result<(), Fault> {
        let (mut bytes, mut came) = ([0; 1024], false);
        loop {
            match self.stream.read(&mut bytes) {
                Ok(0) => return Err(Fault::Disconnected),
                // Nobody asked for these.
                Ok(_) if self.asked == Asked::Nothing => return Err(Fault::Garbled),
                Ok(count) => {
                    came = true;
                    self.answer.take(&bytes[..count])?;
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(Fault::Disconnected),
            }
        }
        let ends_with_vector = matches!(self.asked, Asked::Motion { .. });
        let Some(text) = self.answer.whole(ends_with_vector)? else { return Ok(()) };
        if grammar::is_refusal(text) {
            return Err(Fault::Refused);
        }
        // The next tick tells whether it was all.
        if came && !self.answer.tells_its_end(ends_with_vector) {
            return Ok(());
        }
        let mut parts = grammar::parts(text);
        if let Asked::Motion { with_stop, sets } = self.asked {
            for _ in 0..sets {
                parts.next().ok_or(Fault::Garbled)?;
            }
            if with_stop && parts.next().and_then(grammar::truth).ok_or(Fault::Garbled)? {
                return Err(Fault::EmergencyStop);
            }
            let mut vector = || parts.next().and_then(grammar::vector).ok_or(Fault::Garbled);
            let (position_m, velocity_m_per_s, force_n) = (vector()?, vector()?, vector()?);
            if parts.next().is_some() {
                return Err(Fault::Garbled);
            }
            self.reading.motion = Motion::at(position_m);
            self.reading.motion.velocity_m_per_s = velocity_m_per_s;
            self.reading.measured_force_n = Some(force_n);
            self.age_periods = self.asked_periods;
            self.quiet_periods = 0;
        }
        self.asked = Asked::Nothing;
        Ok(())
    }

    /// Sends the next request, when the last one is answered.
    fn send(&mut self) -> Result<(), Fault> {
        if self.lost.is_some() || self.drain.is_on() {
            self.let_go();
        } else if self.asked == Asked::Nothing && self.sent == self.request.len() {
            self.compose();
        }
        while self.sent < self.request.len() {
            match self.stream.write(&self.request[self.sent..]) {
                Ok(0) => return Err(Fault::Disconnected),
                Ok(count) => self.sent += count,
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(Fault::Disconnected),
            }
        }
        self.drain.told(self.asked == Asked::Nobody && self.sent == self.request.len());
        Ok(())
    }

    fn lose(&mut self, fault: Fault) -> Fault {
        *self.lost.get_or_insert(fault)
    }
}

impl Arm for HapticMaster {
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        if let Some(fault) = self.lost {
            return Err(fault);
        }
        for since in [&mut self.age_periods, &mut self.asked_periods, &mut self.quiet_periods] {
            *since = since.saturating_add(periods);
        }
        let taken = if self.drain.is_on() { self.drop_answers() } else { self.receive() };
        taken.map_err(|fault| self.lose(fault))?;
        if self.quiet_periods > self.silence_periods {
            return Err(self.lose(Fault::Silent));
        }
        let age_s = self.age_periods as f64 * self.period_s;
        self.shown = extrapolate(&self.reading.motion, age_s, LONGEST_EXTRAPOLATION_S);
        Ok(Reading { motion: self.shown, age_s, force_share: self.drain.force_share(), ..self.reading })
    }

    /// A lost arm is still told to let go, should it hear.
    fn apply(&mut self, effort: &Effort) {
        let effort = effort.unless(self.lost.is_some());
        (self.force_n, self.wanted) = (effort.force_n, effort.plane);
        if let Err(fault) = self.send() {
            self.lose(fault);
        }
    }

    fn last_words(&self) -> Option<LastWords> {
        let to = self.stream.try_clone().ok()?.into();
        Some(LastWords { to, bytes: self.farewell.clone() })
    }

    fn last_words_were_said(&mut self) {
        self.lost = self.lost.filter(|fault| !fault.may_be_misheard());
        self.drain.begin(self.silence_periods);
        if let Some(plane) = &mut self.plane {
            plane.was_disabled();
        }
        // They are said once more, behind whatever is on its way.
        self.asked = if self.asked == Asked::Nobody { Asked::Nothing } else { self.asked };
    }
}

impl Drop for HapticMaster {
    /// Takes the effect away, if the arm still listens.
    fn drop(&mut self) {
        let _ = self.stream.set_nonblocking(false);
        let _ = self.stream.set_read_timeout(Some(FAREWELL));
        let _ = self.stream.set_write_timeout(Some(FAREWELL));
        // What is left of the last request first, or the arm would take this for its end.
        let _ = self.stream.write_all(&self.request[self.sent..]);
        for text in request::let_go(self.plane.is_some()).chain(["remove all".to_owned()]) {
            grammar::frame(text.as_bytes(), &mut self.request);
            let _ = self.stream.write_all(&self.request).and_then(|()| self.stream.read(&mut [0; 1024]));
        }
        let _ = self.stream.shutdown(Shutdown::Write);
        tcp::hear_out(&self.stream, FAREWELL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    fn connected() -> (HapticMaster, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let settings = start::StartSettings {
            address: String::new(),
            dialect: Dialect::Apart,
            inertia_kg: 2.0,
            max_force_n: 3.0,
            plane: None,
            homing: Duration::ZERO,
            silence: Duration::from_secs(1000),
        };
        let started = start::Started { stream, version: String::new(), position_m: DVec3::ZERO };
        let arm = listener.accept().unwrap().0;
        arm.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        (HapticMaster::new(started, &settings, 1e-3).unwrap(), arm)
    }

    fn request(arm: &mut TcpStream) -> String {
        let mut header = [0; grammar::HEADER_BYTES];
        arm.read_exact(&mut header).unwrap();
        let mut text = vec![0; header[3].into()];
        arm.read_exact(&mut text).unwrap();
        String::from_utf8(text).unwrap()
    }

    /// `set` and `get` apart, answers without headers, and a byte of them at a time: the first byte was taken for the whole answer to a `set`.
    #[test]
    fn answers_without_headers_are_put_together_from_single_bytes() {
        let (mut driven, mut arm) = connected();
        for round in 0..6 {
            driven.apply(&Effort::force(DVec3::X));
            let asked = request(&mut arm);
            let stop = if asked.contains("emergency") { "false;" } else { "" };
            let place = format!("{stop}[0.{round},0,0];[0,0,0];[0,0,1]");
            assert_eq!(asked.starts_with("set"), round % 2 == 1, "{asked}");
            let answer = if round % 2 == 1 { "Biasforce's force set" } else { &place };
            for byte in answer.bytes() {
                arm.write_all(&[byte]).unwrap();
                while driven.stream.peek(&mut [0]).is_err() {
                    std::thread::yield_now();
                }
                driven.read(1).unwrap();
            }
            let found = driven.read(1).unwrap().motion.position_m.x;
            assert!((found - 0.1 * f64::from(round / 2 * 2)).abs() < 1e-12, "{found}");
        }
    }
}
