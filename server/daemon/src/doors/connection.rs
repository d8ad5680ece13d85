//! Connections: accepted, given a place, served, and closed when they ask for nothing or take nothing.
use super::{
    answer::{Answer, Debts, Kept},
    bounds::{self, Bounds},
    crowd::{Crowd, Place},
    lane::{self, Arms},
    listen::{Listener, Socket},
    refusals::{Peer, Reason, Refusals},
    tls::PeerCertificate,
    whole::{self, ATTACH},
};
use axum::{Router, body::Body};
use hyper::{HeaderMap, Request, Response, StatusCode, body::Incoming, service::service_fn};
use hyper_util::{
    rt::{TokioExecutor, TokioIo, TokioTimer},
    server::conn::auto,
};
use std::{convert::Infallible, io, pin::pin, sync::Arc, time::Duration};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    sync::Semaphore,
    task::JoinSet,
    time::{Instant, sleep, sleep_until, timeout},
};
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;
use tonic::Status;
use tower::ServiceExt as _;

/// How long a socket is left alone when the operating system gives no further descriptor.
const NO_DESCRIPTOR_PAUSE: Duration = Duration::from_millis(50);
/// How often connections are looked after, and how long one may take to end.
const LOOK_AFTER: Duration = Duration::from_secs(1);

/// Room for requests that are being answered.
#[derive(Debug, Clone)]
pub(super) struct Rooms {
    attachments: Arc<Semaphore>,
    streams: Arc<Semaphore>,
    orders: Arc<Semaphore>,
    others: Arc<Semaphore>,
}

impl Rooms {
    pub(super) fn new(bounds: &Bounds) -> Self {
        let of = |requests| Arc::new(Semaphore::new(requests));
        Self {
            attachments: of(bounds.attachments),
            streams: of(bounds.streams),
            orders: of(bounds.requests),
            others: of(bounds.requests),
        }
    }

    fn of(&self, path: &str) -> &Arc<Semaphore> {
        match path {
            ATTACH => &self.attachments,
            _ if path.ends_with("/Watch") || path.starts_with("/grpc.reflection.") => &self.streams,
            _ if path.starts_with("/palpate.v1.Session/") => &self.orders,
            _ => &self.others,
        }
    }
}

/// The answer when there is no room.
fn busy(asked: &HeaderMap) -> Response<Body> {
    let text = "too many requests are being answered: try again later";
    if whole::is_grpc(asked) {
        return whole::refused(&Status::resource_exhausted(text), asked);
    }
    let mut response = Response::new(Body::from(format!("{text}\n")));
    *response.status_mut() = StatusCode::SERVICE_UNAVAILABLE;
    response
}

/// Why something did not come to its end.
#[derive(Debug, Clone, Copy)]
enum Late {
    TooLong,
    Closing,
}

/// Receives connections of one socket.
#[derive(Clone)]
pub(super) struct Host {
    pub(super) router: Router,
    pub(super) bounds: Bounds,
    pub(super) rooms: Rooms,
    /// Where arms' connections are served.
    pub(super) arms: Option<Arc<Arms>>,
    pub(super) tls: Option<TlsAcceptor>,
    pub(super) crowd: Arc<Crowd>,
    pub(super) refusals: Arc<Refusals>,
    pub(super) closing: CancellationToken,
}

impl Host {
    /// Accepts until the doors close, then waits for the connections to end. They are cut when this is dropped.
    pub(super) async fn receive(self, mut listener: Listener) {
        let mut connections = JoinSet::new();
        loop {
            tokio::select! {
                () = self.closing.cancelled() => break,
                Some(_) = connections.join_next(), if !connections.is_empty() => {}
                accepted = listener.accept() => match accepted {
                    Some(Ok((socket, peer))) => self.admit(socket, peer, &mut connections),
                    Some(Err(error)) => self.not_accepted(&error).await,
                    None => break,
                },
            }
        }
        // Nobody may connect from here on: who tries is refused by the system, and does not wait in vain.
        drop(listener);
        while connections.join_next().await.is_some() {}
    }

    fn admit(&self, socket: Socket, peer: Peer, connections: &mut JoinSet<()>) {
        let Some((place, has_evicted)) = self.crowd.enter() else {
            return self.refusals.count(Reason::Full, Some(peer));
        };
        if has_evicted {
            self.refusals.count(Reason::Evicted, None);
        }
        let host = self.clone();
        let gone = place.gone().clone();
        connections.spawn(async move {
            tokio::select! {
                () = gone.cancelled() => {}
                () = host.meet(socket, peer, place) => {}
            }
        });
    }

    /// Looks who it is: an arm's connection goes to the arms' lane.
    async fn meet(&self, mut socket: Socket, peer: Peer, place: Place) {
        let met = match self.within(self.bounds.first_request, lane::is_signed(&socket)).await {
            Ok(met) => met,
            Err(late) => return self.refuse(late, Reason::Silent, peer),
        };
        match (met, &self.arms) {
            (Ok(false), _) => self.serve(socket, peer, &Arc::new(place)).await,
            (Ok(true), Some(arms)) => {
                match self.within(self.bounds.handshake, lane::read_sign(&mut socket)).await {
                    Ok(Ok(())) => {}
                    Ok(Err(_)) => return self.refusals.count(Reason::Handshake, Some(peer)),
                    Err(late) => return self.refuse(late, Reason::Handshake, peer),
                }
                // Its place among all others is free again.
                drop(place);
                match arms.host.crowd.enter() {
                    Some((of_arm, _)) => arms.serve(socket, peer, Arc::new(of_arm)).await,
                    None => self.refusals.count(Reason::Full, Some(peer)),
                }
            }
            (Ok(true), None) => self.refusals.count(Reason::Handshake, Some(peer)),
            // It is gone already.
            (Err(_), _) => {}
        }
    }

    /// Serves a connection to its end.
    pub(super) async fn serve(&self, socket: Socket, peer: Peer, place: &Arc<Place>) {
        match (socket, &self.tls) {
            (Socket::Tcp(stream), Some(acceptor)) => {
                match self.within(self.bounds.handshake, acceptor.accept(stream)).await {
                    Ok(Ok(stream)) => {
                        let shown = stream.get_ref().1.peer_certificates().and_then(|chain| chain.first());
                        let shown = shown.map(|first| PeerCertificate(Arc::new(first.clone().into_owned())));
                        self.attend(stream, peer, shown, place).await;
                    }
                    Ok(Err(_)) => self.refusals.count(Reason::Handshake, Some(peer)),
                    Err(late) => self.refuse(late, Reason::Handshake, peer),
                }
            }
            (Socket::Tcp(stream), None) => self.attend(stream, peer, None, place).await,
            (Socket::Unix(stream), _) => self.attend(stream, peer, None, place).await,
        }
    }

    /// What comes of something that may take so long, and not when the doors close.
    async fn within<T>(&self, limit: Duration, something: impl Future<Output = T>) -> Result<T, Late> {
        tokio::select! {
            () = self.closing.cancelled() => Err(Late::Closing),
            of_it = timeout(limit, something) => of_it.map_err(|_| Late::TooLong),
        }
    }

    fn refuse(&self, late: Late, reason: Reason, peer: Peer) {
        if matches!(late, Late::TooLong) {
            self.refusals.count(reason, Some(peer));
        }
    }

    /// A peer that went away before it was accepted costs nothing. Without descriptors or memory, whoever is idle gives some up, and the
    /// socket is left alone for a while: it stays ready.
    async fn not_accepted(&self, error: &io::Error) {
        use rustix::io::Errno;
        let of_system = error.raw_os_error().map(Errno::from_raw_os_error);
        if !matches!(of_system, Some(Errno::MFILE | Errno::NFILE | Errno::NOBUFS | Errno::NOMEM)) {
            tracing::debug!(%error, "a connection was not accepted");
            return;
        }
        self.refusals.count(Reason::NoDescriptor, None);
        if self.crowd.evict() {
            self.refusals.count(Reason::Evicted, None);
        }
        sleep(NO_DESCRIPTOR_PAUSE).await;
    }

    async fn attend<S: AsyncRead + AsyncWrite + Unpin + Send + 'static>(
        &self,
        stream: S,
        peer: Peer,
        shown: Option<PeerCertificate>,
        place: &Arc<Place>,
    ) {
        let debts = Arc::new(Debts::default());
        let service = service_fn(|mut request: Request<Incoming>| {
            let router = self.router.clone();
            let is_device = request.uri().path() == ATTACH;
            let patience = if is_device { self.bounds.mute_device } else { self.bounds.mute };
            let mut answer = Answer::begin(place, &debts, patience);
            request.extensions_mut().insert(peer);
            if let Some(certificate) = &shown {
                request.extensions_mut().insert(certificate.clone());
            }
            let room = self.room(request.uri().path(), peer);
            async move {
                let Some(room) = room else {
                    return Ok(busy(request.headers()).map(|body| answer.is(body)));
                };
                answer.keep(room);
                let Ok(mut response) = router.oneshot(request.map(Body::new)).await;
                if let Some(kept) = response.extensions_mut().remove::<Kept>() {
                    answer.keep(kept);
                }
                Ok::<_, Infallible>(response.map(|body| answer.is(body)))
            }
        });
        let server = self.protocol();
        let mut connection = pin!(server.serve_connection(TokioIo::new(stream), service));
        let (mut is_closing, mut bounds) = (false, self.bounds);
        loop {
            tokio::select! {
                ended = &mut connection => {
                    if let Err(error) = ended {
                        tracing::debug!(%peer, %error, "a connection ended early");
                    }
                    return;
                }
                () = self.closing.cancelled(), if !is_closing => {
                    is_closing = true;
                    connection.as_mut().graceful_shutdown();
                }
                () = place.gone().cancelled() => return,
                reason = overdue(place, &debts, bounds) => {
                    if is_closing {
                        return;
                    }
                    self.refusals.count(reason, Some(peer));
                    if reason != Reason::Idle {
                        return;
                    }
                    // Its peer is told, and has time to hear it; what is on its way just now is answered.
                    is_closing = true;
                    bounds.idle += LOOK_AFTER;
                    connection.as_mut().graceful_shutdown();
                }
            }
        }
    }

    /// Room for one more request of its kind: none can take that of another.
    fn room(&self, path: &str, peer: Peer) -> Option<Kept> {
        let permit = Arc::clone(self.rooms.of(path)).try_acquire_owned();
        permit.map(Kept::new).inspect_err(|_| self.refusals.count(Reason::Busy, Some(peer))).ok()
    }

    fn protocol(&self) -> auto::Builder<TokioExecutor> {
        let mut server = auto::Builder::new(TokioExecutor::new());
        server
            .http2()
            .timer(TokioTimer::new())
            .keep_alive_interval(Some(bounds::KEEPALIVE_INTERVAL))
            .keep_alive_timeout(bounds::KEEPALIVE_TIMEOUT)
            .max_concurrent_streams(if self.arms.is_some() { bounds::STREAMS } else { bounds::STREAMS_OF_ARM })
            .max_send_buf_size(bounds::SEND_BUFFER_BYTES)
            .max_header_list_size(bounds::HEADER_LIST_BYTES)
            .initial_stream_window_size(bounds::STREAM_WINDOW_BYTES)
            .initial_connection_window_size(bounds::CONNECTION_WINDOW_BYTES);
        // The page speaks HTTP/1.1 where there is no TLS.
        let http1 = &mut server.http1();
        http1
            .timer(TokioTimer::new())
            .header_read_timeout(self.bounds.headers)
            .max_buf_size(bounds::HTTP1_BUFFER_BYTES);
        server
    }
}

/// Waits until a connection has asked for nothing, or taken nothing of an answer, for too long.
async fn overdue(place: &Place, debts: &Debts, bounds: Bounds) -> Reason {
    loop {
        let now = Instant::now();
        let idle_until =
            place.idle_since().map(|since| since + if place.has_asked() { bounds.idle } else { bounds.first_request });
        let mute_until = debts.first();
        match (idle_until, mute_until) {
            (Some(until), _) if until <= now => return if place.has_asked() { Reason::Idle } else { Reason::Silent },
            (_, Some(until)) if until <= now => return Reason::Mute,
            (idle, mute) => {
                let look = now + bounds.first_request.min(bounds.mute).min(bounds.mute_device).min(LOOK_AFTER);
                sleep_until(idle.into_iter().chain(mute).chain([look]).min().unwrap_or(look)).await;
            }
        }
    }
}
