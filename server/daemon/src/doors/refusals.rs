//! Who was refused at the doors, counted by reason, and logged at most once a second for each.
use crate::sparing::Sparing;
use std::{
    fmt,
    net::SocketAddr,
    sync::atomic::{AtomicU64, Ordering},
};

/// Who is at the other end of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
    /// By TCP.
    Tcp(SocketAddr),
    /// A process of this machine, by the Unix socket.
    Unix,
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::Unix => f.write_str("a process of this machine"),
        }
    }
}

/// Why a connection or a request was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The operating system gives no further descriptor.
    NoDescriptor,
    /// All places are taken by connections that are in use.
    Full,
    /// As many requests are being answered as there may be.
    Busy,
    /// Its place was given to another, as it was idle for longest.
    Evicted,
    /// Its TLS handshake failed, or took too long.
    Handshake,
    /// It asked for nothing in time.
    Silent,
    /// It has asked for nothing any more for long.
    Idle,
    /// A web page of another, or a call that no client of gRPC makes.
    Foreign,
    /// Who calls is not known, or may not.
    Forbidden,
    /// A message is larger than its method's may be.
    TooLarge,
    /// A request is not one whole message.
    Broken,
    /// A request did not come to its end in time.
    TooSlow,
    /// All requests together hold as much as they may.
    NoRoom,
    /// A peer took nothing of its answer for too long.
    Mute,
}

/// Every reason, with its name in counters and what it means to whoever reads the log.
pub const REASONS: [(Reason, &str, &str); 14] = [
    (
        Reason::NoDescriptor,
        "no_descriptor",
        "no connection can be accepted: the process has no descriptor left (LimitNOFILE)",
    ),
    (Reason::Full, "full", "a connection was refused: all places are taken"),
    (Reason::Busy, "busy", "a request was refused: as many are being answered as there may be"),
    (Reason::Evicted, "evicted", "the connection that was idle for longest was closed, to let another in"),
    (Reason::Handshake, "handshake", "a TLS handshake failed or took too long"),
    (Reason::Silent, "silent", "a connection was closed, as it asked for nothing"),
    (Reason::Idle, "idle", "a connection was closed, as it had asked for nothing any more"),
    (Reason::Foreign, "foreign", "a request was refused: it came from a web page of others, or is no call of gRPC"),
    (Reason::Forbidden, "forbidden", "a call was refused: who calls is not known, or may not"),
    (Reason::TooLarge, "too_large", "a request was refused: its message is too large"),
    (Reason::Broken, "broken", "a request was refused: it is not one whole message"),
    (Reason::TooSlow, "too_slow", "a request was refused: it did not come to its end in time"),
    (Reason::NoRoom, "no_room", "a request was refused: others hold as much memory as all may"),
    (Reason::Mute, "mute", "a connection was closed: nothing of its answer was taken for too long"),
];

/// Counters by reason.
#[derive(Debug, Default)]
pub struct Refusals {
    counts: [AtomicU64; REASONS.len()],
    logged: [Sparing; REASONS.len()],
}

impl Refusals {
    /// Counts one, and logs it unless another of its kind has just been.
    pub fn count(&self, reason: Reason, peer: Option<Peer>) {
        let Some(index) = REASONS.iter().position(|(other, ..)| *other == reason) else { return };
        let count = self.counts[index].fetch_add(1, Ordering::Relaxed) + 1;
        let (_, name, meaning) = REASONS[index];
        self.logged[index].say(|_| {
            let peer = peer.map(|peer| peer.to_string());
            tracing::warn!(peer, reason = name, count, "{meaning}");
        });
    }

    /// How often, by now.
    pub fn of(&self, reason: Reason) -> u64 {
        let index = REASONS.iter().position(|(other, ..)| *other == reason);
        index.map_or(0, |index| self.counts[index].load(Ordering::Relaxed))
    }

    /// Names and counts of all reasons that there were.
    pub fn all(&self) -> Vec<(&'static str, u64)> {
        let counts = self.counts.iter().map(|count| count.load(Ordering::Relaxed));
        REASONS.iter().map(|(_, name, _)| *name).zip(counts).filter(|(_, count)| *count > 0).collect()
    }
}
