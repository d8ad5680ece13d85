//! Loading a Falcon's firmware, which it forgets without power. The file is Novint's, and not part of this program: whoever has an arm has it from them.
//!
//! At 9600 bit/s the arm's loader is greeted; at 140000 bit/s it takes the file in pieces, and says each again.
use super::BAUD;
use crate::device::{Fault, serial::Line};
use std::{
    path::Path,
    time::{Duration, Instant},
};
use thiserror::Error;
use tokio_util::sync::CancellationToken;

/// Rate (bit/s) of the greeting.
pub const GREETING_BAUD: u32 = 9600;
/// Rate (bit/s) of the file: the loader measures it from the `A`.
pub const LOADING_BAUD: u32 = 140_000;
/// Ours, and what the loader answers to it.
pub const GREETING: [&[u8]; 2] = [b"\nC\r", b"\nD,\r"];
/// The same, at the rate of the file.
pub const READY: [&[u8]; 2] = [b"A", b"A"];
/// Bytes that are sent at once.
pub const PIECE: usize = 62;
/// A larger file is none: the arm's memory is smaller.
const MOST_BYTES: u64 = 1 << 18;
/// How often the loader is greeted: its first answers may be lost.
const GREETINGS: usize = 10;
/// How long each answer may take.
const PATIENCE: Duration = Duration::from_millis(500);
const LOOK_EVERY: Duration = Duration::from_micros(500);

/// Why firmware could not be loaded.
#[derive(Debug, Error)]
pub enum LoadError {
    /// No file.
    #[error("cannot read the firmware {file}: {reason}")]
    Read {
        /// Which.
        file: String,
        /// Why.
        reason: std::io::Error,
    },
    /// Another file.
    #[error("{file} is no firmware of a Falcon: it has {bytes} bytes")]
    NoFirmware {
        /// Which.
        file: String,
        /// Its length.
        bytes: u64,
    },
    /// The loader does not answer as it should.
    #[error("the loader of the Falcon at {path} does not answer {what}: switch the arm off and on, and start again")]
    Silent {
        /// The port.
        path: String,
        /// What it was told.
        what: &'static str,
    },
    /// It understood something else.
    #[error(
        "the Falcon at {path} did not take the firmware: it said other bytes again from byte {byte} on; switch it off and on, and start again"
    )]
    Changed {
        /// The port.
        path: String,
        /// Where in the file.
        byte: usize,
    },
    /// The port.
    #[error("{path}: {fault}")]
    Port {
        /// Which.
        path: String,
        /// What went wrong.
        fault: Fault,
    },
    /// Somebody stopped the start.
    #[error("its start was stopped")]
    Stopped,
}

/// Loads a file into the arm; the line has the rate of a running firmware then.
///
/// # Errors
/// [`LoadError`].
pub fn load(line: &mut Line, path: &str, file: &Path, stop: &CancellationToken) -> Result<(), LoadError> {
    let bytes = read(file)?;
    let mut loader = Loader { line, path, stop };
    loader.greet()?;
    for (piece, at) in bytes.chunks(PIECE).zip((0..).step_by(PIECE)) {
        loader.tell(piece)?;
        let again = loader.hear(|heard| heard.len() >= piece.len() || !piece.starts_with(heard))?;
        if let Some(place) = piece.iter().zip(&again).position(|(a, b)| a != b) {
            return Err(LoadError::Changed { path: path.to_owned(), byte: at + place });
        }
        if again.len() != piece.len() {
            return Err(loader.silent("a piece of the firmware"));
        }
    }
    loader.set_baud(BAUD)
}

fn read(file: &Path) -> Result<Vec<u8>, LoadError> {
    let name = || file.display().to_string();
    let unread = |reason| LoadError::Read { file: name(), reason };
    let bytes = std::fs::metadata(file).map_err(unread)?.len();
    if !(1..=MOST_BYTES).contains(&bytes) {
        return Err(LoadError::NoFirmware { file: name(), bytes });
    }
    std::fs::read(file).map_err(unread)
}

struct Loader<'a> {
    line: &'a mut Line,
    path: &'a str,
    stop: &'a CancellationToken,
}

impl Loader<'_> {
    fn greet(&mut self) -> Result<(), LoadError> {
        self.set_baud(GREETING_BAUD)?;
        self.line.set_modem_lines(false, false);
        self.line.set_modem_lines(false, true);
        let [greeting, answer] = GREETING;
        let mut is_greeted = false;
        for _ in 0..GREETINGS {
            self.tell(greeting)?;
            // Some say a zero first.
            is_greeted = self.hear(|heard| heard.ends_with(answer))?.ends_with(answer);
            if is_greeted {
                break;
            }
        }
        if !is_greeted {
            return Err(self.silent("its greeting"));
        }
        self.line.set_modem_lines(false, false);
        self.set_baud(LOADING_BAUD)?;
        let [ready, answer] = READY;
        self.tell(ready)?;
        if self.hear(|heard| heard.len() >= answer.len())? == answer {
            Ok(())
        } else {
            Err(self.silent("the rate of the firmware"))
        }
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), LoadError> {
        self.line.set_baud(baud).and_then(|()| self.line.forget()).map_err(|fault| self.port(fault))
    }

    fn tell(&mut self, bytes: &[u8]) -> Result<(), LoadError> {
        self.line.send_in_turn(bytes, PATIENCE).map(drop).map_err(|fault| self.port(fault))
    }

    /// What comes until that is all, or for as long as an answer may take.
    fn hear(&mut self, is_all: impl Fn(&[u8]) -> bool) -> Result<Vec<u8>, LoadError> {
        let (began, mut heard) = (Instant::now(), Vec::new());
        while began.elapsed() < PATIENCE && !is_all(&heard) {
            if self.stop.is_cancelled() {
                return Err(LoadError::Stopped);
            }
            let take = |byte| {
                heard.push(byte);
                Ok(None::<()>)
            };
            self.line.newest(take).map_err(|fault| self.port(fault))?;
            std::thread::sleep(LOOK_EVERY);
        }
        Ok(heard)
    }

    fn port(&self, fault: Fault) -> LoadError {
        LoadError::Port { path: self.path.to_owned(), fault }
    }

    fn silent(&self, what: &'static str) -> LoadError {
        LoadError::Silent { path: self.path.to_owned(), what }
    }
}
