//! The page in a real browser: headless Chromium, driven by `browser/*.mjs`, against the real daemon.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a test that cannot start its subject has failed
use palpate_system_tests::{programs, root};
use std::{
    path::Path,
    process::Command,
    sync::{Mutex, PoisonError},
};

/// A browser without a graphics card takes two processors whole: beside another, what is timed in it is late.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Runs a script of `browser`, which gets the daemon, these arguments, and where pictures go.
fn drive(script: &str, arguments: &[&Path]) {
    let browser = root().join("tests/system/browser");
    assert!(
        browser.join("node_modules/playwright-core").exists(),
        "the browser's driver is not installed: run tests/run, which installs it (npm ci in tests/system/browser)"
    );
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let output = Command::new("node")
        .arg(browser.join(script))
        .arg(programs::path_of("palpated"))
        .args(arguments)
        .arg(root().join("tests/system/artefacts"))
        .args(std::env::var_os("CHROMIUM"))
        .output()
        .expect("node runs; tests/run installs what is missing");
    let text = String::from_utf8_lossy(&output.stdout);
    println!("{text}");
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn page_shows_the_dent_and_comes_back_after_a_restart() {
    drive("page.mjs", &[]);
}

#[test]
fn page_draws_the_surface_refined_near_tools_when_asked() {
    drive("refined.mjs", &[&root().join("deploy/scenes/hybrid-block.toml")]);
}

#[test]
fn page_shows_active_particles_when_asked() {
    drive("particles.mjs", &[&root().join("deploy/scenes/hybrid-block.toml")]);
}

#[test]
fn page_takes_a_token_from_its_address() {
    drive("token.mjs", &[]);
}

#[test]
fn page_of_others_may_do_nothing() {
    drive("strangers.mjs", &[]);
}
