//! Sockets: TCP and Unix; and why one cannot be had.
use super::{bounds::KEEPALIVE_INTERVAL, refusals::Peer};
use miette::Diagnostic;
use std::{
    fs, io,
    net::SocketAddr,
    os::unix::fs::{DirBuilderExt as _, FileTypeExt as _, PermissionsExt as _},
    path::{Path, PathBuf},
};
use thiserror::Error;
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};
use tokio_stream::StreamExt as _;
use tonic::transport::server::TcpIncoming;

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
    /// The group of the Unix socket is not known.
    #[error("there is no group \"{group}\" on this machine")]
    #[diagnostic(help("--unix-group takes the name or the number of a group of /etc/group"))]
    Group {
        /// As given.
        group: String,
    },
    /// The Unix socket cannot be given to the group.
    #[error("the Unix socket cannot be given to the group \"{group}\"")]
    #[diagnostic(help(
        "the daemon's user has to be in that group (usermod -aG), and a systemd unit must not have PrivateUsers=yes"
    ))]
    GivenAway {
        /// As given.
        group: String,
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

/// A Unix socket, and who may open it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnixSocket {
    /// Where.
    pub path: PathBuf,
    /// Permissions, such as 0o660: who may write to it may connect.
    pub mode: u32,
    /// Its group; `None`: the process's own.
    pub group: Option<String>,
}

/// A socket that is listened on.
#[derive(Debug)]
pub enum Listener {
    /// By TCP.
    Tcp(TcpIncoming),
    /// On a Unix socket.
    Unix(UnixListener),
}

/// A connection, accepted.
#[derive(Debug)]
pub(super) enum Socket {
    Tcp(TcpStream),
    Unix(UnixStream),
}

/// A connection that no runtime watches.
#[derive(Debug)]
pub(super) enum FreeSocket {
    Tcp(std::net::TcpStream),
    Unix(std::os::unix::net::UnixStream),
}

impl Socket {
    /// Waits until there is something to read.
    pub(super) async fn readable(&self) -> io::Result<()> {
        match self {
            Self::Tcp(stream) => stream.readable().await,
            Self::Unix(stream) => stream.readable().await,
        }
    }

    /// Gives it up.
    pub(super) fn into_std(self) -> io::Result<FreeSocket> {
        Ok(match self {
            Self::Tcp(stream) => FreeSocket::Tcp(stream.into_std()?),
            Self::Unix(stream) => FreeSocket::Unix(stream.into_std()?),
        })
    }
}

impl FreeSocket {
    /// Lets the present runtime watch it.
    pub(super) fn watched(self) -> io::Result<Socket> {
        Ok(match self {
            Self::Tcp(stream) => Socket::Tcp(TcpStream::from_std(stream)?),
            Self::Unix(stream) => Socket::Unix(UnixStream::from_std(stream)?),
        })
    }
}

impl Listener {
    /// The next connection, and who is at its other end.
    pub(super) async fn accept(&mut self) -> Option<io::Result<(Socket, Peer)>> {
        match self {
            Self::Tcp(incoming) => incoming.next().await.map(|accepted| {
                let stream = accepted?;
                let peer = Peer::Tcp(stream.peer_addr()?);
                Ok((Socket::Tcp(stream), peer))
            }),
            Self::Unix(listener) => Some(listener.accept().await.map(|(stream, _)| (Socket::Unix(stream), Peer::Unix))),
        }
    }
}

/// Listens on TCP; small messages go out at once, and dead peers are noticed without HTTP/2 as well.
///
/// # Errors
/// [`ListenError::Busy`] or [`ListenError::Bind`].
pub async fn tcp(address: SocketAddr) -> Result<(Listener, SocketAddr), ListenError> {
    let refuse = |source: io::Error| match source.kind() {
        io::ErrorKind::AddrInUse => ListenError::Busy { address },
        _ => ListenError::Bind { address, source },
    };
    let listener = TcpListener::bind(address).await.map_err(refuse)?;
    let bound = listener.local_addr().map_err(refuse)?;
    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true)).with_keepalive(Some(KEEPALIVE_INTERVAL));
    Ok((Listener::Tcp(incoming), bound))
}

/// Listens on a Unix socket. A socket that nobody answers on is left over from a daemon that crashed, and replaced. It is made in a folder
/// that only this user enters, gets its group and permissions there, and then its place: nobody connects before.
///
/// # Errors
/// [`ListenError::Unix`], [`ListenError::Group`] or [`ListenError::GivenAway`].
pub async fn unix(socket: &UnixSocket) -> Result<Listener, ListenError> {
    let path = &socket.path;
    let refuse = |source| ListenError::Unix { path: path.clone(), source };
    if fs::symlink_metadata(path).is_ok_and(|meta| meta.file_type().is_socket()) {
        if UnixStream::connect(path).await.is_ok() {
            return Err(refuse(io::Error::new(io::ErrorKind::AddrInUse, "another program listens there")));
        }
        fs::remove_file(path).map_err(refuse)?;
    } else if path.exists() {
        return Err(refuse(io::Error::new(io::ErrorKind::AlreadyExists, "something else is there")));
    }
    let mut own = path.clone().into_os_string();
    own.push(format!(".{}", std::process::id()));
    let own = PathBuf::from(own);
    fs::DirBuilder::new().mode(0o700).create(&own).map_err(refuse)?;
    let made = make_in(&own, socket);
    // What is left of it, if anything, helps nobody; that it cannot be removed is no second error.
    let _ = fs::remove_file(own.join(SOCKET));
    let _ = fs::remove_dir(&own);
    made.map(Listener::Unix)
}

const SOCKET: &str = "socket";

/// Makes a socket in a folder, and moves it to its place.
fn make_in(folder: &Path, socket: &UnixSocket) -> Result<UnixListener, ListenError> {
    let refuse = |source| ListenError::Unix { path: socket.path.clone(), source };
    let beside = folder.join(SOCKET);
    let listener = UnixListener::bind(&beside).map_err(refuse)?;
    if let Some(group) = &socket.group {
        let number = group_number(group)?;
        std::os::unix::fs::chown(&beside, None, Some(number))
            .map_err(|source| ListenError::GivenAway { group: group.clone(), source })?;
    }
    fs::set_permissions(&beside, fs::Permissions::from_mode(socket.mode)).map_err(refuse)?;
    fs::rename(&beside, &socket.path).map_err(refuse)?;
    Ok(listener)
}

/// The number of a group, by its name or already one.
fn group_number(group: &str) -> Result<u32, ListenError> {
    if let Ok(number) = group.parse() {
        return Ok(number);
    }
    // NAME:password:NUMBER:members
    let groups = fs::read_to_string("/etc/group").unwrap_or_default();
    let found = groups.lines().find_map(|line| {
        let mut words = line.split(':');
        (words.next() == Some(group)).then(|| words.nth(1)?.parse().ok()).flatten()
    });
    found.ok_or_else(|| ListenError::Group { group: group.to_owned() })
}
