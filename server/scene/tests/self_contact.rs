//! `self_contact` in `[body]`: on where the skin faces itself unless the scene says otherwise, and refused at its key
//! where a body cannot have it.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use palpate_physics::{Model, SelfContactChoice};
use palpate_scene::{Limits, Scene, SceneError, parse};

const BOX: &str = "[body.box]\nsize_mm = [10, 10, 10]\ncells = [2, 2, 2]";
const SHELL: &str = "[body.sphere_shell]\ninner_radius_mm = 8\nouter_radius_mm = 10\ntarget_tets = 300";

fn scene(key: &str, shape: &str, more: &str) -> Result<Scene, SceneError> {
    let text = format!(
        "[scene]\nname = \"t\"\n[body]\n{key}\n{shape}\n[[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 1e4\n\
         poisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n{more}"
    );
    parse(&text, "t.toml", None, &Limits::local(), &mut |_, _| {})
}

fn has_it(key: &str, shape: &str, more: &str) -> bool {
    Model::build(scene(key, shape, more).unwrap().model).unwrap().has_self_contact()
}

#[test]
fn a_cavity_has_it_and_a_box_may_ask_for_it() {
    assert!(has_it("", SHELL, ""));
    assert!(!has_it("self_contact = false", SHELL, ""));
    assert!(!has_it("", BOX, ""));
    assert!(has_it("self_contact = true", BOX, ""));
    let choice = |key: &str| scene(key, BOX, "").unwrap().model.settings.self_contact;
    assert_eq!(choice(""), SelfContactChoice::WhereFacing);
    assert_eq!(choice("self_contact = false"), SelfContactChoice::Off);
}

#[test]
fn without_leapfrog_there_is_none_and_asking_for_it_is_refused() {
    let numerics = "[numerics]\nintegrator = \"backward-euler\"";
    assert!(!has_it("", SHELL, numerics));
    let message = scene("self_contact = true", SHELL, numerics).unwrap_err().one_line();
    assert!(
        message.contains("walls of a body that is not integrated by leapfrog cannot press each other"),
        "{message}"
    );
    assert!(message.contains("self_contact") && message.contains("leave `self_contact` out"), "{message}");
}

#[test]
fn a_single_sheet_cannot_have_it() {
    let text = format!(
        "[scene]\nname = \"t\"\n[body]\nself_contact = true\n{SHELL}\n[body.springs]\npart = \"outer\"\n\
         mesh_n_per_m = 60\nanchor_n_per_m = 12\narea_density_kg_per_m2 = 15\ndamping_n_s_per_m = 0.02\n"
    );
    let load = |text: &str| parse(text, "t.toml", None, &Limits::local(), &mut |_, _| {});
    let message = load(&text).unwrap_err().one_line();
    assert!(message.contains("a surface of springs, which is a single sheet,"), "{message}");
    assert!(load(&text.replace("self_contact = true", "self_contact = false")).is_ok());
}
