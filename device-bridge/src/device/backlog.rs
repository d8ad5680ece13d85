//! How much of what was said to a serial line may be unsent before nothing more is put behind it.

/// With more bytes unsent the other end does not listen, and what is put behind them would be old when it does.
const MOST_BYTES: u32 = 512;
/// The same in buffers, where these are counted: a message may take some ticks to be taken, and with one of them on its way nothing is wrong yet.
const MOST_BUFFERS: u32 = 4;

/// What the operating system's count of unsent bytes means on a line.
///
/// Most drivers count bytes. That of USB CDC lines (`/dev/ttyACM*`) counts buffers on their way, one for each message, and each as its whole size of 20 packets
/// (1280 bytes, or 10240 at high speed) however short the message: one is more than [`MOST_BYTES`] already. Such a line is known by what it counts
/// when a message was put on it while it was empty: more than the message has, and than a message or two of a guard.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Backlog {
    /// A buffer's size (bytes); 0 where bytes are counted, or nothing is known yet.
    buffer: u32,
}

impl Backlog {
    /// An empty line was given so many bytes, and counts so many then.
    pub(super) fn learn(&mut self, given: usize, counted: u32) {
        if counted as usize > given && counted > MOST_BYTES {
            self.buffer = counted;
        }
    }

    /// Whether nothing may be put behind so much.
    pub(super) fn is_too_long(self, counted: u32) -> bool {
        if self.buffer > 0 { counted >= MOST_BUFFERS.saturating_mul(self.buffer) } else { counted > MOST_BYTES }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_bytes_and_buffers_are_messages() {
        let mut backlog = Backlog::default();
        for (given, counted) in [(16, 16), (16, 0), (30, 12)] {
            backlog.learn(given, counted);
            assert!(!backlog.is_too_long(512) && backlog.is_too_long(513));
        }
        for buffer in [1280, 10_240] {
            backlog.learn(2, buffer);
            // Taken before it was looked at.
            backlog.learn(2, 0);
            assert_eq!([1, 3, 4, 16].map(|count| backlog.is_too_long(count * buffer)), [false, false, true, true]);
        }
    }
}
