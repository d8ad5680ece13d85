//! What an arm did is recorded beneath a bridge, and played back as an arm beneath another.

use crate::common;
use crate::common::press::{PRESSED_N, Pressed, pressed_by, simulated};
use glam::DVec3;
use palpate_bridge::{
    BridgeError, Config,
    config::{DeviceConfig, PlaybackConfig, RecordConfig},
    probe::probe,
    recording::{COLUMNS, read},
};
use rustix::process::{Pid, Signal, kill_process};
use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

/// The wall of the press, in the arm's axes (m).
const WALL_M: f64 = 0.2;

/// Time (s), height (m) and force (N) of each row.
fn rows(path: &Path) -> Vec<(f64, f64, f64)> {
    let text = std::fs::read_to_string(path).unwrap();
    let place = |name: &str| COLUMNS.iter().position(|column| *column == name).unwrap();
    let [time, z, force] = ["time_s", "position_z_m", "force_z_n"].map(place);
    let number = |word: &str| word.parse::<f64>().unwrap();
    let values = text.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>());
    values.map(|row| (number(row[time]), number(row[z]), number(row[force]))).collect()
}

fn record(path: &Path) -> RecordConfig {
    RecordConfig { path: Some(path.to_owned()), overwrite: false }
}

fn playback(file: &Path) -> DeviceConfig {
    DeviceConfig::Playback(PlaybackConfig { file: file.to_owned(), ..PlaybackConfig::default() })
}

/// Pressed once by a simulated arm, and again by its recording: the same way, and the same force.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_recorded_press_is_played_back_with_the_same_motion_and_force() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first.csv", "second.csv"].map(|name| folder.path().join(name));
    let Pressed { force_n: pressed_n, summary, .. } =
        pressed_by(2e-4, Duration::ZERO, simulated(), |config| config.record = record(&first)).await;
    assert!((pressed_n / PRESSED_N - 1.0).abs() < 0.02, "{pressed_n}");
    assert_eq!(rows(&first).len() as u64, summary.ticks, "a row a tick");
    let lasts = Duration::from_secs_f64(rows(&first).last().unwrap().0);
    let played_n = pressed_by(2e-3, lasts, playback(&first), |config| config.record = record(&second)).await.force_n;
    // It ends, and stays, where the first bridge's hand came to when its force had gone; the wall has 400 N/m.
    let end_m = WALL_M - rows(&second).last().unwrap().1;
    assert!((played_n / (400.0 * end_m) - 1.0).abs() < 0.02, "{played_n} N at {end_m} m");

    let (once, again) = (rows(&first), rows(&second));
    // Until the first bridge was stopped, its force went to zero and its hand on.
    let stopped_s = once.iter().rev().find(|row| row.2 > 0.98 * pressed_n).unwrap().0;
    let (mut apart_m, mut apart_n, mut places) = (0.0_f64, Vec::new(), 0);
    for &(time_s, z_m, force_n) in &again {
        // It rests for a second first.
        let then_s = time_s - 1.0 + once[0].0;
        let at = once.partition_point(|row| row.0 < then_s - 1e-6);
        let Some(row) = once.get(at).filter(|row| (row.0 - then_s).abs() < 1e-6) else { continue };
        apart_m = apart_m.max((z_m - row.1).abs());
        places += 1;
        if row.0 <= stopped_s && row.1 < WALL_M - 5e-4 {
            apart_n.push((force_n - row.2).abs());
        }
    }
    assert!(places > 1000 && apart_m < 1e-9, "{places} rows, up to {apart_m} m apart");
    apart_n.sort_by(f64::total_cmp);
    let median_n = apart_n[apart_n.len() / 2];
    assert!(apart_n.len() > 300 && median_n < 0.02 * pressed_n, "{} rows, {median_n} N apart", apart_n.len());
}

#[test]
fn a_probe_reads_a_recording_and_records_nothing() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/data/press.csv");
    let poses = read::file(&example).unwrap();
    assert!(poses.len() > 300 && std::fs::metadata(&example).unwrap().len() < 200_000);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("none.csv");
    let config = Config { device: playback(&example), record: record(&path), ..common::config("http://127.0.0.1:1") };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let _context = runtime.enter();
    let report = probe(&config, Duration::from_millis(100)).unwrap();
    assert_eq!(report.position_m, poses[0].motion.position_m);
    assert!(report.measured_force_n.is_none() && !path.exists());
}

#[tokio::test]
async fn a_recording_that_cannot_be_used_stops_the_bridge_and_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bad.csv");
    std::fs::write(&file, format!("{}\n0,0,0,zero\n", COLUMNS.join(","))).unwrap();
    let said = |error: BridgeError| common::told(&error);
    let started = async |config| common::start(config).task.await.unwrap().unwrap_err();
    let config = Config { device: playback(&file), ..common::config("http://127.0.0.1:1") };
    let bad = said(started(config.clone()).await);
    assert!(bad.contains("bad.csv, line 2: 4 values, where the header names 24 columns"), "{bad}");
    // What is there is not written over.
    let over = said(started(Config { record: record(&file), ..common::config("http://127.0.0.1:1") }).await);
    assert!(over.starts_with("record.path: cannot write ") && over.contains("it is there already"), "{over}");
    assert!(std::fs::read_to_string(&file).unwrap().ends_with("zero\n"));
}

/// Ctrl-C in the middle: every row is there, and whole.
#[test]
fn an_interrupted_recording_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("press.csv");
    let mut bridge = Command::new(env!("CARGO_BIN_EXE_palpate-bridge"))
        .args(["--server", "http://127.0.0.1:1", "--record"])
        .arg(&path)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let began = Instant::now();
    // It is written down once a second.
    while std::fs::metadata(&path).map_or(0, |file| file.len()) < 20_000 {
        assert!(began.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(10));
    }
    kill_process(Pid::from_child(&bridge), Signal::INT).unwrap();
    assert!(bridge.wait().unwrap().success());
    let output = bridge.wait_with_output().unwrap();
    let poses = read::file(&path).unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains(&format!("recorded {} rows in {}", poses.len(), path.display())), "{said}");
    let counted = String::from_utf8(output.stdout).unwrap();
    assert!(counted.contains(&format!("{} ticks", poses.len())), "{counted}");
    assert!(std::fs::read_to_string(&path).unwrap().ends_with('\n'));
    assert!(poses.iter().all(|pose| pose.motion.position_m.distance(DVec3::X * 0.05) < 0.03));
}
