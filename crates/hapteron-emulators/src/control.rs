//! How a test scripts an emulated library: names and numbers through two further C symbols of it.
#![allow(unsafe_code, reason = "C symbols for the test that loaded this library")]

use crate::{dhd, hd};
use std::ffi::{CStr, c_char};

/// Sets a named value (`dhd.target_x`, `dhd.refuse_forces`, `hd.calibrated`, ...); 1 when the name is known.
///
/// # Safety
/// `name` must be a text with a terminating zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn emulator_set(name: *const c_char, value: f64) -> i32 {
    // SAFETY: as the caller says.
    let name = unsafe { CStr::from_ptr(name) }.to_str().unwrap_or("");
    let known = match name.split_once('.') {
        Some(("dhd", name)) => dhd::with(|d| d.set(name, value)),
        Some(("hd", name)) => hd::with(|d| d.set(name, value)),
        _ => false,
    };
    i32::from(known)
}

/// The value of a name; not a number when the name is unknown.
///
/// # Safety
/// `name` must be a text with a terminating zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn emulator_get(name: *const c_char) -> f64 {
    // SAFETY: as the caller says.
    let name = unsafe { CStr::from_ptr(name) }.to_str().unwrap_or("");
    let value = match name.split_once('.') {
        Some(("dhd", name)) => dhd::with(|d| d.get(name)),
        Some(("hd", name)) => hd::with(|d| d.get(name)),
        _ => None,
    };
    value.unwrap_or(f64::NAN)
}
