//! A hybrid body in the daemon: over real sockets, and with the bits of `palpated simulate`.
use crate::common::{
    Daemon,
    hybrid::{HYBRID, hybrid_scene},
    seen::{Seen, simulated},
    vec3,
};
use glam::DVec3;
use palpate_physics::snapshot;
use palpate_proto::v1;

/// With particles awake and asleep again.
#[tokio::test(flavor = "multi_thread")]
async fn the_live_loop_and_simulate_reach_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hybrid.toml");
    std::fs::write(&path, HYBRID).unwrap();
    let daemon = Daemon::on(hybrid_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    for (ticks, some_awake) in [(150, true), (350, true), (900, false)] {
        let done = daemon.step(ticks).await;
        let status = daemon.status().await;
        assert_eq!(status.active_particles > 0, some_awake, "{} at tick {done}", status.active_particles);
        assert_eq!(status.quarantine, "");
        let offline = simulated(path.to_str().unwrap(), done as f64 * 1e-3);
        let hash = daemon.snapshot().await.state_hash;
        assert_eq!(offline["state_hash"], format!("{hash:016x}"), "at tick {done}");
    }
    let info = daemon.status().await.session.unwrap();
    assert!(info.particle_count > 1000 && info.most_active_particles == 200, "{info:?}");
    assert_eq!(info.tet_count, 24);
    daemon.finish().await;
}

/// Positions of the skin as the physics has them, against those of a viewer.
#[tokio::test(flavor = "multi_thread")]
async fn viewers_see_the_skin_where_the_physics_has_it() {
    let daemon = Daemon::on(hybrid_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    daemon.step(300).await;
    let Seen { mirror, state, surface_m } = daemon.see_the_surface().await;
    assert!(!state.body.active_particles().is_empty());
    assert!(surface_m.len() > 500);
    let session = daemon.running.as_ref().unwrap().daemon.session();
    let rest = session.model.surface_rest_positions_m();
    let largest = surface_m.iter().zip(rest).map(|(x, rest)| x.distance(*rest)).fold(0.0, f64::max);
    let told = mirror.last.unwrap().max_displacement_m;
    assert!(largest > 1e-4 && (told - largest).abs() < 1e-8, "{told} {largest}");
    daemon.finish().await;
}

/// A force on a vertex of the skin pushes there, and a state with other particles awake goes back into the loop.
#[tokio::test(flavor = "multi_thread")]
async fn forces_act_on_the_skin_and_states_go_back() {
    let daemon = Daemon::on(hybrid_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    let start = daemon.snapshot().await;
    daemon.step(300).await;
    let pressed = daemon.snapshot().await;
    let restore = async |snapshot: &v1::SnapshotResponse| {
        let request = v1::RestoreRequest { state: snapshot.state.clone(), ..Default::default() };
        daemon.session().restore(request).await.unwrap().into_inner()
    };
    assert_eq!(restore(&start).await.state_hash, start.state_hash);
    let session = daemon.running.as_ref().unwrap().daemon.session();
    let rest = session.model.surface_rest_positions_m();
    let corner = DVec3::new(0.04, 0.04, 0.02);
    let vertex = (0..rest.len()).find(|&v| rest[v].distance(corner) < 1e-9).unwrap() as u32;
    let force = v1::InjectedForce {
        surface_vertex: vertex,
        force_n: Some(vec3(DVec3::X * 0.01)),
        from_tick: 0,
        tick_count: 20,
    };
    let request = v1::InjectForcesRequest { forces: vec![force], ..Default::default() };
    daemon.session().inject_forces(request).await.unwrap();
    daemon.step(20).await;
    let state = snapshot::restore(&session.model, &daemon.snapshot().await.state).unwrap();
    let mut positions_m = Vec::new();
    session.model.surface_positions_m(&state, &mut positions_m);
    assert!(positions_m[vertex as usize].x - corner.x > 1e-5, "{}", positions_m[vertex as usize]);
    let out_of_range =
        v1::InjectedForce { surface_vertex: rest.len() as u32, force_n: Some(vec3(DVec3::X)), ..Default::default() };
    let request = v1::InjectForcesRequest { forces: vec![out_of_range], ..Default::default() };
    assert!(daemon.session().inject_forces(request).await.unwrap_err().message().contains("out of range"));
    assert_eq!(restore(&pressed).await.state_hash, pressed.state_hash);
    daemon.step(10).await;
    daemon.finish().await;
}
