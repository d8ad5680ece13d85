//! The bridge's VRPN server, over real sockets: what programs read, how they come, and that none of them holds the loop.

use crate::common::{
    Mock, Running,
    press::{self, bridged, simulated, to_arm},
    start, until,
};
use glam::{DMat3, DVec3};
use palpate_bridge::{
    config::{DeviceConfig, VrpnConfig, VrpnServerConfig},
    device::{
        Arm as _,
        vrpn::{
            Vrpn,
            payload::{self, ForceField, Pose, Velocity},
            peer::{self, Kind, Peer},
            wire::{self, Outgoing, Time},
        },
    },
    emulate::vrpn as emulated,
    settings::arm,
};
use palpate_control::HandPath;
use std::{
    io::{Read as _, Write as _},
    net::{SocketAddr, TcpListener, TcpStream, UdpSocket},
    process::Command,
    time::{Duration, Instant},
};

const NAME: &str = "Palpate0";
/// How long a program waits for what it waits for.
const PATIENCE: Duration = Duration::from_secs(20);

/// A bridge with a server, whose hand presses a wall by 5 mm; and its daemon.
async fn bridge(device: DeviceConfig, change: impl FnOnce(&mut VrpnServerConfig)) -> (Running, SocketAddr, Mock) {
    let mock = Mock::default();
    mock.set(|behaviour| behaviour.local_model = Some(press::wall()));
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let mut config = bridged(&format!("http://{address}"), device);
    config.vrpn_server.listen = Some("127.0.0.1:0".into());
    change(&mut config.vrpn_server);
    let bridge = start(config);
    let stats = bridge.handle.stats();
    until("the server listens", || stats.vrpn_server.address().is_some()).await;
    until("the arm is attached", || bridge.handle.is_attached()).await;
    let at = stats.vrpn_server.address().unwrap();
    (bridge, at, mock)
}

/// A program that reads.
struct Program {
    stream: TcpStream,
    peer: Peer,
}

impl Program {
    fn new(stream: TcpStream) -> Self {
        stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let mut program = Self { stream, peer: Peer::new(vec![NAME.into()]) };
        program.stream.write_all(&wire::cookie()).unwrap();
        let began = Instant::now();
        while program.peer.received.cookie().map(|cookie| assert!(wire::is_cookie(&cookie))).is_none() {
            assert!(began.elapsed() < PATIENCE);
            program.read();
        }
        program
    }

    fn connected(address: SocketAddr) -> Self {
        Self::new(TcpStream::connect(address).unwrap())
    }

    fn read(&mut self) {
        match self.stream.read(self.peer.received.room()) {
            Ok(0) => panic!("the server hung up"),
            Ok(count) => self.peer.received.came(count),
            Err(_) => {}
        }
    }

    fn send(&mut self, kind: Kind, write: impl FnOnce(&mut Vec<u8>)) {
        let mut out = Outgoing::default();
        peer::describe(&[NAME.to_owned()], &mut out);
        out.message(kind.header(0, Time::now()), write);
        self.stream.write_all(out.bytes()).unwrap();
    }

    /// The first of its messages in which `look` finds something.
    fn find<T>(&mut self, what: &str, mut look: impl FnMut(Kind, &[u8]) -> Option<T>) -> T {
        let began = Instant::now();
        loop {
            while let Some(told) = self.peer.next_told().unwrap() {
                if let Some(found) = look(told.kind, self.peer.payload(&told)) {
                    return found;
                }
            }
            assert!(began.elapsed() < PATIENCE, "waited in vain for {what}");
            self.read();
        }
    }

    fn pose(&mut self) -> Pose {
        self.find("a pose", |kind, bytes| (kind == Kind::Pose).then(|| Pose::parse(bytes).unwrap()))
    }
}

/// Pressed by 5 mm against the wall of 400 N/m, in the world's axes.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_program_reads_pose_velocity_force_and_contact_of_the_world() {
    let (bridge, address, mock) = bridge(simulated(), |_| ()).await;
    let stats = bridge.handle.stats();
    until("it presses", || stats.force_n() > press::PRESSED_N - 1e-3).await;
    let mut program = Program::connected(address);
    let pose = program.pose();
    // What is pressed in is F/K.
    assert!(pose.position_m.distance(DVec3::NEG_Z * press::PRESSED_N / 400.0) < 2e-4, "{pose:?}");
    assert_eq!(pose.sensor, 0);
    // The arm's x points along the world's −y.
    assert!((pose.orientation * DVec3::X).distance(DVec3::NEG_Y) < 1e-9);
    let velocity = program.find("a velocity", |kind, bytes| {
        (kind == Kind::Velocity).then(|| Velocity::parse(bytes).unwrap().velocity_m_per_s)
    });
    assert!(velocity.length() < 1e-2, "{velocity}");
    let force_n =
        program.find("a force", |kind, bytes| (kind == Kind::Force).then(|| payload::parse_force(bytes).unwrap()));
    assert!(force_n.distance(DVec3::Z * press::PRESSED_N) < 0.05, "{force_n}");
    let is_field = |kind, bytes: &[u8]| (kind == Kind::ForceField).then(|| ForceField::parse(bytes).unwrap());
    let field = program.find("a field", is_field);
    assert!((field.force_at_n(pose.position_m) - force_n).length() < 0.1, "{field:?}");
    assert_eq!(field.jacobian_n_per_m, DMat3::from_diagonal(DVec3::new(0.0, 0.0, -400.0)));
    // Out of contact a field of nothing is told.
    mock.set(|behaviour| behaviour.local_model = None);
    let ended = |kind, bytes: &[u8]| is_field(kind, bytes).filter(|field| *field == ForceField::NONE);
    program.find("the field's end", ended);
    // Nothing that a program sends has an effect, but a ping.
    program.send(Kind::ForceField, |into| field.write(into));
    program.send(Kind::Ping, |_| ());
    program.find("a pong", |kind, _| (kind == Kind::Pong).then_some(()));
    program.find("the buttons", |kind, _| (kind == Kind::ButtonStates).then_some(()));
    drop(program);
    assert!(bridge.stop().await.latched_fault().is_none());
}

/// Poses come at the rate that is asked for, of every n-th tick: 1 in 4.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_lower_rate_tells_every_nth_tick() {
    let (bridge, address, _mock) = bridge(simulated(), |server| server.rate_hz = Some(250.0)).await;
    let stats = bridge.handle.stats();
    let mut program = Program::connected(address);
    program.pose();
    let ticks = || stats.servo().unwrap().ticks();
    let moments = || stats.vrpn_server.told.get() + stats.vrpn_server.dropped.get();
    let (ticks_before, moments_before) = (ticks(), moments());
    while ticks() < ticks_before + 800 {
        program.pose();
    }
    let share = (moments() - moments_before) as f64 / (ticks() - ticks_before) as f64;
    // A tick that is skipped is none, and what is under way is not counted.
    assert!((0.15..0.3).contains(&share), "{share}");
    bridge.stop().await;
}

/// As VRPN's own library comes for `NAME@host`: a datagram says which port is to be called.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_program_that_calls_by_datagram_is_connected_to() {
    let (bridge, address, _mock) = bridge(simulated(), |_| ()).await;
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let caller = UdpSocket::bind("127.0.0.1:0").unwrap();
    // The host's name does not count: it is where the datagram came from.
    let call = format!("203.0.113.9 {}\0", listener.local_addr().unwrap().port());
    let began = Instant::now();
    let stream = loop {
        caller.send_to(call.as_bytes(), address).unwrap();
        std::thread::sleep(Duration::from_millis(50));
        if let Ok((stream, _)) = listener.accept() {
            break stream;
        }
        assert!(began.elapsed() < PATIENCE);
    };
    stream.set_nonblocking(false).unwrap();
    Program::new(stream).pose();
    caller.send_to(&[0xff; 200], address).unwrap();
    Program::connected(address).pose();
    bridge.stop().await;
}

/// One reads nothing, one talks nonsense, one says nothing, one too many comes: the loop and the others go on.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_program_holds_the_loop_or_another() {
    let (bridge, address, _mock) = bridge(simulated(), |server| server.max_clients = 4).await;
    let stats = bridge.handle.stats();
    let mut stuck = TcpStream::connect(address).unwrap();
    stuck.write_all(&wire::cookie()).unwrap();
    let _silent = TcpStream::connect(address).unwrap();
    let mut strange = TcpStream::connect(address).unwrap();
    strange.write_all(b"GET / HTTP/1.1\r\nHost: here\r\n\r\n").unwrap();
    strange.set_read_timeout(Some(PATIENCE)).unwrap();
    let mut rest = Vec::new();
    let _ = strange.read_to_end(&mut rest);
    assert_eq!(rest, wire::cookie(), "it was told who we are, and no more");
    let mut garbled = Program::connected(address);
    garbled.pose();
    garbled.stream.write_all(&[0xa5; 100]).unwrap();
    garbled.stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let _ = garbled.stream.read_to_end(&mut rest);
    let mut program = Program::connected(address);
    program.pose();
    // What is stuck misses more and more, once its sockets are full.
    until("moments are dropped", || {
        program.pose();
        stats.vrpn_server.dropped.get() > 200
    })
    .await;
    let before = stats.servo().unwrap().ticks();
    until("the loop goes on", || stats.servo().unwrap().ticks() > before + 200).await;
    let _more: Vec<TcpStream> = (0..4).map(|_| TcpStream::connect(address).unwrap()).collect();
    until("one is turned away", || stats.vrpn_server.turned_away.get() > 0).await;
    program.pose();
    drop(stuck);
    assert!(bridge.stop().await.latched_fault().is_none());
}

/// Our driver as a program of our server: an arm behind a bridge behind a VRPN server.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn our_driver_reads_our_server_and_buttons_of_an_arm_behind_another() {
    let settings = emulated::Settings {
        path: HandPath::resting_at(to_arm(DVec3::new(0.01, 0.02, 0.03))),
        ..emulated::Settings::default()
    };
    let arm = emulated::Vrpn::listen("127.0.0.1:0", settings).unwrap();
    let address = arm.address().to_string();
    let device = DeviceConfig::Vrpn(VrpnConfig { address, silence_s: 0.4, ..VrpnConfig::default() });
    let (bridge, address, _mock) = bridge(device, |_| ()).await;
    let name = || NAME.to_owned();
    let keys = VrpnConfig {
        address: address.to_string(),
        tracker: name(),
        button: name(),
        force_device: name(),
        force_is_measured: true,
        silence_s: 5.0,
        ..VrpnConfig::default()
    };
    let limits = palpate_bridge::config::LimitsConfig::default();
    let mut reader = Vrpn::start(&arm::vrpn::checked(&keys, &limits).unwrap(), 1e-3).unwrap();
    for buttons in [1, 3, 2, 0] {
        arm.press(buttons);
        let began = Instant::now();
        while reader.read(1).unwrap().buttons != buttons {
            assert!(began.elapsed() < PATIENCE);
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    let reading = reader.read(0).unwrap();
    assert!(reading.motion.position_m.distance(DVec3::new(0.01, 0.02, 0.03)) < 1e-6, "{reading:?}");
    assert!(reading.measured_force_n.is_some());
    drop(reader);
    bridge.stop().await;
}

/// VRPN's own library, as the Python module `motioncapture` contains it, if that is installed.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn vrpns_own_client_reads_our_server() {
    let python = std::env::var("PALPATE_PYTHON").unwrap_or_else(|_| "python3".into());
    let has_module = Command::new(&python).args(["-c", "import numpy, motioncapture"]).output();
    if !has_module.is_ok_and(|output| output.status.success()) {
        println!("skipped: {python} has no modules motioncapture and numpy");
        return;
    }
    let (bridge, address, _mock) = bridge(simulated(), |_| ()).await;
    let stats = bridge.handle.stats();
    until("it presses", || stats.force_n() > press::PRESSED_N - 1e-3).await;
    let script = format!(
        "import motioncapture\n\
         mc = motioncapture.connect('vrpn', {{'hostname': '{address}'}})\n\
         for _ in range(2000):\n    \
             mc.waitForNextFrame()\n    \
             for name, body in mc.rigidBodies.items():\n        \
                 print(name, *body.position, body.rotation.x, body.rotation.y, body.rotation.z, body.rotation.w)\n        \
                 raise SystemExit\n"
    );
    let read = || Command::new("timeout").args(["20", &python, "-c", &script]).output();
    let output = tokio::task::block_in_place(read).unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    println!("{said}{}", String::from_utf8_lossy(&output.stderr));
    let line = said.lines().last().unwrap_or_default();
    let numbers: Vec<f64> = line.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect();
    assert!(line.starts_with(NAME) && numbers.len() == 7, "{said}");
    let position_m = DVec3::from_slice(&numbers);
    assert!(position_m.distance(DVec3::NEG_Z * press::PRESSED_N / 400.0) < 2e-4, "{position_m}");
    assert!((numbers[3..].iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-5, "{said}");
    bridge.stop().await;
}
