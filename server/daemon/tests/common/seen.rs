//! What viewers see and what `palpated simulate` reaches, to compare with the live state.
use super::{Daemon, Mirror, PATIENCE};
use glam::DVec3;
use palpate_physics::{State, snapshot};
use palpate_proto::v1::{self, LevelOfDetail};
use serde_json::Value;
use std::process::Command;
use tokio::time::timeout;

/// A surface as a viewer saw it, and the state that it was of.
pub struct Seen {
    pub mirror: Mirror,
    pub state: State,
    /// As the physics has it.
    pub surface_m: Vec<DVec3>,
}

impl Daemon {
    /// Watches a paused body until its present tick is seen: every vertex where the physics has it.
    pub async fn see_the_surface(&self) -> Seen {
        let request = v1::WatchRequest { level_of_detail: LevelOfDetail::Full.into(), ..Default::default() };
        let mut stream = self.surface().watch(request).await.unwrap().into_inner();
        let mut mirror = Mirror::default();
        let snapshot = self.snapshot().await;
        while mirror.last.as_ref().is_none_or(|last| last.tick != snapshot.tick) {
            mirror.apply(timeout(PATIENCE, stream.message()).await.unwrap().unwrap().unwrap());
        }
        let session = self.running.as_ref().unwrap().daemon.session();
        let state = snapshot::restore(&session.model, &snapshot.state).unwrap();
        let mut surface_m = Vec::new();
        session.model.surface_positions_m(&state, &mut surface_m);
        assert_eq!(surface_m.len(), mirror.rest.len());
        for (vertex, exact) in surface_m.iter().enumerate() {
            let error = (mirror.position_m(vertex) - *exact).abs().max_element();
            assert!(error <= f64::from(mirror.quantum_m) / 2.0 + 1e-9, "vertex {vertex}: {error} m");
        }
        Seen { mirror, state, surface_m }
    }
}

/// What `palpated simulate --json` says of a scene, a file or one that is built in, run so long.
pub fn simulated(scene: &str, duration_s: f64) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_palpated"))
        .args(["simulate", scene, "--json", "--duration-s", &duration_s.to_string()])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}
