//! Two arms press the same heart at once, each beneath a bridge of its own. What their links were like is printed (docs/realtime.md tells what was measured), and not
//! asserted: machines that run tests are busy. `PALPATE_LOOK_S` says for how long.
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
mod lab;

use lab::{
    Bridge,
    arms::{self, Hand},
};
use palpate_bridge::config::WorkspaceConfig;
use palpate_system_tests::{
    daemon::{Daemon, PATIENCE},
    root,
};
use std::time::{Duration, Instant};

/// In and out, twice a second: both press from 0.1 to 0.35 s.
fn hand() -> Hand {
    Hand { keys: vec![(0.0, 0.045), (0.1, 0.030), (0.35, 0.030), (0.45, 0.045)], period_s: 0.5 }
}

/// A bridge for a tool on that side of the ventricle; the other side is the same, turned about z by half a turn.
fn bridge(daemon: &Daemon, tool: &str, turned: bool, max_force_n: f64) -> Bridge {
    let mut config = lab::config(&daemon.url, arms::simulated(&hand()).device);
    tool.clone_into(&mut config.server.tool);
    config.server.device_name = format!("arm of the {tool}");
    config.limits.max_force_n = max_force_n;
    config.workspace = arms::workspace();
    if turned {
        let origin_m = (-arms::MIDDLE_M).to_array();
        config.workspace =
            WorkspaceConfig { axes: ["-x", "-y", "+z"].map(str::to_owned), origin_m, ..WorkspaceConfig::default() };
    }
    Bridge::start(config)
}

fn look() -> Duration {
    let seconds = std::env::var("PALPATE_LOOK_S").ok().and_then(|text| text.parse().ok()).unwrap_or(3.0);
    Duration::from_secs_f64(seconds)
}

#[test]
fn two_arms_press_the_same_heart_each_with_its_tool_and_its_limits() {
    let scene = root().join("deploy/scenes/two-hands.toml");
    let daemon = Daemon::start(&["--arm", "none", scene.to_str().unwrap()]);
    let finger = bridge(&daemon, "finger", false, 3.0);
    let shaft = bridge(&daemon, "shaft", true, 0.2);
    for arm in [&finger, &shaft] {
        arm.wait("it presses", |handle| handle.stats().force_n() > 0.1);
    }
    let status = daemon.status();
    let mut names: Vec<_> = status["devices"]
        .as_array()
        .unwrap()
        .iter()
        .map(|device| device["device_name"].as_str().unwrap().to_owned())
        .collect();
    names.sort();
    assert_eq!(names, ["arm of the finger", "arm of the shaft"], "{status:#}");

    // The body is pressed from both sides at the same time, and as hard as the hand goes deep. Links of a busy machine
    // withhold forces now and then: how long it takes is not asked.
    let (began, mut together_n) = (Instant::now(), 0.0_f64);
    let pressed = |together_n| {
        let (finger, shaft) = (finger.handle.stats().summary(), shaft.handle.stats().summary());
        together_n > 0.1 && finger.peak_force_n > 0.4 && shaft.saturated > 0
    };
    while began.elapsed() < look() || (!pressed(together_n) && began.elapsed() < PATIENCE) {
        together_n = together_n.max(finger.handle.stats().force_n().min(shaft.handle.stats().force_n()));
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(together_n > 0.1, "{together_n} N at the same time");

    // A tool has one arm. Whoever comes second waits until it is free.
    let third = bridge(&daemon, "finger", false, 3.0);
    third.wait("it was refused", |handle| handle.stats().failures.get() > 2);
    assert!(!third.handle.is_attached() && third.handle.stats().force_n() == 0.0);
    assert!(finger.handle.is_attached() && shaft.handle.is_attached());

    let (one, other) = (finger.stop().unwrap(), shaft.handle.stats().summary());
    third.wait("the tool was free", |handle| handle.is_attached() && handle.stats().force_n() > 0.1);
    for (name, summary) in [("finger", one), ("shaft", other)] {
        println!("{name}:\n{summary}");
        assert!(summary.sent > 0 && summary.received > 0 && summary.non_finite == 0, "{name}: {summary}");
    }
    assert!(one.peak_force_n > 0.4, "{one}");
    let shaft = shaft.stop().unwrap();
    assert!(shaft.peak_force_n <= 0.2 + 1e-9 && shaft.saturated > 0, "its own limit holds: {shaft}");
    assert_eq!(daemon.status()["quarantine"], "");
    third.stop().unwrap();
}
