//! Scenes by name, path or text.
use crate::kept::folder::Source;
use miette::{Diagnostic, Report};
use palpate_proto::v1::load_scene_request::Source as WireSource;
use palpate_scene::{Limits, Scene, builtin_names, load_builtin, load_file, parse};
use std::path::{Path, PathBuf};
use thiserror::Error;
use tonic::Status;

/// A name that is neither a file nor a built-in scene.
#[derive(Debug, Error, Diagnostic)]
#[error("there is no scene file \"{name}\", and no built-in scene of that name")]
#[diagnostic(help("{near}built-in scenes: {known}; a scene file ends in .toml (docs/scenes.md)"))]
struct UnknownScene {
    name: String,
    near: String,
    known: String,
}

/// Loads what a command line asks for: an existing file, else the built-in scene of this name.
///
/// # Errors
/// Neither, or the scene is refused; the report points into the file.
pub fn from_argument(name: &str, progress: &mut dyn FnMut(f64, &str)) -> miette::Result<(Scene, Source)> {
    let limits = Limits::local();
    let path = Path::new(name);
    let built_in = if path.is_file() { None } else { load_builtin(name, &limits, progress) };
    if let Some(scene) = built_in {
        return scene.map(|scene| (scene, Source::Named(name.to_owned()))).map_err(Report::new);
    }
    if path.exists() {
        let scene = load_file(path, &limits, progress).map_err(Report::new)?;
        // It is found from another working directory, too.
        let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        return Ok((scene, Source::Named(real.to_string_lossy().into_owned())));
    }
    let near = builtin_names().iter().find(|known| strsim::jaro_winkler(name, known) > 0.8);
    let near = near.map_or(String::new(), |near| format!("did you mean {near}? "));
    Err(UnknownScene { name: name.to_owned(), near, known: builtin_names().join(", ") }.into())
}

/// Loads what was kept of a session.
///
/// # Errors
/// As [`from_argument`], or as a scene's text is refused.
pub fn from_kept(source: &Source, progress: &mut dyn FnMut(f64, &str)) -> miette::Result<Scene> {
    match source {
        Source::Named(name) => from_argument(name, progress).map(|(scene, _)| scene),
        Source::Text(text) => parse(text, "kept scene", None, &Limits::wire(), progress).map_err(Report::new),
    }
}

/// Loads what a client asks for. Text from the network may be no larger than [`Limits::wire`]; what the daemon's owner
/// put into its scene folders may.
///
/// # Errors
/// `NOT_FOUND`, `PERMISSION_DENIED` or `INVALID_ARGUMENT`, with the scene's own message.
pub fn from_wire(source: WireSource, folders: &[PathBuf]) -> Result<(Scene, Source), Status> {
    let (scene, source) = match source {
        WireSource::Builtin(name) => {
            let scene = load_builtin(&name, &Limits::wire(), &mut |_, _| ()).ok_or_else(|| {
                let known = builtin_names().join(", ");
                Status::not_found(format!("there is no built-in scene \"{name}\"; there are: {known}"))
            })?;
            (scene, Source::Named(name))
        }
        WireSource::Path(path) => {
            let path = allowed(Path::new(&path), folders)?;
            let scene = load_file(&path, &Limits::local(), &mut |_, _| ());
            (scene, Source::Named(path.to_string_lossy().into_owned()))
        }
        WireSource::Toml(text) => (parse(&text, "request", None, &Limits::wire(), &mut |_, _| ()), Source::Text(text)),
    };
    scene.map(|scene| (scene, source)).map_err(|error| Status::invalid_argument(error.one_line()))
}

/// The real path, if it lies below one of the folders: links and `..` lead nowhere else.
fn allowed(path: &Path, folders: &[PathBuf]) -> Result<PathBuf, Status> {
    if folders.is_empty() {
        let text = "this daemon serves no scene files: start palpated with --scene-folder FOLDER, or send the text of a scene that names no files";
        return Err(Status::permission_denied(text));
    }
    // One message for what is missing and what is elsewhere: nobody explores the disk through it.
    let refuse =
        || Status::permission_denied(format!("{} is no file below the daemon's scene folders", path.display()));
    folders
        .iter()
        .find_map(|folder| {
            let folder = folder.canonicalize().ok()?;
            let real = folder.join(path).canonicalize().ok()?;
            (real.starts_with(&folder) && real.is_file()).then_some(real)
        })
        .ok_or_else(refuse)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A client could ask for fifty million tets in one line of text, and the daemon tried.
    #[test]
    fn text_from_the_network_is_limited_where_a_command_line_is_not() {
        let text = "[scene]\nname = \"t\"\n[body.box]\nsize_mm = [10, 10, 10]\ncells = [100, 100, 100]\n\
                    [[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n";
        let refused = from_wire(WireSource::Toml(text.to_owned()), &[]).unwrap_err();
        let wanted = "request:5:9: body.box.cells gives 6000000 tets; at most 200000 are allowed here";
        assert!(refused.message().starts_with(wanted), "{}", refused.message());
        let names = builtin_names().iter().map(|&name| WireSource::Builtin(name.to_owned()));
        assert!(names.into_iter().all(|name| from_wire(name, &[]).is_ok()));
    }

    #[test]
    fn only_files_below_the_folders_are_allowed() {
        let folder = tempfile::tempdir().unwrap();
        let other = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.toml"), "").unwrap();
        std::fs::write(other.path().join("b.toml"), "").unwrap();
        std::os::unix::fs::symlink(other.path().join("b.toml"), folder.path().join("link.toml")).unwrap();
        let folders = [folder.path().to_owned()];
        assert!(allowed(Path::new("a.toml"), &folders).is_ok());
        assert!(allowed(&folder.path().join("a.toml"), &folders).is_ok());
        let up = format!("../{}/b.toml", other.path().file_name().unwrap().to_string_lossy());
        for bad in ["link.toml", "none.toml", ".", "/etc/passwd", up.as_str()] {
            assert!(allowed(Path::new(bad), &folders).is_err(), "{bad}");
        }
        assert!(allowed(Path::new("a.toml"), &[]).is_err());
    }
}
