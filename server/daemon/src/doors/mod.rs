//! The doors: sockets that are listened on, and what every connection and request has to keep to before a service sees it.
//!
//! Everything here is bounded: how many connect, how long a handshake, a header, a request may take, what a request may hold.
//! [`bounds`] has the numbers, [`refusals`] counts and logs whoever met one.
pub mod answer;
pub mod bounds;
mod connection;
pub mod crowd;
pub mod descriptors;
pub mod listen;
pub mod origin;
pub mod refusals;
pub mod tls;
pub mod whole;

use axum::Router;
use bounds::Bounds;
use connection::Host;
use crowd::Crowd;
use listen::{ListenError, Listener};
use refusals::Refusals;
use std::{net::SocketAddr, path::Path, sync::Arc};
use tls::TlsFiles;
use tokio::{sync::Semaphore, task::JoinSet};
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;

/// Open sockets that nobody is let in by yet.
pub struct Doors {
    /// Where TCP is listened on.
    pub address: SocketAddr,
    tcp: Listener,
    tls: Option<TlsAcceptor>,
    unix: Option<Listener>,
}

impl Doors {
    /// Opens the sockets: TCP, with TLS or without, and a Unix socket beside.
    ///
    /// # Errors
    /// [`ListenError`].
    pub async fn open(address: SocketAddr, tls: Option<&TlsFiles>, unix: Option<&Path>) -> Result<Self, ListenError> {
        let tls = tls.map(tls::acceptor).transpose()?;
        let (tcp, address) = listen::tcp(address).await?;
        let unix = match unix {
            Some(path) => Some(listen::unix(path).await?),
            None => None,
        };
        Ok(Self { address, tcp, tls, unix })
    }

    /// Lets everybody in until `closing`; the tasks end when the last connection has.
    pub fn serve(
        self,
        router: &Router,
        bounds: Bounds,
        refusals: &Arc<Refusals>,
        closing: &CancellationToken,
    ) -> JoinSet<()> {
        let mut servers = JoinSet::new();
        let crowd = Crowd::of(bounds.connections);
        let requests = Arc::new(Semaphore::new(bounds.requests));
        let attachments = Arc::new(Semaphore::new(bounds.attachments));
        let host = |tls| Host {
            router: router.clone(),
            bounds,
            requests: Arc::clone(&requests),
            attachments: Arc::clone(&attachments),
            tls,
            crowd: Arc::clone(&crowd),
            refusals: Arc::clone(refusals),
            closing: closing.clone(),
        };
        servers.spawn(host(self.tls).receive(self.tcp));
        if let Some(unix) = self.unix {
            servers.spawn(host(None).receive(unix));
        }
        servers
    }
}
