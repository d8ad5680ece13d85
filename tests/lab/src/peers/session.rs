//! A peer's script at work: it is given a problem, brings its variants to rest, and waits to be asked for times.
use super::{FORMAT, PREFIX, Settled, Task, Times, environment::last_line};
use crate::measure::Row;
use glam::DVec3;
use miette::{Context, IntoDiagnostic, Result, ensure, miette};
use std::{
    fs::{self, File},
    io::{BufRead, BufReader, Write},
    path::Path,
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};
use tempfile::TempDir;

/// What numerical libraries take their number of threads from.
const THREADS: [&str; 4] = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"];

/// A running script; it ends with this value.
#[derive(Debug)]
pub struct Session {
    child: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
    folder: TempDir,
    settled: Settled,
    problem: String,
    resolution: u32,
    elements: usize,
    nodes: usize,
    times_s: Vec<Vec<f64>>,
    failure: String,
}

/// A variant's row, not judged yet.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Names, sizes, failure.
    pub row: Row,
    /// Answers of the last ticks.
    pub answers: Vec<f64>,
    /// Displacements (m) of all nodes.
    pub displacements_m: Vec<DVec3>,
    /// Times (s) of ticks.
    pub times_s: Vec<f64>,
}

impl Session {
    /// Starts a script on a task, on this thread's processor, and waits until it is at rest.
    ///
    /// # Errors
    /// A script that cannot be run, fails, or answers something else; with the last line of what it said.
    pub fn start(python: &Path, script: &Path, task: &Task, resolution: u32) -> Result<Self> {
        let folder = tempfile::tempdir().into_diagnostic()?;
        let file = folder.path().join("task.json");
        fs::write(&file, serde_json::to_string(task).into_diagnostic()?).into_diagnostic()?;
        let said = File::create(folder.path().join("said")).into_diagnostic()?;
        let mut command = Command::new(python);
        command.arg(script).arg(&file).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(said);
        // Some libraries leave logs where they are started.
        command.current_dir(folder.path());
        command.envs(THREADS.map(|name| (name, "1"))).env("PYTHONDONTWRITEBYTECODE", "1");
        let mut child =
            command.spawn().into_diagnostic().wrap_err_with(|| format!("{} cannot be run", python.display()))?;
        let (Some(stdin), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(miette!("{} has no pipes", python.display()));
        };
        let mut session = Self {
            child,
            stdin,
            stdout: BufReader::new(stdout),
            folder,
            settled: Settled { format: FORMAT, peer: String::new(), rows: vec![] },
            problem: task.problem.clone(),
            resolution,
            elements: task.tets.len(),
            nodes: task.rest_positions_m.len(),
            times_s: vec![],
            failure: String::new(),
        };
        let line = session.line()?;
        session.settled = serde_json::from_str(&line).into_diagnostic().wrap_err("it answered something else")?;
        let (settled, nodes) = (&session.settled, session.nodes);
        ensure!(settled.format == FORMAT, "it answers in format {}, the lab reads {FORMAT}", settled.format);
        let fits = |row: &super::SettledRow| !row.failure.is_empty() || row.displacements_m.len() == nodes;
        ensure!(settled.rows.iter().all(fits), "it answered with another number of nodes");
        session.times_s = vec![vec![]; session.settled.rows.len()];
        Ok(session)
    }

    /// Has ticks of all variants timed, in turns: a number of rounds, or as many as fit into some seconds for each.
    pub fn time(&mut self, rounds: usize, seconds: f64) {
        if !self.failure.is_empty() {
            return;
        }
        if let Err(error) = self.more_times(rounds, seconds) {
            self.failure = error.to_string();
        }
    }

    fn more_times(&mut self, rounds: usize, seconds: f64) -> Result<()> {
        writeln!(self.stdin, "time {rounds} {seconds}").into_diagnostic()?;
        self.stdin.flush().into_diagnostic()?;
        let line = self.line()?;
        let times: Times = serde_json::from_str(&line).into_diagnostic()?;
        ensure!(times.times_s.len() == self.times_s.len(), "it timed another number of variants");
        for (all, more) in self.times_s.iter_mut().zip(times.times_s) {
            all.extend(more);
        }
        Ok(())
    }

    /// Law and settings of each variant, by its method's name.
    pub fn settings(&self) -> impl Iterator<Item = (String, String)> {
        let text = |row: &super::SettledRow| (self.method(&row.name), format!("{}. Law: {}.", row.settings, row.law));
        self.settled.rows.iter().map(text)
    }

    /// What was measured.
    pub fn variants(&self) -> Vec<Variant> {
        let rows = self.settled.rows.iter().zip(&self.times_s);
        rows.map(|(settled, times_s)| Variant {
            row: Row {
                problem: self.problem.clone(),
                method: self.method(&settled.name),
                competes: settled.same_law,
                resolution: self.resolution,
                elements: self.elements,
                nodes: self.nodes,
                substeps: settled.steps_per_tick,
                failure: if settled.failure.is_empty() { self.failure.clone() } else { settled.failure.clone() },
                ..Row::default()
            },
            answers: settled.answers_m.clone(),
            displacements_m: settled.displacements_m.iter().map(|u| DVec3::from(*u)).collect(),
            times_s: times_s.clone(),
        })
        .collect()
    }

    fn method(&self, name: &str) -> String {
        format!("{PREFIX}{} {name}", self.settled.peer).replace(',', ";")
    }

    /// A line of the script's, or why there is none.
    fn line(&mut self) -> Result<String> {
        let mut line = String::new();
        let read = self.stdout.read_line(&mut line).into_diagnostic()?;
        if read > 0 {
            return Ok(line);
        }
        let status = self.child.wait().into_diagnostic()?;
        let said = fs::read_to_string(self.folder.path().join("said")).unwrap_or_default();
        Err(miette!("its script ended ({status}): {}", last_line(&said)))
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // The script may be in the middle of something: nobody waits for its answer any more.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
