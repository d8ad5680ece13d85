//! The page in a real browser: headless Chromium, driven by `browser/page.mjs`, against the real daemon.
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
use palpate_system_tests::{programs, root};
use std::process::Command;

#[test]
fn page_shows_the_dent_and_comes_back_after_a_restart() {
    let browser = root().join("tests/system/browser");
    assert!(
        browser.join("node_modules/playwright-core").exists(),
        "the browser's driver is not installed: run tests/run, which installs it (npm ci in tests/system/browser)"
    );
    let artefacts = root().join("tests/system/artefacts");
    let output = Command::new("node")
        .arg(browser.join("page.mjs"))
        .arg(programs::path_of("palpated"))
        .arg(&artefacts)
        .args(std::env::var_os("CHROMIUM"))
        .output()
        .expect("node runs; tests/run installs what is missing");
    let text = String::from_utf8_lossy(&output.stdout);
    println!("{text}");
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
}
