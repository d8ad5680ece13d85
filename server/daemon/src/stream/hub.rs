//! One surface for all viewers: the loop fills a slot only while somebody watches; the hub turns it into a [`Frame`] once.
use super::{
    encode::{Delta, Quantiser, Shape},
    keyframe, places,
    refined::Refiner,
};
use crate::bodies::served;
use crate::sim::exchange::{SurfaceEnd, SurfaceSnapshot, ToolView};
use glam::DVec3;
use palpate_physics::{Model, contact::ToolSpec};
use palpate_proto::v1;
use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering},
    },
    time::{SystemTime, UNIX_EPOCH},
};
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

/// What the loop is asked to publish. Written by the hub, read by the loop.
#[derive(Debug, Default)]
pub struct Demand {
    period_ticks: AtomicU32,
    vertices: AtomicBool,
}

impl Demand {
    /// Ticks between two published surfaces; 0: nobody watches.
    pub fn period_ticks(&self) -> u32 {
        self.period_ticks.load(Ordering::Relaxed)
    }

    /// Whether anybody wants vertices.
    pub fn wants_vertices(&self) -> bool {
        self.vertices.load(Ordering::Relaxed)
    }

    /// Sets both.
    pub fn set(&self, period_ticks: u32, vertices: bool) {
        self.vertices.store(vertices, Ordering::Relaxed);
        self.period_ticks.store(period_ticks, Ordering::Relaxed);
    }
}

/// What a viewer wants beside numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Layers {
    /// Vertices of the surface.
    pub vertices: bool,
    /// Active particles.
    pub particles: bool,
    /// The surface refined near tools.
    pub refined: bool,
}

impl Layers {
    fn and(self, other: Self) -> Self {
        Self {
            vertices: self.vertices || other.vertices,
            particles: self.particles || other.particles,
            refined: self.refined || other.refined,
        }
    }

    /// Whether all that the other wants is among these.
    pub fn has(self, other: Self) -> bool {
        self.and(other) == self
    }
}

/// A moment of the surface, as all viewers see it.
#[derive(Debug)]
pub struct Frame {
    /// Epoch of [`Frame::keyframe`].
    pub epoch: u32,
    /// Counts from 1 in an epoch.
    pub number: u64,
    /// The keyframe's chunks.
    pub keyframe: Arc<Vec<v1::KeyframeChunk>>,
    /// Everything but vertices and the viewer's own counters.
    pub numbers: v1::SurfaceUpdate,
    /// What it was made for.
    pub layers: Layers,
    /// The vertices, when somebody asked for them.
    pub shape: Option<Shape>,
    /// Active particles, when somebody asked for them and the body has particles.
    pub particles: Option<v1::Places>,
    /// The surface refined near tools, when somebody asked for it and it can be.
    pub refined: Option<v1::RefinedSurface>,
    /// Encoded once, for the viewers that hold the frame before (`Some`) or none (`None`).
    encoded: Mutex<Vec<(Option<u64>, Delta)>>,
}

impl Frame {
    /// The update for a viewer that holds frame `since` of this epoch, or nothing yet.
    pub fn update(&self, since: Option<u64>, layers: Layers, skipped: u64) -> v1::SurfaceUpdate {
        let mut update = v1::SurfaceUpdate { skipped, ..self.numbers.clone() };
        update.active_particles = self.particles.clone().filter(|_| layers.particles);
        update.refined_surface = self.refined.clone().filter(|_| layers.refined);
        if let Some(shape) = self.shape.as_ref().filter(|_| layers.vertices) {
            let delta = self.delta(shape, since);
            update.displacement_quantum_m = shape.quantum_m;
            update.changed_u32le = delta.changed_u32le;
            update.displacements_i16le = delta.displacements_i16le;
        }
        update
    }

    fn delta(&self, shape: &Shape, since: Option<u64>) -> Delta {
        let mut encoded = self.encoded.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, delta)) = encoded.iter().find(|(from, _)| *from == since) {
            return delta.clone();
        }
        let delta = shape.delta(since);
        if encoded.len() < 16 {
            encoded.push((since, delta.clone()));
        }
        delta
    }
}

/// Viewers at a time.
pub const MOST_VIEWERS: usize = 1024;

/// Counts viewers and hands out the newest frame.
#[derive(Debug)]
pub struct Hub {
    /// What the loop shall publish.
    pub demand: Arc<Demand>,
    display_rate_hz: f64,
    tick_period_s: Mutex<f64>,
    frames: watch::Sender<Option<Arc<Frame>>>,
    viewers: Mutex<Vec<Wish>>,
    /// Whether anybody wants active particles.
    particles: AtomicBool,
    /// Whether anybody wants the surface refined near tools.
    refined: AtomicBool,
    next_viewer: AtomicU64,
    epoch: AtomicU32,
    skipped: AtomicU64,
}

#[derive(Debug, Clone, Copy)]
struct Wish {
    viewer: u64,
    rate_hz: f64,
    layers: Layers,
}

/// A viewer as long as it lives.
#[derive(Debug)]
pub struct Seat {
    hub: Arc<Hub>,
    viewer: u64,
    /// Frames, the newest only.
    pub frames: watch::Receiver<Option<Arc<Frame>>>,
}

impl Drop for Seat {
    fn drop(&mut self) {
        let viewer = self.viewer;
        self.hub.change_wishes(|wishes| wishes.retain(|wish| wish.viewer != viewer));
    }
}

impl Seat {
    /// Counts frames dropped for this viewer.
    pub fn count_skipped(&self, frames: u64) {
        self.hub.skipped.fetch_add(frames, Ordering::Relaxed);
    }
}

impl Hub {
    /// A hub whose viewers get `display_rate_hz` unless they ask for another rate.
    pub fn new(display_rate_hz: f64) -> Arc<Self> {
        Arc::new(Self {
            demand: Arc::new(Demand::default()),
            display_rate_hz,
            tick_period_s: Mutex::new(1e-3),
            frames: watch::Sender::new(None),
            viewers: Mutex::new(Vec::new()),
            particles: AtomicBool::new(false),
            refined: AtomicBool::new(false),
            next_viewer: AtomicU64::new(1),
            epoch: AtomicU32::new(0),
            skipped: AtomicU64::new(0),
        })
    }

    /// The daemon's display rate (Hz).
    pub fn display_rate_hz(&self) -> f64 {
        self.display_rate_hz
    }

    /// Viewers now.
    pub fn viewer_count(&self) -> u32 {
        self.viewers.lock().unwrap_or_else(PoisonError::into_inner).len() as u32
    }

    /// Updates dropped over all viewers that ever were.
    pub fn frames_skipped(&self) -> u64 {
        self.skipped.load(Ordering::Relaxed)
    }

    /// Adds a viewer that wants so many updates per second (Hz), with these layers; `None`: there are [`MOST_VIEWERS`].
    pub fn join(self: &Arc<Self>, rate_hz: f64, layers: Layers) -> Option<Seat> {
        let viewer = self.next_viewer.fetch_add(1, Ordering::Relaxed);
        let frames = self.frames.subscribe();
        let mut is_full = false;
        self.change_wishes(|wishes| {
            is_full = wishes.len() >= MOST_VIEWERS;
            if is_full {
                return;
            }
            if wishes.is_empty() {
                // Nobody watched: the newest frame may be minutes old, or of another scene.
                self.frames.send_replace(None);
            }
            wishes.push(Wish { viewer, rate_hz, layers });
        });
        (!is_full).then(|| Seat { hub: Arc::clone(self), viewer, frames })
    }

    fn change_wishes(&self, change: impl FnOnce(&mut Vec<Wish>)) {
        let mut wishes = self.viewers.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut wishes);
        let rate_hz = wishes.iter().fold(0.0_f64, |rate, wish| rate.max(wish.rate_hz));
        let period_s = *self.tick_period_s.lock().unwrap_or_else(PoisonError::into_inner);
        let period_ticks = if rate_hz > 0.0 { (1.0 / (rate_hz * period_s)).floor().clamp(1.0, 1e6) as u32 } else { 0 };
        let wanted = wishes.iter().fold(Layers::default(), |layers, wish| layers.and(wish.layers));
        self.particles.store(wanted.particles, Ordering::Relaxed);
        self.refined.store(wanted.refined, Ordering::Relaxed);
        self.demand.set(period_ticks, wanted.vertices);
    }

    /// Serves one session's surface until `ended`. A new epoch begins.
    pub async fn serve(
        self: Arc<Self>,
        session_id: String,
        scene_name: String,
        model: Arc<Model>,
        mut surface: SurfaceEnd,
        ended: CancellationToken,
    ) {
        let epoch = self.epoch.fetch_add(1, Ordering::Relaxed) + 1;
        *self.tick_period_s.lock().unwrap_or_else(PoisonError::into_inner) = model.settings().tick_period_s;
        self.change_wishes(|_| ());
        let keyframe = Arc::new(keyframe::chunks(&session_id, &scene_name, &model, epoch));
        let (low, high) = keyframe::bounds_m(&model);
        let rest_f32_m = keyframe::rest_positions_f32(&model);
        let mut reader = served(&model).shape_reader(&model, &rest_f32_m);
        // Made when somebody first asks: many are never asked.
        let mut refiner: Option<Option<Refiner>> = None;
        let mut quantiser = Quantiser::new(model.surface().nodes.len(), (high - low).length());
        let mut number = 0;
        loop {
            tokio::select! {
                () = ended.cancelled() => return,
                rung = surface.ear.rung() => if rung.is_err() { return },
            }
            if !surface.slot.update() {
                continue;
            }
            number += 1;
            let snapshot = surface.slot.output_buffer();
            let max_displacement_m = reader.read(&snapshot.shape);
            let displacements_m = reader.displacements_m();
            let shape = snapshot.wants_vertices.then(|| quantiser.advance(number, displacements_m));
            let layers = Layers {
                vertices: snapshot.wants_vertices,
                particles: self.particles.load(Ordering::Relaxed),
                // Of vertices that are there.
                refined: snapshot.wants_vertices && self.refined.load(Ordering::Relaxed),
            };
            let refiner = layers.refined.then(|| refiner.get_or_insert_with(|| Refiner::new(&model, &rest_f32_m)));
            let refined =
                refiner.and_then(Option::as_mut).map(|refiner| refiner.read(displacements_m, &tools(&model, snapshot)));
            let has_particles = layers.particles && model.body().particle_count() > 0;
            let particles = has_particles.then(|| places::encode(snapshot.shape.particles_m()));
            let numbers = v1::SurfaceUpdate { max_displacement_m, ..numbers(epoch, snapshot) };
            let encoded = Mutex::new(Vec::new());
            let frame = Frame {
                epoch,
                number,
                keyframe: Arc::clone(&keyframe),
                numbers,
                layers,
                shape,
                particles,
                refined,
                encoded,
            };
            self.frames.send_replace(Some(Arc::new(frame)));
        }
    }
}

/// Centres (m) and radii (m); of a capsule, those of balls along it, no further apart than their radius.
fn tools(model: &Model, snapshot: &SurfaceSnapshot) -> Vec<(DVec3, f64)> {
    let shapes = model.tools();
    let balls = |(view, spec): (&ToolView, &ToolSpec)| {
        let (centre_m, radius_m, half_m) = (view.proxy_position_m, spec.radius_m, spec.shape.half_length_m());
        let to_end_m = view.proxy_orientation * (DVec3::Z * half_m);
        let each_way = (half_m / radius_m).ceil().min(100.0) as i32;
        (-each_way..=each_way).map(move |i| {
            let part = if each_way > 0 { f64::from(i) / f64::from(each_way) } else { 0.0 };
            (centre_m + to_end_m * part, radius_m)
        })
    };
    snapshot.tools.iter().zip(shapes).flat_map(balls).collect()
}

fn numbers(epoch: u32, snapshot: &SurfaceSnapshot) -> v1::SurfaceUpdate {
    v1::SurfaceUpdate {
        epoch,
        tick: snapshot.tick,
        time_s: snapshot.time_s,
        sent_unix_ns: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos() as u64),
        tools: snapshot.tools.iter().map(crate::grpc::convert::tool_state).collect(),
        tick_cost_us: snapshot.tick_cost_us,
        quarantine: crate::grpc::convert::quarantine(snapshot.quarantine),
        ..Default::default()
    }
}
