//! One viewer's stream: its keyframe, then the newest frame whenever the transport can take one and its rate allows.
//!
//! The stream is pulled: nothing is queued for a viewer. One that reads slowly is asked late, gets the newest frame then, and
//! what passed in between is counted as skipped. Frames left out because the viewer asked for a lower rate are not.
use super::hub::{Frame, Layers, Seat};
use palpate_proto::v1::{self, surface_event::Message};
use std::{collections::VecDeque, sync::Arc, time::Duration};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// The state of one viewer's stream.
#[derive(Debug)]
pub struct Viewer {
    seat: Seat,
    layers: Layers,
    interval: Duration,
    stop: CancellationToken,
    chunks: VecDeque<v1::KeyframeChunk>,
    epoch: Option<u32>,
    held: Option<u64>,
    next_due: Instant,
    skipped: u64,
}

impl Viewer {
    /// A viewer of at most `rate_hz` (Hz, > 0) until `stop`.
    pub fn new(seat: Seat, rate_hz: f64, layers: Layers, stop: CancellationToken) -> Self {
        Self {
            seat,
            layers,
            interval: Duration::from_secs_f64(1.0 / rate_hz),
            stop,
            chunks: VecDeque::new(),
            epoch: None,
            held: None,
            next_due: Instant::now(),
            skipped: 0,
        }
    }

    /// The next event, `None` at the end.
    pub async fn next(&mut self) -> Option<v1::SurfaceEvent> {
        let stop = self.stop.clone();
        let event = tokio::select! {
            () = stop.cancelled() => None,
            event = self.next_event() => event,
        };
        event.map(|message| v1::SurfaceEvent { message: Some(message) })
    }

    async fn next_event(&mut self) -> Option<Message> {
        loop {
            if let Some(chunk) = self.chunks.pop_front() {
                return Some(Message::Keyframe(chunk));
            }
            tokio::time::sleep_until(self.next_due).await;
            let newest = self.seat.frames.borrow_and_update().clone();
            match newest.filter(|frame| self.wants(frame)) {
                Some(frame) if self.epoch != Some(frame.epoch) => {
                    self.epoch = Some(frame.epoch);
                    self.held = None;
                    self.chunks.extend(frame.keyframe.iter().cloned());
                }
                Some(frame) => return Some(self.take(&frame)),
                None => self.seat.frames.changed().await.ok()?,
            }
        }
    }

    fn wants(&self, frame: &Arc<Frame>) -> bool {
        let is_new = self.epoch != Some(frame.epoch) || self.held.is_none_or(|held| held < frame.number);
        // A frame made for viewers that want less has less: the next one will have it.
        is_new && frame.layers.has(self.layers)
    }

    fn take(&mut self, frame: &Arc<Frame>) -> Message {
        self.count_what_passed(frame);
        let update = frame.update(self.held, self.layers, self.skipped);
        self.held = Some(frame.number);
        // From the due time, not from now: the mean rate is the asked one. Never two at once to catch up.
        self.next_due = (self.next_due + self.interval).max(Instant::now());
        Message::Update(update)
    }

    /// Frames this viewer would have had at its rate, had the transport asked for the next one when it was due. Counted when a
    /// frame is taken: a transport may ask early and come back late.
    fn count_what_passed(&mut self, frame: &Frame) {
        let Some(held) = self.held else { return };
        let late = Instant::now().saturating_duration_since(self.next_due);
        let due = (late.as_secs_f64() / self.interval.as_secs_f64()) as u64 + 1;
        let skipped = frame.number.saturating_sub(held).min(due).saturating_sub(1);
        self.skipped += skipped;
        self.seat.count_skipped(skipped);
    }
}
