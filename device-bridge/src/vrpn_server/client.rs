//! One program that reads: it gets the newest moment whenever it can take one, and what it could not take is counted.
use super::{moment::Moment, report::Report};
use crate::{
    device::vrpn::{
        peer::{Kind, Peer},
        wire::{self, Malformed, Outgoing, Time},
    },
    stats::VrpnStats,
};
use palpate_realtime::Clock;
use std::{
    io::Error,
    time::{Duration, SystemTime},
};
use thiserror::Error;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    sync::watch,
    time::timeout,
};

/// How long a program may take to say that it speaks VRPN, and to take what it is sent.
const PATIENCE: Duration = Duration::from_secs(5);

/// Why a program is no longer served.
#[derive(Debug, Error)]
pub(super) enum Left {
    /// It went, or cannot be reached.
    #[error("{0}")]
    Gone(#[from] Error),
    /// It says nothing, or reads nothing.
    #[error("it did not answer or read for {} s", PATIENCE.as_secs())]
    Stuck,
    /// It speaks something else.
    #[error(transparent)]
    Strange(#[from] Malformed),
    /// The bridge ends.
    #[error("the bridge ends")]
    Over,
}

/// Serves it until one of both has gone.
pub(super) async fn serve(
    mut stream: TcpStream,
    name: &str,
    mut newest: watch::Receiver<Option<Moment>>,
    stats: &VrpnStats,
) -> Result<(), Left> {
    stream.set_nodelay(true)?;
    let (mut from, mut to) = stream.split();
    to.write_all(&wire::cookie()).await?;
    let mut peer = Peer::new(vec![name.to_owned()]);
    let cookie = async {
        loop {
            if let Some(cookie) = peer.received.cookie() {
                return Ok::<_, Left>(cookie);
            }
            read(&mut from, &mut peer).await?;
        }
    };
    let cookie = timeout(PATIENCE, cookie).await.map_err(|_| Left::Stuck)??;
    if !wire::is_cookie(&cookie) {
        return Err(Malformed.into());
    }
    let (mut report, mut out, mut last) = (Report::default(), Outgoing::default(), 0);
    report.greet(name, newest.borrow_and_update().as_ref(), &mut out);
    loop {
        timeout(PATIENCE, to.write_all(out.bytes())).await.map_err(|_| Left::Stuck)??;
        out.clear();
        tokio::select! {
            changed = newest.changed() => {
                changed.map_err(|_| Left::Over)?;
                let moment = *newest.borrow_and_update();
                let Some(moment) = moment else { continue };
                report.tell(&moment, wall_time(moment.read_ns), &mut out);
                stats.told.increment();
                if last > 0 {
                    stats.dropped.add(moment.number.saturating_sub(last + 1));
                }
                last = moment.number;
            }
            count = read(&mut from, &mut peer) => {
                count?;
                while let Some(told) = peer.next_told()? {
                    // Whatever else it sends, fields of force among it, has no effect here.
                    if told.kind == Kind::Ping {
                        report.answer(&mut out);
                    }
                }
            }
        }
    }
}

async fn read(from: &mut tokio::net::tcp::ReadHalf<'_>, peer: &mut Peer) -> Result<(), Left> {
    match from.read(peer.received.room()).await? {
        0 => Err(Error::from(std::io::ErrorKind::UnexpectedEof).into()),
        count => {
            peer.received.came(count);
            Ok(())
        }
    }
}

/// The wall clock's time then.
fn wall_time(monotonic_ns: u64) -> Time {
    let ago = Duration::from_nanos(Clock::Monotonic.now_ns().saturating_sub(monotonic_ns));
    let now = SystemTime::now();
    Time::at(now.checked_sub(ago).unwrap_or(now))
}
