//! A run over time that was killed, or interrupted, and goes on: what it leaves is what it had left without a break.
use crate::offline::{beam, examples, fails, palpated, succeeds, summary};
use rustix::process::{Pid, Signal, kill_process};
use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

/// Every file of a run by its name; the summary without what depends on the machine.
fn left(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for folder in [out.to_owned(), out.join("frames")] {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten().filter(|entry| entry.path().is_file()) {
            files.insert(entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap());
        }
    }
    let mut of_run = summary(out);
    for of_machine in ["wall_s", "time", "resumed_at_s"] {
        of_run.as_object_mut().unwrap().remove(of_machine);
    }
    files.insert("summary.json".to_owned(), of_run.to_string().into_bytes());
    files
}

fn started(arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_palpated"))
        .args(arguments)
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

/// Ends a run by a signal once it has written a checkpoint that was not there before; false: it was over before that.
fn broken_off(arguments: &[&str], checkpoint: &Path, signal: Signal) -> bool {
    let before = fs::read(checkpoint).ok();
    let mut run = started(arguments);
    let until = Instant::now() + Duration::from_mins(2);
    while run.try_wait().unwrap().is_none() {
        assert!(Instant::now() < until, "no checkpoint is written");
        if fs::read(checkpoint).ok() != before {
            std::thread::sleep(Duration::from_millis(80));
            let _ = kill_process(Pid::from_child(&run), signal);
            run.wait().unwrap();
            return checkpoint.exists();
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    false
}

fn goes_on_to_the_same_bits(scene: &str, duration_s: &str) {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let (whole, broken) = (at("whole"), at("broken"));
    let common = ["simulate", scene, "--duration-s", duration_s, "--checkpoint-every-s", "0.1", "--out"];
    succeeds(&[&common[..], &[whole.to_str().unwrap()]].concat());
    assert!(!whole.join("checkpoint.bin").exists(), "a run that is over leaves nothing to go on with");
    let broken_arguments = [&common[..], &[broken.to_str().unwrap(), "--resume"]].concat();
    let mut breaks = 0;
    for signal in [Signal::KILL, Signal::INT, Signal::KILL, Signal::TERM] {
        breaks += u32::from(broken_off(&broken_arguments, &broken.join("checkpoint.bin"), signal));
    }
    assert!(breaks > 1, "{scene}: it was broken off {breaks} times");
    succeeds(&broken_arguments);
    assert!(summary(&broken)["resumed_at_s"].as_f64().unwrap() > 0.0);
    let (whole, broken) = (left(&whole), left(&broken));
    assert_eq!(whole.keys().collect::<Vec<_>>(), broken.keys().collect::<Vec<_>>(), "{scene}");
    for (name, bytes) in &whole {
        assert!(broken[name] == *bytes, "{scene}: {name} is another");
    }
}

#[test]
fn a_beam_goes_on_to_the_same_bits() {
    let place = tempfile::tempdir().unwrap();
    goes_on_to_the_same_bits(&beam(place.path()), "20");
}

#[test]
fn a_pressed_hybrid_body_goes_on_to_the_same_bits() {
    let scene = examples().join("hybrid-ventricle.toml");
    goes_on_to_the_same_bits(scene.to_str().unwrap(), "1.5");
}

#[test]
fn pressed_springs_go_on_to_the_same_bits() {
    goes_on_to_the_same_bits("springs-dome", "1.5");
}

/// What another run wrote is not gone on with, and stays.
#[test]
fn another_run_is_told_and_left_alone() {
    let place = tempfile::tempdir().unwrap();
    let scene = beam(place.path());
    let out = place.path().join("out");
    let out_text = out.to_str().unwrap();
    let arguments = ["simulate", &scene, "--duration-s", "20", "--checkpoint-every-s", "0.05", "--out", out_text];
    assert!(broken_off(&arguments, &out.join("checkpoint.bin"), Signal::KILL));
    let rows = fs::read(out.join("probes.csv")).unwrap();
    let resumed = |more: &[&str]| fails(&[&["simulate", &scene, "--out", out_text, "--resume"], more].concat());
    let said = resumed(&["--duration-s", "21"]);
    assert!(said.contains("its duration, or when it samples") && said.contains("--force"), "{said}");
    let text = fs::read_to_string(&scene).unwrap();
    fs::write(&scene, text.replace("100e3", "90e3")).unwrap();
    assert!(resumed(&["--duration-s", "20"]).contains("the scene's file has changed"));
    fs::write(&scene, text).unwrap();
    let checkpoint = out.join("checkpoint.bin");
    let good = fs::read(&checkpoint).unwrap();
    for bad in [&good[..good.len() / 2], b"", b"\xff\xff\xff\xff\xff\xff\xff"] {
        fs::write(&checkpoint, bad).unwrap();
        let said = resumed(&["--duration-s", "20"]);
        assert!(said.contains("checkpoint") && said.contains("--force"), "{said}");
    }
    fs::write(&checkpoint, good).unwrap();
    assert_eq!(fs::read(out.join("probes.csv")).unwrap(), rows);
    // A table that lost rows is not gone on with either.
    fs::write(out.join("probes.csv"), &rows[..10]).unwrap();
    assert!(resumed(&["--duration-s", "20"]).contains("shorter"));
    let without = palpated(&["simulate", &scene, "--resume"]);
    assert_eq!(without.status.code(), Some(2), "--resume needs --out");
}
