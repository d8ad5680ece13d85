//! What the tests of arms on a real daemon share: emulated arms, bridges, and a network that is not good.
#![allow(dead_code, unreachable_pub, missing_docs, clippy::unwrap_used)] // helpers of tests; each file uses a part
pub mod arms;
pub mod network;
pub mod outliving;

use palpate_bridge::{
    BridgeError, Config, Handle, Summary,
    config::{DeviceConfig, RealtimeConfig},
};
use palpate_system_tests::daemon::PATIENCE;
use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};
use tokio::runtime::Runtime;
use tokio_util::sync::CancellationToken;

/// A bridge to `url`, as it is by default but for what a test machine does not grant.
pub fn config(url: &str, device: DeviceConfig) -> Config {
    let mut config = Config { device, ..Config::default() };
    url.clone_into(&mut config.server.url);
    config.server.first_pause_s = 0.02;
    config.server.longest_pause_s = 0.1;
    config.server.pause_seed = Some(1);
    config.servo.report_every_s = 0.0;
    config.servo.auto_recover = true;
    // Machines that run tests are busy: how well this one keeps time is not asked.
    config.servo.least_success_rate = 0.0;
    config.realtime = RealtimeConfig { fifo_priority: 0, lock_memory: false, processor: None, stay_awake: false };
    config
}

/// The scene `ventricle` with a fifth of its tets, in a folder: where a test asks what becomes of an arm and not how fast a body is, a slow
/// machine that runs tests has time left beside its ticks.
pub fn light_ventricle(folder: &Path) -> String {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deploy/scenes/ventricle.toml");
    let text = fs::read_to_string(scene).unwrap();
    let light = text.replace("target_tets = 1352", "target_tets = 270");
    assert_ne!(light, text, "the scene says how many tets it has");
    let path = folder.join("light-ventricle.toml");
    fs::write(&path, light).unwrap();
    path.to_str().unwrap().to_owned()
}

/// A linear congruential generator (Knuth's MMIX constants); its high bits.
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }
}

/// A bridge in this process, on a runtime of its own.
pub struct Bridge {
    pub handle: Handle,
    shutdown: CancellationToken,
    task: Option<tokio::task::JoinHandle<Result<Summary, BridgeError>>>,
    runtime: Runtime,
}

impl Bridge {
    pub fn start(config: Config) -> Self {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let (handle, shutdown) = (Handle::new(), CancellationToken::new());
        let (its, stop) = (handle.clone(), shutdown.clone());
        let task = runtime.spawn(async move { palpate_bridge::run_with(&config, stop, its).await });
        Self { handle, shutdown, task: Some(task), runtime }
    }

    pub fn wait(&self, what: &str, condition: impl Fn(&Handle) -> bool) {
        let began = Instant::now();
        while !condition(&self.handle) {
            let ended = self.task.as_ref().is_none_or(tokio::task::JoinHandle::is_finished);
            assert!(!ended && began.elapsed() < PATIENCE, "never: {what}; {}", self.handle.stats().summary());
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Its end, when it is asked for.
    pub fn stop(mut self) -> Result<Summary, BridgeError> {
        self.shutdown.cancel();
        self.runtime.block_on(self.task.take().unwrap()).unwrap()
    }
}
