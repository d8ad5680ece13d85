//! Coming to an understanding with a VRPN server, and waiting for the arm's first pose. Waits, so never in the loop.
use super::{
    Settings,
    heard::{Heard, Senders},
    payload::Pose,
    peer::{self, Peer},
    wire::{self, Outgoing},
};
use crate::device::{Fault, tcp};
use std::{
    io::{ErrorKind, Read as _, Write as _},
    net::TcpStream,
    time::{Duration, Instant},
};
use thiserror::Error;

/// How long the server may take to answer, and the arm to tell its pose.
const PATIENCE: Duration = Duration::from_secs(2);
/// How often it is looked whether the time is over.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Why there is no arm.
#[derive(Debug, Error)]
pub enum StartError {
    /// Nobody there.
    #[error("no VRPN server answers at {address}: {reason}")]
    Unreachable {
        /// Host and port.
        address: String,
        /// Why.
        reason: std::io::Error,
    },
    /// It went away.
    #[error("the connection to {address} broke: {reason}")]
    Broken {
        /// Host and port.
        address: String,
        /// Why.
        reason: std::io::Error,
    },
    /// Not a word.
    #[error("{address} does not say within {} s that it is a VRPN server", PATIENCE.as_secs())]
    Silent {
        /// Host and port.
        address: String,
    },
    /// Something else, or another version.
    #[error("{address} is no VRPN server of version 07: it says {cookie:?}")]
    Strange {
        /// Host and port.
        address: String,
        /// What it said.
        cookie: String,
    },
    /// Nobody of that name.
    #[error("{address} has no {what} named \"{name}\"")]
    Unknown {
        /// Host and port.
        address: String,
        /// What was looked for.
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// No pose.
    #[error("no pose came from \"{name}\", sensor {sensor}, within {} s", PATIENCE.as_secs())]
    NoPose {
        /// The tracker.
        name: String,
        /// Its sensor.
        sensor: i32,
    },
    /// The arm has failed already.
    #[error("{address}: {fault}")]
    Failed {
        /// Host and port.
        address: String,
        /// What is wrong.
        fault: Fault,
    },
}

/// A connection on which poses come.
#[derive(Debug)]
pub(super) struct Started {
    pub stream: TcpStream,
    pub peer: Peer,
    pub heard: Heard,
    pub pose: Pose,
}

/// Our names, each once, and who is who among them.
pub(super) fn names(settings: &Settings) -> (Vec<String>, Senders) {
    let mut names: Vec<String> = Vec::new();
    let mut place = |name: &String| {
        names.iter().position(|known| known == name).unwrap_or_else(|| {
            names.push(name.clone());
            names.len() - 1
        })
    };
    let tracker = place(&settings.tracker);
    let mut optional = |name: &String| (!name.is_empty()).then(|| place(name));
    let (button, force) = (optional(&settings.button), optional(&settings.force_device));
    (names, Senders { tracker, sensor: settings.sensor, button, force })
}

/// Connects, exchanges cookies and names, and waits until the arm has told where it is.
pub(super) fn start(settings: &Settings) -> Result<Started, StartError> {
    let address = || settings.address.clone();
    let unreachable = |reason| StartError::Unreachable { address: address(), reason };
    let broken = |reason| StartError::Broken { address: address(), reason };
    let mut stream = tcp::connect(&settings.address, PATIENCE).map_err(unreachable)?;
    stream.set_read_timeout(Some(LOOK_EVERY)).map_err(broken)?;
    stream.write_all(&wire::cookie()).map_err(broken)?;
    let (names, senders) = names(settings);
    let (mut peer, mut heard) = (Peer::new(names.clone()), Heard::new(senders));
    let cookie = await_some(&mut stream, &mut peer, settings, |peer| Ok(peer.received.cookie()))?;
    let cookie = cookie.ok_or_else(|| StartError::Silent { address: address() })?;
    if !wire::is_cookie(&cookie) {
        let cookie = String::from_utf8_lossy(&cookie).trim_end_matches('\0').to_owned();
        return Err(StartError::Strange { address: address(), cookie });
    }
    let mut out = Outgoing::default();
    peer::describe(&names, &mut out);
    stream.write_all(out.bytes()).map_err(broken)?;
    let failed = |fault| StartError::Failed { address: address(), fault };
    let pose = await_some(&mut stream, &mut peer, settings, |peer| {
        hear(peer, &mut heard).map_err(failed)?;
        let has_force = senders.force.is_none_or(|force| peer.has(force));
        Ok(if has_force { heard.new_pose() } else { None })
    })?;
    let Some(pose) = pose else { return Err(missing(settings, senders, &peer)) };
    Ok(Started { stream, peer, heard, pose })
}

/// Takes all whole messages.
pub(super) fn hear(peer: &mut Peer, heard: &mut Heard) -> Result<(), Fault> {
    while let Some(told) = peer.next_told().map_err(|_| Fault::Garbled)? {
        heard.take(told.sender, told.kind, told.time, peer.payload(&told))?;
    }
    Ok(())
}

fn missing(settings: &Settings, senders: Senders, peer: &Peer) -> StartError {
    let unknown = |what, name: &str| StartError::Unknown { address: settings.address.clone(), what, name: name.into() };
    if !peer.has(senders.tracker) {
        return unknown("tracker", &settings.tracker);
    }
    if senders.force.is_some_and(|force| !peer.has(force)) {
        return unknown("force device", &settings.force_device);
    }
    StartError::NoPose { name: settings.tracker.clone(), sensor: settings.sensor }
}

/// Reads until `look` finds something; `None` when the time is over.
fn await_some<T>(
    stream: &mut TcpStream,
    peer: &mut Peer,
    settings: &Settings,
    mut look: impl FnMut(&mut Peer) -> Result<Option<T>, StartError>,
) -> Result<Option<T>, StartError> {
    let broken = |reason| StartError::Broken { address: settings.address.clone(), reason };
    let began = Instant::now();
    loop {
        if let Some(found) = look(peer)? {
            return Ok(Some(found));
        }
        if began.elapsed() > PATIENCE {
            return Ok(None);
        }
        match stream.read(peer.received.room()) {
            Ok(0) => return Err(broken(ErrorKind::UnexpectedEof.into())),
            Ok(count) => peer.received.came(count),
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(error) => return Err(broken(error)),
        }
    }
}
