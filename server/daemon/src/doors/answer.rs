//! Answers on their way: as long as one is, its connection is in use; what its peer does not take is a debt with a date.
use super::crowd::Place;
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
};
use tokio::{sync::OwnedSemaphorePermit, time::Instant};

/// Since when parts of a connection's answers have been handed to the transport that it has not asked to follow.
#[derive(Debug, Default)]
pub(super) struct Debts {
    next: AtomicU64,
    since: Mutex<BTreeMap<u64, Instant>>,
}

impl Debts {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Instant>> {
        self.since.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Since when the oldest is.
    pub(super) fn oldest(&self) -> Option<Instant> {
        self.lock().values().min().copied()
    }
}

/// One request, from its headers to the end of its answer.
#[derive(Debug)]
pub(super) struct Answer {
    place: Arc<Place>,
    debts: Arc<Debts>,
    number: u64,
    body: Body,
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
    pub(super) fn begin(place: &Arc<Place>, debts: &Arc<Debts>) -> Self {
        place.begin();
        let number = debts.next.fetch_add(1, Ordering::Relaxed);
        Self { place: Arc::clone(place), debts: Arc::clone(debts), number, body: Body::empty(), kept: Vec::new() }
    }

    /// It keeps this until its end.
    pub(super) fn keep(&mut self, kept: Kept) {
        self.kept.push(kept);
    }

    /// Its answer is this.
    pub(super) fn is(mut self, body: Body) -> Self {
        self.body = body;
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

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let polled = Pin::new(&mut self.body).poll_frame(cx);
        let mut debts = self.debts.lock();
        match &polled {
            Poll::Ready(Some(Ok(_))) => debts.insert(self.number, Instant::now()),
            _ => debts.remove(&self.number),
        };
        drop(debts);
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
