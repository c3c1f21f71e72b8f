//! OpenHaptics' HDAPI as C symbols.
#![allow(unsafe_code, reason = "C symbols")]

use super::{
    BAD_HANDLE, Callback, DEVICE, IN_TICK, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Scheduled, tick,
    with,
};
use nalgebra::Vector3;
use std::ffi::{c_char, c_int, c_uint, c_ulong, c_ushort, c_void};
use std::time::Duration;

#[unsafe(no_mangle)]
extern "system" fn hdInitDevice(_name: *const c_char) -> c_uint {
    with(|d| {
        if d.is("absent") {
            d.errors.push(0x301);
            return 0xFFFF_FFFF;
        }
        d.initialised = true;
        DEVICE
    })
}

#[unsafe(no_mangle)]
extern "system" fn hdDisableDevice(_device: c_uint) {
    with(|d| {
        if !d.scheduled.is_empty() {
            d.errors.push(INVALID_OPERATION);
        }
        (d.initialised, d.force_on) = (false, false);
    });
}

#[unsafe(no_mangle)]
extern "system" fn hdMakeCurrentDevice(device: c_uint) {
    with(|d| {
        if device != DEVICE {
            d.errors.push(BAD_HANDLE);
        }
    });
}

#[unsafe(no_mangle)]
extern "system" fn hdBeginFrame(device: c_uint) {
    with(|d| d.begin(device));
}

#[unsafe(no_mangle)]
extern "system" fn hdEndFrame(device: c_uint) {
    with(|d| d.end(device));
}

/// `HDErrorInfo`.
#[repr(C)]
struct ErrorInfo {
    code: c_uint,
    internal: c_int,
    device: c_uint,
}

#[unsafe(no_mangle)]
extern "system" fn hdGetError() -> ErrorInfo {
    ErrorInfo { code: with(|d| d.errors.pop().unwrap_or(0)), internal: 0, device: DEVICE }
}

#[unsafe(no_mangle)]
extern "system" fn hdGetErrorString(_code: c_uint) -> *const c_char {
    c"emulated error".as_ptr()
}

#[unsafe(no_mangle)]
extern "system" fn hdGetString(parameter: c_uint) -> *const c_char {
    match parameter {
        0x2501 => c"Emulated Premium 1.5".as_ptr(),
        0x2504 => c"EMU-1".as_ptr(),
        _ => std::ptr::null(),
    }
}

#[unsafe(no_mangle)]
extern "system" fn hdEnable(capability: c_uint) {
    with(|d| match capability {
        0x4000 => d.force_on = true,
        _ => d.errors.push(INVALID_ENUM),
    });
}

#[unsafe(no_mangle)]
extern "system" fn hdDisable(capability: c_uint) {
    with(|d| match capability {
        0x4000 => d.force_on = false,
        _ => d.errors.push(INVALID_ENUM),
    });
}

#[unsafe(no_mangle)]
unsafe extern "system" fn hdGetDoublev(parameter: c_uint, values: *mut f64) {
    let found = with(|d| d.doubles(parameter));
    // SAFETY: room for the parameter's numbers, as the vendor's manual asks.
    unsafe { std::ptr::copy_nonoverlapping(found.as_ptr(), values, found.len()) };
}

#[unsafe(no_mangle)]
unsafe extern "system" fn hdGetIntegerv(parameter: c_uint, values: *mut c_int) {
    let found = with(|d| match parameter {
        0x2000 => d.scripted("buttons", 0.0) as c_int,
        0x2553 => d.scripted("input_dof", 6.0) as c_int,
        0x2554 => d.scripted("output_dof", 6.0) as c_int,
        0x2555 => 6,
        _ => {
            d.errors.push(INVALID_ENUM);
            0
        }
    });
    // SAFETY: room for one number, as the vendor's manual asks.
    unsafe { *values = found };
}

#[unsafe(no_mangle)]
unsafe extern "system" fn hdSetDoublev(parameter: c_uint, values: *const f64) {
    // SAFETY: three numbers, as the parameters here have.
    let value = unsafe { Vector3::new(*values, *values.add(1), *values.add(2)) };
    with(|d| d.assign(parameter, value));
}

#[unsafe(no_mangle)]
extern "system" fn hdCheckCalibration() -> c_uint {
    with(|d| match (d.calibrated, d.is("needs_hand")) {
        (true, _) => 0x5000,
        (false, false) => 0x5001,
        (false, true) => 0x5002,
    })
}

#[unsafe(no_mangle)]
extern "system" fn hdUpdateCalibration(style: c_uint) {
    with(|d| {
        d.updates += 1;
        match d.in_frame || !matches!(style, 2 | 4) {
            true => d.errors.push(INVALID_OPERATION),
            false => d.calibrated = true,
        }
    });
}

#[unsafe(no_mangle)]
extern "system" fn hdSetSchedulerRate(hz: c_ulong) {
    with(|d| {
        if ![500, 1000, 2000].contains(&hz) {
            d.errors.push(INVALID_VALUE);
        }
    });
}

#[unsafe(no_mangle)]
extern "system" fn hdScheduleAsynchronous(
    callback: Callback,
    data: *mut c_void,
    _priority: c_ushort,
) -> c_ulong {
    with(|d| {
        d.handles += 1;
        let handle = d.handles;
        d.scheduled.push(Scheduled { handle, callback, data: data as usize });
        handle
    })
}

#[unsafe(no_mangle)]
extern "system" fn hdUnschedule(handle: c_ulong) {
    let _guard = IN_TICK.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    with(|d| d.scheduled.retain(|s| s.handle != handle));
}

#[unsafe(no_mangle)]
extern "system" fn hdStartScheduler() {
    with(|d| {
        if !d.initialised {
            d.errors.push(INVALID_OPERATION);
        }
        if std::mem::replace(&mut d.running, true) {
            return;
        }
        d.thread = Some(std::thread::spawn(|| {
            while with(|d| d.running) {
                tick();
                let period = with(|d| d.scripted("period_us", 100.0));
                std::thread::sleep(Duration::from_micros(period as u64));
            }
        }));
    });
}

#[unsafe(no_mangle)]
extern "system" fn hdStopScheduler() {
    let thread = with(|d| {
        d.running = false;
        d.thread.take()
    });
    if let Some(thread) = thread {
        let _ = thread.join();
    }
}
