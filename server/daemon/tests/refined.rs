//! The layer of the surface refined near tools over real sockets.
use crate::common;
use crate::common::{Daemon, PATIENCE, hybrid::hybrid_scene, pressed_scene, springs::springs_scene};
use palpate_physics::{bodies::mass_spring::loop_scheme::refined, mesh::Triangulation, snapshot};
use palpate_proto::v1::{self, surface_event::Message};
use palpate_scene::Scene;
use tokio::time::timeout;

/// The first update of the tick.
async fn update_of(daemon: &Daemon, tick: u64, refined_surface: bool) -> v1::SurfaceUpdate {
    let request = v1::WatchRequest { max_rate_hz: 120.0, refined_surface, ..Default::default() };
    let mut stream = daemon.surface().watch(request).await.unwrap().into_inner();
    timeout(PATIENCE, async {
        loop {
            match stream.message().await.unwrap().unwrap().message.unwrap() {
                Message::Update(update) if update.tick == tick => return update,
                _ => {}
            }
        }
    })
    .await
    .expect("the update in time")
}

/// Pressed: where a new vertex is drawn, the scheme or the edge of the deformed surface has it, or something between.
async fn is_between_the_edge_and_the_scheme(scene: Scene) {
    let daemon = Daemon::on(scene).await;
    daemon.pause().await;
    daemon.reset().await;
    let tick = daemon.step(300).await;
    assert!(update_of(&daemon, tick, false).await.refined_surface.is_none());
    let message = update_of(&daemon, tick, true).await.refined_surface.unwrap();
    let session = daemon.running.as_ref().unwrap().daemon.session();
    let state = snapshot::restore(&session.model, &daemon.snapshot().await.state).unwrap();
    let mut positions_m = Vec::new();
    session.model.surface_positions_m(&state, &mut positions_m);
    let surface = Triangulation::new(positions_m, session.model.surface().triangles.clone()).unwrap();
    let (fine_m, _) = refined(&surface);
    let middles = surface.edges().iter().map(|edge| edge.nodes.map(|v| surface.positions_m()[v as usize]));
    let straight_m = surface.positions_m().iter().copied().chain(middles.map(|[a, b]| (a + b) * 0.5));
    let pairs: Vec<_> = straight_m.zip(fine_m).collect();
    let places = message.rest_positions.unwrap();
    let corner = common::dvec3(places.corner_m.unwrap());
    let triple = |b: &[u8], of: fn([u8; 2]) -> f64| glam::DVec3::from([0, 2, 4].map(|at| of([b[at], b[at + 1]])));
    let rest = places.positions_u16le.chunks_exact(6).map(|b| triple(b, |b| f64::from(u16::from_le_bytes(b))));
    let moved = message.displacements_i16le.chunks_exact(6).map(|b| triple(b, |b| f64::from(i16::from_le_bytes(b))));
    let (mut by_scheme, mut count) = (0, 0);
    for (n, m) in rest.zip(moved) {
        let x = corner + n * f64::from(places.quantum_m) + m * f64::from(message.displacement_quantum_m);
        let apart = |(a, b): &(glam::DVec3, glam::DVec3)| {
            let way = *b - *a;
            let t = ((x - *a).dot(way) / way.length_squared().max(1e-30)).clamp(0.0, 1.0);
            x.distance(*a + way * t)
        };
        let nearest_m = pairs.iter().map(apart).fold(f64::INFINITY, f64::min);
        assert!(nearest_m < 2e-6, "{x} is {nearest_m} m from where it may be");
        by_scheme += usize::from(pairs.iter().any(|(_, fine)| fine.distance(x) < 2e-6));
        count += 1;
    }
    assert!(count > 30 && by_scheme > 3, "{by_scheme} of {count}");
    assert!(message.triangles_u32le.len() > 2 * message.replaced_u32le.len());
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_skin_of_a_hybrid_body_is_refined_where_it_is_touched() {
    is_between_the_edge_and_the_scheme(hybrid_scene()).await;
}

/// Another kind of body at tick 300.
async fn refined_surface_of(scene: Scene) -> Option<v1::RefinedSurface> {
    let daemon = Daemon::on(scene).await;
    daemon.pause().await;
    daemon.reset().await;
    let tick = daemon.step(300).await;
    let refined = update_of(&daemon, tick, true).await.refined_surface;
    daemon.finish().await;
    refined
}

#[tokio::test(flavor = "multi_thread")]
async fn so_is_the_surface_of_tets_but_not_one_of_springs_that_is_sent_refined() {
    assert!(!refined_surface_of(pressed_scene(2)).await.unwrap().triangles_u32le.is_empty());
    assert!(refined_surface_of(springs_scene()).await.is_none());
}
