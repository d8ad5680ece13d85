//! Every call passes here: who calls is found out, the table is asked, and a stream ends when its caller's identity does.
use super::{
    keeper::{Caller, Keeper, Refused},
    table,
};
use crate::{
    doors::{
        origin,
        refusals::{Peer, Reason, Refusals},
        tls::PeerCertificate,
        whole,
    },
    metrics,
};
use axum::{
    body::{Body, Bytes, HttpBody},
    extract::{Request, State},
    http::{
        HeaderMap, HeaderValue, StatusCode,
        header::{AUTHORIZATION, CONTENT_TYPE},
    },
    middleware::Next,
    response::Response,
};
use http_body::Frame;
use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::{Duration, SystemTime},
};
use tokio::time::{Interval, MissedTickBehavior, interval};
use tokio_util::sync::CancellationToken;
use tonic::{Code, Status};
use tracing::Instrument as _;

/// How often it is looked whether a stream's caller may go on.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// Looks that a device's stream has to bring the force to zero and to say goodbye, once its caller may not go on.
const GOODBYE_LOOKS: u32 = 2;

/// What calls have to pass.
#[derive(Debug, Clone)]
pub struct Gate {
    keeper: Arc<Keeper>,
    refusals: Arc<Refusals>,
}

impl Gate {
    /// A gate that counts who does not pass.
    pub fn new(keeper: &Arc<Keeper>, refusals: &Arc<Refusals>) -> Self {
        Self { keeper: Arc::clone(keeper), refusals: Arc::clone(refusals) }
    }
}

/// Cancelled when the caller of a stream may not go on: an extension of the request.
#[derive(Debug, Clone)]
pub struct Expiry(pub CancellationToken);

/// Lets a call pass, with its caller as an extension, or answers why not. What is no call of a service is the page's. Which it is, its
/// path says: services answer a call whatever content type it claims.
pub async fn pass(State(gate): State<Gate>, mut request: Request, next: Next) -> Response {
    let (path, is_grpc) = (request.uri().path(), whole::is_grpc(request.headers()));
    if !is_grpc && !origin::is_call(path) && path != metrics::PATH {
        return next.run(request).await;
    }
    let (is_call, is_device) = (path != metrics::PATH, path == whole::ATTACH);
    let peer = request.extensions().get::<Peer>().copied();
    let caller = match gate.admitted(&request) {
        Ok(caller) => caller,
        Err(status) => {
            gate.refusals.count(Reason::Forbidden, peer);
            return if is_call { whole::refused(&status, request.headers()) } else { in_words(&status) };
        }
    };
    let span = tracing::info_span!("call", rpc = path, peer = peer.map(tracing::field::display), who = caller.name());
    let Caller::Known(_) = &caller else {
        request.extensions_mut().insert(caller);
        return next.run(request).instrument(span).await;
    };
    let expiry = CancellationToken::new();
    request.extensions_mut().insert(caller.clone());
    request.extensions_mut().insert(Expiry(expiry.clone()));
    let is_web = is_web(request.headers());
    let response = next.run(request).instrument(span).await;
    let mut looks = interval(LOOK_EVERY);
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    response.map(|body| {
        let goodbye_looks = if is_device { GOODBYE_LOOKS } else { 0 };
        Body::new(Watched {
            body,
            keeper: gate.keeper,
            caller,
            looks,
            expiry,
            goodbye: None,
            goodbye_looks,
            is_web,
            is_over: false,
        })
    })
}

/// A refusal for who does not speak gRPC.
fn in_words(status: &Status) -> Response {
    let mut response = Response::new(Body::from(format!("{}\n", status.message())));
    *response.status_mut() = match status.code() {
        Code::PermissionDenied => StatusCode::FORBIDDEN,
        _ => StatusCode::UNAUTHORIZED,
    };
    response
}

fn is_web(headers: &HeaderMap) -> bool {
    let kind = headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes).unwrap_or_default();
    kind.starts_with(b"application/grpc-web")
}

impl Gate {
    fn admitted(&self, request: &Request) -> Result<Caller, Status> {
        let is_local = matches!(request.extensions().get::<Peer>(), Some(Peer::Unix));
        let certificate = request.extensions().get::<PeerCertificate>().map(|PeerCertificate(der)| &***der);
        let token = request.headers().get(AUTHORIZATION).map(HeaderValue::as_bytes);
        let (who, path) = (table::who_may(request.uri().path()), request.uri().path());
        if who == table::Who::Anybody {
            return Ok(self.keeper.caller(is_local, certificate, token, SystemTime::now()).unwrap_or(Caller::Unknown));
        }
        let caller = self
            .keeper
            .caller(is_local, certificate, token, SystemTime::now())
            .map_err(|refused| Status::unauthenticated(refused.to_string()))?;
        match &caller {
            Caller::Trusted => Ok(caller),
            Caller::Unknown => Err(Status::unauthenticated(
                "this daemon wants to know who calls: show a certificate or a token (`palpated pki issue`, `palpated pki token`)",
            )),
            Caller::Known(identity) if who.includes(identity.roles) => Ok(caller),
            Caller::Known(identity) => Err(Status::permission_denied(format!(
                "{} may not call {path}: what it was issued is for {}",
                identity.name, identity.roles
            ))),
        }
    }
}

/// An answer that ends when its caller may not go on.
struct Watched {
    body: Body,
    keeper: Arc<Keeper>,
    caller: Caller,
    looks: Interval,
    expiry: CancellationToken,
    /// Why the caller may not go on, and looks since.
    goodbye: Option<(Refused, u32)>,
    /// How many looks it has for its goodbye.
    goodbye_looks: u32,
    is_web: bool,
    is_over: bool,
}

impl Watched {
    /// gRPC's end of a stream: in trailers, or by gRPC-web in a frame of its own.
    fn end(&mut self, refused: Refused) -> Frame<Bytes> {
        self.is_over = true;
        let mut trailers = HeaderMap::new();
        let text = format!("{refused}: the stream ends");
        if Status::permission_denied(text).add_header(&mut trailers).is_err() {
            trailers.insert("grpc-status", HeaderValue::from_static("7"));
        }
        if !self.is_web {
            return Frame::trailers(trailers);
        }
        let mut lines = Vec::new();
        for (name, value) in &trailers {
            lines.extend_from_slice(name.as_str().as_bytes());
            lines.push(b':');
            lines.extend_from_slice(value.as_bytes());
            lines.extend_from_slice(b"\r\n");
        }
        let mut bytes = vec![0x80];
        bytes.extend_from_slice(&(lines.len() as u32).to_be_bytes());
        bytes.extend_from_slice(&lines);
        Frame::data(bytes.into())
    }
}

impl HttpBody for Watched {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        if self.is_over {
            return Poll::Ready(None);
        }
        while self.looks.poll_tick(cx).is_ready() {
            if let Some((refused, looks)) = self.goodbye {
                self.goodbye = Some((refused, looks + 1));
            } else if let Err(refused) = self.keeper.check(&self.caller, SystemTime::now()) {
                self.goodbye = Some((refused, 0));
                self.expiry.cancel();
            }
        }
        let goodbye = self.goodbye;
        let polled = Pin::new(&mut self.body).poll_frame(cx);
        let Some((refused, looks)) = goodbye else { return polled };
        let has_ended = match &polled {
            Poll::Ready(None) => true,
            Poll::Ready(Some(Ok(frame))) => frame.is_trailers(),
            _ => false,
        };
        if has_ended || looks >= self.goodbye_looks { Poll::Ready(Some(Ok(self.end(refused)))) } else { polled }
    }

    fn is_end_stream(&self) -> bool {
        self.is_over || (self.goodbye.is_none() && self.body.is_end_stream())
    }
}
