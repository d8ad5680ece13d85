//! The same bridge over a Unix socket and over TLS.

use crate::common::{Mock, config, start, until};
use palpate_proto::v1::device_server::DeviceServer;
use tokio_stream::wrappers::UnixListenerStream;
use tonic::transport::{Identity, Server, ServerTlsConfig, server::TcpIncoming};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn over_a_unix_socket() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("palpate.sock");
    let mock = Mock::default();
    let incoming = UnixListenerStream::new(tokio::net::UnixListener::bind(&path).unwrap());
    tokio::spawn(Server::builder().add_service(DeviceServer::new(mock.clone())).serve_with_incoming(incoming));
    let bridge = start(config(&format!("unix://{}", path.display())));
    until("the force is up", || bridge.handle.stats().force_n() > 0.99).await;
    bridge.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn over_tls_only_with_the_right_authority() {
    let rcgen::CertifiedKey { cert, signing_key } =
        rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let ca = folder.path().join("ca.pem");
    std::fs::write(&ca, cert.pem()).unwrap();
    let mock = Mock::default();
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let port = listener.local_addr().unwrap().port();
    let tls = ServerTlsConfig::new().identity(Identity::from_pem(cert.pem(), signing_key.serialize_pem()));
    let server = Server::builder().tls_config(tls).unwrap().add_service(DeviceServer::new(mock.clone()));
    tokio::spawn(server.serve_with_incoming(TcpIncoming::from(listener)));

    let mut trusted = config(&format!("https://localhost:{port}"));
    trusted.server.tls_ca = Some(ca);
    let bridge = start(trusted.clone());
    until("the force is up", || bridge.handle.stats().force_n() > 0.99).await;
    bridge.stop().await;

    let refusal = |config: palpate_bridge::Config| async { start(config).task.await.unwrap().unwrap_err().to_string() };
    let mut without = trusted.clone();
    (without.server.url, without.server.tls_ca) = (format!("http://localhost:{port}"), None);
    without.server.give_up_after_s = Some(0.1);
    let error = refusal(without).await;
    assert!(error.contains("or a daemon that wants https://"), "{error}");

    let plain = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let plain_port = plain.local_addr().unwrap().port();
    let server = Server::builder().add_service(DeviceServer::new(Mock::default()));
    tokio::spawn(server.serve_with_incoming(TcpIncoming::from(plain)));
    let mut needless = trusted.clone();
    needless.server.url = format!("https://localhost:{plain_port}");
    needless.server.give_up_after_s = Some(0.1);
    let error = refusal(needless).await;
    assert!(error.contains("does not speak TLS: write http://"), "{error}");

    let other = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let other_ca = folder.path().join("other.pem");
    std::fs::write(&other_ca, other.cert.pem()).unwrap();
    let mut stranger = trusted;
    stranger.server.tls_ca = Some(other_ca);
    stranger.server.give_up_after_s = Some(0.1);
    let error = refusal(stranger.clone()).await;
    assert!(error.contains("certificate is not signed by the authority given with --tls-ca"), "{error}");

    std::fs::write(folder.path().join("other.pem"), "not a certificate").unwrap();
    let error = format!("{:?}", miette::Report::new(start(stranger).task.await.unwrap().unwrap_err()));
    for part in ["cannot read the certificate authority", "other.pem", "it holds no certificate in PEM form"] {
        assert_eq!(error.matches(part).count(), 1, "{part}: {error}");
    }
}
