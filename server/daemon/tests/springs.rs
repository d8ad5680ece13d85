//! A mass-spring surface in the daemon: over real sockets, and with the bits of `palpated simulate`.
use crate::common::{
    Daemon,
    seen::{Seen, simulated},
    springs::{SPRINGS, springs_scene},
    vec3,
};
use glam::DVec3;
use palpate_physics::{State, snapshot};
use palpate_proto::v1;

async fn state(daemon: &Daemon) -> State {
    let session = daemon.running.as_ref().unwrap().daemon.session();
    snapshot::restore(&session.model, &daemon.snapshot().await.state).unwrap()
}

/// Refined, coarse again, and asleep.
#[tokio::test(flavor = "multi_thread")]
async fn the_live_loop_and_simulate_reach_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("springs.toml");
    std::fs::write(&path, SPRINGS).unwrap();
    let daemon = Daemon::on(springs_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    let session = daemon.running.as_ref().unwrap().daemon.session();
    let body = session.model.body().as_mass_spring().unwrap();
    assert_eq!(session.info().tet_count, 0);
    for (ticks, refined, awake) in [(20, false, false), (330, true, true), (2500, false, false)] {
        let done = daemon.step(ticks).await;
        assert_eq!(daemon.status().await.quarantine, "");
        let offline = simulated(path.to_str().unwrap(), done as f64 * 1e-3);
        let hash = daemon.snapshot().await.state_hash;
        assert_eq!(offline["state_hash"], format!("{hash:016x}"), "at tick {done}");
        let state = state(&daemon).await;
        assert_eq!(state.body.as_mass_spring().unwrap().refined_nodes(body) > 20, refined, "at tick {done}");
        assert_eq!(!state.mechanical.x.is_empty(), awake, "{} awake at tick {done}", state.mechanical.x.len());
    }
    daemon.finish().await;
}

/// Positions of the surface as the physics has them, against those of a viewer.
#[tokio::test(flavor = "multi_thread")]
async fn viewers_see_the_surface_where_the_physics_has_it() {
    let daemon = Daemon::on(springs_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    daemon.step(300).await;
    let Seen { mirror, surface_m, .. } = daemon.see_the_surface().await;
    let session = daemon.running.as_ref().unwrap().daemon.session();
    let rest = session.model.surface_rest_positions_m();
    assert_eq!(surface_m.len(), rest.len());
    let largest = surface_m.iter().zip(rest).map(|(x, rest)| x.distance(*rest)).fold(0.0, f64::max);
    let told = mirror.last.unwrap().max_displacement_m;
    assert!(largest > 1e-4 && (told - largest).abs() < 1e-8, "{told} {largest}");
    daemon.finish().await;
}

/// A force on a vertex that sleeps wakes it, and a state with other nodes awake goes back into the loop.
#[tokio::test(flavor = "multi_thread")]
async fn forces_wake_what_sleeps_and_states_go_back() {
    let daemon = Daemon::on(springs_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    daemon.step(300).await;
    let pressed = daemon.snapshot().await;
    let session = daemon.running.as_ref().unwrap().daemon.session();
    let rest = session.model.surface_rest_positions_m();
    let lowest = (0..rest.len()).min_by(|&a, &b| rest[a].z.total_cmp(&rest[b].z)).unwrap() as u32;
    let force = |vertex| v1::InjectedForce {
        surface_vertex: vertex,
        force_n: Some(vec3(DVec3::Z * 0.01)),
        from_tick: 0,
        tick_count: 50,
    };
    let inject = async |vertex: u32| {
        let request = v1::InjectForcesRequest { forces: vec![force(vertex)], ..Default::default() };
        daemon.session().inject_forces(request).await
    };
    inject(lowest).await.unwrap();
    daemon.step(50).await;
    let mut positions_m = Vec::new();
    session.model.surface_positions_m(&state(&daemon).await, &mut positions_m);
    assert!(positions_m[lowest as usize].z - rest[lowest as usize].z > 1e-4, "{}", positions_m[lowest as usize]);
    assert!(inject(rest.len() as u32).await.unwrap_err().message().contains("out of range"));
    let request = v1::RestoreRequest { state: pressed.state.clone(), ..Default::default() };
    let restored = daemon.session().restore(request).await.unwrap().into_inner();
    assert_eq!(restored.state_hash, pressed.state_hash);
    daemon.step(10).await;
    daemon.finish().await;
}
