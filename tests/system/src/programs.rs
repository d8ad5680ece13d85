//! The real programs, built once in the profile of the running test and started as processes.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a test that cannot start its subject has failed

use std::{
    io::{BufRead, BufReader, Read},
    path::PathBuf,
    process::{Child, Command, ExitStatus, Stdio},
    sync::{Once, mpsc},
    thread,
    time::{Duration, Instant},
};

static BUILD: Once = Once::new();

/// Path of a program of this workspace (`examples/NAME`: of an example), built if need be.
pub fn path_of(program: &str) -> PathBuf {
    BUILD.call_once(build);
    profile_dir().join(program)
}

/// `target/<profile>`: the test's own executable lies in its `deps`.
fn profile_dir() -> PathBuf {
    let test = std::env::current_exe().expect("the running test has a path");
    test.ancestors().nth(2).expect("target/<profile>/deps/<test>").to_path_buf()
}

fn build() {
    let release = profile_dir().file_name().is_some_and(|name| name == "release");
    let mut cargo = Command::new(env!("CARGO"));
    // With the tests, as `cargo test --workspace` builds them: the programs alone would choose other features of shared
    // dependencies, and compile most of them once more.
    cargo.args(["build", "--quiet", "--workspace", "--bins", "--examples", "--tests"]);
    // Without what cargo tells a running test of its package: build scripts that read these variables (ring's) would
    // run anew, and everything above them would be compiled once more.
    for (name, _) in std::env::vars_os() {
        let of_package = |name: &str| name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_");
        if name.to_str().is_some_and(of_package) {
            cargo.env_remove(name);
        }
    }
    cargo.current_dir(crate::root()).env("CARGO_TARGET_DIR", profile_dir().parent().expect("target"));
    if release {
        cargo.arg("--release");
    }
    assert!(cargo.status().expect("cargo runs").success(), "the programs do not build");
}

/// A running program whose output is collected; killed when dropped.
pub struct Program {
    child: Child,
    lines: mpsc::Receiver<String>,
    /// Everything printed so far, both streams.
    pub output: String,
}

impl Program {
    /// Starts a program of this workspace.
    pub fn start(program: &str, arguments: &[&str]) -> Self {
        Self::of(Command::new(path_of(program)).args(arguments))
    }

    /// Starts one in a network namespace.
    pub fn start_in(namespace: &str, program: &str, arguments: &[&str]) -> Self {
        // `ip` becomes the program: signals reach it.
        Self::of(Command::new("ip").args(["netns", "exec", namespace]).arg(path_of(program)).args(arguments))
    }

    fn of(command: &mut Command) -> Self {
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let (send, lines) = mpsc::channel();
        collect(child.stdout.take().expect("piped"), send.clone());
        collect(child.stderr.take().expect("piped"), send);
        Self { child, lines, output: String::new() }
    }

    /// Waits until a printed line contains `text`, and returns the line.
    pub fn wait_for(&mut self, text: &str, patience: Duration) -> String {
        let end = Instant::now() + patience;
        while let Ok(line) = self.lines.recv_timeout(end.saturating_duration_since(Instant::now())) {
            self.output.push_str(&line);
            self.output.push('\n');
            if line.contains(text) {
                return line;
            }
        }
        panic!("no line with \"{text}\" within {patience:?}; printed so far:\n{}", self.output);
    }

    /// Nobody reads what it prints from now on: after one more line on each, its standard streams are broken pipes.
    pub fn leave_unread(&mut self) {
        self.lines = mpsc::channel().1;
    }

    /// What it has printed so far, both streams; and how it ended, if it has.
    pub fn said(&mut self) -> String {
        while let Ok(line) = self.lines.try_recv() {
            self.output.push_str(&line);
            self.output.push('\n');
        }
        match self.child.try_wait() {
            Ok(Some(status)) => format!("{}ended: {status}", self.output),
            _ => self.output.clone(),
        }
    }

    /// Resident memory (bytes).
    pub fn resident_bytes(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).expect("the child runs");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("the system tells");
        1024 * line.split_whitespace().next().expect("a number").parse::<u64>().expect("a number")
    }

    /// Sends SIGKILL, and waits for the end.
    pub fn kill(&mut self) {
        self.child.kill().expect("the child runs");
        self.child.wait().expect("the child can be waited for");
    }

    /// Sends SIGTERM.
    pub fn terminate(&self) {
        self.signal(rustix::process::Signal::TERM);
    }

    /// Sends SIGHUP.
    pub fn hang_up(&self) {
        self.signal(rustix::process::Signal::HUP);
    }

    /// Sends SIGUSR1.
    pub fn recover(&self) {
        self.signal(rustix::process::Signal::USR1);
    }

    fn signal(&self, signal: rustix::process::Signal) {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, signal).expect("the child runs");
    }

    /// Waits for the end; the rest of the output is in `output`.
    pub fn wait(&mut self, patience: Duration) -> ExitStatus {
        let end = Instant::now() + patience;
        loop {
            if let Some(status) = self.child.try_wait().expect("the child can be waited for") {
                while let Ok(line) = self.lines.recv_timeout(Duration::from_millis(200)) {
                    self.output.push_str(&line);
                    self.output.push('\n');
                }
                return status;
            }
            assert!(Instant::now() < end, "still running after {patience:?}; printed so far:\n{}", self.output);
            thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // Already ended: nothing to do, and nothing to complain about.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn collect(stream: impl Read + Send + 'static, send: mpsc::Sender<String>) {
    thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            if send.send(line).is_err() {
                return;
            }
        }
    });
}
