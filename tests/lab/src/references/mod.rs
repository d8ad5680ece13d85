//! What every problem's answer is: by formula where there is one, otherwise a converged reference, stored with its provenance in
//! `references/NAME.toml` and made again by `palpate-lab references --remake`.
mod command;
mod in_time;
mod make;
mod richardson;
pub mod series;

pub use command::{Options, run};
pub use make::{Solved, on_grid, remake};
pub use richardson::{Limit, limit};

use crate::problems::{Problem, Quantity, body::Body, exact, sample};
use glam::DVec3;
use miette::{Context, IntoDiagnostic, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A problem's answer, with what is known of how good it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Name of the problem.
    pub problem: String,
    /// What happens, in a sentence.
    pub sentence: String,
    /// "N" or "m".
    pub unit: String,
    /// The answer.
    pub value: f64,
    /// Its uncertainty: how far extrapolation went, or the last refinement where it is not to be trusted; 0 by formula.
    pub uncertainty: f64,
    /// How the value was found.
    pub method: String,
    /// Order of convergence seen, if it is credible.
    pub observed_order: Option<f64>,
    /// Relative L2 difference of the displacement fields of the two finest grids.
    pub field_difference: f64,
    /// Provenance.
    pub provenance: Provenance,
    /// Grids, coarse to fine.
    pub grids: Vec<Grid>,
    /// Displacements (µm) of the problem's material points on the finest grid; none in time.
    pub displacements_um: Vec<[f64; 3]>,
    /// The answer (µm) at the end of every tick of a dynamic problem. The value is its root mean square.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub series_um: Vec<f64>,
}

/// How a reference was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// UTC day it was made.
    pub date: String,
    /// The command that makes it again.
    pub command: String,
    /// Elements and solver.
    pub discretisation: String,
    /// Constitutive law.
    pub law: String,
    /// Young's modulus (Pa).
    pub young_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// What was done.
    pub action: String,
}

/// One grid of a reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Elements over one and a half radii of the contact (`n` of `reference::bodies`).
    pub elements_over_contact: usize,
    /// Unknowns.
    pub unknowns: usize,
    /// Answer.
    pub value: f64,
    /// Newton iterations; substeps per tick in time.
    pub iterations: usize,
}

impl Reference {
    /// Displacements (m) of the problem's material points.
    pub fn displacements_m(&self) -> Vec<DVec3> {
        self.displacements_um.iter().map(|u| DVec3::from(*u) * 1e-6).collect()
    }

    /// The answer (m) of a dynamic problem at the end of every tick.
    pub fn series_m(&self) -> Vec<f64> {
        self.series_um.iter().map(|u| u * 1e-6).collect()
    }

    /// The answer of a problem: by formula, or as stored.
    ///
    /// # Errors
    /// No formula and no file, or a file that cannot be read.
    pub fn of(problem: &Problem) -> Result<Self> {
        if let Some(reference) = by_formula(problem) {
            return Ok(reference);
        }
        let path = path(problem);
        let text = std::fs::read_to_string(&path).into_diagnostic().wrap_err_with(|| {
            format!(
                "the reference of {} is missing ({}); make it with `palpate-lab references {}`",
                problem.name,
                path.display(),
                problem.name
            )
        })?;
        toml::from_str(&text).into_diagnostic().wrap_err_with(|| format!("{} cannot be read", path.display()))
    }
}

/// Where a problem's reference is stored: in the source tree, for that is where it is made and kept.
pub fn path(problem: &Problem) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("references").join(format!("{}.toml", problem.name))
}

fn by_formula(problem: &Problem) -> Option<Reference> {
    let value = exact::answer_m(problem)?;
    let radial = |s: &sample::Sample| (s.rest_m.normalize_or_zero() * value * 1e6).to_array();
    let method = match problem.body {
        Body::Octant => "Lamé's formula, linear elasticity",
        _ => "Reissner's beam by shooting",
    };
    Some(Reference {
        problem: problem.name.clone(),
        sentence: problem.sentence.clone(),
        unit: Quantity::Displacement.unit().into(),
        value,
        uncertainty: 0.0,
        method: method.into(),
        observed_order: None,
        field_difference: 0.0,
        provenance: Provenance::default(),
        grids: vec![],
        displacements_um: sample::points(problem.body).iter().map(radial).collect(),
        series_um: vec![],
    })
}
