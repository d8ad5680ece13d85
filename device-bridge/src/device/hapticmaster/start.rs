//! Bringing a HapticMASTER from whatever state it is in to one in which it takes forces. Waits for it, so never in the loop.
use super::{
    Dialect, EFFECT,
    grammar::{self, Answer},
    plane::{self, PlaneSettings},
};
use crate::device::tcp;
use glam::DVec3;
use std::{
    io::{ErrorKind, Read as _, Write as _},
    net::TcpStream,
    time::{Duration, Instant},
};
use thiserror::Error;
use tokio_util::sync::CancellationToken;

/// What the loop asks for.
pub(super) const MOTION: [&str; 3] = ["get modelpos", "get modelvel", "get measforce"];
/// How long an answer may take.
const PATIENCE: Duration = Duration::from_secs(2);
/// An answer without a header and without a closing bracket is over when nothing more comes for so long.
const QUIET: Duration = Duration::from_millis(20);
/// Between two looks at whether the arm has found its home.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// What a HapticMASTER is started with.
#[derive(Debug, Clone, PartialEq)]
pub struct StartSettings {
    /// Host and port.
    pub address: String,
    /// How commands are put into requests.
    pub dialect: Dialect,
    /// Mass that the hand feels (kg).
    pub inertia_kg: f64,
    /// Largest force (N) asked of it.
    pub max_force_n: f64,
    /// The arm renders contacts by itself.
    pub plane: Option<PlaneSettings>,
    /// How long finding home may take.
    pub homing: Duration,
    /// Without an answer for so long the arm is lost.
    pub silence: Duration,
}

/// An arm that takes forces: ours is zero.
#[derive(Debug)]
pub struct Started {
    /// The connection.
    pub stream: TcpStream,
    /// What it says it is.
    pub version: String,
    /// Where it is (m, its own axes).
    pub position_m: DVec3,
}

/// Why an arm could not be started.
#[derive(Debug, Error)]
pub enum StartError {
    /// Nobody there.
    #[error("no HapticMASTER answers at {address}: {reason}")]
    Unreachable {
        /// Host and port.
        address: String,
        /// Why.
        reason: std::io::Error,
    },
    /// It went away.
    #[error("the connection to the HapticMASTER broke at \"{command}\": {reason}")]
    Broken {
        /// What was asked.
        command: String,
        /// Why.
        reason: std::io::Error,
    },
    /// It does not answer.
    #[error("no answer to \"{command}\" within {} s", PATIENCE.as_secs())]
    Silent {
        /// What was asked.
        command: String,
    },
    /// It answers something else.
    #[error("the answer to \"{command}\" is none of a HapticMASTER: {answer:?}")]
    Strange {
        /// What was asked.
        command: String,
        /// What came.
        answer: String,
    },
    /// It refuses.
    #[error("the HapticMASTER refused \"{command}\": {answer}")]
    Refused {
        /// What was asked.
        command: String,
        /// What it said.
        answer: String,
    },
    /// The button is pressed.
    #[error("its emergency stop is pressed")]
    EmergencyStop,
    /// Somebody stopped the start.
    #[error("its start was stopped")]
    Stopped,
    /// Finding home did not end.
    #[error("it did not find its home within {seconds} s; its state is \"{state}\"")]
    NotHome {
        /// How long it was waited for.
        seconds: f64,
        /// What it says.
        state: String,
    },
}

/// Connects, and brings the arm into its state `force` with an effect of ours on it.
///
/// # Errors
/// [`StartError`]; an arm that still listens is left without effects of ours.
pub fn start(settings: &StartSettings, stop: &CancellationToken) -> Result<Started, StartError> {
    let mut talk = Talk { stream: connect(&settings.address)?, answer: Answer::new() };
    talk.order("remove all")?;
    let version = talk.get("get os")?;
    if talk.truth("get emergencybuttonpushed")? {
        return Err(StartError::EmergencyStop);
    }
    if !talk.truth("get position_calibrated")? {
        talk.order("set state init")?;
        talk.await_stop(settings.homing, stop)?;
    }
    talk.order(&format!("set inertia {}", settings.inertia_kg))?;
    talk.order("set state force")?;
    match talk.create_effects(settings.plane.is_some()).and_then(|()| talk.position_m()) {
        Ok(position_m) => Ok(Started { stream: talk.stream, version, position_m }),
        Err(error) => {
            let _ = talk.order("remove all");
            Err(error)
        }
    }
}

fn connect(address: &str) -> Result<TcpStream, StartError> {
    tcp::connect(address, PATIENCE).map_err(|reason| StartError::Unreachable { address: address.to_owned(), reason })
}

struct Talk {
    stream: TcpStream,
    answer: Answer,
}

impl Talk {
    fn order(&mut self, command: &str) -> Result<(), StartError> {
        self.ask(command, false).map(|_| ())
    }

    fn create_effects(&mut self, with_plane: bool) -> Result<(), StartError> {
        self.order(&format!("create biasforce {EFFECT}"))?;
        self.order(&format!("set {EFFECT} force [0,0,0]"))?;
        self.order(&format!("set {EFFECT} enable"))?;
        let plane = if with_plane { plane::commands_to_create() } else { Vec::new() };
        plane.iter().try_for_each(|command| self.order(command))
    }

    fn position_m(&mut self) -> Result<DVec3, StartError> {
        let command = MOTION[0];
        let answer = self.ask(command, true)?;
        let position_m = grammar::parts(&answer).next().and_then(grammar::vector);
        position_m.ok_or_else(|| StartError::Strange { command: command.into(), answer })
    }

    /// A single answer, without the ornaments of its dialect.
    fn get(&mut self, command: &str) -> Result<String, StartError> {
        let answer = self.ask(command, false)?;
        Ok(grammar::parts(&answer).collect::<Vec<_>>().join("; "))
    }

    fn truth(&mut self, command: &str) -> Result<bool, StartError> {
        let answer = self.get(command)?;
        grammar::truth(&answer).ok_or_else(|| StartError::Strange { command: command.to_owned(), answer })
    }

    fn await_stop(&mut self, patience: Duration, stop: &CancellationToken) -> Result<(), StartError> {
        let began = Instant::now();
        loop {
            let state = self.get("get state")?;
            if state == "stop" {
                return Ok(());
            }
            if stop.is_cancelled() {
                // It must not go on moving when nobody waits for it.
                self.order("set state stop")?;
                return Err(StartError::Stopped);
            }
            if began.elapsed() > patience {
                self.order("set state stop")?;
                return Err(StartError::NotHome { seconds: patience.as_secs_f64(), state });
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }

    fn ask(&mut self, command: &str, ends_with_vector: bool) -> Result<String, StartError> {
        let broken = |reason| StartError::Broken { command: command.to_owned(), reason };
        let strange = |answer: &[u8]| StartError::Strange {
            command: command.to_owned(),
            answer: String::from_utf8_lossy(&answer[..answer.len().min(80)]).into_owned(),
        };
        let mut request = Vec::new();
        grammar::frame(command.as_bytes(), &mut request);
        self.stream.write_all(&request).map_err(broken)?;
        self.answer.expect(1);
        let asked = Instant::now();
        let mut bytes = [0; 1024];
        loop {
            let whole =
                self.answer.whole(ends_with_vector).map_err(|_| strange(self.answer.bytes()))?.map(str::to_owned);
            let certain = self.answer.tells_its_end(ends_with_vector);
            if let (Some(text), true) = (&whole, certain) {
                return accepted(command, text.clone());
            }
            // A whole answer may go on, when nothing says where it ends.
            let wait = if whole.is_some() { QUIET } else { PATIENCE.saturating_sub(asked.elapsed()) };
            if wait.is_zero() {
                return Err(StartError::Silent { command: command.to_owned() });
            }
            self.stream.set_read_timeout(Some(wait)).map_err(broken)?;
            match self.stream.read(&mut bytes) {
                Ok(0) => return Err(broken(ErrorKind::UnexpectedEof.into())),
                Ok(count) => self.answer.take(&bytes[..count]).map_err(|_| strange(&bytes[..count]))?,
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    if let Some(text) = whole {
                        return accepted(command, text);
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(broken(error)),
            }
        }
    }
}

fn accepted(command: &str, answer: String) -> Result<String, StartError> {
    if grammar::is_refusal(&answer) {
        return Err(StartError::Refused { command: command.to_owned(), answer });
    }
    Ok(answer)
}
