//! Files are written whole or not at all: beside, to the disk, and then in the place of what was there.
use std::{
    fs,
    io::{self, Write as _},
    os::unix::fs::OpenOptionsExt as _,
    path::Path,
};

/// Readable by everybody.
pub const PUBLIC: u32 = 0o644;
/// Readable by its owner only.
pub const SECRET: u32 = 0o600;

/// Writes a file with these permissions. A process or machine that dies meanwhile leaves what was there, and perhaps a file beside it
/// that the next attempt removes.
///
/// # Errors
/// The operating system's; what was there is there still.
pub fn write(path: &Path, bytes: &[u8], mode: u32) -> io::Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let beside = Path::new(&beside);
    let _ = fs::remove_file(beside);
    let written = || {
        let mut file = fs::OpenOptions::new().write(true).create_new(true).mode(mode).open(beside)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(beside, path)?;
        // The new name is on the disk as well.
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::File::open(folder)?.sync_all()
    };
    written().inspect_err(|_| {
        // Half a file helps nobody; that it may not be there is no second error.
        let _ = fs::remove_file(beside);
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn a_file_is_there_whole_or_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        fs::write(folder.path().join("a.bin.part"), "of an attempt that died").unwrap();
        write(&path, b"first", SECRET).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, SECRET);
        write(&path, b"second", PUBLIC).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).unwrap();
        assert!(write(&taken, b"x", PUBLIC).is_err());
        assert!(write(&folder.path().join("nowhere/a"), b"x", PUBLIC).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
