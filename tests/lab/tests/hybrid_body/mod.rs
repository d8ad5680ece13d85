//! A hybrid body at rest under a load, against the lab's references.
#![allow(clippy::unwrap_used)] // helpers of tests
use palpate_lab::{
    fine_levels::{CoarseMesh, PlacesOf, Setting, methods::Points},
    problems::{self, Problem},
};
use palpate_physics::bodies::hybrid::partition::Partition;
use std::collections::BTreeSet;

/// A hybrid body whose skin is the boundary of a fine mesh.
pub(crate) struct Case {
    /// What is said of it.
    pub(crate) name: String,
    pub(crate) coarse_tets: u32,
    pub(crate) skin_tets: u32,
    pub(crate) spacing_m: f64,
    /// Active particles: those nearest to the touch.
    pub(crate) active: usize,
    /// What integrates the fine level in place of cells.
    pub(crate) points: Option<MakePoints>,
    /// What points of the skin move with, in place of the particles of their cell.
    pub(crate) places: Option<PlacesOf>,
}

/// Points over the active particles.
pub(crate) type MakePoints = Box<dyn Fn(&Partition, &BTreeSet<u32>) -> Points>;

/// Relative error of the answer, and of the field in L2.
pub(crate) fn error(problem: &Problem, case: &Case) -> (f64, f64) {
    let mesh = CoarseMesh::Made(case.coarse_tets);
    let setting = Setting::new(problem.clone(), mesh, case.skin_tets, case.spacing_m).unwrap();
    let errors = setting.errors(case.active, case.points.as_deref(), case.places).unwrap();
    println!(
        "{}, {}: {} coarse tets ({} corners outside), {} active, {} cells or points: answer {:+.1} %, field {:.1} %",
        case.name,
        problem.name,
        setting.coarse_tets(),
        setting.outside(),
        case.active,
        errors.points,
        100.0 * errors.answer,
        100.0 * errors.field.l2
    );
    (errors.answer, errors.field.l2)
}

pub(crate) fn problem(name: &str) -> Problem {
    problems::all().into_iter().find(|p| p.name == name).unwrap()
}
