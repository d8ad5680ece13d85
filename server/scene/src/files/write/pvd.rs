//! PVD, the index of a series of frames, which ParaView opens.
use super::vtu::escaped;
use crate::files::error::{FileError, Place, Problem};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const HEAD: &str = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n";
const TAIL: &str = "</Collection>\n</VTKFile>\n";

/// The growing index of a series. The file is whole after every frame, and a frame costs the same however many there are.
#[derive(Debug)]
pub struct PvdIndex {
    path: PathBuf,
    file: File,
}

impl PvdIndex {
    /// Starts an index without frames.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let created = File::create(path).and_then(|mut file| {
            file.write_all([HEAD, TAIL].concat().as_bytes())?;
            Ok(file)
        });
        let file = created.map_err(|error| refused(path, error))?;
        Ok(Self { path: path.to_path_buf(), file })
    }

    /// Adds a frame: its time (s) and file name, relative to the index.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add(&mut self, time_s: f64, file: &str) -> Result<(), FileError> {
        let line = format!("<DataSet timestep=\"{time_s}\" part=\"0\" file=\"{}\"/>\n{TAIL}", escaped(file));
        let tail = TAIL.len() as i64;
        // The line and the tail in one write: no moment between in which the tail is missing.
        let added = self.file.seek(SeekFrom::End(-tail)).and_then(|_| self.file.write_all(line.as_bytes()));
        added.map_err(|error| refused(&self.path, error))
    }
}

fn refused(path: &Path, error: io::Error) -> FileError {
    FileError::new(path, Place::File, Problem::Io { action: "written", error })
}
