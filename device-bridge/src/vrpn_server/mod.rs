//! A VRPN server beside the loop: existing VRPN programs read the arm's poses, buttons, force and contact, whatever the arm.
//!
//! The servo publishes into a slot ([`moment`]) and knows no more of it. Here a task takes the newest moment and hands it to a task for each program, which sends it when its
//! socket takes more: a slow program misses moments, which are counted, and delays nobody. Programs come by TCP, or call by a datagram that says on which port they
//! want to be connected to, as VRPN's own library does for `NAME@host`. A call is answered to where it came from, whatever host it names.
mod client;
pub mod moment;
mod report;

use crate::{BridgeError, run::Shared, settings::VrpnServerSettings};
use moment::{Moment, MomentWriter, moments};
use palpate_realtime::{Doorbell, SlotReader};
use std::{
    collections::HashSet,
    io::Result,
    net::{SocketAddr, UdpSocket as StdUdpSocket},
    sync::Arc,
    time::Duration,
};
use tokio::{
    net::{TcpListener, TcpSocket, TcpStream, UdpSocket, unix::pipe},
    sync::watch,
    task::JoinSet,
    time,
};
use tokio_util::sync::CancellationToken;

/// What a socket holds for a program that reads slowly (bytes): old moments are of no use to it.
const SEND_BUFFER_BYTES: u32 = 16 * 1024;
/// How long it may take to reach a program that called.
const CALL_PATIENCE: Duration = Duration::from_secs(2);
/// No program listens below: calls there are somebody's mischief.
const LOWEST_PORT: u16 = 1024;
/// When no connection can be taken (too many open files) it is tried again after so long.
const PAUSE: Duration = Duration::from_millis(100);

/// The server, listening.
#[derive(Debug)]
pub struct VrpnServer {
    settings: VrpnServerSettings,
    listener: TcpListener,
    calls: UdpSocket,
    moments: Moments,
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Moments {
    /// The bell's descriptor, read as a pipe is.
    bell: pipe::Receiver,
    slot: SlotReader<Option<Moment>>,
}

/// Opens the server, if there is to be one, and the servo's end of it.
///
/// # Errors
/// [`BridgeError::Value`] when it cannot listen there.
pub fn open(
    settings: Option<&VrpnServerSettings>,
    shared: &Arc<Shared>,
) -> std::result::Result<Option<(VrpnServer, MomentWriter)>, BridgeError> {
    let Some(settings) = settings else { return Ok(None) };
    let opened = || {
        let (writer, slot, bell) = moments(settings.every)?;
        Ok::<_, std::io::Error>((VrpnServer::listen(settings, slot, &bell, shared)?, writer))
    };
    let opened = opened().map_err(|error| BridgeError::Value {
        key: "vrpn_server.listen".into(),
        reason: format!("cannot listen at {}: {error}; give another address", settings.listen),
    })?;
    Ok(Some(opened))
}

impl VrpnServer {
    fn listen(
        settings: &VrpnServerSettings,
        slot: SlotReader<Option<Moment>>,
        bell: &Doorbell,
        shared: &Arc<Shared>,
    ) -> Result<Self> {
        let socket = socket_for(settings.listen)?;
        socket.set_reuseaddr(true)?;
        socket.bind(settings.listen)?;
        let listener = socket.listen(settings.max_clients as u32)?;
        let address = listener.local_addr()?;
        let calls = StdUdpSocket::bind(address)?;
        calls.set_nonblocking(true)?;
        shared.stats.vrpn_server.set_address(address);
        Ok(Self {
            settings: settings.clone(),
            listener,
            calls: UdpSocket::from_std(calls)?,
            moments: Moments { bell: pipe::Receiver::from_owned_fd_unchecked(bell.try_clone_fd()?)?, slot },
            shared: Arc::clone(shared),
        })
    }

    /// Serves until told to end.
    pub async fn run(self, end: CancellationToken) {
        let Self { settings, listener, calls, mut moments, shared } = self;
        if let Some(address) = shared.stats.vrpn_server.address() {
            tracing::info!("VRPN programs can read the arm as {}@{address}", settings.name);
        }
        let (newest, _) = watch::channel(None);
        let mut programs = Programs { settings, shared, newest, tasks: JoinSet::new(), served: HashSet::new() };
        let mut call = [0; 256];
        loop {
            tokio::select! {
                () = end.cancelled() => break,
                moment = moments.next() => {
                    programs.newest.send_replace(Some(moment));
                }
                Some(left) = programs.tasks.join_next() => {
                    if let Ok(address) = left {
                        programs.served.remove(&address);
                    }
                }
                accepted = listener.accept() => match accepted {
                    Ok((stream, address)) => programs.admit(address, async { Ok(stream) }),
                    Err(error) => {
                        tracing::warn!("no VRPN program can be taken: {error}");
                        time::sleep(PAUSE).await;
                    }
                },
                // An error of a datagram's socket concerns that datagram.
                Ok((count, from)) = calls.recv_from(&mut call) => {
                    if let Some(port) = called_port(&call[..count]) {
                        let address = SocketAddr::new(from.ip(), port);
                        programs.admit(address, connect(address));
                    }
                }
            }
        }
        programs.tasks.shutdown().await;
        let stats = &programs.shared.stats.vrpn_server;
        let [served, turned_away, told, dropped] =
            [&stats.served, &stats.turned_away, &stats.told, &stats.dropped].map(crate::stats::Counter::get);
        tracing::info!(
            "VRPN: {served} programs served, {turned_away} turned away; {told} moments told, {dropped} missed by slow ones"
        );
    }
}

impl Moments {
    async fn next(&mut self) -> Moment {
        loop {
            // An error cannot happen on an open eventfd; were it to, the moments still come with the next ring.
            let _ = self.bell.readable().await;
            let rang = self.bell.try_read(&mut [0; 8]).is_ok();
            if let (true, Some(Some(moment))) = (rang, self.slot.take()) {
                return *moment;
            }
        }
    }
}

/// Those that are served, and those that are being connected to.
struct Programs {
    settings: VrpnServerSettings,
    shared: Arc<Shared>,
    newest: watch::Sender<Option<Moment>>,
    tasks: JoinSet<SocketAddr>,
    served: HashSet<SocketAddr>,
}

impl Programs {
    /// Serves a program in a task of its own, if it is not one too many. One that calls again while it is being connected to is the same.
    fn admit(&mut self, address: SocketAddr, stream: impl Future<Output = Result<TcpStream>> + Send + 'static) {
        let stats = &self.shared.stats.vrpn_server;
        if self.served.contains(&address) {
            return;
        }
        if self.served.len() >= self.settings.max_clients {
            if stats.turned_away.get() == 0 {
                tracing::warn!("a VRPN program is turned away: there are {} already", self.settings.max_clients);
            }
            stats.turned_away.increment();
            return;
        }
        self.served.insert(address);
        stats.served.increment();
        let (name, newest) = (self.settings.name.clone(), self.newest.subscribe());
        let shared = Arc::clone(&self.shared);
        self.tasks.spawn(async move {
            let serving = async { client::serve(stream.await?, &name, newest, &shared.stats.vrpn_server).await };
            if let Err(left) = serving.await {
                tracing::info!("the VRPN program at {address} is no longer served: {left}");
            }
            address
        });
    }
}

/// A socket whose accepted ones, too, hold little.
fn socket_for(address: SocketAddr) -> Result<TcpSocket> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4()? } else { TcpSocket::new_v6()? };
    socket.set_send_buffer_size(SEND_BUFFER_BYTES)?;
    Ok(socket)
}

async fn connect(address: SocketAddr) -> Result<TcpStream> {
    let socket = socket_for(address)?;
    time::timeout(CALL_PATIENCE, socket.connect(address)).await.map_err(|_| std::io::ErrorKind::TimedOut)?
}

/// The port in a call, `host port` and a 0.
fn called_port(call: &[u8]) -> Option<u16> {
    let text = std::str::from_utf8(call.split(|byte| *byte == 0).next()?).ok()?;
    let mut words = text.split_ascii_whitespace();
    let (_host, port) = (words.next()?, words.next()?.parse().ok()?);
    (words.next().is_none() && port >= LOWEST_PORT).then_some(port)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_call_names_a_port_that_a_program_may_have() {
        assert_eq!(called_port(b"127.0.0.1 40000\0"), Some(40_000));
        assert_eq!(called_port(b"a.host.net 1024"), Some(1024));
        for wrong in ["", "40000", "a 22\0", "a 70000\0", "a b\0", "a 4000 5\0"] {
            assert_eq!(called_port(wrong.as_bytes()), None, "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_call_or_none(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
            let _ = called_port(&bytes);
        }
    }
}
