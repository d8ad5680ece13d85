//! Beside the loop: the socket to an Inverse service, on a thread of its own.
//!
//! The service answers each command with one state. So a command goes out when the loop has a new force and the last command is answered; without one, every few
//! milliseconds, or nothing would be heard of the arm. At most one command is on its way, but for the one that lets go: that waits for nothing.
//! A state is as old as the command it answers; one that nobody asked for came since the socket was last seen empty.
use super::{Dialect, wire};
use crate::device::{Fault, share::Share};
use glam::DVec3;
use palpate_realtime::{Doorbell, SlotReader, SlotWriter};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::{
    collections::VecDeque,
    io::{ErrorKind, Read, Write},
    net::TcpStream,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};
use tungstenite::{Bytes, Error, Message, Utf8Bytes, WebSocket, error::ProtocolError};

/// A command goes out at least so often.
const KEEP_ALIVE: Duration = Duration::from_millis(5);
/// How long the end of the program waits for the service to hear of it.
const FAREWELL: Duration = Duration::from_millis(100);
/// Most messages that are read at once: who sends more without a pause is not listened to alone.
const MOST_AT_ONCE: u64 = 64;

/// What is told to the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Told {
    /// What the service said.
    pub state: wire::State,
    /// The arm measured it then or later.
    pub since: Instant,
    /// When it came.
    pub came: Instant,
}

/// Whom it is about.
#[derive(Debug, Clone)]
pub struct Names {
    /// The arm.
    pub arm: String,
    /// The grip; empty: the first.
    pub grip: String,
    /// How forces are told.
    pub dialect: Dialect,
}

/// The thread's ends of everything.
#[derive(Debug)]
pub struct Line {
    socket: WebSocket<TcpStream>,
    names: Names,
    /// Without a new force from the loop for so long the arm is let go.
    silence: Duration,
    forces: SlotReader<DVec3>,
    states: SlotWriter<Result<Told, Fault>>,
    bell: Doorbell,
    force_n: DVec3,
    /// Of what the loop says: none while it is silent, and then it comes back slowly.
    share: Share,
    sent_n: DVec3,
    /// When the commands that are not answered yet were sent.
    asked: VecDeque<Instant>,
    /// When nothing more was there to read.
    empty_at: Instant,
    sent_at: Instant,
    /// When the loop last said a force.
    heard_at: Instant,
}

impl Line {
    /// A socket whose first message was read.
    ///
    /// # Errors
    /// When the operating system refuses reading without waiting.
    pub fn new(
        socket: WebSocket<TcpStream>,
        names: Names,
        silence: Duration,
        forces: SlotReader<DVec3>,
        states: SlotWriter<Result<Told, Fault>>,
        bell: Doorbell,
    ) -> std::io::Result<Self> {
        socket.get_ref().set_nonblocking(true)?;
        let now = Instant::now();
        let (asked, force_n) = (VecDeque::new(), DVec3::ZERO);
        let (empty_at, sent_at, heard_at) = (now, now, now);
        Ok(Self {
            socket,
            names,
            silence,
            forces,
            states,
            bell,
            force_n,
            share: Share::ALL,
            sent_n: force_n,
            asked,
            empty_at,
            sent_at,
            heard_at,
        })
    }

    /// Until told to stop, or the arm is lost; without force either way.
    pub fn run(mut self, stop: &Arc<AtomicBool>) {
        while !stop.load(Ordering::Relaxed) {
            self.wait();
            if let Err(fault) = self.turn(Instant::now()) {
                self.states.publish(Err(fault));
                break;
            }
        }
        self.say_farewell();
    }

    /// For a message, a force of the loop, or the time to say something.
    fn wait(&self) {
        let most = Timespec { tv_sec: 0, tv_nsec: KEEP_ALIVE.subsec_nanos().into() };
        let mut ends = [PollFd::new(self.socket.get_ref(), PollFlags::IN), PollFd::new(&self.bell, PollFlags::IN)];
        if poll(&mut ends, Some(&most)).is_err() {
            // Interrupted, or something that a pause can only help.
            std::thread::sleep(Duration::from_millis(1));
        }
        self.bell.answer();
    }

    fn turn(&mut self, now: Instant) -> Result<(), Fault> {
        let new_n = self.forces.take().copied();
        if let Some(force_n) = new_n {
            self.share.pass(true);
            (self.force_n, self.heard_at) = (force_n * self.share.now(), now);
        } else if now.duration_since(self.heard_at) > self.silence {
            self.share.pass(false);
            self.force_n = DVec3::ZERO;
        }
        self.receive(now)?;
        let is_due = new_n.is_some() || now.duration_since(self.sent_at) >= KEEP_ALIVE;
        let lets_go = self.force_n == DVec3::ZERO && self.sent_n != DVec3::ZERO;
        if (self.asked.is_empty() && is_due) || lets_go {
            let text = wire::command(self.names.dialect, &self.names.arm, self.force_n);
            self.asked.push_back(now);
            (self.sent_at, self.sent_n) = (now, self.force_n);
            return sent(self.socket.send(Message::text(text)));
        }
        // What the other end did not take before, if anything.
        sent(self.socket.flush())
    }

    fn receive(&mut self, now: Instant) -> Result<(), Fault> {
        let (count, state) = newest(&mut self.socket, &self.names)?;
        let mut since = self.empty_at;
        for _ in 0..count {
            since = self.asked.pop_front().unwrap_or(self.empty_at);
        }
        if let Some(state) = state {
            self.states.publish(Ok(Told { state, since, came: now }));
        }
        if count < MOST_AT_ONCE {
            self.empty_at = now;
        }
        Ok(())
    }

    /// No force, and the end. A lost arm is told so, too, should it hear.
    fn say_farewell(&mut self) {
        let stream = self.socket.get_ref();
        let _ = stream.set_nonblocking(false);
        let _ = stream.set_read_timeout(Some(FAREWELL));
        let _ = stream.set_write_timeout(Some(FAREWELL));
        let began = Instant::now();
        let nothing = wire::command(self.names.dialect, &self.names.arm, DVec3::ZERO);
        let told = self.socket.send(Message::text(nothing)).and_then(|()| self.socket.close(None));
        // Closed in order the service takes what was sent before; it is not waited for long.
        while told.is_ok() && began.elapsed() < FAREWELL && self.socket.read().is_ok() {}
    }
}

/// Nothing is lost when the other end takes it later.
fn sent(result: Result<(), Error>) -> Result<(), Fault> {
    match result {
        Err(Error::Io(error)) if is_early(error.kind()) => Ok(()),
        result => result.map_err(|_| Fault::Disconnected),
    }
}

fn is_early(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

/// Reads what has come: how many states, and the newest of them.
///
/// # Errors
/// What loses the arm.
pub(super) fn newest<S: Read + Write>(
    socket: &mut WebSocket<S>,
    names: &Names,
) -> Result<(u64, Option<wire::State>), Fault> {
    let (mut count, mut state) = (0, None);
    while count < MOST_AT_ONCE {
        let Some(message) = next(socket)? else { break };
        state = Some(wire::state(&message, &names.arm, &names.grip)?);
        count += 1;
    }
    Ok((count, state))
}

/// The next message with something in it, as text or as bytes; `None` when none is there.
///
/// # Errors
/// [`Fault::Disconnected`] or [`Fault::Garbled`].
pub(super) fn next<S: Read + Write>(socket: &mut WebSocket<S>) -> Result<Option<Bytes>, Fault> {
    loop {
        match socket.read() {
            Ok(Message::Text(text)) => return Ok(Some(Utf8Bytes::into(text))),
            Ok(Message::Binary(bytes)) => return Ok(Some(bytes)),
            Err(Error::Io(error)) if is_early(error.kind()) => return Ok(None),
            Ok(Message::Close(_)) => return Err(Fault::Disconnected),
            Ok(_) => {}
            Err(error) => return Err(fault_of(&error)),
        }
    }
}

fn fault_of(error: &Error) -> Fault {
    match error {
        Error::Io(_)
        | Error::ConnectionClosed
        | Error::AlreadyClosed
        | Error::Protocol(ProtocolError::ResetWithoutClosingHandshake) => Fault::Disconnected,
        _ => Fault::Garbled,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::{
        prelude::*,
        test_runner::{RngAlgorithm, TestRng},
    };
    use std::io::Cursor;
    use tungstenite::protocol::Role;

    const STATE: &str = r#"{"inverse3": [{"device_id": "1", "state": {"cursor_position": {"x": 0.1, "y": 0, "z": 0},
        "cursor_velocity": {"x": 0, "y": 0, "z": 0}}}]}"#;

    fn names() -> Names {
        Names { arm: "1".into(), grip: String::new(), dialect: Dialect::Vector }
    }

    /// What the service sends, and then nothing more; what is sent to it is lost.
    struct Sent(Cursor<Vec<u8>>);

    impl Read for Sent {
        fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
            match self.0.read(into) {
                Ok(0) => Err(ErrorKind::WouldBlock.into()),
                read => read,
            }
        }
    }

    impl Write for Sent {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn frame(first: u8, payload: &[u8]) -> Vec<u8> {
        let mut bytes = vec![first, 126];
        bytes.extend((payload.len() as u16).to_be_bytes());
        bytes.extend(payload);
        bytes
    }

    fn heard(bytes: Vec<u8>) -> Result<(u64, Option<wire::State>), Fault> {
        newest(&mut WebSocket::from_raw_socket(Sent(Cursor::new(bytes)), Role::Client, None), &names())
    }

    #[test]
    fn states_merged_fragmented_and_between_pings_are_counted_and_the_newest_is_told() {
        let newer = STATE.replace("0.1", "0.2");
        let (begin, end) = newer.as_bytes().split_at(40);
        let parts = [frame(0x81, STATE.as_bytes()), frame(0x89, b"ping"), frame(0x01, begin), frame(0x80, end)];
        let (count, state) = heard(parts.concat()).unwrap();
        assert_eq!((count, state.unwrap().position_m.x), (2, 0.2));
        // As bytes, as good as text.
        assert_eq!(heard(frame(0x82, STATE.as_bytes())).unwrap().0, 1);
        assert_eq!(heard(parts[..3].concat()).unwrap().0, 1, "the second is not whole yet");
        assert_eq!(heard(frame(0x88, b"")), Err(Fault::Disconnected));
        assert_eq!(heard(frame(0x81, b"{}")), Err(Fault::Garbled));
        assert_eq!(heard(frame(0xF1, STATE.as_bytes())), Err(Fault::Garbled), "reserved bits");
        assert_eq!(heard(frame(0x81, STATE.as_bytes()).repeat(100)).unwrap().0, MOST_AT_ONCE);
    }

    /// A million bytes of noise, and as many messages with noise in them or between them.
    #[test]
    fn noise_is_garbled_or_waited_for_and_never_a_wild_pose() {
        let mut rng = TestRng::deterministic_rng(RngAlgorithm::default());
        let (mut noise, mut good) = (0, 0_u64);
        while noise < 1_000_000 {
            let length = rng.random_range(1..400);
            let bytes: Vec<u8> = (0..length).map(|_| rng.random()).collect();
            noise += bytes.len();
            let _ = heard(bytes.clone());
            let mut traffic = [frame(0x81, STATE.as_bytes()), frame(0x81, STATE.as_bytes())].concat();
            let at = rng.random_range(0..=traffic.len());
            let few = rng.random_range(0..bytes.len().min(4));
            traffic.splice(at..(at + few).min(traffic.len()), bytes.into_iter().take(few));
            if let Ok((_, Some(state))) = heard(traffic) {
                good += 1;
                assert!(state.position_m.is_finite() && state.position_m.length() < 18.0);
            }
        }
        assert!(good > 100, "{good}");
    }
}
