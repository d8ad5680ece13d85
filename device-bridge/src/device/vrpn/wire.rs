//! VRPN's bytes: cookies and messages. Bytes in, bytes out, no socket.
//!
//! Both ends begin with a cookie of 24 bytes. Every message then has a header of five big-endian numbers of 32 bits (24 and the bytes of its payload, seconds, microseconds,
//! sender, type), a sequence number that fills it up to 24 bytes, and a payload filled up to a multiple of 8.
use std::{
    ops::Range,
    time::{SystemTime, UNIX_EPOCH},
};
use thiserror::Error;

/// Bytes of a cookie.
pub const COOKIE_BYTES: usize = 24;
/// Bytes before a payload.
pub const HEADER_BYTES: usize = 24;
/// Payloads are filled up to a multiple of this.
const ALIGN: usize = 8;
/// Longest payload that VRPN's own library takes.
pub const LONGEST_PAYLOAD: usize = 64_000;
/// Senders and types have numbers below this.
pub const MOST_IDS: usize = 2000;
/// Where VRPN servers listen.
pub const PORT: u16 = 3883;

/// Version, two spaces, and how the other end shall log: not at all.
const COOKIE: &[u8; COOKIE_BYTES] = b"vrpn: ver. 07.38  0\0\0\0\0\0";
/// As far as this versions have to agree: up to the last full stop.
const MAJOR: usize = "vrpn: ver. 07.".len();

/// Type of a message that names a sender, whose number is the message's sender.
pub const SENDER_DESCRIPTION: i32 = -1;
/// Type of a message that names a type, whose number is the message's sender.
pub const TYPE_DESCRIPTION: i32 = -2;
/// Type of a message that tells where to send by UDP. Not obeyed here: then all goes by TCP.
pub const UDP_DESCRIPTION: i32 = -3;
/// Type of a message that asks for logs. Not obeyed here.
pub const LOG_DESCRIPTION: i32 = -4;
/// Type of a message that says that the connection ends.
pub const DISCONNECT: i32 = -5;

/// It is no VRPN that is spoken here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("these are not VRPN's bytes")]
pub struct Malformed;

/// What both ends say first.
pub fn cookie() -> [u8; COOKIE_BYTES] {
    *COOKIE
}

/// Whether an end that begins with this speaks as we do: minor versions do.
pub fn is_cookie(bytes: &[u8; COOKIE_BYTES]) -> bool {
    bytes[..MAJOR] == COOKIE[..MAJOR]
}

/// A message's time, of the sender's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Time {
    /// Seconds since 1970.
    pub s: u32,
    /// Microseconds.
    pub us: u32,
}

impl Time {
    /// Now.
    pub fn now() -> Self {
        Self::at(SystemTime::now())
    }

    /// Then; as the seconds do not, it ends in 2106.
    pub fn at(time: SystemTime) -> Self {
        let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { s: since.as_secs() as u32, us: since.subsec_micros() }
    }
}

/// What a header says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// When.
    pub time: Time,
    /// Number of the sender; in messages of VRPN's own, whatever they say it is.
    pub sender: i32,
    /// Number of the type; below 0: VRPN's own.
    pub kind: i32,
}

/// Collects what comes, until it is whole.
#[derive(Debug)]
pub struct Received {
    bytes: Box<[u8]>,
    waiting: Range<usize>,
}

impl Default for Received {
    /// With room for the longest message and more.
    fn default() -> Self {
        Self { bytes: vec![0; LONGEST_PAYLOAD + 2 * HEADER_BYTES + 1024].into(), waiting: 0..0 }
    }
}

impl Received {
    /// Where to put what comes next; never empty after [`Received::next_message`] said that nothing is whole.
    pub fn room(&mut self) -> &mut [u8] {
        self.bytes.copy_within(self.waiting.clone(), 0);
        self.waiting = 0..self.waiting.len();
        &mut self.bytes[self.waiting.end..]
    }

    /// So many bytes came into the room.
    pub fn came(&mut self, count: usize) {
        self.waiting.end = (self.waiting.end + count).min(self.bytes.len());
    }

    /// Takes the cookie, once it is whole.
    pub fn cookie(&mut self) -> Option<[u8; COOKIE_BYTES]> {
        let cookie = *self.bytes[self.waiting.clone()].first_chunk()?;
        self.waiting.start += COOKIE_BYTES;
        Some(cookie)
    }

    /// Takes the next message that is whole, whose payload is [`Received::payload`] until there is room made.
    ///
    /// # Errors
    /// [`Malformed`]; what comes behind it means nothing.
    pub fn next_message(&mut self) -> Result<Option<(Header, Range<usize>)>, Malformed> {
        let Some(header) = self.bytes[self.waiting.clone()].first_chunk::<HEADER_BYTES>() else { return Ok(None) };
        let [length, s, us, sender, kind, _] = numbers(header);
        let payload = (length as usize).checked_sub(HEADER_BYTES).ok_or(Malformed)?;
        let (sender, kind) = (sender.cast_signed(), kind.cast_signed());
        let is_known = match kind {
            DISCONNECT..=SENDER_DESCRIPTION => true,
            _ => [kind, sender].into_iter().all(is_id),
        };
        if payload > LONGEST_PAYLOAD || !is_known {
            return Err(Malformed);
        }
        let start = self.waiting.start + HEADER_BYTES;
        let next = start + payload.next_multiple_of(ALIGN);
        if next > self.waiting.end {
            return Ok(None);
        }
        self.waiting.start = next;
        Ok(Some((Header { time: Time { s, us }, sender, kind }, start..start + payload)))
    }

    /// The bytes there.
    pub fn payload(&self, at: Range<usize>) -> &[u8] {
        self.bytes.get(at).unwrap_or_default()
    }
}

/// Whether it can be the number of a sender or type.
pub fn is_id(number: i32) -> bool {
    usize::try_from(number).is_ok_and(|number| number < MOST_IDS)
}

fn numbers(header: &[u8; HEADER_BYTES]) -> [u32; HEADER_BYTES / 4] {
    std::array::from_fn(|i| u32::from_be_bytes(std::array::from_fn(|byte| header[4 * i + byte])))
}

/// Messages on their way out.
#[derive(Debug, Default)]
pub struct Outgoing {
    bytes: Vec<u8>,
    sequence: u32,
}

impl Outgoing {
    /// With room for so many bytes: within it nothing is allocated.
    pub fn with_capacity(bytes: usize) -> Self {
        Self { bytes: Vec::with_capacity(bytes), sequence: 0 }
    }

    /// What there is.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// It is sent.
    pub fn clear(&mut self) {
        self.bytes.clear();
    }

    /// Adds a message.
    pub fn message(&mut self, header: Header, payload: impl FnOnce(&mut Vec<u8>)) {
        let Header { time: Time { s, us }, sender, kind } = header;
        let begin = self.bytes.len();
        for number in [0, s, us, sender.cast_unsigned(), kind.cast_unsigned(), self.sequence] {
            self.bytes.extend_from_slice(&number.to_be_bytes());
        }
        self.sequence = self.sequence.wrapping_add(1);
        payload(&mut self.bytes);
        let length = self.bytes.len() - begin;
        self.bytes[begin..begin + 4].copy_from_slice(&(length as u32).to_be_bytes());
        self.bytes.resize(begin + length.next_multiple_of(ALIGN), 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What comes of bytes that come in parts.
    fn received(bytes: &[u8], parts: usize) -> Result<Vec<(Header, Vec<u8>)>, Malformed> {
        let (mut received, mut messages) = (Received::default(), Vec::new());
        for part in bytes.chunks(parts) {
            received.room()[..part.len()].copy_from_slice(part);
            received.came(part.len());
            while let Some((header, at)) = received.next_message()? {
                messages.push((header, received.payload(at).to_vec()));
            }
        }
        Ok(messages)
    }

    #[test]
    fn a_message_is_what_the_protocol_says_it_is() {
        let mut out = Outgoing::default();
        let header = Header { time: Time { s: 1, us: 2 }, sender: 3, kind: SENDER_DESCRIPTION };
        out.message(header, |_| ());
        out.message(header, |bytes| bytes.extend_from_slice(b"123456789"));
        let begin = b"\0\0\0\x18\0\0\0\x01\0\0\0\x02\0\0\0\x03\xff\xff\xff\xff\0\0\0\0";
        assert_eq!(&out.bytes()[..24], begin);
        // The length is without what fills it up, the second one is number 1.
        assert_eq!((&out.bytes()[24..28], &out.bytes()[44..48]), (&[0, 0, 0, 33][..], &[0, 0, 0, 1][..]));
        assert_eq!(&out.bytes()[48..], b"123456789\0\0\0\0\0\0\0");
    }

    #[test]
    fn minor_versions_agree_and_major_ones_do_not() {
        assert!(is_cookie(&cookie()));
        assert!(is_cookie(b"vrpn: ver. 07.35  3\0\0\0\0\0"));
        assert!(!is_cookie(b"vrpn: ver. 06.38  0\0\0\0\0\0"));
        assert!(!is_cookie(b"HTTP/1.1 400 Bad Request"));
    }

    #[test]
    fn lengths_and_numbers_that_cannot_be_are_malformed() {
        let with = |at: usize, number: i32| {
            let mut out = Outgoing::default();
            out.message(Header { time: Time::default(), sender: 3, kind: 4 }, |_| ());
            let mut bytes = out.bytes().to_vec();
            bytes[4 * at..4 * at + 4].copy_from_slice(&number.to_be_bytes());
            received(&bytes, 64)
        };
        assert!(with(0, 24).is_ok() && with(0, 24 + 64_000).is_ok() && with(4, DISCONNECT).is_ok());
        for (at, number) in [(0, 23), (0, 24 + 64_001), (0, -1), (3, -1), (3, 2000), (4, 2000), (4, -6)] {
            assert_eq!(with(at, number), Err(Malformed), "{number} at {at}");
        }
    }

    #[test]
    fn the_longest_message_has_room_however_it_comes() {
        let mut out = Outgoing::default();
        for _ in 0..3 {
            let header = Header { time: Time::default(), sender: 0, kind: 0 };
            out.message(header, |bytes| bytes.resize(bytes.len() + LONGEST_PAYLOAD, 7));
        }
        for parts in [1, 999, 1024] {
            assert_eq!(received(out.bytes(), parts).unwrap().len(), 3);
        }
    }

    proptest! {
        #[test]
        fn messages_come_out_as_they_went_in_split_and_merged(
            messages in prop::collection::vec((0..2000_i32, -5..2000_i32, prop::collection::vec(any::<u8>(), 0..100)), 0..10),
            (s, us) in any::<(u32, u32)>(),
            parts in 1_usize..300,
        ) {
            let mut out = Outgoing::default();
            let mut expected = Vec::new();
            for (sender, kind, payload) in messages {
                let header = Header { time: Time { s, us }, sender, kind };
                out.message(header, |bytes| bytes.extend_from_slice(&payload));
                expected.push((header, payload));
            }
            prop_assert_eq!(received(out.bytes(), parts), Ok(expected));
        }

        #[test]
        fn any_bytes_are_messages_or_malformed(bytes in prop::collection::vec(any::<u8>(), 0..500), parts in 1_usize..50) {
            let _ = received(&bytes, parts);
        }
    }
}
