//! The folder of a session that is kept: `session.toml` says what runs, `replaced.toml` what ran before the last scene was loaded; both
//! name files beside them, which are there, whole, before they are named.
use crate::whole_file::{self, PUBLIC};
use miette::Diagnostic;
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeSet,
    fs, io,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// Where a scene comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// A built-in scene, by its name, or a file, by its path.
    Named(String),
    /// The text of a scene file.
    Text(String),
}

/// A session at a tick.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    /// Its scene.
    pub source: Source,
    /// Its state, as Snapshot gives it.
    pub state: Vec<u8>,
    /// The state's hash.
    pub state_hash: u64,
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time (s).
    pub time_s: f64,
    /// Whether time stands.
    pub paused: bool,
}

/// Which session of a folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slot {
    /// The one that runs, or ran last.
    Newest,
    /// The one before the last scene was loaded.
    Replaced,
}

impl Slot {
    fn file(self) -> &'static str {
        match self {
            Self::Newest => "session.toml",
            Self::Replaced => "replaced.toml",
        }
    }
}

/// Why a session cannot be kept, or is not there again.
#[derive(Debug, Error, Diagnostic)]
pub enum KeptError {
    /// A file.
    #[error("cannot {what} {}", path.display())]
    #[diagnostic(help("the folder is to be the daemon's user's own, on a disk that has room"))]
    File {
        /// What was tried.
        what: &'static str,
        /// Its path.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file is damaged, or of another version.
    #[error("{} cannot be taken up again: {reason}", path.display())]
    #[diagnostic(help(
        "start without --resume to begin at rest; what is there is then replaced at the first autosave"
    ))]
    Content {
        /// Its path.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// `session.toml`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    format: u32,
    /// Name of a built-in scene, or path of a file.
    scene: Option<String>,
    /// Or a file beside, with the scene's text.
    scene_text: Option<String>,
    /// File beside, with the state.
    state: String,
    state_hash: String,
    tick: u64,
    time_s: f64,
    paused: bool,
}

const FORMAT: u32 = 1;

/// A folder of a session that is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptFolder {
    path: PathBuf,
}

impl KeptFolder {
    /// At this path.
    pub fn at(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    /// Makes it, if it is not there, and sees that it can be written.
    ///
    /// # Errors
    /// [`KeptError`].
    pub fn prepare(&self) -> Result<(), KeptError> {
        let probe = self.path.join("writable");
        fs::create_dir_all(&self.path)
            .and_then(|()| whole_file::write(&probe, b"", PUBLIC))
            .and_then(|()| fs::remove_file(&probe))
            .map_err(|source| KeptError::File { what: "write to the folder", path: self.path.clone(), source })
    }

    /// Keeps a session. Whatever happens meanwhile, the one before is there until this one is.
    ///
    /// # Errors
    /// [`KeptError`]; the one before is there still.
    pub fn write(&self, slot: Slot, kept: &Kept) -> Result<(), KeptError> {
        let state = format!("state-{}-{:016x}.bin", kept.tick, kept.state_hash);
        self.put(&state, &kept.state)?;
        let (scene, scene_text) = match &kept.source {
            Source::Named(name) => (Some(name.clone()), None),
            Source::Text(text) => {
                let name = format!("scene-{:016x}.toml", hash_of(text.as_bytes()));
                self.put(&name, text.as_bytes())?;
                (None, Some(name))
            }
        };
        let Kept { tick, time_s, paused, .. } = *kept;
        let state_hash = format!("{:016x}", kept.state_hash);
        let manifest = Manifest { format: FORMAT, scene, scene_text, state, state_hash, tick, time_s, paused };
        let text = toml::to_string(&manifest)
            .map_err(|error| KeptError::Content { path: self.path.join(slot.file()), reason: error.to_string() })?;
        self.put(slot.file(), text.as_bytes())?;
        self.sweep();
        Ok(())
    }

    /// The session that was kept, if there is one.
    ///
    /// # Errors
    /// [`KeptError`].
    pub fn read(&self, slot: Slot) -> Result<Option<Kept>, KeptError> {
        let Some(manifest) = self.manifest(slot)? else { return Ok(None) };
        let at = self.path.join(slot.file());
        let damaged = |reason: String| KeptError::Content { path: at.clone(), reason };
        let beside = |name: &str| {
            if Path::new(name).components().count() != 1 || name.starts_with('.') {
                return Err(damaged(format!("it names {name}, which is no file beside it")));
            }
            let path = self.path.join(name);
            fs::read(&path).map_err(|source| KeptError::File { what: "read", path, source })
        };
        let source = match (manifest.scene, manifest.scene_text) {
            (Some(name), None) => Source::Named(name),
            (None, Some(file)) => Source::Text(
                String::from_utf8(beside(&file)?).map_err(|_| damaged(format!("{file} is no text (UTF-8)")))?,
            ),
            _ => return Err(damaged("it names no scene, or two".to_owned())),
        };
        let state_hash = u64::from_str_radix(&manifest.state_hash, 16)
            .map_err(|_| damaged("state_hash is no hexadecimal number".to_owned()))?;
        let state = beside(&manifest.state)?;
        let Manifest { tick, time_s, paused, .. } = manifest;
        Ok(Some(Kept { source, state, state_hash, tick, time_s, paused }))
    }

    fn manifest(&self, slot: Slot) -> Result<Option<Manifest>, KeptError> {
        let path = self.path.join(slot.file());
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(KeptError::File { what: "read", path, source }),
        };
        let read: Result<Manifest, _> = toml::from_str(&text);
        match read {
            Ok(manifest) if manifest.format == FORMAT => Ok(Some(manifest)),
            Ok(Manifest { format, .. }) => {
                let reason = format!("its format is {format}, and this version reads {FORMAT}");
                Err(KeptError::Content { path, reason })
            }
            Err(error) => Err(KeptError::Content { path, reason: error.message().to_owned() }),
        }
    }

    fn put(&self, name: &str, bytes: &[u8]) -> Result<(), KeptError> {
        let path = self.path.join(name);
        whole_file::write(&path, bytes, PUBLIC).map_err(|source| KeptError::File { what: "write", path, source })
    }

    /// Moves what cannot be taken up into the folder `refused`, whole, where another version may take it up; where to.
    ///
    /// # Errors
    /// [`KeptError`].
    pub fn set_aside(&self) -> Result<PathBuf, KeptError> {
        let aside = self.path.join("refused");
        let file = |what, path: &Path, source| KeptError::File { what, path: path.to_owned(), source };
        fs::create_dir_all(&aside).map_err(|source| file("make the folder", &aside, source))?;
        let named = self.manifest(Slot::Newest).ok().flatten();
        let beside = named.into_iter().flat_map(|manifest| [Some(manifest.state), manifest.scene_text]).flatten();
        for name in beside.filter(|name| is_state(name) || is_scene(name)) {
            // A text may be the other session's, too; what is missing already is why it is set aside.
            let _ = fs::copy(self.path.join(&name), aside.join(&name));
        }
        let (from, to) = (self.path.join(Slot::Newest.file()), aside.join(Slot::Newest.file()));
        fs::rename(&from, &to).map_err(|source| file("move", &from, source))?;
        Ok(aside)
    }

    /// Removes states and scenes that neither session names. What cannot be removed is tried again next time.
    fn sweep(&self) {
        let mut named = BTreeSet::new();
        for slot in [Slot::Newest, Slot::Replaced] {
            match self.manifest(slot) {
                Ok(manifest) => {
                    named.extend(manifest.into_iter().flat_map(|m| [Some(m.state), m.scene_text]).flatten());
                }
                // What it names is not known; it is of no use to anybody either.
                Err(KeptError::Content { path, .. }) => {
                    let _ = fs::rename(&path, path.with_extension("damaged"));
                }
                Err(KeptError::File { .. }) => return,
            }
        }
        let Ok(entries) = fs::read_dir(&self.path) else { return };
        for entry in entries.flatten() {
            let Ok(name) = entry.file_name().into_string() else { continue };
            if (is_state(&name) || is_scene(&name)) && !named.contains(&name) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// Whether a file is named as this folder names states: `state-TICK-HASH.bin`.
fn is_state(name: &str) -> bool {
    let parts = name.strip_prefix("state-").and_then(|rest| rest.strip_suffix(".bin")?.split_once('-'));
    parts.is_some_and(|(tick, hash)| tick.parse::<u64>().is_ok() && is_hash(hash))
}

/// Or scenes: `scene-HASH.toml`.
fn is_scene(name: &str) -> bool {
    name.strip_prefix("scene-").and_then(|rest| rest.strip_suffix(".toml")).is_some_and(is_hash)
}

fn is_hash(text: &str) -> bool {
    text.len() == 16 && text.bytes().all(|b| b.is_ascii_hexdigit())
}

/// FNV-1a: tells texts apart in the names of their files.
fn hash_of(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(tick: u64, source: Source) -> Kept {
        Kept {
            source,
            state: vec![tick as u8; 100],
            state_hash: tick * 77,
            tick,
            time_s: tick as f64 * 1e-3,
            paused: tick == 2,
        }
    }

    #[test]
    fn a_session_is_read_as_it_was_kept_and_no_file_is_left_that_nobody_names() {
        let parent = tempfile::tempdir().unwrap();
        let folder = KeptFolder::at(&parent.path().join("a/b"));
        folder.prepare().unwrap();
        assert_eq!(folder.read(Slot::Newest).unwrap(), None);
        let first = kept(1, Source::Named("ventricle".into()));
        folder.write(Slot::Newest, &first).unwrap();
        assert_eq!(folder.read(Slot::Newest).unwrap(), Some(first.clone()));
        folder.write(Slot::Replaced, &first).unwrap();
        let second = kept(2, Source::Text("[scene]\nname = \"x\"\n".into()));
        folder.write(Slot::Newest, &second).unwrap();
        folder.write(Slot::Newest, &kept(3, second.source.clone())).unwrap();
        assert_eq!(folder.read(Slot::Newest).unwrap(), Some(kept(3, second.source)));
        assert_eq!(folder.read(Slot::Replaced).unwrap(), Some(first));
        // Two sessions, two states, one text.
        assert_eq!(fs::read_dir(parent.path().join("a/b")).unwrap().count(), 5);
    }

    /// Files of the user's that are named nearly so were removed.
    #[test]
    fn only_the_folders_own_files_are_swept_and_what_is_damaged_stops_nothing() {
        let parent = tempfile::tempdir().unwrap();
        let folder = KeptFolder::at(parent.path());
        let own =
            ["scene-liver.toml", "state-before.bin", "state-12.bin", "state-1-00.bin", "scene-0123456789abcdeg.toml"];
        for name in own {
            fs::write(parent.path().join(name), "mine").unwrap();
        }
        let scene = || Source::Named("ventricle".into());
        folder.write(Slot::Replaced, &kept(1, scene())).unwrap();
        fs::write(parent.path().join("replaced.toml"), "format = ").unwrap();
        for tick in 2..6 {
            folder.write(Slot::Newest, &kept(tick, scene())).unwrap();
        }
        for name in own {
            assert!(parent.path().join(name).exists(), "{name}");
        }
        // Beside the user's: a state, its session, and the damaged one.
        assert_eq!(fs::read_dir(parent.path()).unwrap().count(), own.len() + 3);
        let aside = KeptFolder::at(&folder.set_aside().unwrap());
        assert_eq!(folder.read(Slot::Newest).unwrap(), None);
        assert_eq!(aside.read(Slot::Newest).unwrap(), Some(kept(5, scene())));
    }

    #[test]
    fn what_is_damaged_is_said_to_be_and_nothing_beside_the_folder_is_read() {
        let parent = tempfile::tempdir().unwrap();
        let folder = KeptFolder::at(parent.path());
        folder.write(Slot::Newest, &kept(1, Source::Named("ventricle".into()))).unwrap();
        let path = parent.path().join("session.toml");
        let good = fs::read_to_string(&path).unwrap();
        for (from, to, part) in [
            ("format = 1", "format = 9", "its format is 9"),
            ("state = \"state-", "state = \"../state-", "no file beside it"),
            ("state = \"state-", "state = \"/state-", "no file beside it"),
            ("scene = ", "colour = ", "colour"),
            ("tick = 1", "tick = -1", "tick"),
        ] {
            let bad = good.replace(from, to);
            assert_ne!(bad, good);
            fs::write(&path, bad).unwrap();
            let error = folder.read(Slot::Newest).unwrap_err().to_string();
            assert!(error.contains(part) || error.contains("invalid value"), "{from}: {error}");
        }
        fs::write(&path, good.replace("state-1", "state-2")).unwrap();
        assert!(folder.read(Slot::Newest).unwrap_err().to_string().contains("cannot read"));
    }
}
