//! A libHD that is none: the functions of OpenHaptics' HD that the driver of a PHANToM uses, as a shared library, with a scheduler of its own at 1 kHz. In
//! the place of hardware there is the emulated arm of `palpate-bridge emulate phantom` at the other end of a Unix socket, whose path is the name of the device.
//!
//! It is stricter than the real one: a frame within a frame, a force outside one, an unknown parameter are errors, so that the driver is seen to keep the order.
//!
//! Unsafe as every C interface: what the callers promise is what `hdDevice.h` and `hdScheduler.h` ask of them.
#![allow(unsafe_code)]
#![allow(non_snake_case, missing_docs)] // the names of the C functions, which hdDevice.h and hdScheduler.h explain
mod arm;
mod device;
mod scheduler;

use device::{Device, library};
use std::ffi::{CStr, c_char, c_double, c_int, c_uint, c_ulong, c_ushort, c_void};

/// As in `hdDefines.h`.
mod hd {
    pub(crate) const SUCCESS: u32 = 0;
    pub(crate) const INVALID_ENUM: u32 = 0x0100;
    pub(crate) const INVALID_VALUE: u32 = 0x0101;
    pub(crate) const INVALID_OPERATION: u32 = 0x0102;
    pub(crate) const BAD_HANDLE: u32 = 0x0104;
    pub(crate) const EXCEEDED_MAX_FORCE: u32 = 0x0201;
    pub(crate) const DEVICE_FAULT: u32 = 0x0300;
    pub(crate) const DEVICE_ALREADY_INITIATED: u32 = 0x0301;
    pub(crate) const COMM_ERROR: u32 = 0x0302;
    pub(crate) const ILLEGAL_BEGIN: u32 = 0x0400;
    pub(crate) const ILLEGAL_END: u32 = 0x0401;
    pub(crate) const FRAME_ERROR: u32 = 0x0402;
    pub(crate) const NOMINAL_MAX_FORCE: u32 = 0x2603;
    pub(crate) const CURRENT_FORCE: u32 = 0x2700;
    pub(crate) const CURRENT_TORQUE: u32 = 0x2701;
    pub(crate) const OUTPUT_DOF: u32 = 0x2554;
    pub(crate) const FORCE_OUTPUT: u32 = 0x4000;
    pub(crate) const INVALID_HANDLE: u32 = 0xFFFF_FFFF;
}

/// An error, newest first.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct HDErrorInfo {
    errorCode: c_uint,
    internalErrorCode: c_int,
    hHD: c_uint,
}

/// # Safety
/// `name` is null or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdInitDevice(name: *const c_char) -> c_uint {
    // SAFETY: the caller's promise.
    let name = (!name.is_null()).then(|| unsafe { CStr::from_ptr(name) }.to_string_lossy().into_owned());
    let mut library = library();
    if library.device.is_some() {
        library.raise(hd::DEVICE_ALREADY_INITIATED);
        return hd::INVALID_HANDLE;
    }
    library.device = Device::open(name.as_deref().unwrap_or(arm::DEFAULT)).ok();
    if library.device.is_some() {
        return device::HANDLE;
    }
    library.raise(hd::DEVICE_FAULT);
    hd::INVALID_HANDLE
}

#[unsafe(no_mangle)]
pub extern "C" fn hdDisableDevice(handle: c_uint) {
    let mut library = library();
    if handle == device::HANDLE && library.device.is_some() {
        library.device = None;
    } else {
        library.raise(hd::BAD_HANDLE);
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdBeginFrame(handle: c_uint) {
    library().begin_frame(handle);
}

#[unsafe(no_mangle)]
pub extern "C" fn hdEndFrame(handle: c_uint) {
    library().end_frame(handle);
}

#[unsafe(no_mangle)]
pub extern "C" fn hdGetError() -> HDErrorInfo {
    let mut library = library();
    let code = library.errors.pop().unwrap_or(hd::SUCCESS);
    HDErrorInfo { errorCode: code, internalErrorCode: 0, hHD: device::HANDLE }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdGetErrorString(code: c_uint) -> *const c_char {
    let text = match code {
        hd::SUCCESS => c"success",
        hd::DEVICE_FAULT => c"device fault",
        hd::COMM_ERROR => c"communication error",
        _ => c"error of the mock",
    };
    text.as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn hdEnable(capability: c_uint) {
    library().set_enabled(capability, true);
}

#[unsafe(no_mangle)]
pub extern "C" fn hdDisable(capability: c_uint) {
    library().set_enabled(capability, false);
}

/// # Safety
/// `values` has room for the parameter's numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetDoublev(parameter: c_uint, values: *mut c_double) {
    let numbers = library().numbers(parameter);
    for (index, number) in numbers.into_iter().enumerate() {
        // SAFETY: the caller's promise.
        unsafe { values.add(index).write(number) };
    }
}

/// # Safety
/// `values` has room for the parameter's numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetIntegerv(parameter: c_uint, values: *mut c_int) {
    let numbers = library().numbers(parameter);
    for (index, number) in numbers.into_iter().enumerate() {
        // SAFETY: the caller's promise.
        unsafe { values.add(index).write(number as c_int) };
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdGetString(parameter: c_uint) -> *const c_char {
    library().text(parameter)
}

/// # Safety
/// `values` has the parameter's three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdSetDoublev(parameter: c_uint, values: *const c_double) {
    // SAFETY: the caller's promise.
    let values = unsafe { [values.read(), values.add(1).read(), values.add(2).read()] };
    library().set(parameter, values);
}

#[unsafe(no_mangle)]
pub extern "C" fn hdCheckCalibration() -> c_uint {
    library().calibration()
}

#[unsafe(no_mangle)]
pub extern "C" fn hdUpdateCalibration(style: c_uint) {
    library().with_device(|device| device.tell(&format!("calibrate {style}")));
}

#[unsafe(no_mangle)]
pub extern "C" fn hdSetSchedulerRate(rate_hz: c_ulong) {
    if !scheduler::set_rate(rate_hz) {
        library().raise(hd::INVALID_VALUE);
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdStartScheduler() {
    if !scheduler::start() {
        library().raise(hd::INVALID_OPERATION);
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdStopScheduler() {
    scheduler::stop();
}

/// # Safety
/// `callback` may be called with `data` from another thread until it says that it is done, is unscheduled, or the scheduler stopped.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdScheduleAsynchronous(
    callback: scheduler::Callback,
    data: *mut c_void,
    _priority: c_ushort,
) -> c_ulong {
    scheduler::schedule(callback, data)
}

#[unsafe(no_mangle)]
pub extern "C" fn hdUnschedule(handle: c_ulong) {
    scheduler::unschedule(handle);
}
