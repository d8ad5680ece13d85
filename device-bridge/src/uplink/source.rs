//! Messages up: the hello, then the newest sample whenever the transport can take one.
use crate::{
    convert::{self, Sample},
    run::Shared,
};
use palpate_proto::v1;
use palpate_realtime::{Doorbell, SlotReader};
use std::{
    future::Future,
    pin::Pin,
    sync::{Arc, Mutex, PoisonError},
    task::{Context, Poll, ready},
};
use tokio::net::unix::pipe;
use tokio_stream::Stream;
use tokio_util::sync::WaitForCancellationFutureOwned;

/// Where samples come from: shared by the streams of successive connections, one at a time.
#[derive(Debug)]
pub struct SampleSource {
    /// The bell's descriptor, read as a pipe is.
    bell: pipe::Receiver,
    samples: SlotReader<Option<Sample>>,
}

impl SampleSource {
    /// Samples announced by `bell`.
    ///
    /// # Errors
    /// When the runtime cannot watch the bell.
    pub fn new(bell: &Doorbell, samples: SlotReader<Option<Sample>>) -> std::io::Result<Self> {
        Ok(Self { bell: pipe::Receiver::from_owned_fd_unchecked(bell.try_clone_fd()?)?, samples })
    }

    fn poll_newest(&mut self, cx: &mut Context<'_>) -> Poll<Sample> {
        loop {
            // An error cannot happen on an open eventfd; were it to, the samples still come with the next ring.
            let _ = ready!(self.bell.poll_read_ready(cx));
            let rang = self.bell.try_read(&mut [0; 8]).is_ok();
            if let (true, Some(Some(sample))) = (rang, self.samples.take()) {
                return Poll::Ready(*sample);
            }
        }
    }
}

/// Messages of one connection: the hello, then the newest sample whenever the transport can take one, until ended.
pub(super) struct UpStream {
    pub(super) hello: Option<v1::DeviceUp>,
    pub(super) source: Arc<Mutex<SampleSource>>,
    pub(super) end: Pin<Box<WaitForCancellationFutureOwned>>,
    pub(super) shared: Arc<Shared>,
}

impl Stream for UpStream {
    type Item = v1::DeviceUp;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<v1::DeviceUp>> {
        if let Some(hello) = self.hello.take() {
            return Poll::Ready(Some(hello));
        }
        if self.end.as_mut().poll(cx).is_ready() {
            return Poll::Ready(None);
        }
        let sample = ready!(self.source.lock().unwrap_or_else(PoisonError::into_inner).poll_newest(cx));
        self.shared.stats.sent.increment();
        Poll::Ready(Some(convert::sample(&sample)))
    }
}
