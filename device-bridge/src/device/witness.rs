//! A driver for tests.
#![allow(clippy::unwrap_used, clippy::panic)]
use super::{Arm, Effort, Fault, Reading};
use glam::DVec3;
use palpate_control::Motion;
use std::sync::{
    Arc, Mutex,
    atomic::{AtomicBool, AtomicU64, Ordering},
};

/// Rests at the origin unless told where it is, remembers its force, and panics at a given reading.
#[derive(Debug)]
pub struct Witness {
    panics_at: u64,
    reads: AtomicU64,
    fails: AtomicBool,
    let_go: AtomicU64,
    reading: Mutex<Reading>,
    /// Force now, and the largest so far (N).
    force_n: Mutex<(f64, f64)>,
}

impl Witness {
    pub(crate) fn panicking_at(reading: u64) -> Self {
        Self {
            panics_at: reading,
            reads: 0.into(),
            fails: false.into(),
            let_go: 0.into(),
            reading: Self::at_rest().into(),
            force_n: (0.0, 0.0).into(),
        }
    }

    pub(crate) fn at_rest() -> Reading {
        let motion = Motion::at(DVec3::ZERO);
        Reading { motion, buttons: 0, measured_force_n: None, age_s: 0.0, force_share: 1.0 }
    }

    pub(crate) fn set(&self, reading: Reading) {
        *self.reading.lock().unwrap() = reading;
    }

    pub(crate) fn force_n(&self) -> f64 {
        self.force_n.lock().unwrap().0
    }

    pub(crate) fn fail(&self) {
        self.fails.store(true, Ordering::Relaxed);
    }

    /// How often it was told that its last words were said.
    pub(crate) fn times_let_go(&self) -> u64 {
        self.let_go.load(Ordering::Relaxed)
    }

    pub(crate) fn peak_n(&self) -> f64 {
        self.force_n.lock().unwrap().1
    }

    fn read_now(&self) -> Reading {
        assert!(self.reads.fetch_add(1, Ordering::Relaxed) < self.panics_at, "the driver fails");
        *self.reading.lock().unwrap()
    }

    fn hold(&self, force_n: DVec3) {
        let mut held = self.force_n.lock().unwrap();
        *held = (force_n.length(), held.1.max(force_n.length()));
    }
}

impl Arm for Arc<Witness> {
    fn read(&mut self, _: u64) -> Result<Reading, Fault> {
        if self.fails.load(Ordering::Relaxed) { Err(Fault::Silent) } else { Ok(self.read_now()) }
    }

    fn apply(&mut self, effort: &Effort) {
        self.hold(effort.force_n);
    }

    fn last_words_were_said(&mut self) {
        self.let_go.fetch_add(1, Ordering::Relaxed);
    }
}
