//! The scheduler: a thread that calls at its rate, on absolute deadlines.
use std::{
    ffi::{c_uint, c_ulong, c_void},
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

/// What it calls.
pub(crate) type Callback = unsafe extern "C" fn(*mut c_void) -> c_uint;

/// The rates (Hz) it knows.
const RATES_HZ: [u64; 12] = [500, 533, 571, 615, 666, 727, 800, 889, 1000, 1143, 1333, 1600];
const CALLBACK_DONE: c_uint = 0;

#[derive(Clone, Copy)]
struct Scheduled {
    handle: c_ulong,
    callback: Callback,
    /// An address: only handed on.
    data: usize,
}

static RATE_HZ: AtomicU64 = AtomicU64::new(1000);
static RUNNING: AtomicBool = AtomicBool::new(false);
static NEXT_HANDLE: AtomicU64 = AtomicU64::new(1);
static SCHEDULED: Mutex<Vec<Scheduled>> = Mutex::new(Vec::new());
static THREAD: Mutex<Option<JoinHandle<()>>> = Mutex::new(None);

fn held<T>(mutex: &'static Mutex<T>) -> MutexGuard<'static, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) fn set_rate(rate_hz: u64) -> bool {
    let known = RATES_HZ.contains(&rate_hz);
    if known {
        RATE_HZ.store(rate_hz, Ordering::Relaxed);
    }
    known
}

pub(crate) fn start() -> bool {
    let mut thread = held(&THREAD);
    if thread.is_some() {
        return false;
    }
    RUNNING.store(true, Ordering::Relaxed);
    *thread = std::thread::Builder::new().name("mock-libhd".into()).spawn(run).ok();
    thread.is_some()
}

/// After this nothing is called.
pub(crate) fn stop() {
    RUNNING.store(false, Ordering::Relaxed);
    if let Some(thread) = held(&THREAD).take() {
        let _ = thread.join();
    }
}

pub(crate) fn schedule(callback: Callback, data: *mut c_void) -> c_ulong {
    let handle = NEXT_HANDLE.fetch_add(1, Ordering::Relaxed);
    held(&SCHEDULED).push(Scheduled { handle, callback, data: data as usize });
    handle
}

pub(crate) fn unschedule(handle: c_ulong) {
    held(&SCHEDULED).retain(|scheduled| scheduled.handle != handle);
}

fn run() {
    let mut due = Instant::now();
    while RUNNING.load(Ordering::Relaxed) {
        let all = held(&SCHEDULED).clone();
        for Scheduled { handle, callback, data } in all {
            // SAFETY: the promise of who scheduled it; it is still scheduled, and this thread alone calls.
            if unsafe { callback(data as *mut c_void) } == CALLBACK_DONE {
                unschedule(handle);
            }
        }
        due += Duration::from_secs(1) / RATE_HZ.load(Ordering::Relaxed) as u32;
        let now = Instant::now();
        // What was late is not made up for.
        due = due.max(now);
        std::thread::sleep(due - now);
    }
}
