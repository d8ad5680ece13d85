//! Random bytes on a real line, for tests of what drivers make of them.
#![allow(clippy::unwrap_used)]
use serialport::{SerialPort as _, TTYPort};
use std::{
    io::{Read as _, Write as _},
    time::Duration,
};

/// Both ends of a pseudo terminal, and the path of the driver's.
pub(crate) struct Pair {
    ours: TTYPort,
    /// Open, or ours would end with whoever closes it.
    _theirs: TTYPort,
    pub(crate) path: String,
}

impl Pair {
    pub(crate) fn new() -> Self {
        let (ours, theirs) = TTYPort::pair().unwrap();
        let path = theirs.name().unwrap();
        Self { ours, _theirs: theirs, path }
    }

    /// A driver that starts, while every message of its is answered so.
    pub(crate) fn starting<T: Send>(&mut self, answer: &[u8], start: impl FnOnce() -> T + Send) -> T {
        self.ours.set_timeout(Duration::from_millis(5)).unwrap();
        std::thread::scope(|scope| {
            let started = scope.spawn(start);
            while !started.is_finished() {
                if self.ours.read(&mut [0; 64]).is_ok() {
                    self.ours.write_all(answer).unwrap();
                }
            }
            started.join().unwrap()
        })
    }

    /// A million bytes, in pieces of up to 64; `look` after each.
    pub(crate) fn feed(&mut self, mut look: impl FnMut()) {
        let mut left = 1_000_000_usize;
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        while left > 0 {
            let piece: Vec<u8> = (0..=random.next() % 64).map(|_| random.next() as u8).collect();
            self.ours.write_all(&piece).unwrap();
            look();
            left = left.saturating_sub(piece.len());
            // What the driver says is not heard, and must not pile up.
            let said = self.ours.bytes_to_read().unwrap() as usize;
            self.ours.read_exact(&mut vec![0; said]).unwrap();
        }
    }
}

/// Marsaglia's xorshift.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
}
