//! Who may do what, by certificate and by token, over real sockets.
use crate::common;
use crate::common::{Arm, PATIENCE, above, block_scene, force_of, hello, pressing, sample};
use glam::DVec3;
use palpate_proto::{
    connect::{Connection, Credentials, endpoint},
    v1::{
        self, DeviceFaultCode, device_client::DeviceClient, device_down::Message, device_up,
        session_client::SessionClient, surface_client::SurfaceClient,
    },
};
use palpated::{
    doors::{refusals::Reason, tls::TlsFiles},
    serve::{Running, ServeConfig, ServeError, start},
    who::{
        Identity,
        folder::Folder,
        role::{Role, Roles},
        table::{TABLE, Who},
        token,
    },
};
use std::{
    path::PathBuf,
    time::{Duration, SystemTime},
};
use tokio::{sync::mpsc, time::timeout};
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Request, Status, client::Grpc, codegen::http::uri::PathAndQuery};
use tonic_prost::ProstCodec;

/// A daemon that asks who calls, and the keys to tell it.
struct Guarded {
    running: Running,
    stop: CancellationToken,
    keys: Folder,
    place: tempfile::TempDir,
}

impl Guarded {
    async fn new(change: impl FnOnce(&mut ServeConfig)) -> Self {
        let place = tempfile::tempdir().unwrap();
        let keys = Folder::at(&place.path().join("pki"));
        keys.init(&["localhost".into()], SystemTime::now()).unwrap();
        let tls = TlsFiles { certificate: keys.certificate(), key: keys.key(), authority: Some(keys.authority()) };
        let mut config = ServeConfig { keys: Some(keys.clone()), tls: Some(tls), ..ServeConfig::in_process() };
        change(&mut config);
        let stop = CancellationToken::new();
        let running = start(config, block_scene("guarded", 3), stop.clone()).await.unwrap();
        Self { running, stop, keys, place }
    }

    fn url(&self) -> String {
        format!("https://localhost:{}", self.running.address.unwrap().port())
    }

    async fn connect(&self, credentials: Credentials) -> Connection {
        let credentials = Credentials { authority: Some(self.keys.authority()), ..credentials };
        let channel = endpoint(&self.url(), &credentials).unwrap().connect().await.unwrap();
        Connection::new(channel, credentials.bearer(&self.url()).unwrap())
    }

    fn certificate(&self, name: &str, roles: Roles) -> (PathBuf, PathBuf) {
        let (lasts, now) = (Duration::from_hours(1), SystemTime::now());
        self.keys.issue(name, roles, lasts, now, self.place.path()).unwrap()
    }

    fn token(&self, name: &str, roles: Roles, lasts: Duration) -> String {
        let until = SystemTime::now() + lasts;
        token::mint(&self.keys.token_key().unwrap(), &Identity { name: name.into(), roles, until })
    }

    async fn with_certificate(&self, name: &str, roles: Roles) -> Connection {
        let certificate = Some(self.certificate(name, roles));
        self.connect(Credentials { certificate, ..Credentials::default() }).await
    }

    async fn with_token(&self, token: String) -> Connection {
        self.connect(Credentials { token: Some(token), ..Credentials::default() }).await
    }

    async fn finish(self) {
        self.stop.cancel();
        timeout(PATIENCE, self.running.finished()).await.unwrap().unwrap();
    }
}

const HOUR: Duration = Duration::from_hours(1);

/// Calls of gRPC, and who may make them.
fn all_calls() -> impl Iterator<Item = (&'static str, Who)> {
    TABLE.into_iter().filter(|(path, _)| *path != palpated::metrics::PATH)
}

/// What a call is answered, with an empty message; a stream that begins is left again.
async fn answer(connection: &Connection, path: &'static str) -> Result<(), Status> {
    let mut grpc = Grpc::new(connection.clone());
    grpc.ready().await.unwrap();
    let codec: ProstCodec<(), ()> = ProstCodec::default();
    let request = Request::new(tokio_stream::iter([()]));
    let mut answers = grpc.streaming(request, PathAndQuery::from_static(path), codec).await?.into_inner();
    // That it has begun to answer is enough; what it answers is no empty message.
    match timeout(Duration::from_secs(2), answers.message()).await {
        Ok(Err(status)) if status.code() != Code::Internal => Err(status),
        _ => Ok(()),
    }
}

fn is_refused(answer: &Result<(), Status>) -> Option<Code> {
    let code = answer.as_ref().err()?.code();
    matches!(code, Code::PermissionDenied | Code::Unauthenticated).then_some(code)
}

#[tokio::test(flavor = "multi_thread")]
async fn every_forbidden_pair_of_role_and_call_is_denied() {
    let daemon = Guarded::new(|_| ()).await;
    for (role, name) in Role::ALL {
        let roles = Roles::of(&[role]);
        let by_token = daemon.with_token(daemon.token(name, roles, HOUR)).await;
        for connection in [daemon.with_certificate(name, roles).await, by_token] {
            for (path, who) in all_calls() {
                let answer = answer(&connection, path).await;
                let expected = (!who.includes(roles)).then_some(Code::PermissionDenied);
                assert_eq!(is_refused(&answer), expected, "{name} at {path}: {answer:?}");
            }
        }
    }
    // Nobody, and somebody of another authority, are not let in at all.
    let nobody = daemon.connect(Credentials::default()).await;
    for (path, who) in all_calls() {
        let expected = (who != Who::Anybody).then_some(Code::Unauthenticated);
        assert_eq!(is_refused(&answer(&nobody, path).await), expected, "nobody at {path}");
    }
    let other = Folder::at(&daemon.place.path().join("other"));
    other.init(&["localhost".into()], SystemTime::now()).unwrap();
    let stranger = other.issue("mallory", Roles::ALL, HOUR, SystemTime::now(), daemon.place.path()).unwrap();
    let credentials =
        Credentials { authority: Some(daemon.keys.authority()), certificate: Some(stranger), token: None };
    let refused = match endpoint(&daemon.url(), &credentials).unwrap().connect().await {
        // By TLS 1.3 the refusal comes with the first answer.
        Ok(channel) => SessionClient::new(channel).status(v1::StatusRequest::default()).await.is_err(),
        Err(_) => true,
    };
    assert!(refused);
    assert!(daemon.running.daemon.refusals.of(Reason::Forbidden) > 50);
    daemon.finish().await;
}

/// On the arms' lane a call without gRPC's content type was taken for the page's, and got the tool.
#[tokio::test(flavor = "multi_thread")]
async fn the_arms_lane_asks_as_well_whatever_a_call_claims_to_be() {
    use palpate_proto::connect::connect_arm;
    use tower::ServiceExt as _;
    let daemon = Guarded::new(|_| ()).await;
    let url = daemon.url();
    let nobody = Credentials { authority: Some(daemon.keys.authority()), ..Credentials::default() };
    let viewer =
        Credentials { certificate: Some(daemon.certificate("anna", Roles::of(&[Role::Viewer]))), ..nobody.clone() };
    for (credentials, code) in [(&nobody, Code::Unauthenticated), (&viewer, Code::PermissionDenied)] {
        for kind in ["application/grpc", "text/plain", "application/grpc-web-text", ""] {
            let channel = connect_arm(&endpoint(&url, credentials).unwrap(), &url).await.unwrap();
            let mut ask = http::Request::post("/palpate.v1.Device/Attach").header("te", "trailers");
            if !kind.is_empty() {
                ask = ask.header("content-type", kind);
            }
            let hello = [&[0, 0, 0, 0, 2][..], &[0x0a, 0]].concat();
            let body = tonic::body::Body::new(http_body_util::Full::new(bytes::Bytes::from(hello)));
            let response = channel.oneshot(ask.body(body).unwrap()).await.unwrap();
            let status = Status::from_header_map(response.headers()).expect("refused at once");
            assert_eq!(status.code(), code, "{kind}: {status:?}");
        }
    }
    // Who is an arm is one there, too.
    let left = Credentials { certificate: Some(daemon.certificate("left", Roles::of(&[Role::Device]))), ..nobody };
    let channel = connect_arm(&endpoint(&url, &left).unwrap(), &url).await.unwrap();
    let mut arm = attach(Connection::new(channel, left.bearer(&url).unwrap())).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 0).await;
    daemon.finish().await;
}

/// What strangers send: nothing, noise, tokens of other keys, tokens that have ended or were changed or are for something else.
#[tokio::test(flavor = "multi_thread")]
async fn of_many_hostile_calls_none_succeeds() {
    let calls: usize = std::env::var("PALPATE_HOSTILE_CALLS").ok().and_then(|n| n.parse().ok()).unwrap_or(4_000);
    let daemon = Guarded::new(|_| ()).await;
    let viewer = Roles::of(&[Role::Viewer]);
    let good = daemon.token("anna", viewer, HOUR);
    let ended = daemon.token("anna", Roles::ALL, Duration::ZERO);
    let forged = {
        let until = SystemTime::now() + HOUR;
        token::mint(&[9; 32], &Identity { name: "anna".into(), roles: Roles::ALL, until })
    };
    let mut open = daemon.connect(Credentials::default()).await;
    let mut dice = Dice(34);
    let mut asked = tokio::task::JoinSet::new();
    for n in 1..=calls {
        // HTTP/2 closes a connection on which a thousand calls were refused unread.
        if n.is_multiple_of(500) {
            open = daemon.connect(Credentials::default()).await;
        }
        let mut bytes = good.clone().into_bytes();
        let token = match dice.below(7) {
            0 => None,
            1 => Some("x".repeat(dice.below(3000))),
            2 => Some(forged.clone()),
            3 => Some(ended.clone()),
            4 => Some(good.replace("viewer", "viewer+operator")),
            5 => {
                let index = dice.below(bytes.len());
                bytes[index] = bytes[index].wrapping_add(1 + dice.below(4) as u8).clamp(33, 126);
                Some(String::from_utf8(bytes).unwrap()).filter(|changed| *changed != good)
            }
            _ => Some(good.clone()),
        };
        let is_good = token.as_ref() == Some(&good);
        let calls: Vec<&'static str> = all_calls()
            .filter(|(_, who)| *who != Who::Anybody && !(is_good && who.includes(viewer)))
            .map(|(path, _)| path)
            .collect();
        let path = calls[dice.below(calls.len())];
        let scheme = if dice.below(10) > 0 { "Bearer " } else { "Basic " };
        let channel = open.clone();
        asked.spawn(async move {
            let mut grpc = Grpc::new(channel);
            grpc.ready().await.unwrap();
            let mut request = Request::new(());
            if let Some(token) = token {
                request.metadata_mut().insert("authorization", format!("{scheme}{token}").parse().unwrap());
            }
            let codec: ProstCodec<(), ()> = ProstCodec::default();
            (path, grpc.unary(request, PathAndQuery::from_static(path), codec).await)
        });
        if asked.len() >= 64 {
            check_refused(asked.join_next().await.unwrap().unwrap());
        }
    }
    while let Some(answered) = asked.join_next().await {
        check_refused(answered.unwrap());
    }
    println!("{calls} hostile calls, none succeeded");
    // The daemon is there for whoever may, and nothing has happened to it.
    let anna = daemon.with_token(good).await;
    let status = SessionClient::new(anna).status(v1::StatusRequest::default()).await.unwrap().into_inner();
    assert!(!status.paused && status.devices.is_empty());
    daemon.finish().await;
}

/// splitmix64: the same throws every time.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) % n as u64) as usize
    }
}

fn check_refused((path, answer): (&str, Result<tonic::Response<()>, Status>)) {
    let code = answer.map(|_| ()).expect_err(path).code();
    assert!(matches!(code, Code::PermissionDenied | Code::Unauthenticated), "{path}: {code:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_ends_with_its_token_or_when_it_is_revoked() {
    let daemon = Guarded::new(|_| ()).await;
    let viewer = Roles::of(&[Role::Viewer]);
    // Whole seconds: between 1 and 2 are left.
    let short = daemon.with_token(daemon.token("anna", viewer, Duration::from_secs(2))).await;
    let mut watched = SurfaceClient::new(short).watch(v1::WatchRequest::default()).await.unwrap().into_inner();
    let mut events = 0;
    let end = loop {
        match timeout(PATIENCE, watched.message()).await.unwrap() {
            Ok(Some(_)) => events += 1,
            Ok(None) => panic!("it ended as if all were well"),
            Err(status) => break status,
        }
    };
    assert!(events > 0, "it was served before");
    assert_eq!(
        (end.code(), end.message()),
        (Code::PermissionDenied, "the certificate or token has ended: the stream ends")
    );

    let left = daemon.with_certificate("left", Roles::of(&[Role::Device])).await;
    let mut arm = attach(left.clone()).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 20).await;
    arm.hold_until(pressing(), |command| force_of(command).z > 0.1).await;
    daemon.keys.revoke("left").unwrap();
    daemon.running.keeper.reload().unwrap();
    let up = arm.up.clone();
    let first = arm.sequence + 1;
    let goes_on = tokio::spawn(async move {
        for sequence in first.. {
            let message = Some(device_up::Message::Sample(sample(sequence, pressing())));
            if up.send(v1::DeviceUp { message }).await.is_err() {
                break;
            }
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    });
    let (mut last_n, mut goodbye) = (DVec3::ONE, None);
    let end = loop {
        match timeout(PATIENCE, arm.down.message()).await.unwrap() {
            Ok(Some(down)) => match down.message.unwrap() {
                Message::Command(command) => last_n = force_of(&command),
                Message::Fault(fault) if fault.code() == DeviceFaultCode::Dismissed => goodbye = Some(fault),
                _ => {}
            },
            Ok(None) => panic!("it ended as if all were well"),
            Err(status) => break status,
        }
    };
    goes_on.abort();
    assert_eq!(last_n, DVec3::ZERO, "its force was gone before");
    assert!(goodbye.unwrap().message.contains("revoked"));
    assert_eq!(end.code(), Code::PermissionDenied, "{end:?}");
    let again = answer(&left, "/palpate.v1.Session/Status").await.unwrap_err();
    assert_eq!(again.code(), Code::Unauthenticated, "{again:?}");
    daemon.finish().await;
}

async fn attach(connection: Connection) -> Arm {
    let (up, receiver) = mpsc::channel(64);
    up.send(v1::DeviceUp { message: Some(device_up::Message::Hello(hello())) }).await.unwrap();
    let down = DeviceClient::new(connection).attach(ReceiverStream::new(receiver)).await.unwrap().into_inner();
    Arm { up, down, sequence: 0 }
}

/// Injecting 1 N on each of 23 vertices drove a hand from 0.64 to 4.43 N.
#[tokio::test(flavor = "multi_thread")]
async fn what_others_inject_is_bounded_while_an_arm_is_attached() {
    let daemon = Guarded::new(|config| config.limits.max_injected_force_n = 0.0).await;
    let script = daemon.with_token(daemon.token("script", Roles::of(&[Role::Injector]), HOUR)).await;
    let mut session = SessionClient::new(script);
    let force = |surface_vertex| v1::InjectedForce {
        surface_vertex,
        force_n: Some(v1::Vec3 { z: 0.05, ..Default::default() }),
        from_tick: 0,
        tick_count: 100_000,
    };
    let mut arm = attach(daemon.with_certificate("left", Roles::of(&[Role::Device])).await).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 20).await;
    let forces = (20..40).map(force).collect();
    session.inject_forces(v1::InjectForcesRequest { forces, ..Default::default() }).await.unwrap();
    let from = arm.sequence;
    arm.hold_until(above(), |command| command.sample_sequence > from + 100).await;
    let moved_m = |status: v1::StatusResponse| status.energies.unwrap().elastic_j;
    let mut status = async || session.status(v1::StatusRequest::default()).await.unwrap().into_inner();
    let held_j = moved_m(status().await);
    drop(arm);
    let until = tokio::time::Instant::now() + PATIENCE;
    loop {
        let free_j = moved_m(status().await);
        if free_j > 10.0 * held_j + 1e-9 {
            break;
        }
        assert!(tokio::time::Instant::now() < until, "{held_j} J, then {free_j} J");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    daemon.finish().await;
}

async fn get_metrics(channel: tonic::transport::Channel, token: Option<String>) -> (u16, String) {
    use http_body_util::BodyExt as _;
    use tower::ServiceExt as _;
    let mut ask = http::Request::get("/metrics");
    if let Some(token) = token {
        ask = ask.header("authorization", format!("Bearer {token}"));
    }
    let response = channel.oneshot(ask.body(tonic::body::Body::empty()).unwrap()).await.unwrap();
    assert!(response.status() != 200 || response.headers()["x-accel-buffering"] == "no");
    let status = response.status().as_u16();
    let bytes = response.into_body().collect().await.unwrap().to_bytes();
    (status, String::from_utf8(bytes.to_vec()).unwrap())
}

/// Metrics are for whoever may watch, in a form that their readers take.
#[tokio::test(flavor = "multi_thread")]
async fn metrics_tell_what_there_is_to_who_may_watch() {
    let open = common::Daemon::on(block_scene("measured", 3)).await;
    let mut arm = open.attach(hello()).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 20).await;
    let (status, text) = get_metrics(open.channel.clone(), None).await;
    assert_eq!(status, 200);
    let value = |name: &str| -> f64 {
        let line = text.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{name}:\n{text}"));
        line.rsplit(' ').next().unwrap().parse().unwrap()
    };
    assert!(value("palpate_ticks_total ") > 20.0 && value("palpate_quarantined ") == 0.0);
    assert!(value("palpate_device_samples_total{device=\"test arm\",tool=\"finger\"} ") > 20.0);
    assert!(value("palpate_tick_cost_seconds{quantile=\"0.99\"} ") > 0.0);
    assert!(value("palpate_stage_cost_seconds{stage=\"coupling\",quantile=\"0.5\"} ") > 0.0);
    assert!(value("palpate_resident_memory_bytes ") > 1e6);
    assert!(text.ends_with("# EOF\n"), "{text}");
    drop(arm);
    open.finish().await;

    let guarded = Guarded::new(|_| ()).await;
    let credentials = Credentials { authority: Some(guarded.keys.authority()), ..Credentials::default() };
    let channel = endpoint(&guarded.url(), &credentials).unwrap().connect().await.unwrap();
    let of = |role| Some(guarded.token("somebody", Roles::of(&[role]), HOUR));
    for (token, expected) in [(None, 401), (of(Role::Device), 403), (of(Role::Viewer), 200)] {
        assert_eq!(get_metrics(channel.clone(), token).await.0, expected);
    }
    guarded.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_daemon_on_a_network_wants_identities_or_to_be_told_that_all_are_trusted() {
    let elsewhere = ServeConfig { listen: Some("0.0.0.0:0".parse().unwrap()), ..ServeConfig::in_process() };
    let refused = start(elsewhere.clone(), block_scene("x", 2), CancellationToken::new()).await.unwrap_err();
    assert!(matches!(refused, ServeError::Untrusted { .. }), "{refused:?}");
    let trusted = ServeConfig { trusts_network: true, ..elsewhere };
    assert!(trusted.checked().is_ok());
    let nowhere = ServeConfig { listen: None, ..ServeConfig::in_process() };
    assert!(nowhere.checked().is_err());
}

/// The socket was open to everybody on the machine, and TCP could not be left out.
#[tokio::test(flavor = "multi_thread")]
async fn a_unix_socket_alone_is_for_those_who_may_open_it() {
    use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("palpated.sock");
    let group = std::fs::metadata(folder.path()).unwrap().gid().to_string();
    let mut socket = common::socket(&path);
    (socket.mode, socket.group) = (0o620, Some(group.clone()));
    let daemon = Guarded::new(|config| (config.listen, config.unix) = (None, Some(socket.clone()))).await;
    assert!(daemon.running.address.is_none());
    let meta = std::fs::metadata(&path).unwrap();
    assert_eq!((meta.permissions().mode() & 0o777, meta.gid().to_string()), (0o620, group));
    let url = format!("unix://{}", path.display());
    let channel = endpoint(&url, &Credentials::default()).unwrap().connect().await.unwrap();
    // Who may open it is trusted, where others are asked who they are.
    SessionClient::new(channel).reset(v1::ResetRequest::default()).await.unwrap();
    daemon.finish().await;
    socket.group = Some("no such group".into());
    let config = ServeConfig { unix: Some(socket), ..ServeConfig::in_process() };
    let refused = start(config, block_scene("x", 2), CancellationToken::new()).await.unwrap_err();
    assert!(refused.to_string().contains("no such group"), "{refused}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}
