//! The real programs on a network that is not trusted, and killed: identities by the command line, and a session that goes on.
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
use palpate_system_tests::{
    daemon::{Daemon, PATIENCE, text, view},
    programs::{Program, path_of},
};
use std::{fs, path::Path, process::Command, time::Instant};

fn palpated(arguments: &[&str]) -> String {
    let output = Command::new(path_of("palpated")).args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout).trim().to_owned()
}

/// As docs/operating.md has it: keys, a viewer's certificate, a script's token, an arm; and what each of them may not.
#[test]
fn keys_made_by_the_program_tell_people_scripts_and_arms_apart() {
    let place = tempfile::tempdir().unwrap();
    let file = |name: &str| place.path().join(name).to_str().unwrap().to_owned();
    let (keys, out) = (file("pki"), place.path().to_str().unwrap().to_owned());
    let said = palpated(&["pki", "init", "--folder", &keys, "--host", "lab-7.example"]);
    assert!(said.contains("lab-7.example") && said.contains("palpated serve --pki"), "{said}");
    let issue = |name: &str, role: &str| {
        palpated(&["pki", "issue", name, "--role", role, "--folder", &keys, "--out", &out]);
        [
            "--tls-ca".to_owned(),
            file("pki/ca.pem"),
            "--tls-cert".to_owned(),
            file(&format!("{name}.pem")),
            "--tls-key".to_owned(),
            file(&format!("{name}.key")),
        ]
    };
    let (anna, left, boss) = (issue("anna", "viewer"), issue("left", "device"), issue("boss", "operator"));
    let daemon = Daemon::start(&["ventricle", "--arm", "none", "--pki", &keys]);
    assert!(daemon.url.starts_with("https://"), "{}", daemon.url);
    let ask = |shown: &[String], command: &[&str]| {
        let shown: Vec<&str> = shown.iter().map(String::as_str).collect();
        let output = view(&daemon.url, &[&shown, command].concat());
        (output.status.success(), text(&output.stderr))
    };
    assert!(ask(&anna, &["status"]).0);
    let (done, said) = ask(&anna, &["pause"]);
    assert!(!done && said.contains("anna may not call"), "{said}");
    let (done, said) = ask(&anna[..2], &["status"]);
    assert!(!done && said.contains("show a certificate or a token"), "{said}");

    // A token, narrowed without any key.
    let token = palpated(&["pki", "token", "script", "--role", "viewer", "--role", "injector", "--folder", &keys]);
    let narrow = palpated(&["pki", "narrow", &token, "--role", "viewer", "--hours", "1"]);
    let by_token = |token: &str, command: &[&str]| {
        let shown = ["--tls-ca".to_owned(), file("pki/ca.pem"), "--token".to_owned(), token.to_owned()];
        ask(&shown, command)
    };
    let script = file("push.toml");
    fs::write(&script, "[[force]]\nnearest_to_mm = [30, 0, 0]\nforce_n = [0, 0, -0.01]\ntick_count = 10\n").unwrap();
    assert!(by_token(&token, &["inject", &script]).0);
    let (done, said) = by_token(&narrow, &["inject", &script]);
    assert!(!done && said.contains("script may not call"), "{said}");
    assert!(by_token(&narrow, &["status"]).0);

    // An arm, and an operator who takes the tool from it.
    let mut arguments = vec!["--server", &daemon.url, "--device", "simulated"];
    arguments.extend(left.iter().map(String::as_str));
    let mut bridge = Program::start("palpate-bridge", &arguments);
    bridge.wait_for("attached to tool", PATIENCE);
    assert!(!ask(&anna, &["detach"]).0);
    let (done, said) = ask(&boss, &["detach"]);
    assert!(done, "{said}");
    assert_eq!(bridge.wait(PATIENCE).code(), Some(3), "{}", bridge.output);
    assert!(bridge.output.contains("palpate-view detach"), "{}", bridge.output);

    // Revoked, and the daemon told.
    palpated(&["pki", "revoke", "anna", "--folder", &keys]);
    assert!(ask(&anna, &["status"]).0, "it has not been told yet");
    daemon.program.hang_up();
    let until = Instant::now() + PATIENCE;
    while ask(&anna, &["status"]).0 {
        assert!(Instant::now() < until, "it goes on being let in");
    }
    assert!(ask(&anna, &["status"]).1.contains("revoked"));
    assert!(ask(&boss, &["status"]).0, "SIGHUP ends nothing");
}

#[test]
fn a_daemon_elsewhere_is_not_started_without_identities() {
    let output =
        Command::new(path_of("palpated")).args(["serve", "ventricle", "--listen", "0.0.0.0:0"]).output().unwrap();
    let said = text(&output.stderr);
    assert!(
        !output.status.success() && said.contains("palpated pki init") && said.contains("--trust-the-network"),
        "{said}"
    );
}

/// Killed without a word, twice: the state is the last autosave's, and goes on from there.
#[test]
fn a_killed_daemon_goes_on_at_its_last_autosave() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("kept");
    let at = folder.to_str().unwrap();
    let arguments = ["ventricle", "--autosave", at, "--autosave-every-s", "1", "--resume"];
    let mut last = 0;
    for _ in 0..2 {
        let mut daemon = Daemon::start(&arguments);
        let began = daemon.status()["tick"].as_u64().unwrap();
        assert!(began >= last, "it went on at tick {began}, and tick {last} had been kept");
        daemon.wait_until("it is kept once more", |_| kept_tick(&folder) > began + 200);
        daemon.program.kill();
        last = kept_tick(&folder);
    }
    // While time stands, the very state is there again.
    let mut daemon = Daemon::start(&arguments);
    assert!(daemon.view(&["pause"]).status.success());
    let (first, second) = (place.path().join("a.bin"), place.path().join("b.bin"));
    assert!(daemon.view(&["save", first.to_str().unwrap()]).status.success());
    let tick = daemon.status()["tick"].as_u64().unwrap();
    daemon.wait_until("it is kept", |_| kept_tick(&folder) == tick);
    daemon.program.kill();
    let daemon = Daemon::start(&arguments);
    let status = daemon.status();
    assert_eq!((status["tick"].as_u64(), status["paused"].as_bool()), (Some(tick), Some(true)), "{status:#}");
    assert!(daemon.view(&["save", second.to_str().unwrap()]).status.success());
    assert!(fs::read(first).unwrap() == fs::read(second).unwrap(), "bit for bit");
}

/// A bridge that had stopped on a lost arm was started anew by the service manager, and pushed.
#[test]
fn a_latched_fault_outlives_the_bridge() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("latched");
    let latch = file.to_str().unwrap();
    // A machine that lets the loop wait while other tests run latches no fault of its own.
    let patient = place.path().join("patient.toml");
    fs::write(&patient, "[servo]\nleast_success_rate = 0.0\nguard = false\n[watchdog]\nstale_after_s = 20.0\n")
        .unwrap();
    let daemon = Daemon::start(&["ventricle"]);
    let config = patient.to_str().unwrap();
    let arguments = ["--config", config, "--server", &daemon.url, "--device", "simulated", "--latch-file", latch];
    let state = |status: &serde_json::Value| status["devices"][0]["safety_state"].as_str().unwrap_or("").to_owned();
    fs::write(&file, "device\n").unwrap();
    for killed in [true, false] {
        let mut bridge = Program::start("palpate-bridge", &arguments);
        bridge.wait_for("recover with `kill -USR1", PATIENCE);
        daemon.wait_until("it says so", |status| state(status) == "SAFETY_STATE_FAULT_LATCHED");
        if killed {
            bridge.kill();
            daemon.wait_until("the tool is free", |status| status["devices"].as_array().is_some_and(Vec::is_empty));
            assert!(file.exists());
            continue;
        }
        bridge.recover();
        daemon.wait_until("it operates", |status| state(status) == "SAFETY_STATE_OPERATING");
        let until = Instant::now() + PATIENCE;
        while file.exists() {
            assert!(Instant::now() < until, "what was recovered from is remembered");
        }
        bridge.terminate();
        assert!(bridge.wait(PATIENCE).success());
    }
    assert!(!file.exists(), "a stop that was asked for is no fault");
}

/// The tick that the folder's session was kept at; 0: none is there.
fn kept_tick(folder: &Path) -> u64 {
    let text = fs::read_to_string(folder.join("session.toml")).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("tick = "));
    line.and_then(|tick| tick.parse().ok()).unwrap_or(0)
}
