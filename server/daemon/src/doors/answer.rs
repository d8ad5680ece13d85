//! Answers on their way: as long as one is, its connection is in use; what its peer does not take is a debt with a date.
use super::{bounds::SEND_BUFFER_BYTES, crowd::Place};
use axum::body::{Body, Bytes, HttpBody};
use http_body::{Frame, SizeHint};
use std::{
    collections::BTreeMap,
    pin::Pin,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    task::{Context, Poll},
    time::Duration,
};
use tokio::{sync::OwnedSemaphorePermit, time::Instant};

/// Until when the transport has to ask for what follows those parts of a connection's answers that have been handed to it.
#[derive(Debug, Default)]
pub(super) struct Debts {
    next: AtomicU64,
    due: Mutex<BTreeMap<u64, Instant>>,
}

impl Debts {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Instant>> {
        self.due.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// When the first of them is due.
    pub(super) fn first(&self) -> Option<Instant> {
        self.lock().values().min().copied()
    }
}

/// One request, from its headers to the end of its answer.
#[derive(Debug)]
pub(super) struct Answer {
    place: Arc<Place>,
    debts: Arc<Debts>,
    number: u64,
    /// How long a part may be left.
    patience: Duration,
    body: Body,
    /// Of a part of the body, what has not been handed on.
    rest: Bytes,
    kept: Vec<Kept>,
}

/// What an answer keeps until its end, a permit for what it takes of the daemon: an extension of the response.
#[derive(Debug, Clone)]
pub struct Kept {
    _permit: Arc<OwnedSemaphorePermit>,
}

impl Kept {
    /// Keeps a permit.
    pub fn new(permit: OwnedSemaphorePermit) -> Self {
        Self { _permit: Arc::new(permit) }
    }
}

impl Answer {
    /// A request has come.
    pub(super) fn begin(place: &Arc<Place>, debts: &Arc<Debts>, patience: Duration) -> Self {
        place.begin();
        let number = debts.next.fetch_add(1, Ordering::Relaxed);
        Self {
            place: Arc::clone(place),
            debts: Arc::clone(debts),
            number,
            patience,
            body: Body::empty(),
            rest: Bytes::new(),
            kept: Vec::new(),
        }
    }

    /// It keeps this until its end.
    pub(super) fn keep(&mut self, kept: Kept) {
        self.kept.push(kept);
    }

    /// Its answer is this.
    pub(super) fn is(mut self, body: Body) -> Self {
        self.body = body;
        // A peer whose window has no room asks for nothing from the first.
        self.debts.lock().insert(self.number, Instant::now() + self.patience);
        self
    }
}

impl Drop for Answer {
    fn drop(&mut self) {
        self.debts.lock().remove(&self.number);
        self.place.end();
    }
}

impl HttpBody for Answer {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Polled {
        // A transport that has taken a part holds all of it: parts are small, so that what is not taken is seen to be here.
        if self.rest.is_empty() {
            match Pin::new(&mut self.body).poll_frame(cx) {
                Poll::Ready(Some(Ok(frame))) => match frame.into_data() {
                    Ok(data) if data.len() > SEND_BUFFER_BYTES => self.rest = data,
                    Ok(data) => return self.noted(Poll::Ready(Some(Ok(Frame::data(data))))),
                    Err(trailers) => return self.noted(Poll::Ready(Some(Ok(trailers)))),
                },
                polled => return self.noted(polled),
            }
        }
        let part = SEND_BUFFER_BYTES.min(self.rest.len());
        let part = self.rest.split_to(part);
        self.noted(Poll::Ready(Some(Ok(Frame::data(part)))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let (of_body, rest) = (self.body.size_hint(), self.rest.len() as u64);
        let mut hint = SizeHint::new();
        if let Some(upper) = of_body.upper() {
            hint.set_upper(upper + rest);
        }
        hint.set_lower(of_body.lower() + rest);
        hint
    }
}

type Polled = Poll<Option<Result<Frame<Bytes>, axum::Error>>>;

impl Answer {
    /// Notes until when a part that was handed on has to be taken, or that none is there.
    fn noted(&self, polled: Polled) -> Polled {
        let mut debts = self.debts.lock();
        match &polled {
            Poll::Ready(Some(Ok(_))) => debts.insert(self.number, Instant::now() + self.patience),
            _ => debts.remove(&self.number),
        };
        drop(debts);
        polled
    }
}
