//! The arms' lane: connections that begin with an arm's sign are served whatever everybody else is waiting for.
use crate::common;
use crate::common::{Arm, Daemon, PATIENCE, above, block_scene, hello};
use palpate_proto::{
    ARM_SIGN,
    connect::{Credentials, connect_arm, endpoint},
    v1::{self, session_client::SessionClient},
};
use palpated::{doors::refusals::Reason, serve::ServeConfig};
use std::{
    sync::{
        Arc, Barrier,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    runtime::Builder,
    time::timeout,
};

/// One runtime served all: with 1000 viewers the arm was answered in time in 57 % of its ticks.
#[test]
fn arms_are_answered_while_everybody_else_waits() {
    let of_all = Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    let daemon = of_all.block_on(Daemon::on(block_scene("lane", 2)));
    let url = format!("http://{}", daemon.running.as_ref().unwrap().address.unwrap());
    let of_arm = Builder::new_current_thread().enable_all().build().unwrap();
    let mut arm = of_arm.block_on(async {
        let channel = connect_arm(&endpoint(&url, &Credentials::default()).unwrap(), &url).await.unwrap();
        let mut arm = Arm::attach(channel, hello()).await;
        arm.welcome().await;
        arm.hold_until(above(), |command| command.sample_sequence > 0).await;
        arm
    });
    let viewer = of_arm.block_on(endpoint(&url, &Credentials::default()).unwrap().connect()).unwrap();
    let (busy, goes_on) = (Arc::new(Barrier::new(3)), Arc::new(AtomicBool::new(true)));
    for _ in 0..2 {
        let (busy, goes_on) = (Arc::clone(&busy), Arc::clone(&goes_on));
        of_all.spawn(async move {
            busy.wait();
            while goes_on.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(1));
            }
        });
    }
    busy.wait();
    let status = async { SessionClient::new(viewer).status(v1::StatusRequest::default()).await };
    assert!(of_arm.block_on(async { timeout(Duration::from_millis(200), status).await }).is_err(), "they do wait");
    of_arm.block_on(async {
        for _ in 0..100 {
            let newest = arm.sequence;
            arm.hold_until(above(), |command| command.sample_sequence > newest).await;
        }
    });
    goes_on.store(false, Ordering::Relaxed);
    drop(arm);
    of_all.block_on(daemon.finish());
}

#[tokio::test(flavor = "multi_thread")]
async fn the_sign_goes_before_tls_and_on_a_unix_socket() {
    let folder = tempfile::tempdir().unwrap();
    let files = common::certificate(folder.path());
    let unix = folder.path().join("palpated.sock");
    let config =
        ServeConfig { tls: Some(files.clone()), unix: Some(common::socket(&unix)), ..ServeConfig::in_process() };
    let stop = tokio_util::sync::CancellationToken::new();
    let running = palpated::serve::start(config, block_scene("lane", 2), stop.clone()).await.unwrap();
    for (url, authority) in [
        (format!("https://localhost:{}", running.address.unwrap().port()), Some(files.certificate.clone())),
        (format!("unix://{}", unix.display()), None),
    ] {
        let credentials = Credentials { authority, ..Credentials::default() };
        let channel = connect_arm(&endpoint(&url, &credentials).unwrap(), &url).await.unwrap();
        // No more is served there than an arm needs.
        let other = SessionClient::new(channel.clone()).status(v1::StatusRequest::default()).await.unwrap_err();
        assert_eq!(other.code(), tonic::Code::Unimplemented, "{url}");
        let mut arm = Arm::attach(channel, hello()).await;
        arm.welcome().await;
        arm.hold_until(above(), |command| command.sample_sequence > 0).await;
        drop(arm);
        let until = tokio::time::Instant::now() + PATIENCE;
        while running.daemon.session().tools[0].device().is_some() {
            assert!(tokio::time::Instant::now() < until, "the tool is never free");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }
    stop.cancel();
    running.finished().await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn half_a_sign_and_another_are_sent_away() {
    let daemon = Daemon::on(block_scene("lane", 2)).await;
    let address = daemon.running.as_ref().unwrap().address.unwrap();
    let mut other = ARM_SIGN.to_vec();
    other[15] ^= 1;
    let mut socket = TcpStream::connect(address).await.unwrap();
    socket.write_all(&other).await.unwrap();
    assert_eq!(timeout(PATIENCE, socket.read(&mut [0; 8])).await.unwrap().unwrap(), 0);
    let mut socket = TcpStream::connect(address).await.unwrap();
    socket.write_all(&ARM_SIGN[..7]).await.unwrap();
    socket.shutdown().await.unwrap();
    assert_eq!(timeout(PATIENCE, socket.read(&mut [0; 8])).await.unwrap().unwrap(), 0);
    assert_eq!(daemon.running.as_ref().unwrap().daemon.refusals.of(Reason::Handshake), 2);
    daemon.finish().await;
}
