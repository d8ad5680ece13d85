//! A scene for an offline command: progress and warnings on standard error, and its model.
use crate::{
    bodies::served,
    load::from_argument,
    progress::{BUILDING, Progress},
};
use miette::Diagnostic;
use palpate_physics::{Model, ModelError};
use palpate_scene::Scene;
use thiserror::Error;

/// The physics' refusal of a scene.
#[derive(Debug, Error, Diagnostic)]
#[error("the scene \"{scene}\" cannot be simulated")]
pub(super) struct Refused {
    scene: String,
    /// `palpated check` itself shows the body before it is refused.
    #[help]
    help: Option<&'static str>,
    #[source]
    cause: ModelError,
}

/// Loads a scene with a progress bar.
pub(super) fn load_scene(name: &str) -> miette::Result<Scene> {
    let mut bar = Progress::new(name);
    let loaded = from_argument(name, &mut |fraction, what| bar.show(fraction, what));
    bar.finish();
    loaded.map(|(scene, _)| scene)
}

/// Loads a scene; its warnings go to standard error.
pub(super) fn load_with_warnings(name: &str) -> miette::Result<Scene> {
    let scene = load_scene(name)?;
    for warning in &scene.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(scene)
}

/// Builds the model of a scene; what one would want to change about its body goes to standard error and to the scene's
/// warnings.
pub(super) fn build_with_warnings(scene: &mut Scene) -> miette::Result<Model> {
    let model = build_or_advise(scene, Some("`palpated check` shows what its body is like"))?;
    for remark in served(&model).remarks() {
        eprintln!("note: {remark}");
    }
    for warning in served(&model).warnings(&model) {
        eprintln!("warning: {warning}");
        scene.warnings.push(warning);
    }
    Ok(model)
}

/// Builds the model of a scene, with a progress bar.
pub(super) fn build(scene: &Scene) -> miette::Result<Model> {
    build_or_advise(scene, None)
}

fn build_or_advise(scene: &Scene, help: Option<&'static str>) -> miette::Result<Model> {
    let mut bar = Progress::new(&scene.name);
    let model = build_showing(scene, help, &mut |part| bar.show(part, BUILDING));
    bar.finish();
    model
}

/// Builds the model of a scene; `progress` is told which part of it is done.
pub(super) fn build_showing(
    scene: &Scene,
    help: Option<&'static str>,
    progress: &mut dyn FnMut(f64),
) -> miette::Result<Model> {
    let model = Model::build_with(scene.model.clone(), progress);
    model.map_err(|cause| Refused { scene: scene.name.clone(), help, cause }.into())
}
