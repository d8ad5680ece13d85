//! A serial line beside the loop: it never waits. What its bytes are, each arm says; lines of text are told apart here.
use super::{Fault, LastWords};
use rustix::fs::OFlags;
use serialport::{ClearBuffer, SerialPort as _, TTYPort};
use std::{
    fs::File,
    io::{ErrorKind, Read as _, Write as _},
    os::unix::fs::OpenOptionsExt as _,
    time::{Duration, Instant},
};
use thiserror::Error;

/// Most that is read at once.
const CHUNK: usize = 512;
/// The longest line that is one.
const LONGEST_LINE: usize = 96;
/// With so much unsent nothing more is put behind it: the other end does not listen.
const MOST_UNSENT: u32 = 512;
/// Never waited for: what is there is asked for first.
const WAIT: Duration = Duration::from_millis(1);

/// A port that cannot be opened.
#[derive(Debug, Error)]
#[error("cannot open the serial port {path}: {source}")]
pub struct OpenError {
    /// Which.
    pub path: String,
    /// Why.
    pub source: serialport::Error,
}

/// An arm that could not be started.
#[derive(Debug, Error)]
pub enum StartError {
    /// No port.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// Not a word.
    #[error("no {what} came from {path} within {} s: is the arm's board switched on?", patience.as_secs())]
    Silent {
        /// The port.
        path: String,
        /// What was waited for.
        what: &'static str,
        /// How long.
        patience: Duration,
    },
    /// Something else.
    #[error("{path}: {fault}; is it this arm's port?")]
    Strange {
        /// The port.
        path: String,
        /// What went wrong.
        fault: Fault,
    },
}

/// Opens the line of an arm and waits for its first message, a `what`, for which `look` asks and looks. Blocks.
///
/// # Errors
/// [`StartError`].
pub fn start<T>(
    (path, baud): (&str, u32),
    (what, patience): (&'static str, Duration),
    mut look: impl FnMut(&mut Line) -> Result<Option<T>, Fault>,
) -> Result<(Line, T), StartError> {
    let mut line = Line::open(path, baud)?;
    let began = Instant::now();
    loop {
        if let Some(first) = look(&mut line).map_err(|fault| StartError::Strange { path: path.to_owned(), fault })? {
            return Ok((line, first));
        }
        if began.elapsed() > patience {
            return Err(StartError::Silent { path: path.to_owned(), what, patience });
        }
    }
}

/// A line of an arm, which nobody else may open meanwhile.
#[derive(Debug)]
pub struct Line {
    port: TTYPort,
    /// The same port once more, for a guard.
    spare: File,
}

impl Line {
    /// Opens it, in raw mode.
    ///
    /// # Errors
    /// [`OpenError`], naming the path.
    pub fn open(path: &str, baud: u32) -> Result<Self, OpenError> {
        let failed = |source| OpenError { path: path.to_owned(), source };
        // Before the port itself, which is for one alone; it must not wait for a carrier, nor become our terminal.
        let flags = (OFlags::NOCTTY | OFlags::NONBLOCK).bits().cast_signed();
        let spare = File::options().read(true).write(true).custom_flags(flags).open(path);
        let spare = spare.map_err(|error| failed(error.into()))?;
        let opened = serialport::new(path, baud).timeout(WAIT).open_native();
        opened.map(|port| Self { port, spare }).map_err(failed)
    }

    /// These bytes, for a guard to write.
    pub fn last_words(&self, bytes: Vec<u8>) -> Option<LastWords> {
        Some(LastWords { to: self.spare.try_clone().ok()?.into(), bytes })
    }

    /// Reads what has come into `into`; how much that is. Does not allocate, but for the error when the cable is pulled.
    fn receive(&mut self, into: &mut [u8]) -> Result<usize, Fault> {
        let there = self.port.bytes_to_read().map_err(|_| Fault::Disconnected)?;
        let most = into.len().min(there as usize);
        if most == 0 {
            return Ok(0);
        }
        match self.port.read(&mut into[..most]) {
            Ok(0) => Err(Fault::Disconnected),
            Ok(count) => Ok(count),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(0),
            Err(_) => Err(Fault::Disconnected),
        }
    }

    /// Sends a message whole, or not at all when the other end does not listen: the next one says all of it anew.
    ///
    /// # Errors
    /// [`Fault::Disconnected`].
    pub fn send(&mut self, message: &[u8]) -> Result<(), Fault> {
        let unsent = self.port.bytes_to_write().map_err(|_| Fault::Disconnected)?;
        if unsent > MOST_UNSENT {
            return Ok(());
        }
        match self.port.write(message) {
            Ok(_) => Ok(()),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(()),
            Err(_) => Err(Fault::Disconnected),
        }
    }

    /// What has come goes through `take`, byte by byte; the newest message that it puts together, if any.
    ///
    /// # Errors
    /// [`Fault::Disconnected`], or what `take` says.
    pub fn newest<T>(&mut self, mut take: impl FnMut(u8) -> Result<Option<T>, Fault>) -> Result<Option<T>, Fault> {
        let mut newest = None;
        let mut bytes = [0; CHUNK];
        loop {
            let count = self.receive(&mut bytes)?;
            for &byte in &bytes[..count] {
                newest = take(byte)?.or(newest);
            }
            if count < CHUNK {
                return Ok(newest);
            }
        }
    }

    /// Another rate (bit/s). Not for the loop.
    ///
    /// # Errors
    /// [`Fault::Refused`] when the port has no such rate.
    pub fn set_baud(&mut self, baud: u32) -> Result<(), Fault> {
        self.port.set_baud_rate(baud).map_err(|_| Fault::Refused)
    }

    /// The lines "request to send" and "data terminal ready". A pseudo terminal has none, which is no error.
    pub fn set_modem_lines(&mut self, request_to_send: bool, data_terminal_ready: bool) {
        let _ = self.port.write_request_to_send(request_to_send);
        let _ = self.port.write_data_terminal_ready(data_terminal_ready);
    }

    /// Forgets what came and was not read.
    ///
    /// # Errors
    /// [`Fault::Disconnected`].
    pub fn forget(&mut self) -> Result<(), Fault> {
        self.port.clear(ClearBuffer::Input).map_err(|_| Fault::Disconnected)
    }
}

/// Puts bytes together to lines. What comes before the first end of a line is a part of one, and left out.
#[derive(Debug, Clone)]
pub struct Lines {
    bytes: [u8; LONGEST_LINE],
    length: usize,
    is_in_step: bool,
    is_over: bool,
}

impl Default for Lines {
    fn default() -> Self {
        Self { bytes: [0; LONGEST_LINE], length: 0, is_in_step: false, is_over: false }
    }
}

impl Lines {
    /// The next byte; a line that it ends, without its end (`\n`, `\r\n` or `\r`). An empty one is none.
    ///
    /// # Errors
    /// [`Fault::Garbled`] when a line is too long to be one.
    pub fn take(&mut self, byte: u8) -> Result<Option<&[u8]>, Fault> {
        if std::mem::take(&mut self.is_over) {
            self.length = 0;
        }
        if byte != b'\n' && byte != b'\r' {
            *self.bytes.get_mut(self.length).ok_or(Fault::Garbled)? = byte;
            self.length += 1;
            return Ok(None);
        }
        self.is_over = true;
        let was_in_step = std::mem::replace(&mut self.is_in_step, true);
        Ok((was_in_step && self.length > 0).then_some(&self.bytes[..self.length]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lines_of(text: &[u8]) -> Vec<Vec<u8>> {
        let mut lines = Lines::default();
        text.iter().filter_map(|&byte| lines.take(byte).unwrap().map(<[u8]>::to_vec)).collect()
    }

    #[test]
    fn lines_end_in_either_way_and_the_first_part_is_none() {
        assert_eq!(lines_of(b"34 5\n1 2\r\n\n3\r4\n5"), [b"1 2".to_vec(), b"3".to_vec(), b"4".to_vec()]);
        let mut lines = Lines::default();
        assert!((0..LONGEST_LINE).all(|_| lines.take(b'1') == Ok(None)));
        assert_eq!(lines.take(b'1'), Err(Fault::Garbled));
    }

    #[test]
    fn a_port_that_is_not_there_is_named() {
        let error = Line::open("/dev/nothing", 115_200).unwrap_err();
        assert!(error.to_string().starts_with("cannot open the serial port /dev/nothing: "), "{error}");
    }

    proptest! {
        #[test]
        fn any_bytes_are_lines_or_garbled(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut lines = Lines::default();
            for byte in bytes {
                if let Ok(Some(line)) = lines.take(byte) {
                    prop_assert!(!line.is_empty() && line.len() <= LONGEST_LINE);
                }
            }
        }
    }
}
