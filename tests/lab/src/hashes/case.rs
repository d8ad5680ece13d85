//! A scene, how much of it is run, and what is done to it.
use glam::DVec3;
use miette::{IntoDiagnostic, Result, WrapErr};
use palpate_physics::{Model, PointForce, Scratch, State, bodies::mass_spring::constants_table, contact::ToolTarget};
use palpate_scene::{Limits, Scene, ToCalibrate};
use std::path::{Path, PathBuf};

/// Where a scene comes from.
#[derive(Debug, Clone)]
pub(super) enum Source {
    /// A file.
    File(PathBuf),
    /// Its text.
    Text(String),
    /// Its text, which asks for a table of spring constants named `table.json`; that is made first.
    Calibrated(String),
}

/// What a tick is given.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Drive {
    pub(super) tools: Vec<ToolTarget>,
    pub(super) load_factors: Vec<f64>,
    pub(super) prescribed_m: Vec<DVec3>,
    pub(super) point_forces: Vec<PointForce>,
}

/// Just before a tick.
pub(super) struct Moment<'a> {
    /// Its number, from 1.
    pub(super) tick: u64,
    /// The time at its end (s), as the scene counts it.
    pub(super) time_s: f64,
    pub(super) model: &'a Model,
    pub(super) state: &'a mut State,
    pub(super) scratch: &'a mut Scratch,
    /// What the scene gives it.
    pub(super) drive: &'a mut Drive,
}

/// A scene whose bits are kept.
#[derive(Debug, Clone)]
pub struct Case {
    /// Name, without blanks.
    pub name: String,
    pub(super) source: Source,
    /// Ticks that are run; the whole scene where `None`.
    pub(super) ticks: Option<u64>,
    /// What a scene's text cannot say.
    pub(super) change: fn(&mut Scene),
    /// What else happens before each tick.
    pub(super) act: fn(&mut Moment<'_>),
    /// When (s) its equilibrium is looked for; infinite: with what its loads settle to.
    pub(super) rests_at_s: Option<f64>,
    /// How many natural modes are looked for.
    pub(super) modes: usize,
}

impl Case {
    /// A small scene of which so many ticks are run.
    pub(super) fn of_text(name: impl Into<String>, ticks: u64, text: String) -> Self {
        Self::of(name.into(), Source::Text(text), Some(ticks))
    }

    pub(super) fn of(name: String, source: Source, ticks: Option<u64>) -> Self {
        Self { name, source, ticks, change: |_| {}, act: |_| {}, rests_at_s: None, modes: 0 }
    }

    pub(super) fn changed(self, change: fn(&mut Scene)) -> Self {
        Self { change, ..self }
    }

    pub(super) fn acting(self, act: fn(&mut Moment<'_>)) -> Self {
        Self { act, ..self }
    }

    pub(super) fn resting_at(self, time_s: f64) -> Self {
        Self { rests_at_s: Some(time_s), ..self }
    }

    pub(super) fn with_modes(self, modes: usize) -> Self {
        Self { modes, ..self }
    }

    /// Whether there is more of the scene.
    pub(super) fn is_cut(&self) -> bool {
        self.ticks.is_some() && !self.name.contains('/')
    }

    /// The same scene to its end.
    pub(super) fn whole(&self) -> Self {
        Self { name: format!("{}/whole", self.name), ticks: None, rests_at_s: None, modes: 0, ..self.clone() }
    }

    /// Loads the scene.
    pub(super) fn scene(&self) -> Result<Scene> {
        let quiet = &mut |_: f64, _: &str| {};
        let limits = Limits::local();
        let mut scene = match &self.source {
            Source::File(path) => palpate_scene::load_file(path, &limits, quiet)?,
            Source::Text(text) => palpate_scene::parse(text, &self.name, None, &limits, quiet)?,
            Source::Calibrated(text) => calibrated(text, &limits)?,
        };
        (self.change)(&mut scene);
        Ok(scene)
    }
}

/// Loads a scene after its table was made, as `palpated calibrate` makes it, from the fewest vertices.
fn calibrated(text: &str, limits: &Limits) -> Result<Scene> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    let path = folder.path().join("scene.toml");
    write(&path, text)?;
    let ToCalibrate { surface, coarse, rings, table } = palpate_scene::to_calibrate(&path, limits)?;
    let ratio = coarse.mesh_n_per_m / coarse.anchor_n_per_m;
    let of = constants_table::Calibration { coarse, rings, ratio, samples: 2 };
    let found = constants_table::ConstantsTable::calibrate(&surface, of, &mut |_| {}).into_diagnostic()?;
    write(&table, &serde_json::to_string(&found).into_diagnostic()?)?;
    Ok(palpate_scene::load_file(&path, limits, &mut |_, _| {})?)
}

fn write(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text).into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))
}
