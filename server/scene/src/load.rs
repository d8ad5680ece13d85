//! From a file or a text to a [`Scene`].
use crate::{
    compile::{self, Files, FilesFrom},
    document::{schema, source::Source},
    error::{SceneError, Stage},
    limits::Limits,
    scene::{Scene, ToCalibrate},
};
use std::path::Path;

/// Loads a scene file of at most this size; files it refers to are looked for beside it. `progress` is told a fraction in [0, 1] and what is
/// being done.
///
/// # Errors
/// [`SceneError`], pointing into the file where it can.
pub fn load_file(path: &Path, limits: &Limits, progress: &mut dyn FnMut(f64, &str)) -> Result<Scene, SceneError> {
    let (name, text) = read(path, limits)?;
    parse(&text, &name, Some(path.parent().unwrap_or(Path::new("."))), limits, progress)
}

fn read(path: &Path, limits: &Limits) -> Result<(String, String), SceneError> {
    let name = path.display().to_string();
    let text = limits.read_text(path).map_err(|cause| {
        SceneError::new(Stage::Read, format!("cannot read the scene file {name}: {cause}")).with_cause(cause)
    })?;
    Ok((name, text))
}

/// Loads a scene from its text. `source_name` appears in messages. Relative files are looked for in `base_dir`; without
/// one the scene may refer to no file.
///
/// # Errors
/// [`SceneError`], pointing into the text where it can.
pub fn parse(
    text: &str,
    source_name: &str,
    base_dir: Option<&Path>,
    limits: &Limits,
    progress: &mut dyn FnMut(f64, &str),
) -> Result<Scene, SceneError> {
    compiled(text, source_name, base_dir.map_or(FilesFrom::Nowhere, FilesFrom::Folder), limits, progress)
}

/// Does the same with files from wherever.
pub(crate) fn compiled(
    text: &str,
    source_name: &str,
    from: FilesFrom<'_>,
    limits: &Limits,
    progress: &mut dyn FnMut(f64, &str),
) -> Result<Scene, SceneError> {
    progress(0.0, "reading the scene");
    let (source, document) = Source::read(source_name, text)?;
    compile::compile(&document, &Files { from, limits }, progress).map_err(|fault| source.error(fault))
}

/// What a scene's table of spring constants is made from, without the table.
///
/// # Errors
/// [`SceneError`], pointing into the file where it can: also of a scene that asks for no table.
pub fn to_calibrate(path: &Path, limits: &Limits) -> Result<ToCalibrate, SceneError> {
    let (name, text) = read(path, limits)?;
    let (source, document) = Source::read(&name, &text)?;
    let files = Files { from: FilesFrom::Folder(path.parent().unwrap_or(Path::new("."))), limits };
    compile::to_calibrate(&document, &files).map_err(|fault| source.error(fault))
}

/// JSON schema of the scene document.
pub fn json_schema() -> serde_json::Value {
    schema::schema()
}
