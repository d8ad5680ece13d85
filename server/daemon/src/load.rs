//! Scenes by name, path or text.
use palpate_proto::v1::load_scene_request::Source as WireSource;
use palpate_scene::{Scene, SceneError, builtin, builtin_names, load_file, parse};
use std::path::{Path, PathBuf};
use tonic::Status;

/// Where a scene comes from on the command line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// Part of the program.
    Builtin(String),
    /// A file.
    File(PathBuf),
}

impl Source {
    /// A built-in scene if one has this name and no such file exists, else a file.
    pub fn of_argument(argument: &str) -> Self {
        if builtin(argument).is_some() && !Path::new(argument).is_file() {
            Self::Builtin(argument.to_owned())
        } else {
            Self::File(PathBuf::from(argument))
        }
    }

    /// Loads it.
    ///
    /// # Errors
    /// [`SceneError`].
    pub fn load(&self, progress: &mut dyn FnMut(f64, &str)) -> Result<Scene, SceneError> {
        match self {
            Self::Builtin(name) => parse(builtin(name).unwrap_or_default(), name, None, progress),
            Self::File(path) => load_file(path, progress),
        }
    }
}

/// Loads what a client asks for.
///
/// # Errors
/// `NOT_FOUND`, `PERMISSION_DENIED` or `INVALID_ARGUMENT`, with the scene's own message.
pub fn from_wire(source: WireSource, folders: &[PathBuf]) -> Result<Scene, Status> {
    let scene = match source {
        WireSource::Builtin(name) => {
            let text = builtin(&name).ok_or_else(|| {
                let known = builtin_names().join(", ");
                Status::not_found(format!("there is no built-in scene \"{name}\"; there are: {known}"))
            })?;
            parse(text, &name, None, &mut |_, _| ())
        }
        WireSource::Path(path) => load_file(&allowed(Path::new(&path), folders)?, &mut |_, _| ()),
        WireSource::Toml(text) => parse(&text, "request", None, &mut |_, _| ()),
    };
    scene.map_err(|error| Status::invalid_argument(error.one_line()))
}

/// The real path, if it lies below one of the folders: links and `..` lead nowhere else.
fn allowed(path: &Path, folders: &[PathBuf]) -> Result<PathBuf, Status> {
    if folders.is_empty() {
        let text = "this daemon serves no scene files; start it with --scene-folder, or send the scene as `toml`";
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
