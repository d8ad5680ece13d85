//! A small scene, a daemon on it, and clients.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used, clippy::expect_used)] // each test file uses its own part
pub mod hybrid;
pub mod seen;
pub mod springs;

use glam::DVec3;
use palpate_physics::{
    BodySpec, ModelSpec, PrescribedSpec, Region, Settings, Solid,
    contact::{Coupling, ToolShape, ToolSpec},
    material::{Lame, Law, Material, Viscosity},
    mesh::quality,
};
use palpate_proto::v1::{
    self, device_client::DeviceClient, device_down, device_up, session_client::SessionClient,
    surface_client::SurfaceClient, surface_event,
};
use palpate_scene::{
    BodySummary, Driver, Interpolation, MotionPath, OutputSettings, Probe, Scene, ScriptedHand, Timeline,
    probes::Measure, shapes::box_mesh,
};
use palpated::{
    doors::{listen::UnixSocket, tls::TlsFiles},
    serve::{Runner, Running, ServeConfig, Summary, start_with},
    sim::thread::Loop,
};
use std::{fs, path::Path, time::Duration};
use tokio::{sync::mpsc, time::timeout};
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Streaming, transport::Channel};

/// Nothing here takes longer, even on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(20);
/// Size of the block (m); its top is at z = 0.02.
pub const SIZE_M: DVec3 = DVec3::new(0.04, 0.04, 0.02);
/// Radius of the tool (m).
pub const RADIUS_M: f64 = 0.006;

/// Where a tool hangs clear of the block.
pub fn above() -> DVec3 {
    DVec3::new(0.02, 0.02, 0.035)
}

/// Where a tool presses 3 mm deep.
pub fn pressing() -> DVec3 {
    DVec3::new(0.02, 0.02, 0.023)
}

/// A soft block on a table, with a tool for a device and one that the scene moves.
pub fn block_scene(name: &str, cells: u32) -> Scene {
    let shape = box_mesh(SIZE_M, [cells, cells, cells.div_ceil(2)]).unwrap();
    let bottom = shape.region("z_min").unwrap().nodes();
    let lame = Lame::from_young_poisson(5e3, 0.4).unwrap();
    let viscosity = Viscosity::new(0.5, 0.5).unwrap();
    let material = Material { law: Law::StableNeoHookean, lame, viscosity, crushing_pa: 0.0 };
    let (nodes, tets) = (shape.mesh.positions_m().len(), shape.mesh.tets().len());
    let summary = BodySummary {
        origin: "box".into(),
        nodes,
        tets,
        surface_triangles: 0,
        volume_m3: shape.mesh.total_volume_m3(),
        mass_kg: shape.mesh.total_volume_m3() * 1e3,
        quality: Some(quality::measure(&shape.mesh)),
        fill_report: Vec::new(),
        parts: Vec::new(),
    };
    Scene {
        name: name.into(),
        description: "a soft block".into(),
        model: ModelSpec {
            body: BodySpec::Tet(
                Solid {
                    tet_region: vec![0; tets],
                    mesh: shape.mesh,
                    regions: vec![Region { name: "all".into(), material, density_kg_per_m3: 1e3 }],
                }
                .into(),
            ),
            prescribed: vec![PrescribedSpec {
                name: "table".into(),
                nodes: bottom.clone(),
                axes: [true; 3],
                is_fixed: false,
            }],
            loads: Vec::new(),
            gravity_m_per_s2: DVec3::ZERO,
            tools: vec![tool("finger", above()), tool("probe", above() + DVec3::X * 0.2)],
            settings: Settings::default(),
        },
        timeline: Timeline {
            loads: Vec::new(),
            prescribed: vec![palpate_scene::PrescribedMotion {
                displacement_m: DVec3::ZERO,
                amplitude: palpate_scene::Amplitude::Constant(0.0),
            }],
        },
        drivers: vec![Driver::Device, Driver::Script(path(&[(0.0, above() + DVec3::X * 0.2)]))],
        probes: vec![Probe::new("table force", Measure::Reaction(bottom)), Probe::new("energy", Measure::Energy)],
        output: OutputSettings { duration_s: 1.0, sample_interval_s: 0.01, frame_interval_s: 0.1 },
        arm: None,
        warnings: Vec::new(),
        summary,
    }
}

fn tool(name: &str, start_position_m: DVec3) -> ToolSpec {
    ToolSpec {
        name: name.into(),
        shape: ToolShape::Sphere,
        radius_m: RADIUS_M,
        coupling: Coupling::Spring { stiffness_n_per_m: 500.0, damping_n_s_per_m: 1.0, mass_kg: 0.02 },
        friction_coefficient: 0.3,
        start_position_m,
    }
}

/// A smooth path.
pub fn path(keyframes: &[(f64, DVec3)]) -> MotionPath {
    MotionPath::new(keyframes, Interpolation::Smooth, false).unwrap()
}

/// The scene with a hand that presses.
pub fn pressed_scene(cells: u32) -> Scene {
    let mut scene = block_scene("pressed", cells);
    let path = path(&[(0.0, above()), (0.1, pressing())]);
    scene.arm = Some(ScriptedHand { tool: 0, tool_name: "finger".into(), path });
    scene
}

/// The scene with a hand that never rests: most vertices change all the time.
pub fn kneaded_scene(cells: u32) -> Scene {
    let mut scene = pressed_scene(cells);
    let keyframes = [(0.0, above()), (0.05, pressing()), (0.1, above())];
    let path = MotionPath::new(&keyframes, Interpolation::Smooth, true).unwrap();
    scene.arm = Some(ScriptedHand { tool: 0, tool_name: "finger".into(), path });
    scene
}

/// A daemon in this process.
pub struct Daemon {
    pub running: Option<Running>,
    pub stop: CancellationToken,
    pub channel: Channel,
}

impl Daemon {
    pub async fn on(scene: Scene) -> Self {
        Self::with(scene, ServeConfig::in_process()).await
    }

    pub async fn with(scene: Scene, config: ServeConfig) -> Self {
        Self::running(scene, config, Loop::run).await
    }

    pub async fn running(scene: Scene, config: ServeConfig, run: Runner) -> Self {
        let stop = CancellationToken::new();
        let running = start_with(config, scene, stop.clone(), run).await.unwrap();
        let channel =
            Channel::from_shared(format!("http://{}", running.address.unwrap())).unwrap().connect().await.unwrap();
        Self { running: Some(running), stop, channel }
    }

    pub fn session(&self) -> SessionClient<Channel> {
        SessionClient::new(self.channel.clone()).max_decoding_message_size(64 << 20).max_encoding_message_size(64 << 20)
    }

    pub fn surface(&self) -> SurfaceClient<Channel> {
        SurfaceClient::new(self.channel.clone())
    }

    pub async fn status(&self) -> v1::StatusResponse {
        self.session().status(v1::StatusRequest::default()).await.unwrap().into_inner()
    }

    pub async fn pause(&self) {
        self.session().pause(v1::PauseRequest { paused: true, ..Default::default() }).await.unwrap();
    }

    pub async fn reset(&self) {
        self.session().reset(v1::ResetRequest::default()).await.unwrap();
    }

    /// Injects forces, each within its bound and absurd in their sum: four meganewtons on a vertex of grams.
    pub async fn break_the_body(&self) {
        let force = v1::InjectedForce {
            surface_vertex: 30,
            force_n: Some(v1::Vec3 { x: 1e3, ..Default::default() }),
            from_tick: 0,
            tick_count: 3,
        };
        let inject = v1::InjectForcesRequest { forces: vec![force; 4096], ..Default::default() };
        self.session().inject_forces(inject).await.unwrap();
    }

    pub async fn step(&self, ticks: u32) -> u64 {
        self.session().step(v1::StepRequest { ticks, ..Default::default() }).await.unwrap().into_inner().tick
    }

    pub async fn snapshot(&self) -> v1::SnapshotResponse {
        self.session().snapshot(v1::SnapshotRequest::default()).await.unwrap().into_inner()
    }

    pub async fn attach(&self, hello: v1::DeviceHello) -> Arm {
        Arm::attach(self.channel.clone(), hello).await
    }

    /// Stops gracefully.
    pub async fn finish(mut self) -> Summary {
        self.stop.cancel();
        let running = self.running.take().unwrap();
        timeout(PATIENCE, running.finished()).await.expect("the daemon stops").expect("without a panic")
    }
}

/// A certificate of localhost that it has signed itself, in files of this folder.
pub fn certificate(folder: &Path) -> TlsFiles {
    let made = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
    let files = TlsFiles { certificate: folder.join("cert.pem"), key: folder.join("key.pem"), authority: None };
    fs::write(&files.certificate, made.cert.pem()).unwrap();
    fs::write(&files.key, made.signing_key.serialize_pem()).unwrap();
    files
}

/// A Unix socket for this process's user.
pub fn socket(path: &Path) -> UnixSocket {
    UnixSocket { path: path.to_owned(), mode: 0o600, group: None }
}

/// A hello that asks for the first tool.
pub fn hello() -> v1::DeviceHello {
    v1::DeviceHello {
        device_name: "test arm".into(),
        tool_name: String::new(),
        max_force_n: 3.0,
        servo_rate_hz: 1e3,
        max_torque_nm: 0.1,
        ..Default::default()
    }
}

/// A valid sample.
pub fn sample(sequence: u64, position_m: DVec3) -> v1::DeviceSample {
    v1::DeviceSample {
        sequence,
        device_time_ns: sequence * 1_000_000,
        pose: Some(v1::Pose {
            position_m: Some(vec3(position_m)),
            orientation: Some(v1::Quaternion { w: 1.0, ..Default::default() }),
        }),
        twist: Some(v1::Twist {
            linear_m_per_s: Some(v1::Vec3::default()),
            angular_rad_per_s: Some(v1::Vec3::default()),
        }),
        ..Default::default()
    }
}

pub fn vec3(v: DVec3) -> v1::Vec3 {
    v1::Vec3 { x: v.x, y: v.y, z: v.z }
}

pub fn dvec3(v: v1::Vec3) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

/// An arm that goes on by itself.
pub struct Staying {
    over: CancellationToken,
    task: tokio::task::JoinHandle<Arm>,
}

impl Staying {
    pub async fn back(self) -> Arm {
        self.over.cancel();
        self.task.await.unwrap()
    }
}

/// A device's stream, by hand.
pub struct Arm {
    pub up: mpsc::Sender<v1::DeviceUp>,
    pub down: Streaming<v1::DeviceDown>,
    pub sequence: u64,
}

impl Arm {
    pub async fn attach(channel: Channel, hello: v1::DeviceHello) -> Self {
        let (up, receiver) = mpsc::channel(64);
        up.send(v1::DeviceUp { message: Some(device_up::Message::Hello(hello)) }).await.unwrap();
        let down = DeviceClient::new(channel).attach(ReceiverStream::new(receiver)).await.unwrap().into_inner();
        Self { up, down, sequence: 0 }
    }

    pub async fn next(&mut self) -> Result<Option<device_down::Message>, tonic::Status> {
        let message = timeout(PATIENCE, self.down.message()).await.expect("an answer in time")?;
        Ok(message.map(|down| down.message.expect("a filled message")))
    }

    pub async fn welcome(&mut self) -> v1::DeviceWelcome {
        match self.next().await.unwrap() {
            Some(device_down::Message::Welcome(welcome)) => welcome,
            other => panic!("expected a welcome, got {other:?}"),
        }
    }

    pub async fn send(&mut self, sample: v1::DeviceSample) {
        self.up.send(v1::DeviceUp { message: Some(device_up::Message::Sample(sample)) }).await.unwrap();
    }

    /// Sends the next sample at a place.
    pub async fn move_to(&mut self, position_m: DVec3) {
        self.sequence += 1;
        self.send(sample(self.sequence, position_m)).await;
    }

    /// Stays at a place, as an arm does whatever else goes on, until what is returned is told to give it back.
    pub fn staying(mut self, position_m: DVec3) -> Staying {
        let over = CancellationToken::new();
        let told = over.clone();
        let task = tokio::spawn(async move {
            while !told.is_cancelled() {
                let newest = self.sequence;
                self.hold_until(position_m, |command| command.sample_sequence > newest).await;
            }
            self
        });
        Staying { over, task }
    }

    /// The next command; faults on the way are collected.
    pub async fn command(&mut self, faults: &mut Vec<v1::DeviceFault>) -> v1::DeviceCommand {
        loop {
            match self.next().await.unwrap().expect("the stream goes on") {
                device_down::Message::Command(command) => return command,
                device_down::Message::Fault(fault) => faults.push(fault),
                device_down::Message::Welcome(_) => panic!("a second welcome"),
            }
        }
    }

    /// The next fault; commands on the way are dropped.
    pub async fn fault(&mut self) -> v1::DeviceFault {
        loop {
            match self.next().await.unwrap().expect("the stream goes on") {
                device_down::Message::Fault(fault) => return fault,
                device_down::Message::Command(_) => {}
                device_down::Message::Welcome(_) => panic!("a second welcome"),
            }
        }
    }

    /// Sends samples at a place until a command satisfies `enough`.
    pub async fn hold_until(
        &mut self,
        position_m: DVec3,
        mut enough: impl FnMut(&v1::DeviceCommand) -> bool,
    ) -> v1::DeviceCommand {
        let until = tokio::time::Instant::now() + PATIENCE;
        loop {
            self.move_to(position_m).await;
            let command = self.command(&mut Vec::new()).await;
            if enough(&command) {
                return command;
            }
            assert!(tokio::time::Instant::now() < until, "never enough; last: {command:?}");
        }
    }
}

pub fn force_of(command: &v1::DeviceCommand) -> DVec3 {
    dvec3(command.wrench.unwrap().force_n.unwrap())
}

/// A viewer that keeps the surface as the protocol says.
#[derive(Default)]
pub struct Mirror {
    pub epoch: u32,
    pub header: Option<v1::KeyframeHeader>,
    pub rest: Vec<[f32; 3]>,
    pub triangles: Vec<u32>,
    pub quanta: Vec<[i16; 3]>,
    pub quantum_m: f32,
    pub complete: bool,
    pub updates: u64,
    pub last: Option<v1::SurfaceUpdate>,
}

impl Mirror {
    pub fn apply(&mut self, event: v1::SurfaceEvent) {
        match event.message.unwrap() {
            surface_event::Message::Keyframe(chunk) => self.keyframe(&chunk),
            surface_event::Message::Update(update) => self.update(update),
        }
    }

    fn keyframe(&mut self, chunk: &v1::KeyframeChunk) {
        if chunk.chunk == 0 {
            *self = Self { epoch: chunk.epoch, header: chunk.header.clone(), ..Self::default() };
        }
        assert_eq!(chunk.epoch, self.epoch);
        let floats: Vec<f32> = words(&chunk.rest_positions_m_f32le).map(f32::from_bits).collect();
        self.rest.extend(floats.chunks_exact(3).map(|c| [c[0], c[1], c[2]]));
        self.triangles.extend(words(&chunk.triangles_u32le));
        if chunk.chunk + 1 == chunk.chunk_count {
            let header = self.header.as_ref().unwrap();
            assert_eq!(self.rest.len(), header.vertex_count as usize);
            assert_eq!(self.triangles.len(), 3 * header.triangle_count as usize);
            self.complete = true;
        }
    }

    fn update(&mut self, update: v1::SurfaceUpdate) {
        assert!(self.complete, "an update before its keyframe");
        assert_eq!(update.epoch, self.epoch);
        let triples: Vec<[i16; 3]> = update
            .displacements_i16le
            .chunks_exact(6)
            .map(|b| [0, 2, 4].map(|at| i16::from_le_bytes([b[at], b[at + 1]])))
            .collect();
        if update.changed_u32le.is_empty() && !triples.is_empty() {
            assert_eq!(triples.len(), self.rest.len());
            self.quanta = triples;
        } else {
            for (vertex, triple) in words(&update.changed_u32le).zip(triples) {
                self.quanta[vertex as usize] = triple;
            }
        }
        self.quantum_m = update.displacement_quantum_m;
        self.updates += 1;
        self.last = Some(update);
    }

    /// Position of a vertex (m).
    pub fn position_m(&self, vertex: usize) -> DVec3 {
        let rest = self.rest[vertex].map(f64::from);
        let moved = self.quanta[vertex].map(|n| f64::from(self.quantum_m) * f64::from(n));
        DVec3::from(rest) + DVec3::from(moved)
    }
}

fn words(bytes: &[u8]) -> impl Iterator<Item = u32> + '_ {
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}
