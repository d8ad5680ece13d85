//! The files that a scene refers to: beside it, in the program, or none.
use super::body::file_fault;
use crate::{
    builtin::BuiltinFile,
    document::source::{Fault, Where},
    files::{self, SurfaceFile},
    limits::Limits,
};
use std::path::{Path, PathBuf};

/// Where a scene's files are.
#[derive(Debug, Clone, Copy)]
pub(crate) enum FilesFrom<'a> {
    /// Nowhere: the scene may refer to none.
    Nowhere,
    /// In a folder, at which relative paths start.
    Folder(&'a Path),
    /// In the program.
    Program(&'static [BuiltinFile]),
}

/// A scene's files, and how large they may be.
pub(crate) struct Files<'a> {
    pub(crate) from: FilesFrom<'a>,
    pub(crate) limits: &'a Limits,
}

impl Files<'_> {
    /// The path of a file named in a scene.
    pub(super) fn resolve(&self, at: &Where, file: &str) -> Result<PathBuf, Fault> {
        let base = match self.from {
            FilesFrom::Folder(base) => base,
            FilesFrom::Nowhere => {
                let message = format!("{at} refers to the file {file}, but this scene came without a folder");
                return Err(Fault::value(at.clone(), message)
                    .help("send scenes that need no file, or have the daemon load the file from its own disk (`palpate-view load --on-daemon`, below a folder that `palpated --scene-folder` names)"));
            }
            FilesFrom::Program(_) => {
                let message = format!("{at} refers to the file {file}, which is not a part of the program");
                return Err(Fault::value(at.clone(), message)
                    .help("save the scene as a file, beside the file that it refers to"));
            }
        };
        let path = base.join(file);
        // What cannot be asked is left to the reader, which says why.
        let bytes = path.metadata().map_or(0, |metadata| metadata.len());
        if bytes > self.limits.file_bytes {
            let most = self.limits.file_bytes;
            let message = format!("{at}: {} has {bytes} bytes; at most {most} are allowed here", path.display());
            return Err(Fault::value(at.clone(), message));
        }
        Ok(path)
    }

    /// Reads a surface.
    pub(super) fn read_surface(&self, at: &Where, file: &str) -> Result<SurfaceFile, Fault> {
        let built_in = match self.from {
            FilesFrom::Program(files) => files.iter().find(|built_in| built_in.path == file),
            FilesFrom::Nowhere | FilesFrom::Folder(_) => None,
        };
        let read = match built_in {
            Some(built_in) => files::parse_surface(Path::new(file), built_in.content),
            None => files::read_surface(&self.resolve(at, file)?),
        };
        read.map_err(|error| file_fault(at, error))
    }

    /// Where a file that may not exist yet belongs.
    pub(super) fn place(&self, file: &str) -> PathBuf {
        match self.from {
            FilesFrom::Folder(base) => base.join(file),
            FilesFrom::Nowhere | FilesFrom::Program(_) => PathBuf::from(file),
        }
    }
}
