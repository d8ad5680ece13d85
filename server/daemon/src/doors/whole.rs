//! Requests are taken whole before a service sees them: what they announce is worth nothing, what has come is counted, and what
//! stays away is not waited for. gRPC's decoder would reserve what is announced.
use super::{
    bounds::{self, Bounds},
    refusals::{Peer, Reason, Refusals},
};
use axum::{
    body::{Body, Bytes, HttpBody as _},
    extract::{Request, State},
    http::{HeaderMap, HeaderValue, header::CONTENT_TYPE},
    middleware::Next,
    response::Response,
};
use bytes::BytesMut;
use http_body_util::BodyExt as _;
use std::sync::Arc;
use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore},
    time::{Instant, timeout_at},
};
use tonic::Status;

/// Length of what stands before every message: whether it is compressed, and its length.
const PREFIX_BYTES: usize = 5;
/// What a request may have beside its one message: its prefix, and trailers of gRPC-web.
const BESIDE_BYTES: usize = 1024;
/// The stream of a device.
pub const ATTACH: &str = "/palpate.v1.Device/Attach";
/// What begins trailers of gRPC-web, in a message's place.
const TRAILERS: u8 = 0x80;
/// A permit of [`Gate::room`] is for so many bytes.
const PERMIT_BYTES: usize = 64 * 1024;

/// What requests have to pass.
#[derive(Debug, Clone)]
pub struct Gate {
    bounds: Bounds,
    refusals: Arc<Refusals>,
    room: Arc<Semaphore>,
}

impl Gate {
    /// A gate that counts who does not pass.
    pub fn new(bounds: Bounds, refusals: &Arc<Refusals>) -> Self {
        let room = Arc::new(Semaphore::new(bounds::HELD_BYTES / PERMIT_BYTES));
        Self { bounds, refusals: Arc::clone(refusals), room }
    }
}

/// Takes a request whole and hands it on, or refuses it. What is no gRPC has no body that anybody reads; of streams from clients,
/// every message is bounded by [`bounds::MAX_SMALL_BYTES`].
pub async fn take(State(gate): State<Gate>, request: Request, next: Next) -> Response {
    if !is_grpc(request.headers()) || is_streamed(request.uri().path()) {
        return next.run(request).await;
    }
    let (parts, body) = request.into_parts();
    match gate.collect(body, bounds::message_bytes(parts.uri.path())).await {
        Ok((bytes, _held)) => next.run(Request::from_parts(parts, Body::from(bytes))).await,
        Err((reason, status)) => {
            if let Some(reason) = reason {
                gate.refusals.count(reason, parts.extensions.get::<Peer>().copied());
            }
            refused(&status, &parts.headers)
        }
    }
}

/// Whether a request is of gRPC, or of gRPC-web in bytes; in text it is not spoken.
pub fn is_grpc(headers: &HeaderMap) -> bool {
    let kind = headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes).unwrap_or_default();
    kind.starts_with(b"application/grpc") && !kind.starts_with(b"application/grpc-web-text")
}

fn is_streamed(path: &str) -> bool {
    path == ATTACH || path.starts_with("/grpc.reflection.")
}

/// An answer without a message, of the kind that was asked for.
pub fn refused(status: &Status, asked: &HeaderMap) -> Response {
    let mut response = status.clone().into_http::<Body>();
    let kind = asked.get(CONTENT_TYPE).cloned();
    response.headers_mut().insert(CONTENT_TYPE, kind.unwrap_or(HeaderValue::from_static("application/grpc")));
    response
}

impl Gate {
    /// The bytes of a request, and the room that they take.
    async fn collect(
        &self,
        mut body: Body,
        message_bytes: usize,
    ) -> Result<(Bytes, Option<OwnedSemaphorePermit>), (Option<Reason>, Status)> {
        let ends = Instant::now() + self.bounds.request;
        let mut bytes = BytesMut::new();
        let mut held: Option<OwnedSemaphorePermit> = None;
        while !body.is_end_stream() {
            let until = ends.min(Instant::now() + self.bounds.stall);
            let frame = match timeout_at(until, body.frame()).await {
                Ok(Some(Ok(frame))) => frame,
                Ok(Some(Err(error))) => {
                    return Err((None, Status::cancelled(format!("the request broke off: {error}"))));
                }
                Ok(None) => break,
                Err(_) => return Err((Some(Reason::TooSlow), self.too_slow())),
            };
            let Some(data) = frame.data_ref() else { continue };
            let size = bytes.len() + data.len();
            let announced = announced(&bytes, data);
            let most = announced.unwrap_or(0).max(size.saturating_sub(BESIDE_BYTES));
            if most > message_bytes {
                return Err((Some(Reason::TooLarge), too_large(most, message_bytes)));
            }
            if size > bounds::MAX_SMALL_BYTES + BESIDE_BYTES {
                self.make_room(&mut held, size)?;
            }
            bytes.extend_from_slice(data);
        }
        if !is_one_message(&bytes) {
            return Err((
                Some(Reason::Broken),
                Status::invalid_argument("the request is not one message, whole and alone"),
            ));
        }
        Ok((bytes.freeze(), held))
    }

    /// Takes permits for as many bytes.
    fn make_room(&self, held: &mut Option<OwnedSemaphorePermit>, size: usize) -> Result<(), (Option<Reason>, Status)> {
        let has = held.as_ref().map_or(0, OwnedSemaphorePermit::num_permits);
        let further = size.div_ceil(PERMIT_BYTES).saturating_sub(has);
        let Ok(permits) = Arc::clone(&self.room).try_acquire_many_owned(further as u32) else {
            let text = "other requests hold as much memory as all may: try again later";
            return Err((Some(Reason::NoRoom), Status::resource_exhausted(text)));
        };
        match held {
            Some(held) => held.merge(permits),
            None => *held = Some(permits),
        }
        Ok(())
    }

    fn too_slow(&self) -> Status {
        let (stall, all) = (self.bounds.stall.as_secs_f64(), self.bounds.request.as_secs_f64());
        let text =
            format!("the request did not come to its end: no further byte for {stall} s, or more than {all} s in all");
        Status::deadline_exceeded(text)
    }
}

/// The length that a message announces, once the bytes before it are there.
fn announced(before: &[u8], data: &[u8]) -> Option<usize> {
    let mut prefix = before.iter().chain(data).skip(1).take(PREFIX_BYTES - 1);
    let mut byte = || prefix.next().copied();
    Some(u32::from_be_bytes([byte()?, byte()?, byte()?, byte()?]) as usize)
}

/// Whether a request's bytes are a message with its prefix, and no more but what gRPC-web may put behind it. gRPC's decoder would take
/// another's announcement for true.
fn is_one_message(bytes: &[u8]) -> bool {
    let end = |from: usize| Some(from + PREFIX_BYTES + announced(&[], bytes.get(from..)?)?);
    match end(0) {
        // None at all is told by the service itself.
        None => bytes.is_empty(),
        Some(first) if first == bytes.len() => true,
        Some(first) => bytes.get(first) == Some(&TRAILERS) && end(first) == Some(bytes.len()),
    }
}

fn too_large(bytes: usize, most: usize) -> Status {
    Status::out_of_range(format!("the request's message has {bytes} bytes or more; its method takes at most {most}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_one_message_whole_and_alone() {
        let message = [0, 0, 0, 0, 2, 7, 7];
        let trailers = [0x80, 0, 0, 0, 1, 9];
        assert!(is_one_message(&[]) && is_one_message(&message) && is_one_message(&[0; 5]));
        assert!(is_one_message(&[&message[..], &trailers].concat()));
        for broken in [&message[..6], &message[..3], &[&message[..], &[0]].concat(), &[&message[..], &message].concat()]
        {
            assert!(!is_one_message(broken), "{broken:?}");
        }
        // 10 bytes that would have the decoder reserve 64 MiB.
        assert!(!is_one_message(&[0, 0, 0, 0, 0, 0, 4, 0, 0, 0]));
        assert!(!is_one_message(&[&message[..], &trailers[..5]].concat()));
    }
}
