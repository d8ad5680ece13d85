//! A serial line beside the loop: it never waits. What its bytes are, each arm says; lines of text are told apart in [`Lines`].
pub use super::lines::Lines;
use super::{Fault, LastWords, backlog::Backlog};
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
/// More is left to the next tick: who sends so much does not hold the loop up.
const MOST_CHUNKS: usize = 16;
/// No message of a loop is longer.
const LONGEST_MESSAGE: usize = 128;
/// Never waited for: what is there is asked for first.
const WAIT: Duration = Duration::from_millis(1);
/// Between two looks at whether a line is empty, outside the loop.
const LOOK_EVERY: Duration = Duration::from_millis(1);
/// How long whoever takes the force away at the end waits for the line to be empty before.
pub const FAREWELL: Duration = Duration::from_millis(100);

/// A port that cannot be opened.
#[derive(Debug, Error)]
#[error("cannot open the serial port {path}: {reason}")]
pub struct OpenError {
    /// Which.
    pub path: String,
    /// Why.
    pub reason: serialport::Error,
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
    /// The same port once more, which does not wait for room: to write, and for a guard.
    spare: File,
    /// The end of a message for which there was no room.
    rest: Vec<u8>,
    backlog: Backlog,
    /// Messages that were not sent: all, and since the last that was.
    refused: u64,
    refused_in_row: u64,
    /// Counts in the operating system's place.
    #[cfg(test)]
    pub(crate) buffers: Option<Buffers>,
}

/// A count of unsent bytes as that of a USB CDC line.
#[cfg(test)]
#[derive(Debug)]
pub(crate) struct Buffers {
    /// What each is counted as.
    pub(crate) each: u32,
    /// How long a message is on its way.
    pub(crate) takes: Duration,
    pub(crate) since: Vec<Instant>,
}

impl Line {
    /// Opens it, in raw mode.
    ///
    /// # Errors
    /// [`OpenError`], naming the path.
    pub fn open(path: &str, baud: u32) -> Result<Self, OpenError> {
        let failed = |reason| OpenError { path: path.to_owned(), reason };
        // Before the port itself, which is for one alone; it must not wait for a carrier, nor become our terminal.
        let flags = (OFlags::NOCTTY | OFlags::NONBLOCK).bits().cast_signed();
        let spare = File::options().read(true).write(true).custom_flags(flags).open(path);
        let spare = spare.map_err(|error| failed(error.into()))?;
        let opened = serialport::new(path, baud).timeout(WAIT).open_native();
        Ok(Self {
            port: opened.map_err(failed)?,
            spare,
            rest: Vec::with_capacity(LONGEST_MESSAGE),
            backlog: Backlog::default(),
            refused: 0,
            refused_in_row: 0,
            #[cfg(test)]
            buffers: None,
        })
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

    /// Sends a message if it can go now; whether it did. One that did not is not kept: the next says all of it anew. Never waits.
    ///
    /// # Errors
    /// [`Fault::Disconnected`].
    pub fn send(&mut self, message: &[u8]) -> Result<bool, Fault> {
        let sent = self.put(message)?;
        self.count(sent);
        Ok(sent)
    }

    /// The same once the line is empty, which is waited for; after so long, whatever it is. Not for the loop.
    ///
    /// # Errors
    /// [`Fault::Disconnected`].
    pub fn send_in_turn(&mut self, message: &[u8], patience: Duration) -> Result<bool, Fault> {
        let began = Instant::now();
        let mut sent = false;
        loop {
            let is_late = began.elapsed() >= patience;
            let is_empty = self.finish()? && self.unsent()? == 0;
            if !sent && (is_empty || is_late) {
                sent = self.put(message)?;
            }
            if is_late || sent && self.rest.is_empty() {
                self.count(sent);
                return Ok(sent);
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }

    /// How many messages were not sent since the last that was: the other end does not listen.
    pub fn refused_in_row(&self) -> u64 {
        self.refused_in_row
    }

    fn count(&mut self, sent: bool) {
        self.refused += u64::from(!sent);
        self.refused_in_row = if sent { 0 } else { self.refused_in_row.saturating_add(1) };
    }

    /// Nothing of it, or all: what there was no room for is kept, and goes first from now on.
    fn put(&mut self, message: &[u8]) -> Result<bool, Fault> {
        if !self.finish()? {
            return Ok(false);
        }
        let unsent = self.unsent()?;
        if self.backlog.is_too_long(unsent) {
            return Ok(false);
        }
        let count = write(&self.spare, message)?;
        if count == 0 {
            return Ok(false);
        }
        self.rest.extend_from_slice(&message[count..]);
        #[cfg(test)]
        if let Some(buffers) = &mut self.buffers {
            buffers.since.push(Instant::now());
        }
        if unsent == 0 {
            self.backlog.learn(count, self.unsent()?);
        }
        Ok(true)
    }

    /// The rest of a message that was begun; whether there is none any more.
    fn finish(&mut self) -> Result<bool, Fault> {
        if !self.rest.is_empty() {
            let count = write(&self.spare, &self.rest)?;
            self.rest.drain(..count);
        }
        Ok(self.rest.is_empty())
    }

    fn unsent(&self) -> Result<u32, Fault> {
        let count = self.port.bytes_to_write().map_err(|_| Fault::Disconnected)?;
        #[cfg(test)]
        let count = self.buffers.as_ref().map_or(count, Buffers::count);
        Ok(count)
    }

    /// What has come goes through `take`, byte by byte; the newest message that it puts together, if any. What is left of a message of ours goes on its way.
    ///
    /// # Errors
    /// [`Fault::Disconnected`], or what `take` says.
    pub fn newest<T>(&mut self, mut take: impl FnMut(u8) -> Result<Option<T>, Fault>) -> Result<Option<T>, Fault> {
        self.finish()?;
        let mut newest = None;
        let mut bytes = [0; CHUNK];
        for _ in 0..MOST_CHUNKS {
            let count = self.receive(&mut bytes)?;
            for &byte in &bytes[..count] {
                newest = take(byte)?.or(newest);
            }
            if count < CHUNK {
                break;
            }
        }
        Ok(newest)
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

impl Drop for Line {
    fn drop(&mut self) {
        if self.refused > 0 {
            let path = self.port.name().unwrap_or_default();
            tracing::warn!("{} messages to {path} were not sent: its other end did not listen", self.refused);
        }
    }
}

/// As many bytes as there is room for, without waiting; how many.
fn write(mut to: &File, bytes: &[u8]) -> Result<usize, Fault> {
    match to.write(bytes) {
        Ok(count) => Ok(count),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
        Err(_) => Err(Fault::Disconnected),
    }
}

#[cfg(test)]
impl Buffers {
    pub(crate) fn new(each: u32, takes: Duration) -> Self {
        Self { each, takes, since: Vec::new() }
    }

    fn count(&self) -> u32 {
        self.each * self.since.iter().filter(|since| since.elapsed() < self.takes).count() as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::noise::Pair;

    #[test]
    fn a_port_that_is_not_there_is_named() {
        let error = Line::open("/dev/nothing", 115_200).unwrap_err();
        assert!(error.to_string().starts_with("cannot open the serial port /dev/nothing: "), "{error}");
    }

    fn message(number: u32) -> [u8; 28] {
        let mut message = [b'.'; 28];
        message[..4].copy_from_slice(&number.to_be_bytes());
        message
    }

    /// Nobody reads: nothing waits, and what is not sent is counted. Then somebody does: every message is whole, and the newest is the last.
    #[test]
    fn a_line_that_is_full_refuses_messages_and_none_is_sent_in_part() {
        let mut pair = Pair::new();
        let mut line = Line::open(&pair.path, 115_200).unwrap();
        let mut sent = Vec::new();
        for number in 0..1_000_000 {
            if line.send(&message(number)).unwrap() {
                sent.extend_from_slice(&message(number));
            } else if line.refused_in_row() == 3 {
                break;
            }
        }
        assert_eq!((line.refused_in_row(), line.refused), (3, 3));
        let mut heard = pair.heard();
        let nothing = |_| Ok(None::<()>);
        // What was begun goes on by itself.
        line.newest(nothing).unwrap();
        heard.append(&mut pair.heard());
        assert!(heard == sent, "{} bytes heard, {} sent", heard.len(), sent.len());
        assert_eq!((line.send(&message(7)), line.refused_in_row(), line.refused), (Ok(true), 0, 3));
        assert_eq!(pair.heard(), message(7));
    }

    #[test]
    fn the_rest_of_a_message_goes_first() {
        let mut pair = Pair::new();
        let mut line = Line::open(&pair.path, 115_200).unwrap();
        line.rest.extend_from_slice(b"rest,");
        assert_eq!(line.send(b"next"), Ok(true));
        assert_eq!(pair.heard(), b"rest,next");
    }

    /// Its count is 10240 bytes for a message: all of a loop's go out while it takes them, and few are put behind each other when it does not.
    #[test]
    fn a_usb_cdc_line_is_no_full_one() {
        let mut pair = Pair::new();
        let mut line = Line::open(&pair.path, 115_200).unwrap();
        line.buffers = Some(Buffers::new(10_240, Duration::from_secs(1000)));
        let sent: Vec<bool> = (0..6).map(|number| line.send(&message(number)).unwrap()).collect();
        assert_eq!(sent, [true, true, true, true, false, false]);
        assert_eq!(line.send_in_turn(&message(6), Duration::from_millis(5)), Ok(false));
        line.buffers = Some(Buffers::new(10_240, Duration::from_millis(3)));
        assert!((0..20).all(|number| line.send_in_turn(&message(number), Duration::from_secs(20)).unwrap()));
        let since = &line.buffers.as_ref().unwrap().since;
        assert!(since.windows(2).all(|pair| pair[1] - pair[0] >= Duration::from_millis(3)), "one after the other");
        assert_eq!(pair.heard().len(), 24 * 28);
    }
}
