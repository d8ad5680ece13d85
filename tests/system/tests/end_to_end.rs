//! Daemon, bridge and viewer as real processes over real sockets.
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
use palpate_system_tests::{
    daemon::{Daemon, PATIENCE, text, view},
    programs::Program,
};
use serde_json::Value;
use std::{fs, path::Path};

#[test]
fn the_default_scene_is_pressed_and_every_view_shows_it() {
    let daemon = Daemon::start(&[]);
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();

    let status = daemon.wait_until("time goes on", |s| s["tick"].as_u64() > Some(500));
    assert!(status["tets"].as_u64() > Some(100), "{status:#}");
    assert_eq!(status["quarantine"], "");

    let watch = daemon.view(&["watch", "--seconds", "4", "--json"]);
    let seconds: Vec<Value> = text(&watch.stdout).lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert!(!seconds.is_empty(), "{}", text(&watch.stderr));
    let largest = |key: &str| seconds.iter().filter_map(|s| s[key].as_f64()).fold(0.0, f64::max);
    assert!(largest("max_displacement_mm") > 0.05, "nothing moves: {seconds:?}");
    assert!(largest("rate_hz") > 5.0, "{seconds:?}");

    let pressed = daemon.view(&["snapshot", &file("pressed.png"), "--min-force-n", "0.05", "--timeout-s", "60"]);
    assert!(pressed.status.success(), "{}", text(&pressed.stderr));
    let never = daemon.view(&["snapshot", &file("never.png"), "--min-force-n", "500", "--timeout-s", "0.5"]);
    let said = text(&never.stderr);
    assert!(!never.status.success() && said.contains("no tool was pressed with 500 N within 0.5 s"), "{said}");

    for name in ["dent.png", "dent.vtu", "dent.obj", "dent.ply"] {
        let command = if name.ends_with("png") { "snapshot" } else { "export" };
        let output = daemon.view(&[command, &file(name)]);
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
        assert!(fs::metadata(file(name)).unwrap().len() > 1000, "{name} is nearly empty");
        let again = daemon.view(&[command, &file(name)]);
        assert!(!again.status.success() && text(&again.stderr).contains("--force"), "{name} was overwritten");
    }
    let png = fs::File::open(file("dent.png")).unwrap();
    let mut reader = png::Decoder::new(std::io::BufReader::new(png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    let ground = pixels[..3].to_vec();
    let drawn = pixels.chunks(3).filter(|pixel| **pixel != *ground).count();
    assert!(drawn > pixels.len() / 3 / 20, "only {drawn} pixels show the body");
}

/// A daemon told of its end before it ended: where that had no reader, SIGTERM did nothing, and no later one did.
#[test]
fn programs_that_nobody_reads_stop_when_they_are_told() {
    let mut daemon = Daemon::start(&[]);
    daemon.program.leave_unread();
    // Each logs when an arm comes and goes.
    for _ in 0..2 {
        let mut bridge = Program::start("palpate-bridge", &["--server", &daemon.url, "--device", "simulated"]);
        bridge.leave_unread();
        daemon.wait_until("the arm feels the body", |s| s["devices"][0]["force_n"].as_f64() > Some(0.05));
        bridge.terminate();
        assert!(bridge.wait(PATIENCE).success());
        daemon.wait_until("the device is gone", |s| s["devices"].as_array().is_some_and(Vec::is_empty));
    }
    daemon.program.terminate();
    assert!(daemon.program.wait(PATIENCE).success());
}

#[test]
fn a_bridge_takes_the_tool_and_gives_it_back() {
    let mut daemon = Daemon::start(&[]);
    let arguments = ["--server", &daemon.url, "--device", "simulated"];
    let mut bridge = Program::start("palpate-bridge", &arguments);
    let status = daemon.wait_until("the bridge streams", |s| {
        s["devices"].as_array().is_some_and(|d| d.iter().any(|d| d["samples_accepted"].as_u64() > Some(500)))
    });
    assert_eq!(status["devices"].as_array().unwrap().len(), 1, "{status:#}");
    daemon.wait_until("the arm feels the body", |s| s["devices"][0]["force_n"].as_f64() > Some(0.05));
    bridge.terminate();
    let code = bridge.wait(PATIENCE);
    assert!(code.success(), "the bridge ended with {code}:\n{}", bridge.output);
    assert!(!bridge.output.contains('\x1b'), "colours in a pipe:\n{}", bridge.output);
    daemon.wait_until("the device is gone", |s| s["devices"].as_array().is_some_and(Vec::is_empty));
    daemon.program.terminate();
    let code = daemon.program.wait(PATIENCE);
    assert!(code.success(), "the daemon ended with {code}:\n{}", daemon.program.output);
    let printed = &daemon.program.output;
    assert!(printed.contains("device attached") && !printed.contains('\x1b'), "colours in a pipe:\n{printed}");
}

#[test]
fn the_daemon_drains_while_a_bridge_and_a_viewer_hang_on() {
    let mut daemon = Daemon::start(&[]);
    let bridge = Program::start("palpate-bridge", &["--server", &daemon.url, "--device", "simulated"]);
    let viewer = Program::start("palpate-view", &["--server", &daemon.url, "watch"]);
    daemon.wait_until("both are attached", |s| {
        s["viewers"].as_u64() >= Some(1) && s["devices"].as_array().is_some_and(|d| d.len() == 1)
    });
    daemon.program.terminate();
    let code = daemon.program.wait(PATIENCE);
    assert!(code.success(), "{code}:\n{}", daemon.program.output);
    let printed = &daemon.program.output;
    assert!(printed.contains("p99"), "no histograms at exit:\n{printed}");
    assert!(!printed.contains("were cut"), "streams were cut:\n{printed}");
    drop((bridge, viewer));
}

#[test]
fn a_loop_that_fails_lets_the_arm_go_and_the_daemon_end_with_an_error() {
    let mut daemon = Daemon::of("examples/failing_loop", &[]);
    let mut bridge = Program::start("palpate-bridge", &["--server", &daemon.url, "--device", "simulated"]);
    bridge.wait_for("attached to tool", PATIENCE);
    let said = bridge.wait_for("loop failed", PATIENCE);
    assert!(said.contains("the daemon reports: ") && said.contains("ramped to zero"), "{said}");
    let code = daemon.program.wait(PATIENCE);
    let printed = &daemon.program.output;
    assert_eq!(code.code(), Some(1), "{printed}");
    assert!(printed.contains("stopped without being told to: the simulation loop ended by a panic"), "{printed}");
    assert!(printed.contains("p99"), "no histograms at exit:\n{printed}");
    assert!(printed.contains("ERROR") && !printed.contains('\u{1b}'), "a log in a pipe has no colours:\n{printed}");
}

#[test]
fn injected_forces_arrive() {
    let daemon = Daemon::start(&["--arm", "none"]);
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("push.toml");
    // The same point in both units: one vertex, pushed towards the inside of the wall.
    let force = |point: &str| format!("[[force]]\n{point}\nforce_n = [-0.05, 0.0, 0.0]\ntick_count = 100000\n");
    fs::write(&script, force("nearest_to_mm = [32, 0, 0]") + &force("nearest_to_m = [0.032, 0.0, 0.0]")).unwrap();
    let output = daemon.view(&["inject", script.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(said.contains("2 forces accepted"), "{said}");
    let vertices: Vec<&str> = said.lines().filter_map(|line| line.split_once("surface vertex ")).map(|v| v.1).collect();
    assert!(vertices.len() == 2 && vertices[0] == vertices[1], "{said}");
    daemon.wait_until("work is done on the body", |s| s["energies_j"]["external_work"].as_f64() > Some(1e-9));
    // The wall's probe is beside that point, and the displacement of a push is largest there: it arrived where it was meant to.
    let wall = |s: &Value| s["probes"].as_array()?.iter().find(|p| p["name"] == "wall")?["values"][0].as_f64();
    daemon.wait_until("the wall is pushed inwards", |s| wall(s).is_some_and(|x_m| x_m < -2e-4));

    fs::write(&script, "[[force]]\nsurface_vertex = 4000000000\nforce_n = [0.0, 0.0, 1.0]\ntick_count = 1\n").unwrap();
    let refused = daemon.view(&["inject", script.to_str().unwrap()]);
    assert!(!refused.status.success());
    assert!(text(&refused.stderr).contains("4000000000"), "{}", text(&refused.stderr));
    let tick = daemon.status()["tick"].as_u64();
    daemon.wait_until("the daemon goes on", |s| s["tick"].as_u64() > tick);
}

#[test]
fn a_session_is_paused_stepped_saved_restored_reset_and_loaded() {
    let daemon = Daemon::start(&["--arm", "none"]);
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let said = |arguments: &[&str]| {
        let output = daemon.view(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    let state = |said: &str| said.trim().rsplit(' ').next().unwrap().to_owned();
    daemon.wait_until("time goes on", |s| s["tick"].as_u64() > Some(100));
    said(&["pause"]);
    let paused = daemon.status();
    assert_eq!(paused["paused"], true);
    fs::write(file("push.toml"), "[[force]]\nsurface_vertex = 3\nforce_n = [0.01, 0.0, 0.0]\ntick_count = 50\n")
        .unwrap();
    said(&["inject", &file("push.toml")]);
    said(&["step", "40"]);
    assert_eq!(daemon.status()["tick"].as_u64(), paused["tick"].as_u64().map(|tick| tick + 40));
    let saved = state(&said(&["save", &file("moved.state")]));
    assert!(!daemon.view(&["save", &file("moved.state")]).status.success(), "a saved state was overwritten");
    said(&["step", "10"]);
    assert_ne!(state(&said(&["save", "--force", &file("later.state")])), saved);
    assert_eq!(state(&said(&["restore", &file("moved.state")])), saved, "the same bits");
    assert!(said(&["reset"]).contains("tick 0"));
    said(&["resume"]);
    daemon.wait_until("time goes on from rest", |s| s["paused"] == false && s["tick"].as_u64() > Some(10));
    assert!(said(&["load", "cantilever"]).starts_with("cantilever"));
    assert_eq!(daemon.status()["scene_name"], "cantilever");
    let refused = daemon.view(&["restore", &file("moved.state")]);
    assert!(!refused.status.success(), "the state of another scene was taken");
    let refused = daemon.view(&["load", "nothing"]);
    let message = text(&refused.stderr);
    assert!(!refused.status.success() && message.contains("built-in scenes are"), "{message}");
}

#[test]
fn two_daemons_on_one_port_and_no_daemon_at_all_are_explained() {
    let daemon = Daemon::start(&[]);
    let address = daemon.url.trim_start_matches("http://").to_owned();
    let mut second = Program::start("palpated", &["serve", "--listen", &address]);
    assert!(!second.wait(PATIENCE).success());
    let port = address.rsplit(':').next().unwrap();
    assert!(second.output.contains(port) && second.output.contains("--listen"), "{}", second.output);
    drop(daemon);

    let nobody = view(&format!("http://{address}"), &["status"]);
    assert!(!nobody.status.success());
    let message = text(&nobody.stderr);
    assert!(message.contains("no daemon answers") && message.contains("palpated"), "{message}");
}

#[test]
fn a_unix_socket_serves_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("palpated.sock");
    let _daemon = Daemon::start(&["--unix", socket.to_str().unwrap()]);
    let output = view(&format!("unix://{}", socket.display()), &["status"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(Path::new(&socket).exists());
}
