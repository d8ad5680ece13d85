//! The doors: sockets that are listened on, and what every connection and request has to keep to before a service sees it.
//!
//! Everything here is bounded: how many connect, how long a handshake, a header, a request may take, what a request may hold.
//! [`bounds`] has the numbers, [`refusals`] counts and logs whoever met one.
pub mod answer;
pub mod bounds;
mod connection;
pub mod crowd;
pub mod descriptors;
pub mod lane;
pub mod listen;
pub mod origin;
pub mod refusals;
pub mod tls;
pub mod whole;

use axum::Router;
use bounds::Bounds;
use connection::{Host, Rooms};
use crowd::Crowd;
use lane::Arms;
use listen::{ListenError, Listener, UnixSocket};
use refusals::Refusals;
use std::{net::SocketAddr, sync::Arc};
use tls::TlsFiles;
use tokio::{runtime::Handle, task::JoinSet};
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;

/// What is served.
#[derive(Debug, Clone)]
pub struct Routers {
    /// To everybody.
    pub all: Router,
    /// To connections of arms: no more than they need.
    pub arms: Router,
}

/// Open sockets that nobody is let in by yet.
pub struct Doors {
    /// Where TCP is listened on, if it is.
    pub address: Option<SocketAddr>,
    tcp: Option<Listener>,
    tls: Option<TlsAcceptor>,
    unix: Option<Listener>,
}

impl Doors {
    /// Opens the sockets: TCP, with TLS or without, and a Unix socket.
    ///
    /// # Errors
    /// [`ListenError`].
    pub async fn open(
        address: Option<SocketAddr>,
        tls: Option<&TlsFiles>,
        unix: Option<&UnixSocket>,
    ) -> Result<Self, ListenError> {
        let tls = tls.map(tls::acceptor).transpose()?;
        let (tcp, address) = match address {
            Some(address) => listen::tcp(address).await.map(|(tcp, bound)| (Some(tcp), Some(bound)))?,
            None => (None, None),
        };
        let unix = match unix {
            Some(socket) => Some(listen::unix(socket).await?),
            None => None,
        };
        Ok(Self { address, tcp, tls, unix })
    }

    /// Lets everybody in until `closing`, arms by their own lane; the tasks end when the last connection has.
    pub fn serve(
        self,
        routers: &Routers,
        arms: &Handle,
        bounds: Bounds,
        refusals: &Arc<Refusals>,
        closing: &CancellationToken,
    ) -> JoinSet<()> {
        let mut servers = JoinSet::new();
        let crowd = Crowd::of(bounds.connections);
        let rooms = Rooms::new(&bounds);
        let arms_crowd = Crowd::of(bounds.attachments);
        let host = |router: &Router, crowd: &Arc<Crowd>, arms, tls| Host {
            router: router.clone(),
            arms,
            bounds,
            rooms: rooms.clone(),
            tls,
            crowd: Arc::clone(crowd),
            refusals: Arc::clone(refusals),
            closing: closing.clone(),
        };
        let both = |tls: Option<TlsAcceptor>| {
            let of_arms = host(&routers.arms, &arms_crowd, None, tls.clone());
            host(&routers.all, &crowd, Some(Arc::new(Arms { handle: arms.clone(), host: of_arms })), tls)
        };
        if let Some(tcp) = self.tcp {
            servers.spawn(both(self.tls).receive(tcp));
        }
        if let Some(unix) = self.unix {
            servers.spawn(both(None).receive(unix));
        }
        servers
    }
}
