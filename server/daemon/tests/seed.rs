//! The papers' hybrid in the daemon, as its shipped scene: over real sockets, and with the bits of `palpated simulate`.
use crate::common::{
    Daemon,
    hybrid::{SEED, seed_scene},
    seen::{Seen, simulated},
    vec3,
};
use glam::DVec3;
use palpate_proto::v1;

/// With particles awake, and asleep again.
#[tokio::test(flavor = "multi_thread")]
async fn the_live_loop_and_simulate_reach_the_same_bits() {
    let daemon = Daemon::on(seed_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    for (ticks, some_awake) in [(400, true), (350, false)] {
        let done = daemon.step(ticks).await;
        let status = daemon.status().await;
        assert_eq!(status.active_particles > 0, some_awake, "{} at tick {done}", status.active_particles);
        assert_eq!(status.quarantine, "");
        let offline = simulated(SEED, done as f64 * 7e-3);
        let hash = daemon.snapshot().await.state_hash;
        assert_eq!(offline["state_hash"], format!("{hash:016x}"), "at tick {done}");
        assert_eq!(offline["body"]["particles"]["active"], status.active_particles);
    }
    let info = daemon.status().await.session.unwrap();
    assert_eq!((info.tet_count, info.particle_count, info.most_active_particles), (186, 27_988, 274));
    assert_eq!((info.tick_period_s, info.substeps_per_tick), (7e-3, 1));
    daemon.finish().await;
}

/// The loop keeps the papers' period by the clock.
#[tokio::test(flavor = "multi_thread")]
async fn a_live_session_runs_at_the_papers_step() {
    let daemon = Daemon::on(seed_scene()).await;
    let (first, begun) = (daemon.status().await, std::time::Instant::now());
    tokio::time::sleep(std::time::Duration::from_millis(700)).await;
    let last = daemon.status().await;
    let ticks = (last.tick - first.tick) as f64;
    // Ticks that a busy machine misses are skipped, so there may be fewer, but never more.
    assert!(ticks >= 10.0 && ticks * 7e-3 <= begun.elapsed().as_secs_f64() + 0.02, "{ticks} ticks");
    assert!((last.time_s - last.tick as f64 * 7e-3).abs() < 1e-9);
    daemon.finish().await;
}

/// Viewers see the skin where the physics has it; a force on one of its vertices acts there.
#[tokio::test(flavor = "multi_thread")]
async fn viewers_see_the_skin_and_forces_act_on_it() {
    let daemon = Daemon::on(seed_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    let session = daemon.running.as_ref().unwrap().daemon.session();
    let rest_m = session.model.body().as_seed().unwrap().model().surface_rest_m();
    let apex = (0..rest_m.len()).min_by(|&a, &b| rest_m[a].z.total_cmp(&rest_m[b].z)).unwrap();
    let force = v1::InjectedForce {
        surface_vertex: apex as u32,
        force_n: Some(vec3(DVec3::Z * 1e-4)),
        from_tick: 0,
        tick_count: 400,
    };
    let request = v1::InjectForcesRequest { forces: vec![force], ..Default::default() };
    daemon.session().inject_forces(request).await.unwrap();
    daemon.step(400).await;
    let Seen { state, surface_m, .. } = daemon.see_the_surface().await;
    assert!(state.awake_particles() > 0);
    assert_eq!(surface_m.len(), rest_m.len());
    assert!(surface_m[apex].z - rest_m[apex].z > 1e-4, "{}", surface_m[apex] - rest_m[apex]);
    daemon.finish().await;
}
