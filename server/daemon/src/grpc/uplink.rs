//! A device's way up: every sample is checked, the newest goes into the loop's slot, what is wrong goes back as a fault.
use super::convert::{self, Rejected};
use crate::{
    session::{Daemon, DeviceRecord, Dismissal},
    sim::exchange::DeviceInput,
    sparing::Sparing,
};
use palpate_proto::v1::{self, DeviceFaultCode, device_up::Message};
use palpate_realtime::Clock;
use std::{
    collections::BTreeMap,
    sync::{Arc, atomic::Ordering},
    time::Duration,
};
use tokio::{
    sync::{mpsc, oneshot},
    time::{Instant, MissedTickBehavior, interval_at},
};
use tokio_util::sync::{CancellationToken, DropGuard};
use tonic::{Status, Streaming};
use triple_buffer::Input;

/// Faults that may wait for the way down; beyond it they are only counted.
pub const FAULTS_WAITING: usize = 16;

/// The loop's slot for samples. It finds its way back however the way up ends, by a panic too: without it no other device could
/// take the tool.
#[derive(Debug)]
pub struct Lent {
    slot: Option<Input<Option<DeviceInput>>>,
    back: Option<oneshot::Sender<Input<Option<DeviceInput>>>>,
}

impl Lent {
    /// The slot, and where it comes back.
    pub fn new(slot: Input<Option<DeviceInput>>) -> (Self, oneshot::Receiver<Input<Option<DeviceInput>>>) {
        let (back, returned) = oneshot::channel();
        (Self { slot: Some(slot), back: Some(back) }, returned)
    }

    fn write(&mut self, input: DeviceInput) {
        if let Some(slot) = &mut self.slot {
            slot.write(Some(input));
        }
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        if let (Some(slot), Some(back)) = (self.slot.take(), self.back.take()) {
            let _ = back.send(slot);
        }
    }
}

/// The way up of one attachment.
#[derive(Debug)]
pub struct Uplink {
    /// Messages of the device.
    pub messages: Streaming<v1::DeviceUp>,
    /// Slot of the loop.
    pub samples: Lent,
    /// Attachment.
    pub attachment: u64,
    /// What status shows.
    pub record: Arc<DeviceRecord>,
    /// Total of rejected samples.
    pub daemon: Arc<Daemon>,
    /// To the way down.
    pub faults: mpsc::Sender<v1::DeviceFault>,
    /// Cancelled when either way ends.
    pub over: CancellationToken,
    /// Time without a sample after which the tool is taken from the device.
    pub lease: Duration,
    /// Lines about a fault that is latched at the device.
    pub of_latches: Sparing,
}

/// In so many looks without a sample a lease ends.
const LOOKS: u32 = 10;

/// How long a device has been silent. Time in which the daemon stood still does not count: it looks once meanwhile, and where its loop
/// did not tick, a device that sends a sample for each command had none to send.
#[derive(Debug, Default)]
struct Silence {
    samples: u64,
    ticks: u64,
    looks: u32,
}

impl Silence {
    /// Whether it has been silent for the time of its lease, after so many samples of its and ticks of the loop.
    fn look(&mut self, samples: u64, ticks: u64) -> bool {
        if samples != self.samples {
            self.looks = 0;
        } else if ticks != self.ticks {
            self.looks += 1;
        }
        (self.samples, self.ticks) = (samples, ticks);
        self.looks >= LOOKS
    }
}

/// How the way up ended.
pub type Ended = Result<(), Status>;

impl Uplink {
    /// Reads until the device, or the way down, ends. The slot goes back then.
    pub async fn run(mut self, _ends_the_way_down: DropGuard) -> Ended {
        let mut last_sequence = None;
        let mut counts: BTreeMap<i32, u64> = BTreeMap::new();
        let over = self.over.clone();
        let mut silence = Silence::default();
        let mut looks = interval_at(Instant::now() + self.lease / LOOKS, self.lease / LOOKS);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let message = tokio::select! {
                () = over.cancelled() => return Ok(()),
                message = self.messages.message() => message,
                _ = looks.tick() => {
                    let ticks = self.daemon.timing.the_loop.ticks();
                    // One whose samples are refused is not silent.
                    let samples = [&self.record.accepted, &self.record.rejected].map(|count| count.load(Ordering::Relaxed));
                    if silence.look(samples.iter().sum(), ticks) {
                        self.record.dismiss(Dismissal::Silent);
                    }
                    continue;
                }
            };
            let up = match message {
                Ok(Some(up)) => up,
                Ok(None) => return Ok(()),
                Err(status) => return Err(status),
            };
            if let Err((sequence, rejected)) = self.take(&up, &mut last_sequence) {
                self.report(sequence, rejected, &mut counts);
            }
        }
    }

    fn take(&mut self, up: &v1::DeviceUp, last_sequence: &mut Option<u64>) -> Result<(), (u64, Rejected)> {
        let missing = |message: &str| Rejected { code: DeviceFaultCode::MissingField, message: message.to_owned() };
        let sample = match &up.message {
            Some(Message::Sample(sample)) => sample,
            Some(Message::Hello(_)) => return Err((0, missing("this stream said hello already: send samples"))),
            None => return Err((0, missing("the message carries neither hello nor sample"))),
        };
        let arrived_ns = Clock::Monotonic.now_ns();
        let input = convert::device_sample(sample, *last_sequence, self.attachment, arrived_ns)
            .map_err(|rejected| (sample.sequence, rejected))?;
        *last_sequence = Some(input.sequence);
        self.samples.write(input);
        self.record.accepted.fetch_add(1, Ordering::Relaxed);
        self.record.newest_ns.store(arrived_ns, Ordering::Relaxed);
        self.tell_safety(sample.safety_state);
        Ok(())
    }

    /// Notes what the device says of its force; that a fault is latched is logged when it begins.
    fn tell_safety(&self, state: i32) {
        if self.record.safety_state.swap(state, Ordering::Relaxed) != state
            && state == i32::from(v1::SafetyState::FaultLatched)
        {
            let device = &self.record.name;
            self.of_latches.say(|times| {
                tracing::warn!(
                    device,
                    times,
                    "a fault is latched at the device: it has no force until somebody there recovers it"
                );
            });
        }
    }

    fn report(&self, sample_sequence: u64, rejected: Rejected, counts: &mut BTreeMap<i32, u64>) {
        self.record.rejected.fetch_add(1, Ordering::Relaxed);
        self.daemon.samples_rejected.fetch_add(1, Ordering::Relaxed);
        let code = i32::from(rejected.code);
        let count = counts.entry(code).or_insert(0);
        *count += 1;
        // A full queue drops the fault: the count of the next one tells.
        let _ =
            self.faults.try_send(v1::DeviceFault { code, message: rejected.message, sample_sequence, count: *count });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_silence_of_the_whole_lease_ends_it() {
        let (mut silence, mut ticks) = (Silence::default(), 0);
        let mut looks = |accepted: u64, times: u32, goes_on: bool| {
            (0..times).any(|_| {
                ticks += u64::from(goes_on);
                silence.look(accepted, ticks)
            })
        };
        // A device that has said hello and nothing else has as long as any other.
        assert!(!looks(0, LOOKS - 1, true));
        assert!(!looks(1, LOOKS, true));
        assert!(!looks(2, LOOKS, true));
        assert!(!looks(2, 100, false), "the loop stands");
        assert!(looks(2, 1, true));
    }
}
