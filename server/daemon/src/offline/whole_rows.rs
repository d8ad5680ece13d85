//! A table that grows by whole rows: whoever kills the program, or fills the disk, leaves no row in part.
use std::{
    fs::File,
    io::{self, Seek as _, SeekFrom, Write as _},
    path::Path,
    time::{Duration, Instant},
};

/// Rows are handed to the disk in blocks of about this size.
const BLOCK_BYTES: usize = 64 * 1024;
/// A block is handed over by then, however small it is.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// A table on its way to a file.
#[derive(Debug)]
pub(super) struct WholeRows {
    file: File,
    waiting: Vec<u8>,
    flushed: Instant,
}

impl WholeRows {
    /// A new file, in the place of what is there.
    pub(super) fn create(path: &Path) -> io::Result<Self> {
        Ok(Self::of(File::create(path)?))
    }

    /// Goes on behind the first `length` bytes of a file; what is there after them goes.
    pub(super) fn resume(path: &Path, length: u64) -> io::Result<Self> {
        let mut file = File::options().write(true).open(path)?;
        if file.metadata()?.len() < length {
            return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "it is shorter than it was at the checkpoint"));
        }
        file.set_len(length)?;
        file.seek(SeekFrom::End(0))?;
        Ok(Self::of(file))
    }

    /// How long (bytes) the file is once all rows so far are with the disk, to which they are handed here.
    pub(super) fn length(&mut self) -> io::Result<u64> {
        self.flush()?;
        self.file.sync_data()?;
        self.file.stream_position()
    }

    fn of(file: File) -> Self {
        Self { file, waiting: Vec::with_capacity(2 * BLOCK_BYTES), flushed: Instant::now() }
    }

    /// Adds a row, which `write` writes with its end of line.
    pub(super) fn add(&mut self, write: impl FnOnce(&mut Vec<u8>) -> io::Result<()>) -> io::Result<()> {
        write(&mut self.waiting)?;
        if self.waiting.len() >= BLOCK_BYTES || self.flushed.elapsed() > FLUSH_EVERY { self.flush() } else { Ok(()) }
    }

    /// Hands what waits to the disk: all of it or, where that has no room, nothing.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        let before = self.file.stream_position()?;
        self.file.write_all(&self.waiting).inspect_err(|_| {
            // What cannot be cut, a device, has no length.
            let _ = self.file.set_len(before);
        })?;
        self.waiting.clear();
        self.flushed = Instant::now();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_holds_whole_rows_at_any_moment() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.csv");
        let mut rows = WholeRows::create(&path).unwrap();
        let line = format!("{}\n", "7,".repeat(50));
        let mut seen = 0;
        for _ in 0..5000 {
            rows.add(|out| out.write_all(line.as_bytes())).unwrap();
            let size = std::fs::metadata(&path).unwrap().len() as usize;
            assert_eq!(size % line.len(), 0);
            seen += usize::from(size > 0);
        }
        assert!(seen > 1000, "blocks of it are there meanwhile");
        rows.flush().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), line.repeat(5000));
    }

    #[test]
    fn a_full_disk_is_told_at_once() {
        let mut rows = WholeRows::of(File::options().write(true).open("/dev/full").unwrap());
        let line = "7,".repeat(50);
        let told = (0..10_000).find(|_| rows.add(|out| out.write_all(line.as_bytes())).is_err());
        assert!(told.is_some_and(|row| row < 1000), "{told:?}");
    }
}
