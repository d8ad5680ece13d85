//! Random bytes on a real line, for tests of what drivers make of them.
#![allow(clippy::unwrap_used)]
use serialport::{SerialPort as _, TTYPort};
use std::{
    io::{Read as _, Write as _},
    time::{Duration, Instant},
};

/// How long a pseudo terminal of a busy machine may take to hand on what was written.
const PATIENCE: Duration = Duration::from_secs(30);
/// How long a driver that starts is listened to at a time.
const LISTENED: Duration = Duration::from_millis(5);

/// Both ends of a pseudo terminal, and the path of the driver's.
pub(crate) struct Pair {
    ours: TTYPort,
    /// Open, or ours would end with whoever closes it.
    theirs: TTYPort,
    pub(crate) path: String,
}

impl Pair {
    pub(crate) fn new() -> Self {
        let (mut ours, theirs) = TTYPort::pair().unwrap();
        ours.set_timeout(PATIENCE).unwrap();
        let path = theirs.name().unwrap();
        Self { ours, theirs, path }
    }

    /// A driver that starts, while every message of its is answered so.
    pub(crate) fn starting<T: Send>(&mut self, answer: &[u8], start: impl FnOnce() -> T + Send) -> T {
        std::thread::scope(|scope| {
            let started = scope.spawn(start);
            while !started.is_finished() {
                self.ours.set_timeout(LISTENED).unwrap();
                let said = self.ours.read(&mut [0; 64]).is_ok();
                self.ours.set_timeout(PATIENCE).unwrap();
                if said {
                    self.ours.write_all(answer).unwrap();
                }
            }
            started.join().unwrap()
        })
    }

    /// Says something to the driver.
    pub(crate) fn say(&mut self, bytes: &[u8]) {
        self.ours.write_all(bytes).unwrap();
    }

    /// All that the driver has said so far.
    pub(crate) fn heard(&mut self) -> Vec<u8> {
        let mut heard = Vec::new();
        loop {
            // A pseudo terminal hands on what was written a moment later.
            std::thread::sleep(Duration::from_millis(20));
            let there = self.ours.bytes_to_read().unwrap() as usize;
            if there == 0 {
                return heard;
            }
            let mut bytes = vec![0; there];
            self.ours.read_exact(&mut bytes).unwrap();
            heard.append(&mut bytes);
        }
    }

    /// A million random bytes, in pieces of up to 64: every other one within messages of the arm; `look` after each has
    /// come to the driver's end.
    pub(crate) fn feed(&mut self, message: &[u8], mut look: impl FnMut()) {
        let mut left = 1_000_000_usize;
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        while left > 0 {
            let noise: Vec<u8> = (0..=random.next() % 64).map(|_| random.next() as u8).collect();
            let piece =
                if noise.len().is_multiple_of(2) { spliced(message, &noise, &mut random) } else { noise.clone() };
            self.ours.write_all(&piece).unwrap();
            self.wait_for(piece.len());
            look();
            left = left.saturating_sub(noise.len());
            // What the driver says is not heard, and must not pile up.
            let said = self.ours.bytes_to_read().unwrap() as usize;
            self.ours.read_exact(&mut vec![0; said]).unwrap();
        }
    }

    /// Until so many bytes are at the driver's end: the kernel hands them on a moment after they were written, and on a
    /// busy machine several pieces at once.
    fn wait_for(&self, count: usize) {
        let began = Instant::now();
        while (self.theirs.bytes_to_read().unwrap() as usize) < count {
            assert!(began.elapsed() < PATIENCE, "the pseudo terminal does not hand on {count} bytes");
            std::thread::yield_now();
        }
    }
}

/// Two messages, in the midst of which a part of the noise was put, or takes the place of what was there.
fn spliced(message: &[u8], noise: &[u8], random: &mut Random) -> Vec<u8> {
    let mut piece = [message, message].concat();
    let at = random.next() as usize % piece.len();
    let few = &noise[..noise.len().min(1 + random.next() as usize % 4)];
    let replaced = if random.next().is_multiple_of(2) { few.len().min(piece.len() - at) } else { 0 };
    piece.splice(at..at + replaced, few.iter().copied());
    piece
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
