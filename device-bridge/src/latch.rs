//! A latched fault outlives the program: who starts it anew, a service manager or a person in a hurry, does not bring the force back.
use palpate_control::{Fault, Link};
use std::{
    fs,
    io::{self, Write as _},
    path::{Path, PathBuf},
};

/// Faults by the name that stands in the file. A stop that was asked for is none.
const NAMES: [(Fault, &str); 6] = [
    (Fault::Stale, "stale"),
    (Fault::NonFinite, "non-finite"),
    (Fault::Peer, "peer"),
    (Fault::Device, "device"),
    (Fault::Unreliable, "unreliable"),
    (Fault::Stalled, "stalled"),
];

/// Where the latched fault is remembered, and which.
#[derive(Debug)]
pub struct Latch {
    path: PathBuf,
    remembered: Option<Fault>,
    /// What went wrong last, which is said once.
    said: String,
}

impl Latch {
    /// What is remembered there. A file that cannot be understood means a fault.
    ///
    /// # Errors
    /// When it cannot be read, or its folder not be written.
    pub fn at(path: PathBuf) -> io::Result<Self> {
        let remembered = match fs::read_to_string(&path) {
            Ok(text) => {
                let word = text.split_whitespace().next().unwrap_or_default().to_owned();
                let known = NAMES.iter().find(|(_, name)| *name == word);
                Some(known.map_or(Fault::Stalled, |(fault, _)| *fault))
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        let latch = Self { path, remembered, said: String::new() };
        // A place that cannot be written is told now, and not when there is something to remember.
        fs::write(latch.beside(), "")?;
        fs::remove_file(latch.beside())?;
        Ok(latch)
    }

    fn beside(&self) -> PathBuf {
        let mut beside = self.path.clone().into_os_string();
        beside.push(".part");
        beside.into()
    }

    /// The fault that is remembered.
    pub fn remembered(&self) -> Option<Fault> {
        self.remembered
    }

    /// Remembers what is latched, and forgets what was recovered from. What goes wrong is said once, and tried again.
    pub fn follow(&mut self, link: Link) {
        let said = match self.try_follow(link) {
            Ok(()) => String::new(),
            Err(error) => format!("the latched fault is not remembered in {}: {error}", self.path.display()),
        };
        if !said.is_empty() && said != self.said {
            tracing::error!("{said}");
        }
        self.said = said;
    }

    fn try_follow(&mut self, link: Link) -> io::Result<()> {
        let now = match link {
            // A stop that was asked for is no fault, and one that is on its way is not recovered from.
            Link::Latched(Fault::Requested) | Link::Ramping(_) => return Ok(()),
            Link::Latched(fault) => Some(fault),
            Link::Waiting | Link::Fresh | Link::Extrapolating => None,
        };
        if now == self.remembered {
            return Ok(());
        }
        match now.and_then(|fault| NAMES.iter().find(|(other, _)| *other == fault)) {
            Some((_, name)) => self.write(name)?,
            None => match fs::remove_file(&self.path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            },
        }
        self.remembered = now;
        Ok(())
    }

    /// Beside, to the disk, and then in place.
    fn write(&self, name: &str) -> io::Result<()> {
        let mut file = fs::File::create(self.beside())?;
        writeln!(file, "{name}")?;
        file.sync_all()?;
        fs::rename(self.beside(), &self.path)?;
        // The new name is on the disk as well.
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        fs::File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latched_fault_is_remembered_until_it_is_recovered_from() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("latched");
        let mut latch = Latch::at(path.clone()).unwrap();
        assert_eq!(latch.remembered(), None);
        for (link, after) in [
            (Link::Fresh, None),
            (Link::Ramping(Fault::Stale), None),
            (Link::Latched(Fault::Stale), Some(Fault::Stale)),
            (Link::Latched(Fault::Requested), Some(Fault::Stale)),
            (Link::Waiting, None),
            (Link::Latched(Fault::Device), Some(Fault::Device)),
        ] {
            latch.follow(link);
            assert_eq!(Latch::at(path.clone()).unwrap().remembered(), after, "{link:?}");
        }
        for (fault, name) in NAMES {
            fs::write(&path, name).unwrap();
            assert_eq!(Latch::at(path.clone()).unwrap().remembered(), Some(fault));
        }
        // Half a word of a disk that was full.
        fs::write(&path, "sta").unwrap();
        assert_eq!(Latch::at(path).unwrap().remembered(), Some(Fault::Stalled));
    }

    #[test]
    fn a_place_that_cannot_be_written_is_told_at_the_start() {
        assert!(Latch::at("/nowhere/latched".into()).is_err());
        assert!(Latch::at("/proc/latched".into()).is_err());
    }
}
