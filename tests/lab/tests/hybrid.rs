//! The hybrid body at rest under the small patch, against the lab's references.
mod hybrid_body;

use hybrid_body::{Case, error, problem};
use palpate_lab::problems::place::Place;

fn cells(coarse_tets: u32, skin_tets: u32, spacing_m: f64) -> Case {
    Case { name: "cells".into(), coarse_tets, skin_tets, spacing_m, active: 600, points: None, places: None }
}

#[test]
fn with_six_hundred_particles_the_block_answers_as_the_fine_solid() {
    for (nu, most) in [("0.30", 0.02), ("0.45", 0.02), ("0.49", 0.05)] {
        let case = cells(4, 32, 2.5e-3);
        let (answer, field) = error(&problem(&format!("block-patch-small-nu{nu}")), &case);
        assert!(answer.abs() < most && field < 0.08, "{nu}: {answer} {field}");
    }
}

#[test]
fn with_six_hundred_particles_the_ventricle_answers_as_the_fine_solid() {
    for nu in ["0.30", "0.45", "0.49"] {
        let case = cells(400, 150_000, 3.2e-3);
        let (answer, field) = error(&problem(&format!("ventricle-patch-small-nu{nu}")), &case);
        assert!(answer.abs() < 0.02 && field < 0.05, "{nu}: {answer} {field}");
    }
}

#[test]
fn so_it_does_at_five_places_on_few_coarse_tets_too() {
    for place in Place::ALL {
        let problem = problem(&format!("{}-patch-small-nu0.45", place.name()));
        for coarse_tets in [188, 400] {
            let (answer, field) = error(&problem, &cells(coarse_tets, 150_000, 3.2e-3));
            assert!(answer.abs() < 0.05 && field < 0.1, "{place:?} on {coarse_tets}: {answer} {field}");
        }
    }
}
