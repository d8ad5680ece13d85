//! Every problem has its reference, and making one again gives what is stored.
#![allow(clippy::unwrap_used)] // a test that cannot build its subject has failed
use palpate_lab::{
    problems::{self, exact, sample},
    references::{self, Reference},
};

#[test]
fn every_problem_has_a_reference_that_fits_it() {
    for problem in problems::all() {
        let reference = Reference::of(&problem).unwrap();
        assert_eq!(reference.problem, problem.name);
        assert_eq!(reference.unit, problem.quantity().unit(), "{}", problem.name);
        assert!(reference.value > 0.0 && reference.uncertainty >= 0.0, "{}", problem.name);
        let points = if problem.motion.ticks().is_some() { 0 } else { sample::points(problem.body).len() };
        assert_eq!(reference.displacements_um.len(), points, "{}", problem.name);
        assert_eq!(reference.series_um.len(), problem.motion.ticks().unwrap_or(0), "{}", problem.name);
        if exact::answer_m(&problem).is_none() {
            let p = &reference.provenance;
            assert_eq!(reference.grids.len(), 3, "{}", problem.name);
            assert_eq!(p.poisson_ratio, problem.poisson_ratio, "{}", problem.name);
            assert_eq!(p.law, format!("{:?}", problem.law), "{}", problem.name);
            let action = format!("{:?}", problem.action);
            assert!(p.action.starts_with(&action), "{}: stored for {}, is {action}", problem.name, p.action);
            if problem.motion.ticks().is_some() {
                let motion = format!("{:?}", problem.motion);
                assert!(p.action.contains(&motion), "{}: stored for {}, is {motion}", problem.name, p.action);
            }
        }
    }
}

/// No file is left of a problem that was renamed or given up.
#[test]
fn every_file_belongs_to_a_problem() {
    let paths: Vec<_> = problems::all().iter().map(references::path).collect();
    for entry in paths[0].parent().unwrap().read_dir().unwrap() {
        assert!(paths.contains(&entry.as_ref().unwrap().path()), "{entry:?}");
    }
}

#[test]
fn making_a_grid_again_gives_what_is_stored() {
    let problem = problems::all().into_iter().find(|p| p.name == "block-patch-small-nu0.45").unwrap();
    let stored = &Reference::of(&problem).unwrap().grids[0];
    let again = references::on_grid(&problem, stored.elements_over_contact, 0.0, &mut |_| {}).unwrap().grid;
    assert_eq!((again.unknowns, again.iterations), (stored.unknowns, stored.iterations));
    // Newton stops at a relative residual of 1e-9.
    assert!((again.value / stored.value - 1.0).abs() < 1e-8, "{} {}", again.value, stored.value);
}
