//! A scene by path or by name, with progress and warnings on standard error.
use super::progress::Progress;
use miette::{Diagnostic, Report};
use palpate_physics::{Model, ModelError};
use palpate_scene::{Scene, builtin, builtin_names};
use std::path::Path;
use thiserror::Error;

/// A name that is neither a file nor a built-in scene.
#[derive(Debug, Error, Diagnostic)]
#[error("there is no scene file \"{name}\", and no built-in scene of that name")]
#[diagnostic(help("built-in scenes: {known}; a scene file ends in .toml (docs/scenes.md)"))]
struct UnknownScene {
    name: String,
    known: String,
}

/// The physics' refusal of a scene.
#[derive(Debug, Error, Diagnostic)]
#[error("the scene \"{scene}\" cannot be simulated")]
#[diagnostic(help("`palpated check` shows what its body is like"))]
struct Refused {
    scene: String,
    #[source]
    cause: ModelError,
}

/// Loads a scene: an existing file, else a built-in name.
///
/// # Errors
/// Neither, or the scene is refused; the report points into the file.
pub fn load_scene(name: &str) -> miette::Result<Scene> {
    let mut bar = Progress::new(name);
    let mut show = |fraction: f64, what: &str| bar.show(fraction, what);
    let path = Path::new(name);
    let scene = match builtin(name) {
        Some(text) if !path.is_file() => palpate_scene::parse(text, name, None, &mut show),
        None if !path.exists() => {
            let known = builtin_names().join(", ");
            return Err(UnknownScene { name: name.to_owned(), known }.into());
        }
        _ => palpate_scene::load_file(path, &mut show),
    };
    bar.finish();
    scene.map_err(Report::new)
}

/// Loads a scene for an offline run: its warnings go to standard error.
pub(super) fn load_with_warnings(name: &str) -> miette::Result<Scene> {
    let scene = load_scene(name)?;
    for warning in &scene.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(scene)
}

/// Builds the model of a scene.
pub(super) fn build(scene: &Scene) -> miette::Result<Model> {
    Model::build(scene.model.clone()).map_err(|cause| Refused { scene: scene.name.clone(), cause }.into())
}
