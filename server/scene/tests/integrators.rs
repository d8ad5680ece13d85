//! `[numerics] integrator`: every name is read, runs, and another one is answered with those there are.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use palpate_physics::{Integrator, Model, Scratch, State, TickInput, step};
use palpate_scene::{Limits, Scene, SceneError, json_schema, parse};

fn scene(integrator: &str) -> Result<Scene, SceneError> {
    let text = format!(
        r#"[scene]
name = "t"
gravity_m_per_s2 = [0, 0, -9.81]
[body.box]
size_mm = [10, 10, 10]
cells = [2, 2, 2]
[[material]]
law = "stable-neo-hookean"
young_modulus_pa = 1e4
poisson_ratio = 0.3
density_kg_per_m3 = 1000
[[fixed]]
region = "z_min"
[numerics]
integrator = "{integrator}"
"#
    );
    parse(&text, "t.toml", None, &Limits::local(), &mut |_, _| {})
}

const NAMES: [(&str, Integrator); 4] = [
    ("leapfrog", Integrator::Leapfrog),
    ("seed-verlet", Integrator::SeedVerlet),
    ("seed-semi-implicit", Integrator::SeedSemiImplicit),
    ("backward-euler", Integrator::BackwardEuler),
];

#[test]
fn every_name_is_read_and_runs() {
    let schema = json_schema().to_string();
    for (name, integrator) in NAMES {
        let spec = scene(name).unwrap_or_else(|error| panic!("{}", error.one_line())).model;
        assert_eq!(spec.settings.integrator, integrator);
        assert!(schema.contains(&format!("\"{name}\"")), "{name}");
        let model = Model::build(spec).unwrap();
        let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
        let input = TickInput {
            tools: &[],
            load_factors: &[],
            prescribed_displacements_m: &vec![glam::DVec3::ZERO; model.prescribed().len()],
            point_forces: &[],
        };
        for _ in 0..10 {
            assert!(step(&model, &mut state, &mut scratch, &input).quarantined.is_none());
        }
        assert!(
            state.mechanical.x.iter().zip(model.rest_positions_m()).any(|(x, rest)| x.z < rest.z),
            "{name} stands still"
        );
    }
}

#[test]
fn another_name_is_answered_with_those_there_are() {
    let message = scene("midpoint").unwrap_err().one_line();
    for (name, _) in NAMES {
        assert!(message.contains(name), "{message}");
    }
}

#[test]
fn repeating_unstable_ticks_is_on_unless_switched_off() {
    assert!(scene("leapfrog").unwrap().model.settings.subcycle_unstable);
    assert!(!scene("leapfrog\"\nsubcycle_unstable = false#").unwrap().model.settings.subcycle_unstable);
}

#[test]
fn the_solver_s_keys_are_read_and_held_to_their_ranges() {
    let with = |keys: &str| scene(&format!("backward-euler\"\n{keys}#"));
    let settings = with("solver_iterations = 7\nsolver_tolerance = 0.25").unwrap().model.settings;
    assert_eq!((settings.solver_iterations, settings.solver_tolerance), (7, 0.25));
    for wrong in ["solver_iterations = 0", "solver_tolerance = 0", "solver_tolerance = 1.5"] {
        let message = with(wrong).unwrap_err().one_line();
        assert!(message.contains(wrong.split(' ').next().unwrap()), "{message}");
    }
}

#[test]
fn sleep_is_off_unless_asked_for_and_not_for_the_papers_schemes() {
    let tolerance_m = |rest: &str| scene(rest).map(|scene| scene.model.settings.sleep_tolerance_m);
    assert_eq!(tolerance_m("leapfrog").unwrap(), 0.0);
    assert!((tolerance_m("backward-euler\"\nsleep_tolerance_um = 0.1#").unwrap() - 1e-7).abs() < 1e-20);
    for bad in ["seed-verlet\"\nsleep_tolerance_um = 0.1#", "leapfrog\"\nsleep_tolerance_um = -1#"] {
        let message = scene(bad).unwrap_err().one_line();
        assert!(message.contains("sleep_tolerance_um") && message.contains("must be 0"), "{message}");
    }
}
