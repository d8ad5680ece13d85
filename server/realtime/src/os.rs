//! What the operating system can do for a loop: priority, locked memory, a processor of its own, awake processors.
//!
//! Every measure is optional, and each says in one line whether it was granted, or why not and what to do. The only unsafe
//! code of this crate is here.
#![allow(unsafe_code)]
use rustix::{
    mm::{MlockAllFlags, mlockall},
    process::{Resource, getrlimit},
    thread::{CpuSet, sched_setaffinity},
};
use std::{fmt, fs::File, io, io::Write};

/// What to ask for, for the calling thread (priority, processor) and its process (memory, awake processors).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OsMeasures {
    /// `SCHED_FIFO` priority, 1 to 99; `None`: leave the scheduling as it is.
    pub fifo_priority: Option<u8>,
    /// Lock all memory, now and later, so that no tick waits for a page.
    pub lock_memory: bool,
    /// Run on this processor only, counted from 0.
    pub processor: Option<usize>,
    /// Keep processors out of deep sleep (`/dev/cpu_dma_latency`), as `cyclictest` does; costs power.
    pub stay_awake: bool,
}

impl Default for OsMeasures {
    /// Priority 80 and locked memory, on any processor.
    fn default() -> Self {
        Self { fifo_priority: Some(80), lock_memory: true, processor: None, stay_awake: false }
    }
}

impl OsMeasures {
    /// Nothing: for tests.
    pub const NONE: Self = Self { fifo_priority: None, lock_memory: false, processor: None, stay_awake: false };
}

/// Whether a measure was granted, in one line for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// It is in force.
    pub granted: bool,
    /// Which, and if refused why, and what to do.
    pub text: String,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// What was granted, and what must live as long as the loop.
#[derive(Debug)]
pub struct Granted {
    /// One per measure asked for.
    pub notes: Vec<Note>,
    /// The kernel keeps processors awake while this file is open.
    _awake: Option<File>,
}

/// Blocks from this size on (bytes) are the system's own again as soon as they are freed.
#[cfg(target_env = "gnu")]
const OWN_PAGES_BYTES: libc::c_int = 128 * 1024;

/// Has the allocator give large blocks back to the system when they are freed, for the whole process.
///
/// glibc does so by itself until the first of them is freed; from then on blocks of its size come from its heaps, which, in locked memory,
/// never shrink (`MADV_DONTNEED` is refused there). A crowd's messages stayed for ever.
pub fn give_large_blocks_back() {
    // SAFETY: mallopt takes two numbers, and may be called at any time by any thread.
    #[cfg(target_env = "gnu")]
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, OWN_PAGES_BYTES);
    }
}

/// How far the priority of a stream's thread is below its loop's.
const BELOW_THE_LOOP: u8 = 10;
/// Stack that is touched beforehand: more than a tick uses.
const PREFAULT_BYTES: usize = 256 * 1024;

impl OsMeasures {
    /// What the thread of the loop's stream asks for: a priority below the loop's, if that has one. Memory is locked for the process, and
    /// processors are kept awake for all.
    #[must_use]
    pub fn of_stream(self) -> Self {
        let fifo_priority = self.fifo_priority.map(|priority| priority.saturating_sub(BELOW_THE_LOOP).max(1));
        Self { fifo_priority, ..Self::NONE }
    }

    /// Asks for everything, on the thread that will run the loop. Allocates and logs nothing to files: call before the loop.
    #[must_use = "the notes are for the user, and dropping them lets the processors sleep"]
    pub fn apply(&self) -> Granted {
        let mut notes = Vec::new();
        let mut awake = None;
        if self.lock_memory {
            notes.push(lock_memory());
        }
        if let Some(processor) = self.processor {
            notes.push(pin_to(processor));
        }
        if self.stay_awake {
            let (note, file) = stay_awake();
            notes.push(note);
            awake = file;
        }
        if let Some(priority) = self.fifo_priority {
            notes.push(fifo(priority));
        }
        prefault_stack();
        Granted { notes, _awake: awake }
    }
}

fn granted(text: String) -> Note {
    Note { granted: true, text }
}

fn refused(text: String) -> Note {
    Note { granted: false, text }
}

fn fifo(priority: u8) -> Note {
    if !(1..=99).contains(&priority) {
        return refused(format!("priority: SCHED_FIFO {priority} is out of range, use 1 to 99"));
    }
    let parameter = libc::sched_param { sched_priority: i32::from(priority) };
    // Threads and processes that this one starts are not of the loop: they begin at normal priority.
    let policy = libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK;
    // SAFETY: `parameter` is a valid sched_param for the whole call, which only reads it; thread 0 is the calling one.
    let answer = unsafe { libc::sched_setscheduler(0, policy, &raw const parameter) };
    if answer == 0 {
        return granted(format!("priority: SCHED_FIFO {priority}"));
    }
    let error = io::Error::last_os_error();
    refused(format!(
        "priority: SCHED_FIFO {priority} refused ({error}): the loop runs at normal priority and may wake late. Allow it with \
         `ulimit -r {priority}`, LimitRTPRIO={priority} in the systemd unit, or CAP_SYS_NICE"
    ))
}

fn lock_memory() -> Note {
    // With MCL_FUTURE every later allocation fails beyond the limit, so a limit is as good as a refusal.
    let limit = getrlimit(Resource::Memlock).current;
    let privileged = rustix::process::geteuid().is_root();
    if let (Some(bytes), false) = (limit, privileged) {
        return refused(format!(
            "memory: not locked, since the limit of {} KiB is too low: a tick may wait for a page. Allow it with `ulimit -l \
             unlimited`, LimitMEMLOCK=infinity in the systemd unit, or CAP_IPC_LOCK with no limit",
            bytes / 1024
        ));
    }
    match mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE) {
        Ok(()) => granted("memory: locked".to_owned()),
        Err(error) => refused(format!(
            "memory: not locked ({error}): a tick may wait for a page. Allow it with `ulimit -l unlimited`, \
             LimitMEMLOCK=infinity in the systemd unit, or CAP_IPC_LOCK"
        )),
    }
}

fn pin_to(processor: usize) -> Note {
    let available = std::thread::available_parallelism().map_or(1, usize::from);
    if processor >= CpuSet::MAX_CPU {
        return refused(format!("processor: {processor} does not exist, this machine has {available}"));
    }
    let mut set = CpuSet::new();
    set.set(processor);
    match sched_setaffinity(None, &set) {
        Ok(()) => granted(format!("processor: pinned to {processor}")),
        Err(error) => refused(format!(
            "processor: not pinned to {processor} ({error}): this process may use {available}, numbered from 0; see `taskset -p \
             $$` and the cpuset of its control group"
        )),
    }
}

fn stay_awake() -> (Note, Option<File>) {
    const PATH: &str = "/dev/cpu_dma_latency";
    const DRIVER: &str = "/sys/devices/system/cpu/cpuidle/current_driver";
    let open = || -> io::Result<File> {
        let mut file = File::options().write(true).open(PATH)?;
        file.write_all(&0_i32.to_ne_bytes())?;
        Ok(file)
    };
    // In many virtual machines the kernel knows of no sleep states: it halts idle processors whatever it is asked for.
    let halts = std::fs::read_to_string(DRIVER).is_ok_and(|driver| driver.trim() == "none");
    match open() {
        Ok(file) if halts => (
            refused(
                "processors: halted when they are idle, as this (virtual) machine knows no other rest, and its host may give them back \
                 milliseconds later: see deploy/host-tuning.md"
                    .to_owned(),
            ),
            Some(file),
        ),
        Ok(file) => (granted(format!("processors: kept awake through {PATH}")), Some(file)),
        Err(error) => (
            refused(format!(
                "processors: may sleep deeply, {PATH} cannot be written ({error}). Run as root, or give the user write access \
                 to it"
            )),
            None,
        ),
    }
}

/// Touches the stack below the caller, so that its pages are there before the first tick.
#[inline(never)]
#[allow(clippy::large_stack_arrays)] // that is its purpose
fn prefault_stack() {
    std::hint::black_box([0_u8; PREFAULT_BYTES]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::thread::sched_getaffinity;

    #[test]
    fn nothing_asked_nothing_said() {
        assert!(OsMeasures::NONE.apply().notes.is_empty());
    }

    #[test]
    fn every_measure_answers_with_one_line_and_a_refusal_says_what_to_do() {
        // On a thread of its own: priority and processor are the thread's. Memory is not locked: it is the process's.
        let notes = std::thread::spawn(|| {
            let measures =
                OsMeasures { fifo_priority: Some(10), lock_memory: false, processor: Some(0), stay_awake: true };
            measures.apply().notes
        })
        .join()
        .unwrap();
        assert_eq!(notes.len(), 3);
        for note in &notes {
            assert!(!note.text.contains('\n'));
            assert!(
                note.granted
                    || note.text.contains("ulimit")
                    || note.text.contains("taskset")
                    || note.text.contains("root")
                    || note.text.contains("host-tuning.md"),
                "{note}"
            );
        }
    }

    #[test]
    fn a_granted_priority_is_really_in_force() {
        std::thread::spawn(|| {
            let note = fifo(7);
            // SAFETY: no arguments but a thread id; 0 is the calling thread.
            let policy = unsafe { libc::sched_getscheduler(0) };
            let (fifo, reset) = (policy & !libc::SCHED_RESET_ON_FORK, policy & libc::SCHED_RESET_ON_FORK);
            assert_eq!(note.granted, fifo == libc::SCHED_FIFO, "{note}");
            assert_eq!(note.granted, reset != 0, "threads begun by this one start at normal priority: {note}");
        })
        .join()
        .unwrap();
    }

    #[test]
    fn a_granted_processor_is_the_only_one() {
        std::thread::spawn(|| {
            let note = pin_to(0);
            let set = sched_getaffinity(None).unwrap();
            assert_eq!(note.granted, set.count() == 1 && set.is_set(0), "{note}");
        })
        .join()
        .unwrap();
    }

    #[test]
    fn impossible_wishes_are_refused() {
        assert!(fifo(0).text.contains("1 to 99"));
        assert!(fifo(100).text.contains("1 to 99"));
        assert!(!pin_to(100_000).granted);
        assert!(!pin_to(1000).granted);
    }

    fn resident_mib() -> f64 {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        line.split_whitespace().next().unwrap().parse::<f64>().unwrap() / 1024.0
    }

    /// Freed in any order, and with small ones between them.
    #[test]
    #[cfg(target_env = "gnu")]
    fn large_blocks_go_back_to_the_system() {
        give_large_blocks_back();
        drop(vec![1_u8; 4 << 20]);
        let before = resident_mib();
        let mut kept = Vec::new();
        let blocks: Vec<_> = (0..100)
            .map(|_| {
                kept.push(vec![1_u8; 64]);
                vec![1_u8; 1 << 20]
            })
            .collect();
        let most = resident_mib();
        drop(blocks);
        let after = resident_mib();
        assert!(most - before > 95.0 && after - before < 10.0, "{before}, {most}, {after} MiB");
        drop(kept);
    }
}
