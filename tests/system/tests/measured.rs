//! `palpate-bridge measure`, as a user runs it: over a good link, and over one that no force may be given over.
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
mod lab;

use lab::network::{Conditions, Network};
use palpate_system_tests::{daemon::Daemon, programs};
use std::{
    path::Path,
    process::{Command, Output},
};

fn measure(url: &str, picture: &Path) -> Output {
    let config = picture.with_extension("toml");
    // How well a machine that runs tests keeps time is not asked: the watchdog is patient, the network is not that patient.
    let text = format!("[server]\nurl = \"{url}\"\n[watchdog]\nfresh_for_s = 0.1\nstale_after_s = 0.2\n");
    std::fs::write(&config, text).unwrap();
    Command::new(programs::path_of("palpate-bridge"))
        .args(["measure", "--time-s", "1", "--config"])
        .arg(config)
        .arg("--svg")
        .arg(picture)
        .output()
        .unwrap()
}

#[test]
fn a_link_is_measured_and_one_that_is_too_slow_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let daemon = Daemon::start(&["--arm", "none", &lab::light_ventricle(folder.path())]);
    let network = Network::to(&daemon.url, 4);
    let good = measure(&network.url(), &folder.path().join("good.svg"));
    let said = String::from_utf8_lossy(&good.stdout);
    assert_eq!(good.status.code(), Some(0), "{said}{}", String::from_utf8_lossy(&good.stderr));
    assert!(said.contains("success") && said.contains(": good") && said.contains("gains"), "{said}");
    let picture = std::fs::read_to_string(folder.path().join("good.svg")).unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("from a pose to the force"), "{picture}");

    network.set(Conditions { delay_ms: 150, ..Conditions::default() });
    let slow = measure(&network.url(), &folder.path().join("slow.svg"));
    let said = String::from_utf8_lossy(&slow.stdout);
    assert_eq!(slow.status.code(), Some(2), "{said}{}", String::from_utf8_lossy(&slow.stderr));
    assert!(said.contains("NO FORCE"), "{said}");
    // It was measured without a force, and nobody is attached any more.
    daemon.wait_until("the tool is free", |status| status["devices"].as_array().is_some_and(Vec::is_empty));
}
