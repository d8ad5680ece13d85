//! Writes down what an arm does, between its driver and the loop. The loop puts a row into a bounded queue and goes on; a thread writes. A row that finds the queue
//! full is lost, and counted.
use super::{Row, write_header, write_row};
use crate::{
    BridgeError,
    device::{Arm, Effort, Fault, LastWords, Reading},
};
use glam::DVec3;
use palpate_control::Motion;
use rtrb::{Consumer, Producer, RingBuffer};
use std::{
    fs::File,
    io::{self, Seek as _, Write as _},
    path::{Path, PathBuf},
    sync::{
        Arc, OnceLock,
        atomic::{AtomicU64, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

/// Rows that may wait for the disk: eight seconds at 1 kHz.
const QUEUE: usize = 8192;
/// How often the queue is emptied.
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// No more than this is lost when the program is killed.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// Where to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordSettings {
    /// The file.
    pub path: PathBuf,
    /// In the place of what is there.
    pub overwrite: bool,
}

impl RecordSettings {
    /// Nothing of the user's is overwritten unasked.
    ///
    /// # Errors
    /// [`BridgeError::Value`] when the file is there.
    pub fn checked(self) -> Result<Self, BridgeError> {
        if !self.overwrite && self.path.exists() { Err(refused(&self.path, &exists())) } else { Ok(self) }
    }

    fn create(&self) -> Result<File, BridgeError> {
        let opened = if self.overwrite { File::create(&self.path) } else { File::create_new(&self.path) };
        let begun = opened.and_then(|mut file| write_header(&mut file).map(|()| file));
        begun.map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => refused(&self.path, &exists()),
            _ => refused(&self.path, &error),
        })
    }
}

fn exists() -> io::Error {
    io::Error::new(io::ErrorKind::AlreadyExists, "it is there already; name another file, or say --overwrite")
}

fn refused(path: &Path, error: &io::Error) -> BridgeError {
    BridgeError::Value { key: "record.path".to_owned(), reason: format!("cannot write {}: {error}", path.display()) }
}

/// Why a recording ended before its arm did, once it has.
#[derive(Debug, Clone, Default)]
pub struct Failure(Arc<OnceLock<RecordFailure>>);

/// A recording that ended before its arm did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordFailure {
    /// The file.
    pub path: PathBuf,
    /// Whole rows that are in it, at least.
    pub written: u64,
    /// Why.
    pub reason: String,
}

impl Failure {
    /// What went wrong, if anything did.
    pub fn get(&self) -> Option<&RecordFailure> {
        self.0.get()
    }
}

/// An arm, and what it did.
#[derive(Debug)]
pub struct Recorded {
    // Dropped in this order: the arm is let go before the disk is waited for.
    arm: Box<dyn Arm>,
    queue: Queue,
    _writer: Writer,
    period_s: f64,
    periods: u64,
    read: Option<Reading>,
}

impl Recorded {
    /// This arm, written down from now on.
    ///
    /// # Errors
    /// [`BridgeError::Value`] when the file cannot be written, [`BridgeError::System`] without a thread.
    pub fn start(
        arm: Box<dyn Arm>,
        settings: &RecordSettings,
        period_s: f64,
        failure: &Failure,
    ) -> Result<Self, BridgeError> {
        let file = settings.create()?;
        let (queue, rows) = Queue::new(QUEUE);
        let writer = Writer::start(file, &settings.path, rows, Arc::clone(&queue.made), failure.clone())
            .map_err(|source| BridgeError::System { what: "start the recording's thread", source })?;
        Ok(Self { arm, queue, _writer: writer, period_s, periods: 0, read: None })
    }
}

impl Arm for Recorded {
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        self.periods = self.periods.saturating_add(periods);
        let read = self.arm.read(periods);
        self.read = read.ok();
        read
    }

    /// A lost arm does nothing more that is known.
    fn apply(&mut self, effort: &Effort) {
        self.arm.apply(effort);
        // After the recording's end rows are for nobody.
        if let Some(reading) = self.read.take().filter(|_| self.queue.is_written()) {
            self.queue.push(&Row::new(self.periods as f64 * self.period_s, &reading, *effort));
        }
    }

    fn stiffest_wall_n_per_m(&self) -> Option<f64> {
        self.arm.stiffest_wall_n_per_m()
    }

    fn last_words(&self) -> Option<LastWords> {
        self.arm.last_words()
    }

    fn last_words_were_said(&mut self) {
        self.arm.last_words_were_said();
    }
}

/// The loop's end of the queue.
#[derive(Debug)]
struct Queue {
    rows: Producer<Row>,
    /// Rows put into it, or lost.
    made: Arc<AtomicU64>,
}

impl Queue {
    fn new(capacity: usize) -> (Self, Consumer<Row>) {
        let (mut rows, mut waiting) = RingBuffer::new(capacity);
        // Every page of it is touched here, so none is in the loop.
        let motion = Motion::at(DVec3::ZERO);
        let row = Row { time_s: 0.0, motion, buttons: 0, measured_force_n: None, effort: Effort::NONE };
        while rows.push(row).is_ok() {}
        while waiting.pop().is_ok() {}
        (Self { rows, made: Arc::default() }, waiting)
    }

    /// Whether somebody writes what is put in.
    fn is_written(&self) -> bool {
        !self.rows.is_abandoned()
    }

    fn push(&mut self, row: &Row) {
        // Lost when it is full.
        let _ = self.rows.push(*row);
        self.made.fetch_add(1, Ordering::Relaxed);
    }
}

/// The thread that writes. Dropped after the queue's other end, it writes what is left, and says how much was written and lost.
#[derive(Debug)]
struct Writer {
    path: PathBuf,
    made: Arc<AtomicU64>,
    written: Arc<AtomicU64>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

impl Writer {
    fn start(file: File, path: &Path, rows: Consumer<Row>, made: Arc<AtomicU64>, failure: Failure) -> io::Result<Self> {
        let written = Arc::<AtomicU64>::default();
        let thread = std::thread::Builder::new().name("palpate-record".to_owned()).spawn({
            let (written, path) = (Arc::clone(&written), path.to_owned());
            move || {
                let ended = write_all(file, rows, &written);
                if let Err(error) = &ended {
                    let (written, reason) = (written.load(Ordering::Relaxed), error.to_string());
                    tracing::error!(
                        "the recording {} ends here, after {written} rows: {reason}; the arm goes on without it",
                        path.display()
                    );
                    let _ = failure.0.set(RecordFailure { path, written, reason });
                }
                ended
            }
        })?;
        Ok(Self { path: path.to_owned(), made, written, thread: Some(thread) })
    }

    /// Waits for the end; rows written, rows lost, and what went wrong.
    fn end(&mut self) -> (u64, u64, io::Result<()>) {
        let joined = self.thread.take().map_or(Ok(Ok(())), JoinHandle::join);
        let (made, written) = (self.made.load(Ordering::Relaxed), self.written.load(Ordering::Relaxed));
        (written, made.saturating_sub(written), joined.unwrap_or_else(|_| Err(io::Error::other("its thread panicked"))))
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        let path = self.path.display().to_string();
        match self.end() {
            (written, 0, Ok(())) => tracing::info!("recorded {written} rows in {path}"),
            (written, lost, Ok(())) => {
                tracing::warn!("recorded {written} rows in {path}; {lost} rows are lost: the disk did not keep up");
            }
            // It was said when it happened.
            (_, _, Err(_)) => {}
        }
    }
}

/// Until the other end is gone and the queue empty. What the disk has no room for does not stand there in part: the file ends with a whole
/// row. `written` counts rows that the disk has taken.
fn write_all(mut file: File, mut rows: Consumer<Row>, written: &AtomicU64) -> io::Result<()> {
    let mut flushed = Instant::now();
    let (mut waiting, mut count) = (Vec::with_capacity(BLOCK_BYTES), 0);
    loop {
        // Asked first: what was put in before it went is still taken.
        let is_last = rows.is_abandoned();
        while let Ok(row) = rows.pop() {
            write_row(&mut waiting, &row)?;
            count += 1;
            if waiting.len() >= BLOCK_BYTES {
                break;
            }
        }
        if waiting.len() >= BLOCK_BYTES || flushed.elapsed() > FLUSH_EVERY || (is_last && !waiting.is_empty()) {
            append(&mut file, &waiting)?;
            written.fetch_add(count, Ordering::Relaxed);
            waiting.clear();
            (count, flushed) = (0, Instant::now());
            continue;
        }
        if is_last {
            return Ok(());
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

/// Rows are handed to the disk in blocks of about this size.
const BLOCK_BYTES: usize = 64 * 1024;

/// Appends a block of whole rows, or nothing of it.
fn append(file: &mut File, block: &[u8]) -> io::Result<()> {
    let before = file.stream_position().unwrap_or(0);
    file.write_all(block).inspect_err(|_| {
        // What cannot be cut, a device, has no length.
        let _ = file.set_len(before);
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        device::{Witness, simulated::SimulatedDevice},
        recording::read,
    };
    use palpate_control::{ArmSpec, HandPath, SimulatedArm};

    fn simulated() -> Box<dyn Arm> {
        let path = HandPath::resting_at(DVec3::X);
        Box::new(SimulatedDevice::new(SimulatedArm::new(ArmSpec::default(), path, 1e-3).unwrap()))
    }

    #[test]
    fn every_tick_is_a_row_with_its_force_and_skipped_ticks_are_time() {
        let folder = tempfile::tempdir().unwrap();
        let settings = RecordSettings { path: folder.path().join("a.csv"), overwrite: false };
        let mut arm = Recorded::start(simulated(), &settings, 1e-3, &Failure::default()).unwrap();
        for periods in [1, 1, 3] {
            arm.read(periods).unwrap();
            arm.apply(&Effort::force(DVec3::Z * periods as f64));
        }
        // Without a reading there is nothing to tell.
        arm.apply(&Effort::NONE);
        drop(arm);
        let text = std::fs::read_to_string(&settings.path).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|line| line.split(',').collect()).collect();
        assert_eq!(rows.iter().map(|row| row[0]).collect::<Vec<_>>(), ["0.001", "0.002", "0.005"]);
        assert_eq!(rows.iter().map(|row| row[20]).collect::<Vec<_>>(), ["1", "1", "3"]);
        assert_eq!(read::file(&settings.path).unwrap().len(), 3);
        let again = settings.clone().checked().unwrap_err().to_string();
        assert!(again.starts_with("record.path: cannot write ") && again.ends_with("or say --overwrite"), "{again}");
        assert_eq!(Recorded::start(simulated(), &settings, 1e-3, &Failure::default()).unwrap_err().to_string(), again);
        let over = RecordSettings { overwrite: true, ..settings };
        drop(Recorded::start(simulated(), &over, 1e-3, &Failure::default()).unwrap());
        assert_eq!(std::fs::read_to_string(&over.path).unwrap().lines().count(), 1);
        let nowhere = RecordSettings { path: "/nowhere/a.csv".into(), overwrite: false };
        let error = Recorded::start(simulated(), &nowhere, 1e-3, &Failure::default()).unwrap_err().to_string();
        assert!(error.starts_with("record.path: cannot write /nowhere/a.csv: No such file"), "{error}");
    }

    #[test]
    fn rows_that_find_the_queue_full_are_lost_and_counted() {
        let (mut queue, rows) = Queue::new(4);
        let reading = Witness::at_rest();
        for tick in 0..10 {
            queue.push(&Row::new(f64::from(tick), &reading, Effort::NONE));
        }
        // The disk wakes up when four wait, and six are gone.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let file = File::create(&path).unwrap();
        let mut writer = Writer::start(file, &path, rows, Arc::clone(&queue.made), Failure::default()).unwrap();
        drop(queue);
        let (written, lost, result) = writer.end();
        assert_eq!((written, lost, result.is_ok()), (4, 6, true));
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().map(|line| &line[..2]).collect::<Vec<_>>(), ["0,", "1,", "2,", "3,"]);
    }

    /// A full disk ends the recording, not the arm.
    #[test]
    fn a_disk_that_is_full_is_told_and_the_arm_goes_on() {
        let settings = RecordSettings { path: "/dev/full".into(), overwrite: true };
        let refused = settings.create().unwrap_err().to_string();
        assert!(refused.starts_with("record.path: cannot write /dev/full: No space"), "{refused}");
        let (mut queue, rows) = Queue::new(10_000);
        let file = File::options().write(true).open("/dev/full").unwrap();
        let failure = Failure::default();
        let mut writer = Writer::start(file, &settings.path, rows, Arc::clone(&queue.made), failure.clone()).unwrap();
        for tick in 0..20_000 {
            queue.push(&Row::new(f64::from(tick), &Witness::at_rest(), Effort::NONE));
        }
        // It ends at once, not when the arm does.
        let until = Instant::now() + Duration::from_secs(20);
        while queue.is_written() {
            assert!(Instant::now() < until);
            std::thread::sleep(LOOK_EVERY);
        }
        drop(queue);
        let (written, lost, result) = writer.end();
        assert!((written, lost) == (0, 20_000) && result.is_err(), "{written}, {lost}, {result:?}");
        let failure = failure.get().unwrap();
        assert!(failure.written == 0 && failure.reason.contains("No space"), "{failure:?}");
    }

    #[test]
    fn a_block_that_finds_no_room_leaves_whole_rows() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut file = File::create(&path).unwrap();
        append(&mut file, b"1,2\n").unwrap();
        drop(file);
        // A file that is only read refuses as a full disk does.
        let mut read_only = File::open(&path).unwrap();
        assert!(append(&mut read_only, b"3,4\n").is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"1,2\n");
    }
}
