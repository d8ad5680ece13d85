//! Streams that end in every way but the good one, from a server over a real socket.
#![allow(clippy::unwrap_used)]
use palpate_proto::connect::Credentials;
use palpate_proto::v1::{
    self, LevelOfDetail, SurfaceEvent, SurfaceUpdate, WatchRequest,
    surface_event::Message,
    surface_server::{Surface, SurfaceServer},
};
use palpate_view::{ViewError, connect::Server, surface::Watcher};
use std::time::Duration;
use tokio::{io::AsyncWriteExt as _, net::TcpListener, sync::mpsc, task::JoinHandle};
use tokio_stream::wrappers::{ReceiverStream, TcpListenerStream};
use tonic::{Request, Response, Status};

type Events = mpsc::Sender<Result<SurfaceEvent, Status>>;

/// Sends a keyframe without vertices and one update, then hands the stream to the test.
struct OneUpdate(mpsc::Sender<Events>);

#[tonic::async_trait]
impl Surface for OneUpdate {
    type WatchStream = ReceiverStream<Result<SurfaceEvent, Status>>;

    async fn watch(&self, request: Request<WatchRequest>) -> Result<Response<Self::WatchStream>, Status> {
        if request.into_inner().max_rate_hz > 240.0 {
            return Err(Status::invalid_argument("max_rate_hz is too large"));
        }
        let (events, stream) = mpsc::channel(8);
        let header = Some(v1::KeyframeHeader::default());
        let chunk = v1::KeyframeChunk { epoch: 1, chunk_count: 1, header, ..Default::default() };
        let update = SurfaceUpdate { epoch: 1, tick: 7, ..Default::default() };
        for message in [Message::Keyframe(chunk), Message::Update(update)] {
            events.send(Ok(SurfaceEvent { message: Some(message) })).await.unwrap();
        }
        self.0.send(events).await.unwrap();
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

async fn serve() -> (Server, mpsc::Receiver<Events>, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let (send, streams) = mpsc::channel(1);
    let service = tonic::transport::Server::builder().add_service(SurfaceServer::new(OneUpdate(send)));
    let running = tokio::spawn(async move {
        service.serve_with_incoming(TcpListenerStream::new(listener)).await.unwrap();
    });
    (Server { address, credentials: Credentials::default() }, streams, running)
}

async fn watch(server: &Server) -> Watcher {
    let channel = server.connect().await.unwrap();
    let mut watcher = Watcher::start(channel, 60.0, LevelOfDetail::Full).await.unwrap();
    assert_eq!(watcher.next().await.unwrap().unwrap().last.tick, 7);
    watcher
}

/// A daemon that hung left `watch` hanging for ever: the transport's pings did not end an open stream.
#[tokio::test]
async fn a_stream_that_says_nothing_more_is_an_error() {
    let (server, mut streams, _running) = serve().await;
    let mut watcher = watch(&server).await;
    let _open = streams.recv().await.unwrap();
    watcher.patience = Duration::from_millis(50);
    let error = watcher.next().await.unwrap_err();
    assert!(matches!(error, ViewError::Silent { .. }), "{error}");
}

#[tokio::test]
async fn a_stream_that_the_daemon_ends_is_an_end() {
    let (server, mut streams, _running) = serve().await;
    let mut watcher = watch(&server).await;
    drop(streams.recv().await.unwrap());
    assert!(watcher.next().await.unwrap().is_none());
}

/// A web server was a daemon whose connection "broke: frame with invalid size".
#[tokio::test]
async fn a_server_of_another_kind_and_no_server_are_told_apart() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let server =
        Server { address: format!("http://{}", listener.local_addr().unwrap()), credentials: Credentials::default() };
    let web = tokio::spawn(async move {
        while let Ok((mut stream, _)) = listener.accept().await {
            let _ = stream.write_all(b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n").await;
        }
    });
    let error = server.connect().await.unwrap_err();
    assert!(matches!(&error, ViewError::Unreachable { reason, .. } if reason.contains("another program")), "{error}");
    web.abort();
    let _ = web.await;
    let error = server.connect().await.unwrap_err();
    assert!(matches!(&error, ViewError::Unreachable { reason, .. } if reason.contains("nothing listens")), "{error}");
    let server = Server { address: "unix:///nowhere/palpate.sock".into(), credentials: Credentials::default() };
    let error = server.connect().await.unwrap_err();
    assert!(matches!(&error, ViewError::Unreachable { reason, .. } if reason.contains("no such socket")), "{error}");
}

/// A daemon that was killed "refused", in the words of the transport.
#[tokio::test]
async fn a_lost_connection_is_no_refusal_and_a_refusal_is_no_lost_connection() {
    let (server, mut streams, _running) = serve().await;
    let far_end = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let through =
        Server { address: format!("http://{}", far_end.local_addr().unwrap()), credentials: Credentials::default() };
    let target = server.address.trim_start_matches("http://").to_owned();
    let wire = tokio::spawn(async move {
        let (mut near, _) = far_end.accept().await.unwrap();
        let mut far = tokio::net::TcpStream::connect(target).await.unwrap();
        let _ = tokio::io::copy_bidirectional(&mut near, &mut far).await;
    });
    let mut watcher = watch(&through).await;
    let _open = streams.recv().await.unwrap();
    wire.abort();
    let error = watcher.next().await.unwrap_err();
    assert!(matches!(error, ViewError::Lost(_)), "{error}");

    let channel = server.connect().await.unwrap();
    let Err(error) = Watcher::start(channel, 241.0, LevelOfDetail::Full).await else { panic!("241 Hz were given") };
    assert!(matches!(&error, ViewError::Refused { message, .. } if message.contains("too large")), "{error}");
}
