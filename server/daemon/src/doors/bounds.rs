//! The numbers that connections and requests have to keep to.
use palpate_proto::MAX_SNAPSHOT_BYTES;
use std::time::Duration;

/// What connections have to keep to. Tests make them small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bounds {
    /// Connections at a time, over all sockets. One more takes the place of whoever has been idle for longest.
    pub connections: usize,
    /// Streams of viewers, of health and of reflection at a time.
    pub streams: usize,
    /// Other requests at a time: those of Session, and as many of all else.
    pub requests: usize,
    /// Streams of devices at a time, those that have not said hello yet among them.
    pub attachments: usize,
    /// How long a TLS handshake may take.
    pub handshake: Duration,
    /// How long a connection may take until its first request has been asked for.
    pub first_request: Duration,
    /// How long a connection may be without a request after that.
    pub idle: Duration,
    /// How long a peer may leave a part of an answer that is there for it.
    pub mute: Duration,
    /// The same of a device, whose commands come every tick: who takes none has no force either.
    pub mute_device: Duration,
    /// How long headers of HTTP/1.1 may take, from the end of the request before: a connection that is kept open waits no longer.
    pub headers: Duration,
    /// How long a request may be without a further byte.
    pub stall: Duration,
    /// How long a request may take to come.
    pub request: Duration,
}

impl Default for Bounds {
    fn default() -> Self {
        Self {
            connections: 4096,
            streams: 1536,
            requests: 256,
            attachments: 64,
            handshake: Duration::from_secs(5),
            first_request: Duration::from_secs(10),
            idle: Duration::from_mins(5),
            mute: Duration::from_mins(1),
            mute_device: Duration::from_secs(2),
            headers: Duration::from_secs(5),
            stall: Duration::from_secs(5),
            request: Duration::from_mins(1),
        }
    }
}

/// Dead peers are noticed after these two.
pub const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(10);
/// See [`KEEPALIVE_INTERVAL`].
pub const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(5);
/// Streams on one connection at a time.
pub const STREAMS: u32 = 256;
/// Streams on a connection of an arm, which needs one.
pub const STREAMS_OF_ARM: u32 = 2;
/// Bytes that a connection of HTTP/1.1 reads ahead, and holds of its answer.
pub const HTTP1_BUFFER_BYTES: usize = 32 * 1024;
/// Bytes of an answer that a stream hands to the transport for a peer that does not read; and the largest part that it is cut into.
pub const SEND_BUFFER_BYTES: usize = 16 * 1024;
/// Bytes of a request's headers.
pub const HEADER_LIST_BYTES: u32 = 16 * 1024;
/// Bytes that a stream's and a connection's requests may be ahead of what has been read of them: a sample has some 150.
pub const STREAM_WINDOW_BYTES: u32 = 256 * 1024;
/// See [`STREAM_WINDOW_BYTES`].
pub const CONNECTION_WINDOW_BYTES: u32 = 1024 * 1024;
/// Bytes that all larger requests together hold until they have been answered.
pub const HELD_BYTES: usize = 2 * MAX_SNAPSHOT_BYTES;

/// Largest message of requests that carry a scene or forces (bytes).
pub const MAX_REQUEST_BYTES: usize = 2 * 1024 * 1024;
/// Largest message of all others (bytes): a sample of a device has some 150.
pub const MAX_SMALL_BYTES: usize = 16 * 1024;

/// Largest message of a method (bytes), by its path.
pub fn message_bytes(path: &str) -> usize {
    match path {
        "/palpate.v1.Session/Restore" => MAX_SNAPSHOT_BYTES,
        "/palpate.v1.Session/LoadScene" | "/palpate.v1.Session/InjectForces" => MAX_REQUEST_BYTES,
        _ => MAX_SMALL_BYTES,
    }
}
