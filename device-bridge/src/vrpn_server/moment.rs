//! What the servo tells of a tick, for programs that watch. It publishes into a slot, and waits for nobody.
use crate::device::Reading;
use glam::DVec3;
use palpate_control::LocalModel;
use palpate_realtime::{Doorbell, SlotReader, SlotWriter, slot};

/// One tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Counts what was told, from 1.
    pub number: u64,
    /// When the arm was read (ns, this machine's monotonic clock).
    pub read_ns: u64,
    /// What was read, in the world.
    pub reading: Reading,
    /// Force on the arm (N, world).
    pub force_n: DVec3,
    /// The newest contact, as long as there is force from it.
    pub contact: Option<LocalModel>,
}

/// The servo's end.
#[derive(Debug)]
pub struct MomentWriter {
    slot: SlotWriter<Option<Moment>>,
    bell: Doorbell,
    every: u64,
    ticks: u64,
    number: u64,
}

/// Every so many ticks are told: both ends, and the bell that rings then.
///
/// # Errors
/// When the process has too many open files.
pub fn moments(every: u64) -> std::io::Result<(MomentWriter, SlotReader<Option<Moment>>, Doorbell)> {
    let (writer, reader) = slot(&None);
    let bell = Doorbell::new()?;
    let writer = MomentWriter { slot: writer, bell: bell.clone(), every: every.max(1), ticks: 0, number: 0 };
    Ok((writer, reader, bell))
}

impl MomentWriter {
    /// A tick. Neither waits nor allocates.
    pub fn tell(&mut self, read_ns: u64, reading: &Reading, force_n: DVec3, contact: Option<LocalModel>) {
        self.ticks += 1;
        if !self.ticks.is_multiple_of(self.every) {
            return;
        }
        self.number += 1;
        self.slot.publish(Some(Moment { number: self.number, read_ns, reading: *reading, force_n, contact }));
        self.bell.ring();
    }
}
