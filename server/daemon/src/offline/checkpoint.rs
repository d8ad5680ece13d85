//! Where a run over time goes on after it was interrupted, or its machine died: to the same bits as without a break.
use super::{args::OutputArgs, folder, plan::Plan, probe_rows::RowsMark, walls::WallNumbers};
use crate::{
    strained::Seen,
    whole_file::{self, PUBLIC},
};
use miette::{Diagnostic, IntoDiagnostic, WrapErr};
use palpate_physics::{Model, State, snapshot};
use serde::{Deserialize, Serialize};
use std::{
    fs, io,
    path::PathBuf,
    time::{Duration, Instant},
};
use thiserror::Error;

/// Changes with what a checkpoint holds.
const FORMAT: u32 = 1;

/// A run after one of its ticks, and what it had written by then.
pub(super) struct Checkpoint {
    pub(super) plan: Plan,
    pub(super) state: State,
    pub(super) rows: RowsMark,
    /// Of frames (s).
    pub(super) frame_times_s: Vec<f64>,
    pub(super) most_awake: usize,
    /// How far (m) each tool slipped from its device at most, and when (s).
    pub(super) slips: Vec<(f64, f64)>,
    pub(super) seen: Seen,
    pub(super) walls: WallNumbers,
}

/// The file; with the state as a snapshot, which knows its model.
#[derive(Serialize, Deserialize)]
struct File {
    scene: String,
    /// What stands in the scene's file; nothing of a built-in one.
    scene_text: String,
    plan: Plan,
    snapshot: Vec<u8>,
    rows: RowsMark,
    frame_times_s: Vec<f64>,
    most_awake: usize,
    slips: Vec<(f64, f64)>,
    seen: Seen,
    walls: WallNumbers,
}

/// Why a run does not go on.
#[derive(Debug, Error, Diagnostic)]
enum NotResumed {
    #[error("the run in {} does not go on: {reason}", path.display())]
    #[diagnostic(help("give the same scene and options as before, or begin anew with --force in place of --resume"))]
    Other { path: PathBuf, reason: String },
    #[error("{} is no checkpoint that this version of palpated reads", path.display())]
    #[diagnostic(help("begin anew with --force in place of --resume"))]
    Unreadable { path: PathBuf },
}

/// Checkpoints of a run that writes into a folder.
pub(super) struct Checkpoints {
    path: Option<PathBuf>,
    scene: String,
    every: Duration,
    last: Instant,
}

impl Checkpoints {
    /// One every so many seconds of wall time.
    pub(super) fn new(output: &OutputArgs, every_s: f64) -> Self {
        let path = output.out.as_ref().map(|out| out.join(folder::CHECKPOINT));
        let every = Duration::try_from_secs_f64(every_s).unwrap_or(Duration::MAX);
        Self { path, scene: output.scene.clone(), every, last: Instant::now() }
    }

    fn scene_text(&self) -> String {
        fs::read_to_string(&self.scene).unwrap_or_default()
    }

    /// Whether it is time for one.
    pub(super) fn are_due(&self) -> bool {
        self.path.is_some() && self.last.elapsed() >= self.every
    }

    /// Writes one in the place of the one before, which is there until this one is.
    pub(super) fn write(&mut self, checkpoint: &Checkpoint, model: &Model) -> miette::Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        let Checkpoint { plan, state, rows, frame_times_s, most_awake, slips, seen, walls } = checkpoint;
        let file = File {
            scene: self.scene.clone(),
            scene_text: self.scene_text(),
            plan: plan.clone(),
            snapshot: snapshot::save(model, state),
            rows: rows.clone(),
            frame_times_s: frame_times_s.clone(),
            most_awake: *most_awake,
            slips: slips.clone(),
            seen: *seen,
            walls: *walls,
        };
        let refused = || format!("cannot write {}", path.display());
        let bytes = postcard::to_allocvec(&(FORMAT, file)).into_diagnostic().wrap_err_with(refused)?;
        whole_file::write(path, &bytes, PUBLIC).into_diagnostic().wrap_err_with(refused)?;
        self.last = Instant::now();
        Ok(())
    }

    /// The one in the folder, if there is one.
    ///
    /// # Errors
    /// It cannot be read, or is of another run.
    pub(super) fn read(&self, plan: &Plan, model: &Model) -> miette::Result<Option<Checkpoint>> {
        let Some(path) = &self.path else { return Ok(None) };
        let bytes = match fs::read(path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => {
                return Err(error).into_diagnostic().wrap_err_with(|| format!("cannot read {}", path.display()));
            }
        };
        let file: File = match postcard::from_bytes(&bytes) {
            Ok((FORMAT, file)) => file,
            _ => return Err(NotResumed::Unreadable { path: path.clone() }.into()),
        };
        let other = |reason: String| NotResumed::Other { path: path.clone(), reason };
        if file.scene != self.scene {
            return Err(other(format!("it is one of the scene {}", file.scene)).into());
        }
        if file.scene_text != self.scene_text() {
            return Err(other("the scene's file has changed".to_owned()).into());
        }
        if file.plan != *plan {
            return Err(other("its duration, or when it samples or writes frames, is another".to_owned()).into());
        }
        let state = snapshot::restore(model, &file.snapshot).map_err(|error| other(error.to_string()))?;
        let File { plan, rows, frame_times_s, most_awake, slips, seen, walls, .. } = file;
        Ok(Some(Checkpoint { plan, state, rows, frame_times_s, most_awake, slips, seen, walls }))
    }

    /// The run is over: nothing is left to go on with.
    pub(super) fn remove(&self) {
        // One that is left is of a run that has ended: resumed, it ends so once more.
        let _ = self.path.as_ref().map(fs::remove_file);
    }
}
