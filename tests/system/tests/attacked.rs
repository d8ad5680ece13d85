//! The real daemon, attacked by strangers as it was when it fell: what they announce, that they are silent, and that they do not read costs it
//! a bounded amount, which it gets back; and others are served meanwhile. HTTP/2 is written by hand, as attackers do.
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
use palpate_system_tests::daemon::{Daemon, PATIENCE};
use std::{
    io::{Read as _, Write as _},
    net::{SocketAddr, TcpStream},
    thread,
    time::{Duration, Instant},
};

const MIB: u64 = 1024 * 1024;

/// A frame of HTTP/2 (RFC 9113, 4.1).
fn frame(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let mut bytes = (payload.len() as u32).to_be_bytes()[1..].to_vec();
    bytes.extend([kind, flags]);
    bytes.extend(stream.to_be_bytes());
    bytes.extend_from_slice(payload);
    bytes
}

/// Headers of a call, each literal and not indexed (RFC 7541, 6.2.2).
fn headers(stream: u32, path: &str) -> Vec<u8> {
    let fields = [
        (":method", "POST"),
        (":scheme", "http"),
        (":path", path),
        (":authority", "localhost"),
        ("content-type", "application/grpc"),
        ("te", "trailers"),
    ];
    let mut block = Vec::new();
    for (name, value) in fields {
        block.push(0);
        for text in [name, value] {
            block.push(text.len() as u8);
            block.extend_from_slice(text.as_bytes());
        }
    }
    frame(1, 4, stream, &block)
}

/// A connection whose windows are as large as they may be, so that the daemon may send all it has.
fn begin(to: SocketAddr) -> TcpStream {
    let mut socket = TcpStream::connect(to).unwrap();
    let mut hello = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".to_vec();
    // SETTINGS_INITIAL_WINDOW_SIZE, and the connection's own.
    hello.extend(frame(4, 0, 0, &[0, 4, 0x7f, 0xff, 0xff, 0xff]));
    hello.extend(frame(8, 0, 0, &0x7fff_0000_u32.to_be_bytes()));
    socket.write_all(&hello).unwrap();
    socket
}

/// The message of a call: its prefix, and what comes of it.
fn data(stream: u32, announced: u32, comes: &[u8], is_last: bool) -> Vec<u8> {
    let mut message = vec![0];
    message.extend(announced.to_be_bytes());
    message.extend_from_slice(comes);
    frame(0, u8::from(is_last), stream, &message)
}

fn attacked() -> (Daemon, SocketAddr) {
    let daemon = Daemon::start(&["ventricle", "--arm", "none"]);
    let address = daemon.url.trim_start_matches("http://").parse().unwrap();
    // What it holds for whoever asks at all is there.
    daemon.status();
    (daemon, address)
}

fn grown_mib(daemon: &Daemon, before: u64) -> f64 {
    (daemon.program.resident_bytes() as f64 - before as f64) / MIB as f64
}

/// Seventy such streams of 116 bytes ended it.
#[test]
fn messages_that_are_announced_take_no_memory() {
    let (daemon, address) = attacked();
    let before = daemon.program.resident_bytes();
    let sockets: Vec<_> = (0..4)
        .map(|_| {
            let mut socket = begin(address);
            for stream in (1..128).step_by(2) {
                let path = ["Session/Restore", "Session/LoadScene", "Device/Attach"][stream as usize / 2 % 3];
                let mut bytes = headers(stream, &format!("/palpate.v1.{path}"));
                bytes.extend(data(stream, 64 << 20, &[0; 11], false));
                socket.write_all(&bytes).unwrap();
            }
            socket
        })
        .collect();
    thread::sleep(Duration::from_secs(2));
    let grown = grown_mib(&daemon, before);
    println!("256 announced messages: {grown:.1} MiB");
    assert!(grown < 32.0, "{grown} MiB");
    daemon.status();
    drop(sockets);
}

/// 1100 of them locked everyone out, and the daemon spun.
#[test]
fn silent_connections_keep_nobody_out() {
    let (daemon, address) = attacked();
    let most = rustix::process::getrlimit(rustix::process::Resource::Nofile);
    rustix::process::setrlimit(
        rustix::process::Resource::Nofile,
        rustix::process::Rlimit { current: most.maximum, ..most },
    )
    .unwrap();
    let silent: Vec<_> = (0..2000).map(|_| TcpStream::connect(address)).collect();
    let connected = silent.iter().filter(|socket| socket.is_ok()).count();
    println!("{connected} silent connections");
    assert!(connected > 1900);
    let began = Instant::now();
    daemon.status();
    println!("a new client is served in {:.0} ms", began.elapsed().as_secs_f64() * 1e3);
}

/// They held 2.3 GB, and 2.1 stayed. What they hold is bounded; large blocks go back to the system when they have gone, and small ones are
/// used again by the next crowd.
#[test]
fn answers_that_nobody_reads_are_bounded_and_given_back() {
    let (daemon, address) = attacked();
    let before = daemon.program.resident_bytes();
    let asked = |n: u32| {
        let mut socket = begin(address);
        for stream in (1..500).step_by(2) {
            let path = if (n + stream / 2).is_multiple_of(2) { "Surface/Watch" } else { "Session/Snapshot" };
            let mut bytes = headers(stream, &format!("/palpate.v1.{path}"));
            bytes.extend(data(stream, 0, &[], true));
            // Whoever is sent away hears no more.
            if socket.write_all(&bytes).is_err() {
                break;
            }
        }
        socket
    };
    let (mut most, mut left) = ([0.0_f64; 3], [0.0_f64; 3]);
    for (crowd, left) in most.iter_mut().zip(&mut left) {
        let sockets: Vec<_> = (0..16).map(asked).collect();
        for _ in 0..50 {
            thread::sleep(Duration::from_millis(100));
            *crowd = crowd.max(grown_mib(&daemon, before));
        }
        daemon.status();
        drop(sockets);
        daemon.wait_until("they have gone", |status| status["viewers"] == 0);
        thread::sleep(Duration::from_secs(2));
        *left = grown_mib(&daemon, before);
    }
    println!("4000 mute streams, three times: at most {most:.0?} MiB; when they had gone {left:.0?} MiB");
    assert!(most.iter().all(|mib| *mib < 300.0), "{most:?} MiB");
    assert!(left.iter().all(|mib| *mib < 128.0) && left[2] < left[0] + 32.0, "{left:?} MiB");
}

/// The frames above are HTTP/2: a call that is whole is answered.
#[test]
fn a_call_written_by_hand_is_answered() {
    let (_daemon, address) = attacked();
    let mut socket = begin(address);
    let mut bytes = headers(1, "/palpate.v1.Session/List");
    bytes.extend(data(1, 0, &[], true));
    socket.write_all(&bytes).unwrap();
    socket.set_read_timeout(Some(PATIENCE)).unwrap();
    let (mut answer, mut part) = (Vec::new(), [0; 4096]);
    while !answer.windows(9).any(|window| window == b"ventricle") {
        let count = socket.read(&mut part).unwrap();
        assert!(count > 0, "{}", String::from_utf8_lossy(&answer));
        answer.extend_from_slice(&part[..count]);
    }
}
