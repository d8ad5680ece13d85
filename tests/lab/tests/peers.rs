//! Peers' scripts in processes of their own: what they answer, and what is told when they cannot.
#![allow(clippy::unwrap_used)] // a test that cannot build its subject has failed
use palpate_lab::{
    methods::Pace,
    peers::{Environment, Session, Task},
    problems,
};
use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// A peer whose nodes all go 2 µm along x and whose ticks take 1, 2, 3 … µs.
const KNOWN: &str = r#"
import json, os, sys
task = json.load(open(sys.argv[1]))
assert os.environ["OMP_NUM_THREADS"] == "1"
row = dict(name="known, one", settings="none", law="none", same_law=True, steps_per_tick=3, failure="",
           answers_m=[1e-6, 3e-6], displacements_m=[[2e-6, 0.0, 0.0]] * len(task["rest_positions_m"]))
bad = dict(row, name="bad", failure="became unstable", answers_m=[], displacements_m=[])
print(json.dumps(dict(format=1, peer="Fake", rows=[row, bad])), flush=True)
for line in sys.stdin:
    _, rounds, seconds = line.split()
    if float(seconds) == 0.0:
        sys.exit("no time")
    print(json.dumps(dict(times_s=[[1e-6 * (i + 1) for i in range(int(rounds))], []])), flush=True)
"#;

fn python() -> Option<PathBuf> {
    let there = Command::new("python3").arg("--version").output().is_ok_and(|output| output.status.success());
    if !there {
        println!("skipped: there is no python3 on this machine");
    }
    there.then(|| "python3".into())
}

fn task() -> Task {
    let problem = problems::all().into_iter().find(|p| p.name == "block-patch-small-nu0.45").unwrap();
    let pace = Pace { ramp_ticks: 3, rest_ticks: 2, damping_per_s: 4.0, motion: problems::Motion::ToRest };
    Task::new(&problem, 4, &pace, 1.0).unwrap()
}

fn start(python: &Path, text: &str) -> miette::Result<Session> {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("fake.py");
    fs::write(&script, text).unwrap();
    Session::start(python, &script, &task(), 4)
}

#[test]
fn what_a_script_answers_is_what_is_read() {
    let Some(python) = python() else { return };
    let mut session = start(&python, KNOWN).unwrap();
    session.time(2, 1.0);
    session.time(3, 1.0);
    let variants = session.variants();
    let [known, bad] = &variants[..] else { panic!("{variants:?}") };
    assert_eq!(known.row.method, "peer: Fake known; one");
    assert_eq!((known.row.substeps, known.row.resolution, known.row.elements), (3, 4, task().tets.len()));
    assert!(known.row.competes && known.row.failure.is_empty());
    assert_eq!(known.answers, [1e-6, 3e-6]);
    assert!(known.displacements_m.iter().all(|u| u.to_array() == [2e-6, 0.0, 0.0]));
    assert_eq!(known.times_s, [1e-6, 2e-6, 1e-6, 2e-6, 3e-6]);
    assert!(bad.row.failure == "became unstable" && bad.times_s.is_empty());
    // It dies while it is timed: what it measured stays, and its rows say why there is no more.
    session.time(1, 0.0);
    session.time(1, 1.0);
    let after = session.variants();
    assert!(after[0].row.failure.contains("no time"), "{}", after[0].row.failure);
    assert_eq!(after[0].times_s, known.times_s);
}

#[test]
fn a_script_that_fails_is_told_in_one_line() {
    let Some(python) = python() else { return };
    for (text, told) in [
        ("import no_such_package", "ModuleNotFoundError: No module named 'no_such_package'"),
        ("print('hello')", "something else"),
        ("print('{\"format\": 9, \"peer\": \"x\", \"rows\": []}')", "format 9"),
    ] {
        let why = start(&python, text).unwrap_err().to_string();
        assert!(why.contains(told) && !why.contains('\n'), "{why}");
    }
}

#[test]
fn a_missing_python_or_package_is_told_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let why = Environment::make("no-such-python", folder.path()).unwrap_err();
    assert!(why.contains("`no-such-python -m venv") && why.contains("install Python"), "{why}");
    let Some(python) = python() else { return };
    let environment = Environment { python };
    // A version nothing can have: pip refuses it before it asks anybody.
    let why = environment.install(("palpate", "no version")).unwrap_err();
    assert!(why.contains("pip install") && !why.contains('\n'), "{why}");
}
