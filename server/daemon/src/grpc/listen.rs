//! Sockets: TCP with or without TLS, and Unix.
use miette::Diagnostic;
use std::{
    fs, io,
    net::SocketAddr,
    os::unix::fs::FileTypeExt,
    path::{Path, PathBuf},
    time::Duration,
};
use thiserror::Error;
use tokio::net::{TcpListener, UnixListener, UnixStream};
use tokio_stream::wrappers::UnixListenerStream;
use tokio_util::sync::CancellationToken;
use tonic::{
    service::Routes,
    transport::{Identity, Server, ServerTlsConfig, server::TcpIncoming},
};

/// Dead peers are noticed after these two.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(10);
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(5);
/// Streams on one connection at a time.
const MAX_STREAMS: u32 = 256;

/// Why a socket cannot be opened.
#[derive(Debug, Error, Diagnostic)]
pub enum ListenError {
    /// The port is taken.
    #[error("port {} of {} is in use by another program", address.port(), address.ip())]
    #[diagnostic(help(
        "another palpated may be running: find it with `ss -ltnp 'sport = :{}'`, or choose a port with --listen {}:0",
        address.port(),
        address.ip()
    ))]
    Busy {
        /// The address.
        address: SocketAddr,
    },
    /// The address cannot be bound for another reason.
    #[error("cannot listen on {address}")]
    #[diagnostic(help("--listen takes an address of this machine and a port, such as 127.0.0.1:7411 or 0.0.0.0:7411"))]
    Bind {
        /// The address.
        address: SocketAddr,
        /// Why.
        source: io::Error,
    },
    /// The Unix socket cannot be made.
    #[error("cannot listen on the Unix socket {}", path.display())]
    #[diagnostic(help("the folder must exist and be writable, and no other daemon may listen there"))]
    Unix {
        /// Its path.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A certificate or key cannot be read.
    #[error("cannot read the {what} {}", path.display())]
    #[diagnostic(help("--tls-cert and --tls-key take PEM files"))]
    TlsFile {
        /// `certificate` or `key`.
        what: &'static str,
        /// Its path.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Certificate and key are not usable.
    #[error("the certificate {} and its key cannot be used: {reason}", path.display())]
    #[diagnostic(help("both must be PEM, the key must be the certificate's, unencrypted, PKCS#8, SEC1 or PKCS#1"))]
    Tls {
        /// Path of the certificate.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

/// Certificate chain and key (PEM files).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TlsFiles {
    /// Certificate chain.
    pub certificate: PathBuf,
    /// Private key.
    pub key: PathBuf,
}

/// A server with this daemon's limits.
///
/// # Errors
/// [`ListenError::TlsFile`] or [`ListenError::Tls`].
pub fn server(tls: Option<&TlsFiles>) -> Result<Server, ListenError> {
    let server = Server::builder()
        // The page speaks HTTP/1.1 where there is no TLS.
        .accept_http1(true)
        .max_concurrent_streams(MAX_STREAMS)
        .http2_keepalive_interval(Some(KEEPALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT));
    let Some(files) = tls else { return Ok(server) };
    let read = |what, path: &Path| {
        fs::read(path).map_err(|source| ListenError::TlsFile { what, path: path.to_owned(), source })
    };
    let identity = Identity::from_pem(read("certificate", &files.certificate)?, read("key", &files.key)?);
    let refuse = |error: tonic::transport::Error| {
        let reason = std::error::Error::source(&error).map_or_else(|| error.to_string(), ToString::to_string);
        ListenError::Tls { path: files.certificate.clone(), reason }
    };
    server.tls_config(ServerTlsConfig::new().identity(identity)).map_err(refuse)
}

/// Listens on TCP; small messages go out at once, and dead peers are noticed without HTTP/2 as well.
///
/// # Errors
/// [`ListenError::Busy`] or [`ListenError::Bind`].
pub async fn tcp(address: SocketAddr) -> Result<(TcpIncoming, SocketAddr), ListenError> {
    let refuse = |source: io::Error| match source.kind() {
        io::ErrorKind::AddrInUse => ListenError::Busy { address },
        _ => ListenError::Bind { address, source },
    };
    let listener = TcpListener::bind(address).await.map_err(refuse)?;
    let bound = listener.local_addr().map_err(refuse)?;
    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true)).with_keepalive(Some(KEEPALIVE_INTERVAL));
    Ok((incoming, bound))
}

/// Listens on a Unix socket. A socket that nobody answers on is left over from a daemon that crashed, and replaced.
///
/// # Errors
/// [`ListenError::Unix`].
pub async fn unix(path: &Path) -> Result<UnixListenerStream, ListenError> {
    let refuse = |source| ListenError::Unix { path: path.to_owned(), source };
    if fs::symlink_metadata(path).is_ok_and(|meta| meta.file_type().is_socket()) {
        if UnixStream::connect(path).await.is_ok() {
            return Err(refuse(io::Error::new(io::ErrorKind::AddrInUse, "another program listens there")));
        }
        fs::remove_file(path).map_err(refuse)?;
    }
    Ok(UnixListenerStream::new(UnixListener::bind(path).map_err(refuse)?))
}

/// Serves until `stop`, then waits for open streams to end.
///
/// # Errors
/// The transport's.
pub async fn serve_tcp(
    mut server: Server,
    routes: Routes,
    incoming: TcpIncoming,
    stop: CancellationToken,
) -> Result<(), tonic::transport::Error> {
    server.add_routes(routes).serve_with_incoming_shutdown(incoming, stop.cancelled_owned()).await
}

/// The same on a Unix socket.
///
/// # Errors
/// The transport's.
pub async fn serve_unix(
    mut server: Server,
    routes: Routes,
    incoming: UnixListenerStream,
    stop: CancellationToken,
) -> Result<(), tonic::transport::Error> {
    server.add_routes(routes).serve_with_incoming_shutdown(incoming, stop.cancelled_owned()).await
}
