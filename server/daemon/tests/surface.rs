//! Viewers over a real socket.
use crate::common::{Daemon, Mirror, PATIENCE, block_scene, kneaded_scene, pressed_scene};
use palpate_proto::v1::{self, LevelOfDetail, surface_client::SurfaceClient};
use std::time::Duration;
use tokio::time::timeout;
use tonic::{Code, Streaming, transport::Endpoint};

async fn watch(daemon: &Daemon, max_rate_hz: f64, level: LevelOfDetail) -> Streaming<v1::SurfaceEvent> {
    let request = v1::WatchRequest { max_rate_hz, level_of_detail: level.into(), ..Default::default() };
    daemon.surface().watch(request).await.unwrap().into_inner()
}

async fn event(stream: &mut Streaming<v1::SurfaceEvent>) -> v1::SurfaceEvent {
    timeout(PATIENCE, stream.message()).await.expect("an event in time").unwrap().expect("the stream goes on")
}

/// The next update that is `wanted`.
async fn next_update(
    stream: &mut Streaming<v1::SurfaceEvent>,
    wanted: impl Fn(&v1::SurfaceUpdate) -> bool,
) -> v1::SurfaceUpdate {
    let until = tokio::time::Instant::now() + PATIENCE;
    loop {
        match event(stream).await.message {
            Some(v1::surface_event::Message::Update(update)) if wanted(&update) => return update,
            _ => assert!(tokio::time::Instant::now() < until, "no such update"),
        }
    }
}

/// Surface positions (m) of a snapshot, by way of the physics.
fn positions_of(daemon: &Daemon, snapshot: &v1::SnapshotResponse) -> Vec<glam::DVec3> {
    let session = daemon.running.as_ref().unwrap().daemon.session();
    let state = palpate_physics::snapshot::restore(&session.model, &snapshot.state).unwrap();
    session.model.surface().nodes.iter().map(|&node| state.mechanical.x[node as usize]).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn keyframe_and_updates_give_the_daemons_own_surface() {
    let daemon = Daemon::on(pressed_scene(4)).await;
    let mut stream = watch(&daemon, 120.0, LevelOfDetail::Full).await;
    let mut mirror = Mirror::default();
    while mirror.updates < 60 {
        mirror.apply(event(&mut stream).await);
    }
    daemon.pause().await;
    let snapshot = daemon.snapshot().await;
    while mirror.last.as_ref().unwrap().tick != snapshot.tick {
        mirror.apply(event(&mut stream).await);
    }
    let half_quantum_m = f64::from(mirror.quantum_m) / 2.0;
    let largest = mirror.last.as_ref().unwrap().max_displacement_m;
    assert!(largest > 1e-4, "the block was pressed: {largest}");
    for (vertex, exact) in positions_of(&daemon, &snapshot).into_iter().enumerate() {
        let error = (mirror.position_m(vertex) - exact).abs().max_element();
        // f32 carries the displacement from the loop to the hub.
        assert!(error <= half_quantum_m + 1e-9, "vertex {vertex}: {error} m, quantum {} m", mirror.quantum_m);
    }
    let header = mirror.header.unwrap();
    assert_eq!(header.scene_name, "pressed");
    assert_eq!(header.tools.iter().map(|tool| tool.name.as_str()).collect::<Vec<_>>(), ["finger", "probe"]);
    let tool = mirror.last.unwrap().tools[0];
    assert!(tool.contacts > 0 && tool.contact_force_n.unwrap().z > 0.0);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn numbers_come_without_vertices_beside_viewers_that_have_them() {
    let daemon = Daemon::on(pressed_scene(2)).await;
    let mut numbers = watch(&daemon, 20.0, LevelOfDetail::Numbers).await;
    let mut full = watch(&daemon, 240.0, LevelOfDetail::Full).await;
    let mut seen = Vec::new();
    while seen.len() < 6 {
        tokio::select! {
            event = event(&mut numbers) => if let Some(v1::surface_event::Message::Update(update)) = event.message {
                assert!(update.displacements_i16le.is_empty() && update.changed_u32le.is_empty());
                assert_eq!(update.tools.len(), 2);
                seen.push(update.tick);
            },
            _ = event(&mut full) => {}
        }
    }
    assert!(seen.windows(2).all(|pair| pair[0] < pair[1]), "{seen:?}");
    daemon.finish().await;
}

/// Without vertices the largest displacement was told to be zero.
#[tokio::test(flavor = "multi_thread")]
async fn the_largest_displacement_is_the_same_with_and_without_vertices() {
    let daemon = Daemon::on(pressed_scene(3)).await;
    let mut full = watch(&daemon, 60.0, LevelOfDetail::Full).await;
    while daemon.status().await.tick < 300 {
        event(&mut full).await;
    }
    daemon.pause().await;
    let tick = daemon.status().await.tick;
    let largest_at = async |stream: &mut Streaming<v1::SurfaceEvent>| loop {
        match event(stream).await.message {
            Some(v1::surface_event::Message::Update(update)) if update.tick == tick => break update.max_displacement_m,
            _ => {}
        }
    };
    let with = largest_at(&mut full).await;
    drop(full);
    let mut numbers = watch(&daemon, 60.0, LevelOfDetail::Numbers).await;
    let without = largest_at(&mut numbers).await;
    assert!(with > 1e-4, "it is pressed: {with} m");
    assert_eq!(with, without);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_that_does_not_read_skips_and_still_ends_with_the_exact_surface() {
    let daemon = Daemon::on(kneaded_scene(8)).await;
    // A window that holds some forty updates: what the transport has taken is not skipped.
    let url = format!("http://{}", daemon.running.as_ref().unwrap().address.unwrap());
    let endpoint = Endpoint::from_shared(url).unwrap().initial_stream_window_size(65_535);
    let mut client = SurfaceClient::new(endpoint.connect().await.unwrap());
    let request = v1::WatchRequest { max_rate_hz: 240.0, ..Default::default() };
    let mut lazy = client.watch(request).await.unwrap().into_inner();
    let mut mirror = Mirror::default();
    let before = daemon.status().await;
    let until = tokio::time::Instant::now() + 3 * PATIENCE;
    while mirror.last.as_ref().is_none_or(|update| update.skipped < 20) {
        assert!(tokio::time::Instant::now() < until, "nothing was skipped");
        // Not read for long, then read for a while: what passed in between shows as skipped.
        tokio::time::sleep(Duration::from_millis(700)).await;
        for _ in 0..5 {
            mirror.apply(event(&mut lazy).await);
        }
    }
    let after = daemon.status().await;
    assert!(after.tick > before.tick);
    daemon.pause().await;
    let snapshot = daemon.snapshot().await;
    while mirror.last.as_ref().unwrap().tick != snapshot.tick {
        mirror.apply(event(&mut lazy).await);
    }
    assert!(after.frames_skipped >= 20);
    let half_quantum_m = f64::from(mirror.quantum_m) / 2.0;
    for (vertex, exact) in positions_of(&daemon, &snapshot).into_iter().enumerate() {
        let error = (mirror.position_m(vertex) - exact).abs().max_element();
        assert!(error <= half_quantum_m + 1e-9, "vertex {vertex}: {error} m");
    }
    daemon.finish().await;
}

/// A body that was quarantined stood still before its viewers without a word.
#[tokio::test(flavor = "multi_thread")]
async fn a_quarantine_is_on_the_stream_until_reset() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    for level in [LevelOfDetail::Full, LevelOfDetail::Numbers] {
        let mut stream = watch(&daemon, 60.0, level).await;
        let update = next_update(&mut stream, |_| true).await;
        assert_eq!(update.quarantine, "");
        daemon.break_the_body().await;
        let held = next_update(&mut stream, |update| !update.quarantine.is_empty()).await;
        assert!(held.quarantine.contains("non-finite"), "{}", held.quarantine);
        assert_eq!(held.quarantine, daemon.status().await.quarantine);
        assert!(held.max_displacement_m.is_finite());
        let later = next_update(&mut stream, |_| true).await;
        assert_eq!(
            (later.time_s, later.max_displacement_m),
            (held.time_s, held.max_displacement_m),
            "the state stands"
        );
        daemon.reset().await;
        next_update(&mut stream, |update| update.quarantine.is_empty() && update.tick > 0).await;
    }
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_made_for_nobody() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let shared = std::sync::Arc::clone(&daemon.running.as_ref().unwrap().daemon);
    assert_eq!(shared.hub.demand.period_ticks(), 0);
    let stream = watch(&daemon, 100.0, LevelOfDetail::Numbers).await;
    assert_eq!(shared.hub.demand.period_ticks(), 10);
    assert!(!shared.hub.demand.wants_vertices());
    assert_eq!(daemon.status().await.viewers, 1);
    drop(stream);
    let until = tokio::time::Instant::now() + PATIENCE;
    while shared.hub.demand.period_ticks() != 0 {
        assert!(tokio::time::Instant::now() < until, "the viewer has gone, the demand stays");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(daemon.status().await.viewers, 0);
    daemon.finish().await;
}

/// A viewer that came after a time without viewers got the last frame of the one before as its first: a snapshot showed
/// the body of minutes ago.
#[tokio::test(flavor = "multi_thread")]
async fn the_first_update_is_of_now_after_nobody_watched() {
    let daemon = Daemon::on(pressed_scene(2)).await;
    let mut first = watch(&daemon, 60.0, LevelOfDetail::Full).await;
    event(&mut first).await;
    drop(first);
    while daemon.status().await.viewers > 0 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let now = daemon.status().await.tick;
    while daemon.status().await.tick < now + 100 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let mut second = watch(&daemon, 60.0, LevelOfDetail::Full).await;
    let update = loop {
        if let Some(v1::surface_event::Message::Update(update)) = event(&mut second).await.message {
            break update;
        }
    };
    assert!(update.tick >= now + 100, "tick {} was shown at tick {}", update.tick, now + 100);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_requests_are_refused_and_streams_end_cleanly_at_the_stop() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    for (request, code) in [
        (v1::WatchRequest { max_rate_hz: f64::NAN, ..Default::default() }, Code::InvalidArgument),
        (v1::WatchRequest { max_rate_hz: 1e3, ..Default::default() }, Code::InvalidArgument),
        (v1::WatchRequest { level_of_detail: 9, ..Default::default() }, Code::InvalidArgument),
        (v1::WatchRequest { session_id: "gone".into(), ..Default::default() }, Code::NotFound),
    ] {
        assert_eq!(daemon.surface().watch(request).await.unwrap_err().code(), code);
    }
    let mut stream = watch(&daemon, 0.0, LevelOfDetail::Full).await;
    event(&mut stream).await;
    let reading = tokio::spawn(async move { while stream.message().await.expect("a clean end").is_some() {} });
    let summary = daemon.finish().await;
    reading.await.unwrap();
    assert!(!summary.cut);
}
