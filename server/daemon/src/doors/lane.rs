//! The arms' lane: connections that say at their very first byte that they are an arm's are served by a thread of their own, with
//! real-time priority below the loop's. What a thousand viewers or a flood of requests make the other threads do does not delay them.
//!
//! The sign comes before TLS and HTTP/2, so that one port serves all. A client that does not give it may attach all the same, and
//! waits its turn among viewers.
use super::{connection::Host, crowd::Place, listen::Socket, refusals::Peer};
use palpate_proto::ARM_SIGN;
use palpate_realtime::{Note, OsMeasures};
use rustix::{
    fd::{AsFd as _, BorrowedFd},
    net::{RecvFlags, recv},
};
use std::{io, sync::Arc, thread};
use tokio::{
    io::{AsyncReadExt as _, Interest},
    runtime::{Builder, Handle},
    sync::oneshot,
};
use tokio_util::{
    sync::{CancellationToken, DropGuard},
    task::AbortOnDropHandle,
};

/// The thread that serves arms. It ends when this is dropped.
#[derive(Debug)]
pub struct Lane {
    /// Its runtime.
    pub handle: Handle,
    /// What the operating system granted it.
    pub notes: Vec<Note>,
    _ends: DropGuard,
}

impl Lane {
    /// Starts the thread.
    ///
    /// # Errors
    /// The operating system's.
    pub async fn start(measures: OsMeasures) -> io::Result<Self> {
        let ends = CancellationToken::new();
        let (tell, told) = oneshot::channel();
        let ended = ends.clone();
        let body = move || {
            let runtime = match Builder::new_current_thread().enable_all().build() {
                Ok(runtime) => runtime,
                Err(error) => return drop(tell.send(Err(error))),
            };
            let granted = measures.apply();
            let _ = tell.send(Ok((runtime.handle().clone(), granted.notes.clone())));
            runtime.block_on(ended.cancelled_owned());
            // What still hangs on a socket is not waited for.
            runtime.shutdown_background();
            drop(granted);
        };
        thread::Builder::new().name("palpate-arms".into()).spawn(body)?;
        let (handle, notes) = told.await.map_err(|_| io::Error::other("its thread ended"))??;
        Ok(Self { handle, notes, _ends: ends.drop_guard() })
    }
}

/// Whether the connection begins with an arm's sign; nothing of it is read.
pub(super) async fn is_signed(socket: &Socket) -> io::Result<bool> {
    let mut first = [0];
    let mut look = |fd: BorrowedFd<'_>| match recv(fd, &mut first, RecvFlags::PEEK)? {
        (0, _) => Err(io::Error::from(io::ErrorKind::UnexpectedEof)),
        _ => Ok(first[0] == ARM_SIGN[0]),
    };
    loop {
        socket.readable().await?;
        let looked = match socket {
            Socket::Tcp(stream) => stream.try_io(Interest::READABLE, || look(stream.as_fd())),
            Socket::Unix(stream) => stream.try_io(Interest::READABLE, || look(stream.as_fd())),
        };
        match looked {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            looked => return looked,
        }
    }
}

/// Reads the sign.
pub(super) async fn read_sign(socket: &mut Socket) -> io::Result<()> {
    let mut sign = [0; ARM_SIGN.len()];
    match socket {
        Socket::Tcp(stream) => stream.read_exact(&mut sign).await?,
        Socket::Unix(stream) => stream.read_exact(&mut sign).await?,
    };
    if sign == *ARM_SIGN { Ok(()) } else { Err(io::ErrorKind::InvalidData.into()) }
}

/// Who serves arms, and where.
pub(super) struct Arms {
    pub(super) handle: Handle,
    pub(super) host: Host,
}

impl Arms {
    /// Serves a connection on the lane's thread, to its end.
    pub(super) async fn serve(&self, socket: Socket, peer: Peer, place: Arc<Place>) {
        // A socket belongs to the runtime that watches it: one gives it up before another takes it.
        let Ok(free) = socket.into_std() else { return };
        let host = self.host.clone();
        let serve = async move {
            if let Ok(socket) = free.watched() {
                host.serve(socket, peer, &place).await;
            }
        };
        let _ = AbortOnDropHandle::new(self.handle.spawn(serve)).await;
    }
}
