//! The ways in: TCP, TLS, Unix sockets, health, reflection, the page, gRPC-web; and ports that cannot be had.
use crate::common;
use crate::common::{Daemon, block_scene};
use palpate_proto::v1::{self, session_client::SessionClient};
use palpated::{
    doors::listen::ListenError,
    serve::{ServeConfig, ServeError, start},
};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio_util::sync::CancellationToken;
use tonic::transport::{Certificate, ClientTlsConfig, Endpoint};
use tonic_health::pb::{HealthCheckRequest, health_client::HealthClient};
use tonic_reflection::pb::v1::{
    ServerReflectionRequest, server_reflection_client::ServerReflectionClient,
    server_reflection_request::MessageRequest, server_reflection_response::MessageResponse,
};

async fn scene_name(channel: tonic::transport::Channel) -> String {
    let status = SessionClient::new(channel).status(v1::StatusRequest::default()).await.unwrap().into_inner();
    status.session.unwrap().scene_name
}

#[tokio::test(flavor = "multi_thread")]
async fn a_unix_socket_answers_and_replaces_one_left_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("palpated.sock");
    drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
    assert!(path.exists(), "left over, as after a crash");
    let config = ServeConfig { unix: Some(common::socket(&path)), ..ServeConfig::in_process() };
    let daemon = Daemon::with(block_scene("by unix", 2), config.clone()).await;
    let channel = Endpoint::from_shared(format!("unix://{}", path.display())).unwrap().connect().await.unwrap();
    assert_eq!(scene_name(channel).await, "by unix");
    let second = start(config, block_scene("second", 2), CancellationToken::new()).await;
    assert!(matches!(second, Err(ServeError::Listen(ListenError::Unix { .. }))), "a living one is not replaced");
    daemon.finish().await;
    assert!(!path.exists());
}

#[tokio::test(flavor = "multi_thread")]
async fn tls_answers_those_who_trust_it_and_nobody_else() {
    let folder = tempfile::tempdir().unwrap();
    let files = common::certificate(folder.path());
    let trusted = std::fs::read(&files.certificate).unwrap();
    let config = ServeConfig { tls: Some(files.clone()), ..ServeConfig::in_process() };
    let stop = CancellationToken::new();
    let running = start(config, block_scene("by tls", 2), stop.clone()).await.unwrap();
    let url = format!("https://localhost:{}", running.address.unwrap().port());
    let tls = ClientTlsConfig::new().ca_certificate(Certificate::from_pem(trusted)).domain_name("localhost");
    let channel = Endpoint::from_shared(url.clone()).unwrap().tls_config(tls).unwrap().connect().await.unwrap();
    assert_eq!(scene_name(channel).await, "by tls");
    let other = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
    let stranger = ClientTlsConfig::new().ca_certificate(Certificate::from_pem(other.cert.pem()));
    assert!(Endpoint::from_shared(url).unwrap().tls_config(stranger).unwrap().connect().await.is_err());
    let plain = format!("http://{}", running.address.unwrap());
    let plain = Endpoint::from_shared(plain).unwrap().connect_lazy();
    assert!(SessionClient::new(plain).status(v1::StatusRequest::default()).await.is_err());
    stop.cancel();
    running.finished().await.unwrap();

    std::fs::write(&files.key, "no key").unwrap();
    let config = ServeConfig { tls: Some(files.clone()), ..ServeConfig::in_process() };
    let broken = start(config.clone(), block_scene("x", 2), CancellationToken::new()).await.unwrap_err();
    assert!(matches!(broken, ServeError::Listen(ListenError::Tls { .. })), "{broken:?}");
    std::fs::remove_file(&files.key).unwrap();
    let missing = start(config, block_scene("x", 2), CancellationToken::new()).await.unwrap_err();
    assert!(missing.to_string().contains("key.pem"), "{missing}");
}

/// Health said SERVING while the body was quarantined, and no arm had force.
#[tokio::test(flavor = "multi_thread")]
async fn a_quarantined_daemon_does_not_serve_arms() {
    let daemon = Daemon::on(block_scene("health", 4)).await;
    let mut health = HealthClient::new(daemon.channel.clone());
    let mut until = async |service: &str, status: i32| {
        let request = HealthCheckRequest { service: service.into() };
        let mut watch = health.watch(request).await.unwrap().into_inner();
        let is = async { while watch.message().await.unwrap().unwrap().status != status {} };
        tokio::time::timeout(common::PATIENCE, is).await.unwrap_or_else(|_| panic!("{service} is never {status}"));
    };
    until("", 1).await;
    daemon.break_the_body().await;
    until("palpate.v1.Device", 2).await;
    until("", 2).await;
    until("palpate.v1.Session", 1).await;
    daemon.reset().await;
    until("palpate.v1.Device", 1).await;
    until("", 1).await;
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_busy_port_is_named_with_a_way_out() {
    let daemon = Daemon::on(block_scene("first", 2)).await;
    let listen = daemon.running.as_ref().unwrap().address.unwrap();
    let config = ServeConfig { listen: Some(listen), ..ServeConfig::in_process() };
    let busy = start(config, block_scene("second", 2), CancellationToken::new()).await.unwrap_err();
    let help = miette::Diagnostic::help(&busy).unwrap().to_string();
    assert!(busy.to_string().contains(&listen.port().to_string()) && help.contains("--listen"), "{busy} {help}");
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn health_and_reflection_answer() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let mut health = HealthClient::new(daemon.channel.clone());
    for service in ["", "palpate.v1.Device", "palpate.v1.Surface", "palpate.v1.Session"] {
        let request = HealthCheckRequest { service: service.into() };
        assert_eq!(health.check(request).await.unwrap().into_inner().status, 1, "{service} is SERVING");
    }
    let ask = ServerReflectionRequest {
        message_request: Some(MessageRequest::ListServices(String::new())),
        ..Default::default()
    };
    let mut reflection = ServerReflectionClient::new(daemon.channel.clone());
    let mut answers = reflection.server_reflection_info(tokio_stream::once(ask)).await.unwrap().into_inner();
    let Some(MessageResponse::ListServicesResponse(list)) = answers.message().await.unwrap().unwrap().message_response
    else {
        panic!("no list of services")
    };
    let names: Vec<&str> = list.service.iter().map(|service| service.name.as_str()).collect();
    for service in ["palpate.v1.Device", "palpate.v1.Surface", "palpate.v1.Session", "grpc.health.v1.Health"] {
        assert!(names.contains(&service), "{names:?}");
    }
    daemon.finish().await;
}

/// One HTTP/1.1 request, as a browser's.
async fn http(daemon: &Daemon, request: &str) -> String {
    let mut socket = tokio::net::TcpStream::connect(daemon.running.as_ref().unwrap().address.unwrap()).await.unwrap();
    socket.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    socket.read_to_end(&mut answer).await.unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_browser_gets_the_page_and_grpc_web_on_the_same_port() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let page = http(&daemon, "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").await;
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("<!doctype html>"), "{page}");
    let missing = http(&daemon, "GET /nothing HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").await;
    assert!(missing.starts_with("HTTP/1.1 404"), "{missing}");
    let list = "POST /palpate.v1.Session/List HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\
                Content-Type: application/grpc-web+proto\r\nContent-Length: 5\r\n\r\n\0\0\0\0\0";
    let answer = http(&daemon, list).await;
    assert!(
        answer.starts_with("HTTP/1.1 200") && answer.contains("block") && answer.contains("grpc-status:0"),
        "{answer}"
    );
    let unknown = "POST /palpate.v9.Session/List HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\
                   Content-Type: application/grpc-web+proto\r\nContent-Length: 5\r\n\r\n\0\0\0\0\0";
    assert!(http(&daemon, unknown).await.contains("grpc-status: 12"));
    // Garbage closes the connection and nothing else.
    http(&daemon, "\x16\x03\x01 garbage \r\n\r\n").await;
    assert_eq!(scene_name(daemon.channel.clone()).await, "block");
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_loop_that_ends_by_itself_ends_the_daemon_as_a_failure() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let mut health = HealthClient::new(daemon.channel.clone());
    let mut watch = health.watch(HealthCheckRequest::default()).await.unwrap().into_inner();
    assert_eq!(watch.message().await.unwrap().unwrap().status, 1, "SERVING");
    // Nobody told the daemon to stop: only its loop ends.
    let Daemon { running, stop, .. } = daemon;
    let running = running.unwrap();
    running.daemon.sign.raise();
    let changed = tokio::time::timeout(common::PATIENCE, watch.message()).await.expect("it is noticed");
    assert_eq!(changed.unwrap().unwrap().status, 2, "NOT_SERVING");
    drop(watch);
    let summary = tokio::time::timeout(common::PATIENCE, running.finished()).await.expect("it stops").unwrap();
    assert!(summary.failure.is_some_and(|failure| failure.contains("loop")), "{:?}", summary.failure);
    assert!(stop.is_cancelled(), "everybody is told");
}
