//! `elements` in `[body]`: what the energy of a body of tets is taken of, and a refusal where there is another kind of body.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use palpate_physics::{BodySpec, bodies::tet::TetElements};
use palpate_scene::{Limits, Scene, SceneError, parse};

fn scene(key: &str, more: &str) -> Result<Scene, SceneError> {
    let text = format!(
        "[scene]\nname = \"t\"\n[body]\n{key}\n[body.box]\nsize_mm = [10, 10, 10]\ncells = [2, 2, 2]\n{more}\n[[material]]\n\
         law = \"stvk\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n"
    );
    parse(&text, "t.toml", None, &Limits::local(), &mut |_, _| {})
}

#[test]
fn tets_are_smoothed_unless_they_are_to_be_linear() {
    for (key, expected) in [
        ("", TetElements::Smoothed),
        ("elements = \"linear\"", TetElements::Linear),
        ("elements = \"smoothed\"", TetElements::Smoothed),
    ] {
        let BodySpec::Tet(body) = scene(key, "").unwrap().model.body else { panic!("a box is of tets") };
        assert_eq!(body.elements, expected, "{key}");
    }
}

#[test]
fn other_bodies_have_no_such_choice() {
    let particles = "[body.particles]\nspacing_mm = 2.5";
    let message = scene("elements = \"smoothed\"", particles).unwrap_err().one_line();
    assert!(message.contains("elements") && message.contains("leave `elements` out"), "{message}");
    assert!(scene("", particles).is_ok());
    let message = scene("elements = \"quadratic\"", "").unwrap_err().one_line();
    assert!(message.contains("linear") && message.contains("smoothed"), "{message}");
}
