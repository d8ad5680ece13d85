//! Bridge and daemon on two machines, as far as the kernel is concerned: each in a network namespace of its own, with a cable between them that is pulled and put in again.
//! Nobody is told when a cable is pulled: no connection ends, the packets stay away.
//!
//! Namespaces want root and `ip` (iproute2). Without them this test says so and does nothing. Where the kernel has `netem` the cable is also a slow one that loses packets.
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
mod lab;

use lab::{
    arms::{self, Hand},
    outliving::Lab,
};
use palpate_system_tests::{daemon::PATIENCE, programs::Program};
use std::{
    process::Command,
    time::{Duration, Instant},
};

/// Two namespaces and a cable; gone when dropped.
struct Machines {
    daemon: String,
    bridge: String,
}

impl Machines {
    const DAEMON_ADDRESS: &str = "10.203.7.1";

    /// `Err`: what this machine does not allow.
    fn new() -> Result<Self, String> {
        let id = std::process::id();
        let machines = Self { daemon: format!("palpate-d{id}"), bridge: format!("palpate-b{id}") };
        let Self { daemon, bridge } = &machines;
        for words in [
            format!("netns add {daemon}"),
            format!("netns add {bridge}"),
            format!("link add cable netns {daemon} type veth peer name cable netns {bridge}"),
            format!("-n {daemon} addr add {}/24 dev cable", Self::DAEMON_ADDRESS),
            format!("-n {bridge} addr add 10.203.7.2/24 dev cable"),
            format!("-n {daemon} link set cable up"),
            format!("-n {bridge} link set cable up"),
        ] {
            run("ip", &words)?;
        }
        Ok(machines)
    }

    fn cable(&self, state: &str) {
        run("ip", &format!("-n {} link set cable {state}", self.bridge)).unwrap();
    }
}

impl Drop for Machines {
    fn drop(&mut self) {
        for name in [&self.daemon, &self.bridge] {
            let _ = run("ip", &format!("netns del {name}"));
        }
    }
}

fn run(program: &str, words: &str) -> Result<(), String> {
    let output =
        Command::new(program).args(words.split(' ')).output().map_err(|error| format!("{program}: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    if output.status.success() { Ok(()) } else { Err(format!("{program} {words}: {}", said.trim())) }
}

#[test]
fn a_pulled_cable_leaves_no_force_and_the_arm_comes_back() {
    let machines = match Machines::new() {
        Ok(machines) => machines,
        Err(why) => return println!("not tried here: {why}"),
    };
    let listen = format!("{}:7411", Machines::DAEMON_ADDRESS);
    let folder = tempfile::tempdir().unwrap();
    let scene = lab::light_ventricle(folder.path());
    // Nobody else is on that cable.
    let arguments = ["serve", "--arm", "none", &scene, "--listen", &listen, "--trust-the-network"];
    let mut daemon = Program::start_in(&machines.daemon, "palpated", &arguments);
    daemon.wait_for(&listen, PATIENCE);
    // It stays pressed for longer than the cable is out: the force ends because it is taken away.
    let keys = vec![(0.0, 0.050), (0.1, 0.050), (0.4, 0.028), (3.9, 0.028), (4.2, 0.050)];
    let hand = Hand { keys, period_s: 4.2 };
    let lab = Lab::new(arms::woodenhaptics(&hand), &format!("http://{listen}"));
    let mut bridge = Program::start_in(&machines.bridge, "palpate-bridge", &lab.arguments());
    for out_ms in [100, 3000] {
        lab.wait("it presses", |force_n| force_n > 0.1);
        machines.cable("down");
        println!("pulled: without force after {:?}", lab.wait_for_end());
        // Shorter than it takes to notice that nobody answers, and longer.
        let until = Instant::now() + Duration::from_millis(out_ms);
        while Instant::now() < until {
            assert_eq!(lab.force_n(), 0.0, "a cable that is not there carries no force");
            std::thread::sleep(Duration::from_millis(1));
        }
        machines.cable("up");
    }
    lab.wait("it presses again", |force_n| force_n > 0.1);
    let netem = format!("netns exec {} tc qdisc add dev cable root netem delay 2ms 1ms loss 5%", machines.bridge);
    match run("ip", &netem) {
        Ok(()) => lab.wait("it presses on a slow cable", |force_n| force_n > 0.01),
        Err(why) => println!("no slow cable here: {why}"),
    }
    bridge.terminate();
    assert!(bridge.wait(PATIENCE).success(), "{}", bridge.output);
    assert_eq!(lab.force_n(), 0.0);
}
