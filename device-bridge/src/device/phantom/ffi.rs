//! OpenHaptics' libHD, loaded at run time: its functions, as `hdDevice.h` and `hdScheduler.h` declare them, behind ones that are safe to call.
//!
//! The only unsafe code of this crate is here (docs/adr/libhd.md). What keeps it sound: a library once loaded stays loaded, since its threads may run; what is given to its scheduler lives as
//! long as the process, and is run by one thread at a time, whatever the library does; a parameter has a buffer larger than any of HD's.
#![allow(unsafe_code)]
use super::frame::{Frame, Next};
use libloading::Library;
use std::{
    error::Error as _,
    ffi::{CStr, c_char, c_double, c_int, c_uint, c_ulong, c_ushort, c_void},
    panic::{AssertUnwindSafe, catch_unwind},
    ptr,
    sync::{Mutex, TryLockError},
};
use thiserror::Error;

/// `HD_INVALID_HANDLE`.
const INVALID_HANDLE: c_uint = 0xFFFF_FFFF;
/// `HD_DEFAULT_SCHEDULER_PRIORITY`.
const DEFAULT_PRIORITY: c_ushort = c_ushort::MAX / 2;
/// `HD_CALLBACK_DONE`, `HD_CALLBACK_CONTINUE`.
const DONE: c_uint = 0;
const CONTINUE: c_uint = 1;
/// Numbers of the largest parameter, the Jacobian.
const LARGEST: usize = 36;

/// A parameter of N numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter<const N: usize>(c_uint);

/// `HD_CURRENT_POSITION` (mm).
pub const POSITION: Parameter<3> = Parameter(0x2050);
/// `HD_CURRENT_VELOCITY` (mm/s).
pub const VELOCITY: Parameter<3> = Parameter(0x2051);
/// `HD_CURRENT_TRANSFORM`: of the tool, column by column.
pub const TRANSFORM: Parameter<16> = Parameter(0x2052);
/// `HD_CURRENT_ANGULAR_VELOCITY` (rad/s).
pub const ANGULAR_VELOCITY: Parameter<3> = Parameter(0x2053);
/// `HD_CURRENT_FORCE` (N).
pub const FORCE: Parameter<3> = Parameter(0x2700);
/// `HD_CURRENT_TORQUE` (mN m).
pub const TORQUE: Parameter<3> = Parameter(0x2701);
/// `HD_NOMINAL_MAX_STIFFNESS` (N/mm).
pub const MAX_STIFFNESS: Parameter<1> = Parameter(0x2602);
/// `HD_NOMINAL_MAX_FORCE` (N).
pub const MAX_FORCE: Parameter<1> = Parameter(0x2603);
/// `HD_NOMINAL_MAX_CONTINUOUS_FORCE` (N).
pub const MAX_CONTINUOUS_FORCE: Parameter<1> = Parameter(0x2604);
/// `HD_SOFTWARE_VELOCITY_LIMIT` (mm/s).
pub const VELOCITY_LIMIT: Parameter<1> = Parameter(0x2606);
/// `HD_SOFTWARE_FORCE_IMPULSE_LIMIT` (N between two frames).
pub const IMPULSE_LIMIT: Parameter<1> = Parameter(0x2607);
/// `HD_NOMINAL_MAX_TORQUE_FORCE` (mN m).
pub const MAX_TORQUE: Parameter<1> = Parameter(0x2622);

/// A whole number: `HD_CURRENT_BUTTONS` and others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Integer(c_uint);

/// `HD_CURRENT_BUTTONS`: bit i is button i.
pub const BUTTONS: Integer = Integer(0x2000);
/// `HD_OUTPUT_DOF`: 6 with motors for torque.
pub const OUTPUT_DOF: Integer = Integer(0x2554);
/// `HD_CALIBRATION_STYLE`: a bit for each.
pub const CALIBRATION_STYLE: Integer = Integer(0x2555);

/// `HD_DEVICE_MODEL_TYPE`.
pub const MODEL: Text = Text(0x2501);

/// A text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Text(c_uint);

/// `HD_FORCE_OUTPUT`.
pub const FORCE_OUTPUT: Capability = Capability(0x4000);

/// What can be switched on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capability(c_uint);

/// Why there is no libHD.
#[derive(Debug, Error)]
pub enum LoadError {
    /// None can be loaded.
    #[error(
        "libHD cannot be loaded ({tried}): install OpenHaptics and the driver of the arm (docs/arms/phantom.md), or give its path as device.library"
    )]
    Missing {
        /// Each name, with what the system says of it.
        tried: String,
    },
    /// It is something else.
    #[error(
        "{library} has no function {symbol}: it is not OpenHaptics' libHD, or one before 3.0; device.library says which to load"
    )]
    Symbol {
        /// Which library.
        library: String,
        /// Which function.
        symbol: &'static str,
    },
}

/// `HDErrorInfo`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
struct ErrorInfo {
    code: c_uint,
    internal: c_int,
    device: c_uint,
}

type Callback = unsafe extern "C" fn(*mut c_void) -> c_uint;

#[derive(Debug)]
struct Functions {
    init_device: unsafe extern "C" fn(*const c_char) -> c_uint,
    disable_device: unsafe extern "C" fn(c_uint),
    begin_frame: unsafe extern "C" fn(c_uint),
    end_frame: unsafe extern "C" fn(c_uint),
    get_error: unsafe extern "C" fn() -> ErrorInfo,
    get_error_string: unsafe extern "C" fn(c_uint) -> *const c_char,
    enable: unsafe extern "C" fn(c_uint),
    get_doublev: unsafe extern "C" fn(c_uint, *mut c_double),
    get_integerv: unsafe extern "C" fn(c_uint, *mut c_int),
    get_string: unsafe extern "C" fn(c_uint) -> *const c_char,
    set_doublev: unsafe extern "C" fn(c_uint, *const c_double),
    check_calibration: unsafe extern "C" fn() -> c_uint,
    update_calibration: unsafe extern "C" fn(c_uint),
    set_scheduler_rate: unsafe extern "C" fn(c_ulong),
    start_scheduler: unsafe extern "C" fn(),
    stop_scheduler: unsafe extern "C" fn(),
    schedule_asynchronous: unsafe extern "C" fn(Callback, *mut c_void, c_ushort) -> c_ulong,
    unschedule: unsafe extern "C" fn(c_ulong),
}

impl Functions {
    fn of(library: &Library, name: &str) -> Result<Self, LoadError> {
        macro_rules! function {
            ($symbol:literal) => {{
                // SAFETY: the field that this becomes has the type of the function with this name in HD's headers.
                let found = unsafe { library.get($symbol) };
                *found.map_err(|_| LoadError::Symbol { library: name.to_owned(), symbol: $symbol })?
            }};
        }
        Ok(Self {
            init_device: function!("hdInitDevice"),
            disable_device: function!("hdDisableDevice"),
            begin_frame: function!("hdBeginFrame"),
            end_frame: function!("hdEndFrame"),
            get_error: function!("hdGetError"),
            get_error_string: function!("hdGetErrorString"),
            enable: function!("hdEnable"),
            get_doublev: function!("hdGetDoublev"),
            get_integerv: function!("hdGetIntegerv"),
            get_string: function!("hdGetString"),
            set_doublev: function!("hdSetDoublev"),
            check_calibration: function!("hdCheckCalibration"),
            update_calibration: function!("hdUpdateCalibration"),
            set_scheduler_rate: function!("hdSetSchedulerRate"),
            start_scheduler: function!("hdStartScheduler"),
            stop_scheduler: function!("hdStopScheduler"),
            schedule_asynchronous: function!("hdScheduleAsynchronous"),
            unschedule: function!("hdUnschedule"),
        })
    }
}

/// A device that was initialised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Device(c_uint);

/// What was given to the scheduler.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scheduled(c_ulong);

/// The library.
#[derive(Debug, Clone, Copy)]
pub struct Hd(&'static Functions);

impl Hd {
    /// The first of these that can be loaded; it stays loaded.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn load(names: &[String]) -> Result<Self, LoadError> {
        let mut tried = Vec::new();
        for name in names {
            // SAFETY: what a library does when it is loaded is its own; the user names it.
            match unsafe { Library::new(name) } {
                Ok(library) => {
                    // A library with threads of its own must never be unloaded: forgotten, it stays.
                    let library = Box::leak(Box::new(library));
                    return Ok(Self(Box::leak(Box::new(Functions::of(library, name)?))));
                }
                // The system's own words, with the name, are its cause.
                Err(error) => tried.push(error.source().map_or_else(|| error.to_string(), ToString::to_string)),
            }
        }
        Err(LoadError::Missing { tried: tried.join("; ") })
    }

    /// The device of this name, or the default one.
    pub fn init_device(self, name: Option<&CStr>) -> Option<Device> {
        // SAFETY: a string, or null for the default, which HD only reads.
        let handle = unsafe { (self.0.init_device)(name.map_or(ptr::null(), CStr::as_ptr)) };
        (handle != INVALID_HANDLE).then_some(Device(handle))
    }

    /// Ends its use.
    pub fn disable_device(self, device: Device) {
        // SAFETY: a handle that HD gave; one that is none any more is an error of HD's, not undefined.
        unsafe { (self.0.disable_device)(device.0) };
    }

    /// Reads the device's state; what follows is of this frame.
    pub fn begin_frame(self, device: Device) {
        // SAFETY: as `disable_device`.
        unsafe { (self.0.begin_frame)(device.0) };
    }

    /// Sends force and torque to the device.
    pub fn end_frame(self, device: Device) {
        // SAFETY: as `disable_device`.
        unsafe { (self.0.end_frame)(device.0) };
    }

    /// Takes the newest error from HD's stack; its code.
    pub fn error(self) -> Option<u32> {
        // SAFETY: takes nothing and gives a value.
        let error = unsafe { (self.0.get_error)() };
        (error.code != 0).then_some(error.code)
    }

    /// What HD says of an error. Allocates.
    pub fn error_text(self, code: u32) -> String {
        // SAFETY: takes a number.
        text(unsafe { (self.0.get_error_string)(code) })
    }

    /// Switches something on.
    pub fn enable(self, capability: Capability) {
        // SAFETY: takes a number.
        unsafe { (self.0.enable)(capability.0) };
    }

    /// The parameter's numbers; not numbers (NaN) where HD refuses.
    pub fn doubles<const N: usize>(self, parameter: Parameter<N>) -> [f64; N] {
        let mut values = [f64::NAN; LARGEST];
        // SAFETY: HD writes the parameter's numbers, and there is room for those of any.
        unsafe { (self.0.get_doublev)(parameter.0, values.as_mut_ptr()) };
        std::array::from_fn(|index| values[index])
    }

    /// The whole number; 0 where HD refuses.
    pub fn integer(self, parameter: Integer) -> i32 {
        let mut values = [0; LARGEST];
        // SAFETY: as `doubles`.
        unsafe { (self.0.get_integerv)(parameter.0, values.as_mut_ptr()) };
        values[0]
    }

    /// The text, empty where HD refuses. Allocates.
    pub fn text(self, parameter: Text) -> String {
        // SAFETY: takes a number.
        text(unsafe { (self.0.get_string)(parameter.0) })
    }

    /// Sets the parameter's numbers.
    pub fn set<const N: usize>(self, parameter: Parameter<N>, values: [f64; N]) {
        let mut all = [0.0; LARGEST];
        all[..N].copy_from_slice(&values);
        // SAFETY: HD reads the parameter's numbers, and there are those of any.
        unsafe { (self.0.set_doublev)(parameter.0, all.as_ptr()) };
    }

    /// How the device's calibration stands: a `HD_CALIBRATION_…`.
    pub fn check_calibration(self) -> u32 {
        // SAFETY: takes nothing and gives a number.
        unsafe { (self.0.check_calibration)() }
    }

    /// Calibrates in this style.
    pub fn update_calibration(self, style: u32) {
        // SAFETY: takes a number.
        unsafe { (self.0.update_calibration)(style) };
    }

    /// How often (Hz) the scheduler calls.
    pub fn set_scheduler_rate(self, rate_hz: u32) {
        // SAFETY: takes a number.
        unsafe { (self.0.set_scheduler_rate)(rate_hz.into()) };
    }

    /// Starts the scheduler.
    pub fn start_scheduler(self) {
        // SAFETY: takes nothing.
        unsafe { (self.0.start_scheduler)() };
    }

    /// Stops the scheduler.
    pub fn stop_scheduler(self) {
        // SAFETY: takes nothing.
        unsafe { (self.0.stop_scheduler)() };
    }

    /// The scheduler runs this frame from now on, until it is done. It is never freed: no call can come too late.
    pub fn schedule(self, frame: Frame) -> Scheduled {
        let frame: &'static Mutex<Frame> = Box::leak(Box::new(Mutex::new(frame)));
        // SAFETY: `run_frame` takes the address of a `Mutex<Frame>` that lives as long as the process.
        let handle = unsafe {
            (self.0.schedule_asynchronous)(run_frame, ptr::from_ref(frame).cast_mut().cast(), DEFAULT_PRIORITY)
        };
        Scheduled(handle)
    }

    /// The scheduler runs it no more.
    pub fn unschedule(self, scheduled: Scheduled) {
        // SAFETY: takes a number.
        unsafe { (self.0.unschedule)(scheduled.0) };
    }
}

/// A copy of HD's text; empty for null.
fn text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, so one of HD's strings, which it does not change while it is copied.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// On HD's thread. A panic must not go through HD: it ends the arm.
///
/// # Safety
/// `data` is the address of a `Mutex<Frame>` that is never freed.
unsafe extern "C" fn run_frame(data: *mut c_void) -> c_uint {
    // SAFETY: the caller's promise, kept by `Hd::schedule`, which alone gives this function away.
    let frame = unsafe { &*data.cast::<Mutex<Frame>>() };
    let mut frame = match frame.try_lock() {
        Ok(frame) => frame,
        Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
        // HD has one scheduler thread; should it have two, one frame is enough.
        Err(TryLockError::WouldBlock) => return CONTINUE,
    };
    match catch_unwind(AssertUnwindSafe(|| frame.run())) {
        Ok(Next::Done) => DONE,
        Ok(Next::Again) => CONTINUE,
        Err(_) => {
            frame.fail();
            CONTINUE
        }
    }
}
