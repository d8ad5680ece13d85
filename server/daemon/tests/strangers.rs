//! Strangers at the doors: who announces and does not send, who connects and does not ask, who asks and does not read. All is
//! bounded, counted, and nobody is kept out by them.
use crate::common::{Daemon, PATIENCE, above, block_scene, hello, kneaded_scene};
use futures_util::{StreamExt as _, stream};
use http_body_util::{BodyExt as _, StreamBody};
use palpate_proto::v1;
use palpated::{
    doors::{bounds::Bounds, refusals::Reason},
    serve::ServeConfig,
};
use std::{io, time::Duration};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpSocket, TcpStream},
    time::{Instant, sleep, timeout},
};
use tonic::{Code, body::Body, transport::Channel};
use tower::{Service as _, ServiceExt as _};

/// What the daemon is told to be impatient in.
const SHORT: Duration = Duration::from_millis(300);

async fn daemon_with(bounds: Bounds) -> Daemon {
    Daemon::with(block_scene("at the doors", 2), ServeConfig { bounds, ..ServeConfig::in_process() }).await
}

fn count(daemon: &Daemon, reason: Reason) -> u64 {
    daemon.running.as_ref().unwrap().daemon.refusals.of(reason)
}

async fn connect(daemon: &Daemon) -> TcpStream {
    TcpStream::connect(daemon.running.as_ref().unwrap().address.unwrap()).await.unwrap()
}

async fn another_channel(daemon: &Daemon) -> Channel {
    let url = format!("http://{}", daemon.running.as_ref().unwrap().address.unwrap());
    Channel::from_shared(url).unwrap().connect().await.unwrap()
}

/// Waits until this is so.
async fn eventually(mut is_so: impl FnMut() -> bool, what: &str) {
    let until = Instant::now() + PATIENCE;
    while !is_so() {
        assert!(Instant::now() < until, "never: {what}");
        sleep(Duration::from_millis(5)).await;
    }
}

/// Whether the other end closes a socket without being asked anything further.
async fn is_closed(socket: &mut TcpStream) -> bool {
    let mut rest = Vec::new();
    timeout(PATIENCE, socket.read_to_end(&mut rest)).await.is_ok()
}

/// A request of these parts, each after the one before; `is_left_open`: and no end.
async fn call(channel: &Channel, path: &str, parts: Vec<Vec<u8>>, is_left_open: bool) -> tonic::Status {
    let parts = stream::iter(parts).map(|part| Ok::<_, io::Error>(http_body::Frame::data(bytes::Bytes::from(part))));
    let end = stream::pending().take(usize::from(is_left_open));
    let request = http::Request::post(path)
        .header("content-type", "application/grpc")
        .header("te", "trailers")
        .body(Body::new(StreamBody::new(parts.chain(end))))
        .unwrap();
    let mut channel = channel.clone();
    let response = timeout(PATIENCE, channel.ready().await.unwrap().call(request)).await.expect("an answer").unwrap();
    let (head, body) = response.into_parts();
    if let Some(status) = tonic::Status::from_header_map(&head.headers) {
        return status;
    }
    let trailers = body.collect().await.unwrap().trailers().cloned().unwrap();
    tonic::Status::from_header_map(&trailers).unwrap()
}

/// What stands before a message of so many bytes.
fn prefix(bytes: u32) -> Vec<u8> {
    let mut prefix = vec![0];
    prefix.extend(bytes.to_be_bytes());
    prefix
}

#[tokio::test(flavor = "multi_thread")]
async fn every_method_has_its_own_largest_message() {
    let daemon = daemon_with(Bounds::default()).await;
    let session = |method: &str| format!("/palpate.v1.Session/{method}");
    let large = 40 << 10;
    for method in ["Pause", "Step", "Status", "List", "Snapshot", "Reset"] {
        let status = call(&daemon.channel, &session(method), vec![prefix(large), vec![0; 100]], true).await;
        assert_eq!(status.code(), Code::OutOfRange, "{method}: refused by what it announces; {status:?}");
        // Announced as small, and larger.
        let status = call(&daemon.channel, &session(method), vec![prefix(10), vec![0; large as usize]], true).await;
        assert_eq!(status.code(), Code::OutOfRange, "{method}: {status:?}");
    }
    assert_eq!(count(&daemon, Reason::TooLarge), 12);
    let too_much = (64 << 20) + 1;
    let status = call(&daemon.channel, &session("Restore"), vec![prefix(too_much)], true).await;
    assert_eq!(status.code(), Code::OutOfRange);
    // What a method may have reaches it.
    let restore = v1::RestoreRequest { state: vec![7; 8 << 20].into(), ..Default::default() };
    assert_eq!(daemon.session().restore(restore).await.unwrap_err().code(), Code::InvalidArgument);
    let scene = v1::LoadSceneRequest { source: Some(v1::load_scene_request::Source::Toml("x".repeat(1 << 20))) };
    assert_eq!(daemon.session().load_scene(scene).await.unwrap_err().code(), Code::InvalidArgument);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_that_stays_away_is_not_waited_for() {
    let daemon = daemon_with(Bounds { stall: SHORT, request: 2 * SHORT, ..Bounds::default() }).await;
    let path = "/palpate.v1.Session/Restore";
    let status = call(&daemon.channel, path, vec![prefix(1 << 20), vec![0; 11]], true).await;
    assert_eq!((status.code(), count(&daemon, Reason::TooSlow)), (Code::DeadlineExceeded, 1), "{status:?}");
    // Nor one that comes byte by byte.
    let drops = stream::unfold((), |()| async {
        sleep(SHORT / 6).await;
        Some((Ok::<_, io::Error>(http_body::Frame::data(bytes::Bytes::from_static(&[0]))), ()))
    });
    let request = http::Request::post(path).header("content-type", "application/grpc").header("te", "trailers");
    let request = request.body(Body::new(StreamBody::new(drops))).unwrap();
    let mut channel = daemon.channel.clone();
    let response = timeout(PATIENCE, channel.ready().await.unwrap().call(request)).await.unwrap().unwrap();
    let status = tonic::Status::from_header_map(response.headers()).unwrap();
    assert_eq!((status.code(), count(&daemon, Reason::TooSlow)), (Code::DeadlineExceeded, 2), "{status:?}");
    daemon.finish().await;
}

/// Requests that are kept unfinished hold as much as all may together, and the small ones of others pass beside them.
#[tokio::test(flavor = "multi_thread")]
async fn unfinished_requests_hold_a_bounded_amount_together() {
    let daemon = daemon_with(Bounds { stall: 2 * PATIENCE, ..Bounds::default() }).await;
    let channels = [another_channel(&daemon).await, another_channel(&daemon).await, another_channel(&daemon).await];
    let calls = channels.map(|channel| {
        tokio::spawn(async move {
            let parts = std::iter::once(prefix(64 << 20)).chain((0..60).map(|_| vec![0; 1 << 20])).collect();
            call(&channel, "/palpate.v1.Session/Restore", parts, true).await
        })
    });
    eventually(|| count(&daemon, Reason::NoRoom) >= 1, "the third has no room").await;
    daemon.status().await;
    daemon.pause().await;
    for call in calls {
        call.abort();
    }
    // What they held is given back.
    let restore = v1::RestoreRequest { state: vec![7; 60 << 20].into(), ..Default::default() };
    let again = || async { daemon.session().restore(restore.clone()).await.unwrap_err().code() };
    let until = Instant::now() + PATIENCE;
    while again().await != Code::InvalidArgument {
        assert!(Instant::now() < until, "what they held is never given back");
    }
    daemon.finish().await;
}

/// 1100 silent connections locked everyone out, and the daemon spun on accepting.
#[tokio::test(flavor = "multi_thread")]
async fn silent_connections_keep_nobody_out() {
    let daemon = daemon_with(Bounds { connections: 32, ..Bounds::default() }).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    let mut silent = Vec::new();
    for _ in 0..200 {
        silent.push(connect(&daemon).await);
    }
    let channel = another_channel(&daemon).await;
    let mut session = v1::session_client::SessionClient::new(channel);
    session.status(v1::StatusRequest::default()).await.unwrap();
    assert!(count(&daemon, Reason::Evicted) >= 200 - 32, "{}", count(&daemon, Reason::Evicted));
    assert_eq!(count(&daemon, Reason::Full), 0);
    arm.hold_until(above(), |command| command.sample_sequence > 0).await;
    for socket in &mut silent[..100] {
        assert!(is_closed(socket).await);
    }
    daemon.finish().await;
}

/// Connections that are in use are never sent away for others.
#[tokio::test(flavor = "multi_thread")]
async fn whoever_comes_when_all_places_are_in_use_is_refused() {
    let daemon = daemon_with(Bounds { connections: 3, ..Bounds::default() }).await;
    let mut viewers = Vec::new();
    for _ in 0..2 {
        let channel = another_channel(&daemon).await;
        let mut surface = v1::surface_client::SurfaceClient::new(channel);
        viewers.push(surface.watch(v1::WatchRequest::default()).await.unwrap().into_inner());
    }
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    let mut late = connect(&daemon).await;
    assert!(is_closed(&mut late).await);
    assert_eq!((count(&daemon, Reason::Full), count(&daemon, Reason::Evicted)), (1, 0));
    drop(viewers);
    let until = Instant::now() + PATIENCE;
    loop {
        let url = format!("http://{}", daemon.running.as_ref().unwrap().address.unwrap());
        let channel = Channel::from_shared(url).unwrap().connect_lazy();
        let mut session = v1::session_client::SessionClient::new(channel);
        if session.status(v1::StatusRequest::default()).await.is_ok() {
            break;
        }
        assert!(Instant::now() < until, "their places never become free");
    }
    arm.hold_until(above(), |command| command.sample_sequence > 0).await;
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_that_ask_for_nothing_are_closed() {
    let daemon =
        daemon_with(Bounds { first_request: SHORT, idle: 2 * SHORT, headers: SHORT, ..Bounds::default() }).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    let staying = arm.staying(above());
    // Nothing; half of HTTP/2's preface; half of a request's headers.
    for said in [&b""[..], b"PRI * HTTP/2.0\r\n", b"GET / HTTP/1.1\r\nHost: localhost\r\nX-A: "] {
        let mut socket = connect(&daemon).await;
        socket.write_all(said).await.unwrap();
        assert!(is_closed(&mut socket).await, "{said:?}");
    }
    assert!(count(&daemon, Reason::Silent) >= 2, "{}", count(&daemon, Reason::Silent));
    // One that has asked once may be idle for longer, not for ever.
    let mut session = v1::session_client::SessionClient::new(another_channel(&daemon).await);
    session.status(v1::StatusRequest::default()).await.unwrap();
    eventually(|| count(&daemon, Reason::Idle) == 1, "it is closed").await;
    session.status(v1::StatusRequest::default()).await.unwrap();
    let mut arm = staying.back().await;
    arm.hold_until(above(), |command| command.sample_sequence > 0).await;
    daemon.finish().await;
}

/// 4000 streams that nobody read held 2.3 GB.
#[tokio::test(flavor = "multi_thread")]
async fn a_peer_that_does_not_read_its_answers_is_sent_away() {
    let config = ServeConfig { bounds: Bounds { mute: SHORT, ..Bounds::default() }, ..ServeConfig::in_process() };
    let daemon = Daemon::with(kneaded_scene(8), config).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    let staying = arm.staying(above());
    // By HTTP/2, with windows as large as there are, and no byte of theirs is read.
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let mut socket = socket.connect(daemon.running.as_ref().unwrap().address.unwrap()).await.unwrap();
    let mut said = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".to_vec();
    said.extend([0, 0, 6, 4, 0, 0, 0, 0, 0, 0, 4, 0x7f, 0xff, 0xff, 0xff]);
    said.extend([0, 0, 4, 8, 0, 0, 0, 0, 0, 0x7f, 0xff, 0, 0]);
    for stream in (1_u8..120).step_by(2) {
        let path = b"/palpate.v1.Surface/Watch";
        // POST, http, the path, the authority "x".
        let mut headers = vec![0x83, 0x86, 0x04, path.len() as u8];
        headers.extend(path);
        headers.extend([0x01, 1, b'x']);
        for (name, value) in [("content-type", "application/grpc"), ("te", "trailers")] {
            headers.extend([0x00, name.len() as u8]);
            headers.extend(name.as_bytes());
            headers.push(value.len() as u8);
            headers.extend(value.as_bytes());
        }
        said.extend([0, 0, headers.len() as u8, 1, 4, 0, 0, 0, stream]);
        said.extend(headers);
        said.extend([0, 0, 5, 0, 1, 0, 0, 0, stream, 0, 0, 0, 0, 0]);
    }
    socket.write_all(&said).await.unwrap();
    eventually(|| daemon.running.as_ref().unwrap().daemon.hub.viewer_count() == 60, "60 viewers").await;
    eventually(|| count(&daemon, Reason::Mute) == 1, "they are sent away").await;
    eventually(|| daemon.running.as_ref().unwrap().daemon.hub.viewer_count() == 0, "their places are free").await;
    let mut arm = staying.back().await;
    arm.hold_until(above(), |command| command.sample_sequence > 0).await;
    daemon.finish().await;
}

/// Streams that nobody may open without end: of viewers and of whoever asks for health.
#[tokio::test(flavor = "multi_thread")]
async fn as_many_requests_are_answered_as_there_may_be_and_devices_have_room_of_their_own() {
    let daemon = daemon_with(Bounds { streams: 20, attachments: 2, ..Bounds::default() }).await;
    let channel = another_channel(&daemon).await;
    let mut surface = v1::surface_client::SurfaceClient::new(channel);
    let mut viewers = Vec::new();
    for _ in 0..20 {
        viewers.push(surface.watch(v1::WatchRequest::default()).await.unwrap().into_inner());
    }
    let refused = surface.watch(v1::WatchRequest::default()).await.unwrap_err();
    assert_eq!((refused.code(), count(&daemon, Reason::Busy)), (Code::ResourceExhausted, 1), "{refused:?}");
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 0).await;
    drop(viewers.pop());
    let until = Instant::now() + PATIENCE;
    while surface.watch(v1::WatchRequest::default()).await.is_err() {
        assert!(Instant::now() < until, "its room is never free");
    }
    daemon.finish().await;
}

/// Pages of others paused the daemon with a `fetch` in `no-cors`; browsers' own tests are in `tests/system/browser`.
#[tokio::test(flavor = "multi_thread")]
async fn a_page_of_others_is_not_answered() {
    let daemon = daemon_with(Bounds::default()).await;
    let say = |head: String| {
        let socket = connect(&daemon);
        async move {
            let mut socket = socket.await;
            socket.write_all(head.as_bytes()).await.unwrap();
            let mut answer = Vec::new();
            timeout(PATIENCE, socket.read_to_end(&mut answer)).await.unwrap().unwrap();
            String::from_utf8_lossy(&answer).into_owned()
        }
    };
    let pause = "POST /palpate.v1.Session/Pause HTTP/1.1\r\nConnection: close\r\n";
    let body = "Content-Length: 7\r\n\r\n\0\0\0\0\u{2}\u{10}\u{1}";
    let web = "Content-Type: application/grpc-web+proto\r\n";
    for (head, code) in [
        (format!("{pause}Host: localhost:1\r\nOrigin: http://evil.example\r\n{web}{body}"), 403),
        (format!("{pause}Host: localhost:1\r\nOrigin: http://evil.example\r\nContent-Type: text/plain\r\n{body}"), 415),
        (format!("{pause}Host: evil.example\r\nOrigin: http://evil.example\r\n{web}{body}"), 421),
        ("GET / HTTP/1.1\r\nConnection: close\r\nHost: evil.example\r\n\r\n".to_owned(), 421),
    ] {
        let answer = say(head.clone()).await;
        assert!(answer.starts_with(&format!("HTTP/1.1 {code} ")), "{head:?}: {answer}");
    }
    assert!(!daemon.status().await.paused && count(&daemon, Reason::Foreign) == 4);
    let own = format!("{pause}Host: localhost:1\r\nOrigin: http://localhost:1\r\n{web}{body}");
    assert!(say(own).await.contains("200 OK"));
    assert!(daemon.status().await.paused);
    let page = say("GET / HTTP/1.1\r\nConnection: close\r\nHost: 127.0.0.1\r\n\r\n".to_owned()).await;
    assert!(page.contains("content-security-policy: default-src 'self'"), "{page}");
    daemon.finish().await;
}

/// Whoever has said nothing yet does not keep the daemon from stopping.
#[tokio::test(flavor = "multi_thread")]
async fn a_silent_connection_does_not_delay_the_stop() {
    let daemon = daemon_with(Bounds::default()).await;
    let _silent = connect(&daemon).await;
    let mut half = connect(&daemon).await;
    half.write_all(b"PRI * HT").await.unwrap();
    sleep(SHORT).await;
    let summary = daemon.finish().await;
    assert!(!summary.cut);
}

/// Nine states of which no byte was read were held by the transport, and none of them counted.
#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_is_not_read_is_held_where_it_is_counted() {
    let config = ServeConfig { bounds: Bounds { mute: 4 * SHORT, ..Bounds::default() }, ..ServeConfig::in_process() };
    let daemon = Daemon::with(block_scene("large", 12), config).await;
    let bytes = daemon.snapshot().await.state.len();
    assert!(bytes > 80_000, "{bytes}: larger than what a connection may hold");
    // Windows that let a few bytes pass.
    let url = format!("http://{}", daemon.running.as_ref().unwrap().address.unwrap());
    let endpoint =
        Channel::from_shared(url).unwrap().initial_stream_window_size(1).initial_connection_window_size(65_535);
    let channel = endpoint.connect().await.unwrap();
    let calls: Vec<_> = (0..8)
        .map(|_| {
            let mut channel = channel.clone();
            tokio::spawn(async move {
                let request = http::Request::post("/palpate.v1.Session/Snapshot")
                    .header("content-type", "application/grpc")
                    .header("te", "trailers")
                    .body(Body::new(http_body_util::Full::new(bytes::Bytes::from(prefix(0)))))
                    .unwrap();
                let response = channel.ready().await.unwrap().call(request).await.unwrap();
                // Its body is kept, and not read.
                sleep(PATIENCE).await;
                drop(response);
            })
        })
        .collect();
    let room = || daemon.running.as_ref().unwrap().daemon.room_for_states_left();
    eventually(|| room() == 0, "all eight are held, and counted").await;
    eventually(|| count(&daemon, Reason::Mute) >= 1, "who does not read is sent away").await;
    eventually(|| room() == 8, "what they held is given back").await;
    for call in calls {
        call.abort();
    }
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_is_one_message_and_not_in_text() {
    let daemon = daemon_with(Bounds::default()).await;
    let pause = "/palpate.v1.Session/Pause";
    // An empty message, and behind it one that is announced with 64 MiB: the decoder would reserve them.
    let twice = [prefix(0), prefix(64 << 20)].concat();
    assert_eq!(call(&daemon.channel, pause, vec![twice], false).await.code(), Code::InvalidArgument);
    assert_eq!(call(&daemon.channel, pause, vec![prefix(9)], false).await.code(), Code::InvalidArgument);
    assert_eq!(count(&daemon, Reason::Broken), 2);
    let mut socket = connect(&daemon).await;
    let head = format!("POST {pause} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: 8\r\n");
    socket
        .write_all(format!("{head}Content-Type: application/grpc-web-text\r\n\r\nAAAAAAA=").as_bytes())
        .await
        .unwrap();
    let mut answer = String::new();
    timeout(PATIENCE, socket.read_to_string(&mut answer)).await.unwrap().unwrap();
    assert!(answer.starts_with("HTTP/1.1 415 "), "{answer}");
    daemon.finish().await;
}
