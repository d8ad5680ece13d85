//! What a message announces costs nothing: alone in its process, as it looks at the process's memory.
#![allow(clippy::unwrap_used, clippy::expect_used)]
mod common;
use common::{Daemon, block_scene};
use futures_util::{StreamExt as _, stream};
use http_body_util::StreamBody;
use std::{io, time::Duration};
use tokio::time::sleep;
use tonic::{body::Body, transport::Channel};
use tower::{Service as _, ServiceExt as _};

/// What is announced has come as far as it will.
const SHORT: Duration = Duration::from_millis(300);

async fn connected(daemon: &Daemon) -> Channel {
    let url = format!("http://{}", daemon.running.as_ref().unwrap().address.unwrap());
    Channel::from_shared(url).unwrap().connect().await.unwrap()
}

/// A message of so many bytes, of which eleven come.
async fn announce_and_wait(mut channel: Channel, path: &str, bytes: u32) {
    let mut parts = vec![0];
    parts.extend(bytes.to_be_bytes());
    parts.extend([0; 11]);
    let parts = stream::iter([Ok::<_, io::Error>(http_body::Frame::data(bytes::Bytes::from(parts)))]);
    let request = http::Request::post(path)
        .header("content-type", "application/grpc")
        .header("te", "trailers")
        .body(Body::new(StreamBody::new(parts.chain(stream::pending()))))
        .unwrap();
    let _ = channel.ready().await.unwrap().call(request).await;
}

/// Kilobytes of the process that are its own to write: what it has reserved, touched or not.
fn writable_kib() -> i64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmData:")).unwrap();
    line.split_whitespace().next().unwrap().parse().unwrap()
}

/// 116 bytes made the daemon reserve 64 MiB, and fill them, as its memory is locked: seventy such streams ended it.
#[tokio::test(flavor = "multi_thread")]
async fn an_announced_message_costs_what_has_come_of_it() {
    let daemon = Daemon::on(block_scene("announced", 2)).await;
    let channels = [connected(&daemon).await, connected(&daemon).await];
    let announce = |n: usize| {
        let path = ["Session/Restore", "Session/LoadScene", "Session/Pause", "Surface/Watch", "Device/Attach"][n % 5];
        let most = if n.is_multiple_of(5) { 64 << 20 } else { 16 << 10 };
        let (path, channel) = (format!("/palpate.v1.{path}"), channels[n % 2].clone());
        tokio::spawn(async move { announce_and_wait(channel, &path, most).await })
    };
    let first: Vec<_> = (0..10).map(announce).collect();
    sleep(SHORT).await;
    let before_kib = writable_kib();
    let calls: Vec<_> = (0..256).map(announce).collect();
    sleep(3 * SHORT).await;
    let grown_kib = writable_kib() - before_kib;
    assert!(grown_kib < 32 * 1024, "{grown_kib} KiB");
    daemon.status().await;
    for call in first.into_iter().chain(calls) {
        call.abort();
    }
    daemon.finish().await;
}
