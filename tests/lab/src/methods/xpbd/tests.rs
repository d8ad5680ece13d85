#![allow(clippy::unwrap_used)] // a test that cannot build its subject has failed
use super::*;
use crate::methods::testing::{equilibrium, farthest_m, free, momenta, problem, settle, tumbling};

fn body(name: &str, resolution: u32, pace: &Pace, substeps: u32) -> Body {
    let problem = problem(name);
    let settings =
        Settings { mass_damping_per_s: pace.damping_per_s, substeps: Substeps::Fixed(substeps), ..Settings::default() };
    Body::new(Subject::new(&problem, resolution, problem.material().unwrap(), settings).unwrap())
}

/// What one sweep leaves out falls with the square of the substep: so does the distance from equilibrium.
#[test]
fn it_comes_to_rest_near_equilibrium_the_nearer_the_more_substeps() {
    for (name, resolution) in [
        ("ventricle-sphere-small-nu0.45", 188),
        ("block-patch-small-nu0.45", 4),
        ("block-patch-small-nu0.45-stvk", 4),
        ("block-sphere-large-nu0.45-corotated", 4),
    ] {
        let pace = Pace::of(&problem(name)).unwrap();
        // Twice the rest: the answer's last motion is not to be seen.
        let errors = [5, 10, 20].map(|substeps| {
            let mut body = body(name, resolution, &pace, substeps);
            settle(&mut body, &pace);
            settle(&mut body, &Pace { ramp_ticks: 1, ..pace });
            let (x, answer) = equilibrium(&body.subject);
            let moved = farthest_m(&x, body.subject.model.rest_positions_m());
            (farthest_m(&body.x, &x) / moved, (body.answer() / answer - 1.0).abs())
        });
        let order = |of: fn(&(f64, f64)) -> f64| [0, 1].map(|i| (of(&errors[i]) / of(&errors[i + 1])).log2());
        let (positions, answers) = (order(|e| e.0), order(|e| e.1));
        println!("{name}: {errors:?} orders {positions:.2?} {answers:.2?}");
        assert!(positions[1] > 1.8 && answers[1] > 1.8, "{name}: {errors:?} {positions:?} {answers:?}");
    }
}

#[test]
fn momenta_are_conserved_in_free_flight() {
    for name in ["block-patch-small-nu0.45", "block-patch-small-nu0.45-stvk"] {
        let settings = Settings { substeps: Substeps::Fixed(10), ..Settings::default() };
        let mut body = Body::new(free(&problem(name), settings));
        body.v = tumbling(&body.x);
        let before = momenta(&body.subject.model, &body.x, &body.v);
        for _ in 0..100 {
            body.tick(0.0);
        }
        let after = momenta(&body.subject.model, &body.x, &body.v);
        assert!((after[0] - before[0]).length() < 1e-9 * before[0].length(), "{name}: {before:?} {after:?}");
        // Every Δx is along forces that sum to no torque at the positions where they act; inertia then moves on from others, an error
        // of first order in the substep.
        assert!((after[1] - before[1]).length() < 2e-2 * before[1].length(), "{name}: {before:?} {after:?}");
    }
}
