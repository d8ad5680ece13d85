//! Scenes that are part of the program, with the files that they refer to. They are files of `deploy/scenes`.
use crate::{compile::FilesFrom, error::SceneError, limits::Limits, load, scene::Scene};

/// A scene.
struct Builtin {
    name: &'static str,
    text: &'static str,
    files: &'static [BuiltinFile],
}

/// A file that a scene refers to.
#[derive(Debug)]
pub(crate) struct BuiltinFile {
    /// As the scene names it.
    pub(crate) path: &'static str,
    pub(crate) content: &'static [u8],
}

macro_rules! scenes {
    ($($name:literal $([$($file:literal),*])?),*) => {
        const SCENES: &[Builtin] = &[$(Builtin {
            name: $name,
            text: include_str!(concat!("../../../deploy/scenes/", $name, ".toml")),
            files: &[$($(BuiltinFile {
                path: $file,
                content: include_bytes!(concat!("../../../deploy/scenes/", $file)),
            }),*)?],
        }),*];
        const NAMES: &[&str] = &[$($name),*];
    };
}

scenes!(
    "heart" ["data/heart-inner.ply", "data/heart-outer.ply"],
    "ventricle",
    "cantilever",
    "lame-sphere",
    "paper-2006",
    "hybrid-ventricle",
    "hybrid-block",
    "seed-ellipsoids",
    "seed-full-fem",
    "seed-hybrid",
    "springs-dome"
);

fn find(name: &str) -> Option<&'static Builtin> {
    SCENES.iter().find(|scene| scene.name == name)
}

/// Text of a built-in scene.
pub fn builtin(name: &str) -> Option<&'static str> {
    find(name).map(|scene| scene.text)
}

/// Loads a built-in scene; `None` where there is none of this name. `progress` is told as by [`load::load_file`].
///
/// # Errors
/// [`SceneError`], where the limits are too narrow for it.
pub fn load_builtin(
    name: &str,
    limits: &Limits,
    progress: &mut dyn FnMut(f64, &str),
) -> Option<Result<Scene, SceneError>> {
    let scene = find(name)?;
    Some(load::compiled(scene.text, name, FilesFrom::Program(scene.files), limits, progress))
}

/// Names of the built-in scenes; the first is the default.
pub fn builtin_names() -> &'static [&'static str] {
    NAMES
}
