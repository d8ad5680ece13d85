//! Devices that are not there: their bytes over real sockets, with the motion of an arm and a hand, and faults on request.
pub mod cli;
pub mod hapticmaster;
pub mod woodenhaptics;

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// What an emulator does wrong. Set while it runs.
#[derive(Debug, Default)]
pub struct Faults {
    /// Answers nothing, and goes on.
    pub silence: AtomicBool,
    /// Answers bytes without meaning.
    pub garbage: AtomicBool,
    /// Answers byte by byte.
    pub split: AtomicBool,
    /// Answers after so long (us).
    pub slow_us: AtomicU32,
    /// Refuses every command.
    pub refusal: AtomicBool,
    /// The emergency stop is pressed.
    pub emergency_stop: AtomicBool,
    /// The cable is pulled: the connection is cut.
    pub cut: AtomicBool,
}

impl Faults {
    /// Sets one of them.
    pub fn set(flag: &AtomicBool, on: bool) {
        flag.store(on, Ordering::Relaxed);
    }

    fn is(flag: &AtomicBool) -> bool {
        flag.load(Ordering::Relaxed)
    }
}
