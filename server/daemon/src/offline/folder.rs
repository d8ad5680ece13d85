//! The folder of an offline run: never overwrites what it did not write, and nothing without being told to.
use miette::{Diagnostic, IntoDiagnostic, WrapErr};
use std::{
    fs,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// Names this program writes.
pub(super) const PROBES: &str = "probes.csv";
pub(super) const SUMMARY: &str = "summary.json";
pub(super) const INDEX: &str = "frames.pvd";
pub(super) const FRAMES: &str = "frames";
pub(super) const CHECKPOINT: &str = "checkpoint.bin";

#[derive(Debug, Error, Diagnostic)]
#[error("the folder {folder} is not empty (it holds {example})")]
#[diagnostic(help(
    "choose another folder with --out, or add --force to replace the results of an earlier run in it; a run that was interrupted there goes on with `palpated simulate SCENE --out FOLDER --resume`"
))]
struct NotEmpty {
    folder: String,
    example: String,
}

/// Refuses a folder that holds something, unless `force` is given; changes nothing.
///
/// # Errors
/// It holds something and `force` is not given, or the system refuses.
pub(super) fn check(folder: &Path, force: bool) -> miette::Result<()> {
    if force || !folder.exists() {
        return Ok(());
    }
    let refused = || format!("cannot read the output folder {}", folder.display());
    match fs::read_dir(folder).into_diagnostic().wrap_err_with(refused)?.next() {
        None => Ok(()),
        Some(entry) => {
            let example = entry.into_diagnostic().wrap_err_with(refused)?.file_name().to_string_lossy().into_owned();
            Err(NotEmpty { folder: folder.display().to_string(), example }.into())
        }
    }
}

/// Prepares an output folder. With `force` the results of an earlier run are removed; other files are left alone.
///
/// # Errors
/// It holds something and `force` is not given, or the system refuses.
pub(super) fn prepare(folder: &Path, force: bool) -> miette::Result<PathBuf> {
    let refused = || format!("cannot prepare the output folder {}", folder.display());
    check(folder, force)?;
    fs::create_dir_all(folder).into_diagnostic().wrap_err_with(refused)?;
    remove_results(folder).into_diagnostic().wrap_err_with(refused)?;
    Ok(folder.to_path_buf())
}

fn remove_results(folder: &Path) -> std::io::Result<()> {
    for name in [PROBES, SUMMARY, INDEX, CHECKPOINT] {
        let path = folder.join(name);
        if path.is_file() {
            fs::remove_file(path)?;
        }
    }
    let frames = folder.join(FRAMES);
    if frames.is_dir() {
        for entry in fs::read_dir(frames)? {
            let path = entry?.path();
            if path.extension().is_some_and(|extension| extension == "vtu") {
                fs::remove_file(path)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_with_something_in_it_needs_force_and_strangers_survive() {
        let folder = tempfile::tempdir().unwrap();
        prepare(folder.path(), false).unwrap();
        fs::write(folder.path().join("notes.txt"), "mine").unwrap();
        fs::write(folder.path().join(PROBES), "old").unwrap();
        let error = prepare(folder.path(), false).unwrap_err();
        assert!(error.to_string().contains("is not empty"));
        assert!(folder.path().join(PROBES).exists());
        prepare(folder.path(), true).unwrap();
        assert!(!folder.path().join(PROBES).exists());
        assert!(folder.path().join("notes.txt").exists());
    }
}
