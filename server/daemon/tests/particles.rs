//! The layer of active particles over real sockets.
use crate::common::{
    Daemon, PATIENCE, dvec3,
    hybrid::{hybrid_scene, seed_scene},
    pressed_scene,
};
use glam::DVec3;
use palpate_physics::snapshot;
use palpate_proto::v1::{self, LevelOfDetail, surface_event::Message};
use palpate_scene::Scene;
use palpated::stream::hub::Layers;
use std::{f64::consts::PI, ops::RangeInclusive, sync::Arc};
use tokio::time::timeout;
use tonic::Streaming;

async fn watch(daemon: &Daemon, level: LevelOfDetail, active_particles: bool) -> Streaming<v1::SurfaceEvent> {
    let request =
        v1::WatchRequest { max_rate_hz: 120.0, level_of_detail: level.into(), active_particles, ..Default::default() };
    daemon.surface().watch(request).await.unwrap().into_inner()
}

/// The header of the keyframe, and the first update of the tick.
async fn update_of(stream: &mut Streaming<v1::SurfaceEvent>, tick: u64) -> (v1::KeyframeHeader, v1::SurfaceUpdate) {
    let mut header = None;
    timeout(PATIENCE, async {
        loop {
            match stream.message().await.unwrap().unwrap().message.unwrap() {
                Message::Keyframe(chunk) => header = chunk.header.or(header.take()),
                Message::Update(update) if update.tick == tick => return (header.take().unwrap(), update),
                Message::Update(_) => {}
            }
        }
    })
    .await
    .expect("the update in time")
}

fn positions_m(particles: &v1::Places) -> Vec<DVec3> {
    let place = |b: &[u8]| DVec3::from([0, 2, 4].map(|at| f64::from(u16::from_le_bytes([b[at], b[at + 1]]))));
    let corner = dvec3(particles.corner_m.unwrap());
    particles.positions_u16le.chunks_exact(6).map(|b| corner + place(b) * f64::from(particles.quantum_m)).collect()
}

/// At the ends of spells of so many ticks; returns how many there were.
async fn seen_where_the_physics_has_them(scene: Scene, spacing_m: RangeInclusive<f64>, spells: [u32; 3]) -> Vec<usize> {
    let daemon = Daemon::on(scene).await;
    daemon.pause().await;
    daemon.reset().await;
    let mut counts = Vec::new();
    for ticks in spells {
        let tick = daemon.step(ticks).await;
        let mut stream = watch(&daemon, LevelOfDetail::Full, true).await;
        let (header, update) = update_of(&mut stream, tick).await;
        let seen = positions_m(update.active_particles.as_ref().unwrap());
        assert_eq!(seen.len(), daemon.status().await.active_particles as usize);
        let session = daemon.running.as_ref().unwrap().daemon.session();
        let state = snapshot::restore(&session.model, &daemon.snapshot().await.state).unwrap();
        let exact = state.awake_particles_m();
        assert_eq!(seen.len(), exact.len());
        let half_quantum_m = f64::from(update.active_particles.unwrap().quantum_m) / 2.0;
        assert!(half_quantum_m < 1e-6, "{half_quantum_m} m");
        for (seen, exact) in seen.iter().zip(exact) {
            assert!((*seen - *exact).abs().max_element() <= half_quantum_m + 1e-15, "{seen} {exact}");
        }
        // A cut cell's particles lie outside the body, by a spacing at most.
        assert!(spacing_m.contains(&header.particle_spacing_m), "{} m", header.particle_spacing_m);
        let room = DVec3::splat(header.particle_spacing_m);
        let (low, high) = (dvec3(header.bounds_min_m.unwrap()) - room, dvec3(header.bounds_max_m.unwrap()) + room);
        assert!(seen.iter().all(|x| x.cmpge(low).all() && x.cmple(high).all()));
        counts.push(seen.len());
    }
    daemon.finish().await;
    counts
}

#[tokio::test(flavor = "multi_thread")]
async fn particles_are_seen_where_the_physics_has_them() {
    // Before the touch, pressed, dragged on.
    let counts = seen_where_the_physics_has_them(hybrid_scene(), 2.5e-3..=2.5e-3, [10, 290, 150]).await;
    assert!(counts[0] == 0 && counts[1] > 20 && counts[2] > 20, "{counts:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn so_are_those_of_the_papers_hybrid() {
    // Each takes the spacing's cube of the volume between the ellipsoids, of which the core's flat faces leave some more.
    let layer_m3 = 4.0 / 3.0 * PI * (34.0 * 32.0 * 50.0 - 27.0 * 25.0 * 39.0) * 1e-9;
    let spacing_m = (layer_m3 / 27_988.0).cbrt();
    let spacing_m = spacing_m..=1.08 * spacing_m;
    // Before the touch, pressed, let go.
    let counts = seen_where_the_physics_has_them(seed_scene(), spacing_m, [10, 390, 350]).await;
    assert!(counts[0] == 0 && counts[1] > 20 && counts[2] == 0, "{counts:?}");
}

/// Beside a viewer that asks as well as alone.
#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_made_or_sent_for_those_that_do_not_ask() {
    let daemon = Daemon::on(hybrid_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    let tick = daemon.step(300).await;
    assert!(daemon.status().await.active_particles > 20);
    let hub = Arc::clone(&daemon.running.as_ref().unwrap().daemon.hub);
    let mut plain = watch(&daemon, LevelOfDetail::Full, false).await;
    assert!(update_of(&mut plain, tick).await.1.active_particles.is_none());
    let mut seat = hub.join(60.0, Layers { vertices: true, ..Layers::default() }).unwrap();
    for _ in 0..5 {
        timeout(PATIENCE, seat.frames.changed()).await.unwrap().unwrap();
        let frame = seat.frames.borrow_and_update().clone().unwrap();
        assert!(frame.shape.is_some() && frame.particles.is_none());
    }
    // Numbers and particles alone: no vertices go with them.
    let mut asking = watch(&daemon, LevelOfDetail::Numbers, true).await;
    let update = update_of(&mut asking, tick).await.1;
    assert!(update.displacements_i16le.is_empty() && !update.active_particles.unwrap().positions_u16le.is_empty());
    for _ in 0..5 {
        let event = timeout(PATIENCE, plain.message()).await.unwrap().unwrap().unwrap();
        assert!(matches!(event.message, Some(Message::Update(update)) if update.active_particles.is_none()));
    }
    drop(asking);
    timeout(PATIENCE, async {
        while seat.frames.changed().await.is_ok()
            && seat.frames.borrow_and_update().as_ref().unwrap().particles.is_some()
        {}
    })
    .await
    .expect("nothing is made when the one that asked has gone");
    drop(seat);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_of_tets_has_none_and_its_viewers_go_on() {
    let daemon = Daemon::on(pressed_scene(2)).await;
    daemon.pause().await;
    let tick = daemon.status().await.tick;
    let mut stream = watch(&daemon, LevelOfDetail::Full, true).await;
    let (header, update) = update_of(&mut stream, tick).await;
    assert!(update.active_particles.is_none() && !update.displacements_i16le.is_empty());
    assert_eq!(header.particle_spacing_m, 0.0);
    daemon.finish().await;
}
