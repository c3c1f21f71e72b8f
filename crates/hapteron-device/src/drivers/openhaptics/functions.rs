//! The functions and numbers of HDAPI that this driver uses, behind signatures that cannot be misused.
#![allow(unsafe_code, reason = "calls into the vendor's library")]

use crate::DeviceFault;
use crate::drivers::library::vendor_functions;
use std::ffi::{CStr, c_char, c_int, c_uint, c_ulong, c_ushort, c_void};

/// What `hdGetError` answers, by value.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub(super) struct ErrorInfo {
    pub code: c_uint,
    _internal: c_int,
    _device: c_uint,
}

/// A callback of the scheduler: 0 is done, 1 is again in the next tick.
pub(super) type Callback = unsafe extern "system" fn(*mut c_void) -> c_uint;
pub(super) const DONE: c_uint = 0;
pub(super) const AGAIN: c_uint = 1;

pub(super) const INVALID_HANDLE: c_uint = 0xFFFF_FFFF;
pub(super) const FORCE_OUTPUT: c_uint = 0x4000;
pub(super) const CURRENT_BUTTONS: c_uint = 0x2000;
pub(super) const CURRENT_POSITION: c_uint = 0x2050;
pub(super) const CURRENT_VELOCITY: c_uint = 0x2051;
pub(super) const CURRENT_TRANSFORM: c_uint = 0x2052;
pub(super) const CURRENT_ANGULAR_VELOCITY: c_uint = 0x2053;
pub(super) const MODEL_TYPE: c_uint = 0x2501;
pub(super) const SERIAL_NUMBER: c_uint = 0x2504;
pub(super) const USABLE_WORKSPACE: c_uint = 0x2551;
pub(super) const INPUT_DOF: c_uint = 0x2553;
pub(super) const OUTPUT_DOF: c_uint = 0x2554;
pub(super) const CALIBRATION_STYLE: c_uint = 0x2555;
pub(super) const NOMINAL_MAX_STIFFNESS: c_uint = 0x2602;
pub(super) const NOMINAL_MAX_FORCE: c_uint = 0x2603;
pub(super) const NOMINAL_MAX_CONTINUOUS_FORCE: c_uint = 0x2604;
pub(super) const NOMINAL_MAX_DAMPING: c_uint = 0x2609;
pub(super) const NOMINAL_MAX_TORQUE_STIFFNESS: c_uint = 0x2620;
pub(super) const NOMINAL_MAX_TORQUE: c_uint = 0x2622;
pub(super) const NOMINAL_MAX_CONTINUOUS_TORQUE: c_uint = 0x2623;
pub(super) const CURRENT_FORCE: c_uint = 0x2700;
pub(super) const CURRENT_TORQUE: c_uint = 0x2701;
const CALIBRATION_OK: c_uint = 0x5000;
const CALIBRATION_NEEDS_UPDATE: c_uint = 0x5001;

vendor_functions! {
    /// HDAPI.
    Functions
    required {
        hdInitDevice(*const c_char) -> c_uint;
        hdDisableDevice(c_uint) -> ();
        hdMakeCurrentDevice(c_uint) -> ();
        hdBeginFrame(c_uint) -> ();
        hdEndFrame(c_uint) -> ();
        hdGetError() -> ErrorInfo;
        hdEnable(c_uint) -> ();
        hdDisable(c_uint) -> ();
        hdGetDoublev(c_uint, *mut f64) -> ();
        hdGetIntegerv(c_uint, *mut c_int) -> ();
        hdSetDoublev(c_uint, *const f64) -> ();
        hdScheduleAsynchronous(Callback, *mut c_void, c_ushort) -> c_ulong;
        hdUnschedule(c_ulong) -> ();
        hdStartScheduler() -> ();
        hdStopScheduler() -> ();
    }
    optional {
        hdGetErrorString(c_uint) -> *const c_char;
        hdGetString(c_uint) -> *const c_char;
        hdCheckCalibration() -> c_uint;
        hdUpdateCalibration(c_uint) -> ();
        hdSetSchedulerRate(c_ulong) -> ();
    }
}

/// Whether the device knows where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Calibration {
    Known,
    /// It knows better now and wants to be told to take it over.
    Update,
    /// The user has to bring it to its reset position or its inkwell.
    ByHand,
}

impl Functions {
    /// The device of a name (`None`: the default one), or the error's code.
    pub fn init(&self, name: Option<&CStr>) -> Result<c_uint, c_uint> {
        // SAFETY: a text with a terminating zero, or null.
        let device = unsafe { (self.hdInitDevice)(name.map_or(std::ptr::null(), CStr::as_ptr)) };
        let error = self.first_error();
        if device == INVALID_HANDLE || error.is_some() {
            return Err(error.unwrap_or(0));
        }
        Ok(device)
    }

    pub fn disable_device(&self, device: c_uint) {
        // SAFETY: a plain value; no callback uses the device any more.
        unsafe { (self.hdDisableDevice)(device) };
    }

    pub fn make_current(&self, device: c_uint) {
        // SAFETY: a plain value.
        unsafe { (self.hdMakeCurrentDevice)(device) };
    }

    pub fn begin(&self, device: c_uint) {
        // SAFETY: a plain value.
        unsafe { (self.hdBeginFrame)(device) };
    }

    pub fn end(&self, device: c_uint) {
        // SAFETY: a plain value.
        unsafe { (self.hdEndFrame)(device) };
    }

    /// `N` must be at least what the parameter has.
    pub fn doubles<const N: usize>(&self, parameter: c_uint) -> [f64; N] {
        // Longer than any parameter that this driver asks for.
        let mut values = [0.0; 16];
        // SAFETY: room for 16 numbers; the longest parameter here, a transform, has 16.
        unsafe { (self.hdGetDoublev)(parameter, values.as_mut_ptr()) };
        let mut wanted = [0.0; N];
        wanted.copy_from_slice(&values[..N]);
        wanted
    }

    pub fn integer(&self, parameter: c_uint) -> c_int {
        let mut values: [c_int; 8] = [0; 8];
        // SAFETY: room for 8 numbers; the parameters here have one.
        unsafe { (self.hdGetIntegerv)(parameter, values.as_mut_ptr()) };
        values[0]
    }

    pub fn string(&self, parameter: c_uint) -> Option<String> {
        // SAFETY: the library answers with a text that stays, or null.
        self.hdGetString.and_then(|f| unsafe { text(f(parameter)) })
    }

    pub fn error_text(&self, code: c_uint) -> String {
        // SAFETY: as above.
        let said = self.hdGetErrorString.and_then(|f| unsafe { text(f(code)) });
        format!("code {code:#x}{}", said.map(|t| format!(", {t}")).unwrap_or_default())
    }

    /// Only inside a frame.
    pub fn set(&self, parameter: c_uint, value: [f64; 3]) {
        // SAFETY: three numbers, as the parameters here have.
        unsafe { (self.hdSetDoublev)(parameter, value.as_ptr()) };
    }

    pub fn enable_force(&self, on: bool) {
        // SAFETY: plain values.
        unsafe { if on { (self.hdEnable)(FORCE_OUTPUT) } else { (self.hdDisable)(FORCE_OUTPUT) } };
    }

    /// # Safety
    /// `data` must be good for `callback` until it is unscheduled.
    pub unsafe fn schedule(&self, callback: Callback, data: *mut c_void) -> c_ulong {
        // SAFETY: as the caller says. The highest priority that the library has.
        unsafe { (self.hdScheduleAsynchronous)(callback, data, 65535) }
    }

    pub fn unschedule(&self, handle: c_ulong) {
        // SAFETY: a plain value.
        unsafe { (self.hdUnschedule)(handle) };
    }

    pub fn start_scheduler(&self) {
        // SAFETY: no arguments.
        unsafe { (self.hdStartScheduler)() };
    }

    pub fn stop_scheduler(&self) {
        // SAFETY: no arguments.
        unsafe { (self.hdStopScheduler)() };
    }

    /// A rate that the library does not take is no fault: it stays as it is. Answers whether it was taken.
    pub fn set_rate(&self, hz: u32) -> bool {
        let Some(set) = self.hdSetSchedulerRate else { return false };
        // SAFETY: a plain value.
        unsafe { set(c_ulong::from(hz)) };
        self.first_error().is_none()
    }

    pub fn calibration(&self) -> Calibration {
        // SAFETY: no arguments.
        match self.hdCheckCalibration.map(|check| unsafe { check() }) {
            None | Some(CALIBRATION_OK) => Calibration::Known,
            Some(CALIBRATION_NEEDS_UPDATE) => Calibration::Update,
            Some(_) => Calibration::ByHand,
        }
    }

    /// Not inside a frame. Of the device's styles, the one that needs least of the user.
    pub fn update_calibration(&self) {
        let styles = self.integer(CALIBRATION_STYLE) as c_uint;
        let style = [2, 4, 1].into_iter().find(|s| styles & s != 0).unwrap_or(styles);
        if let Some(update) = self.hdUpdateCalibration {
            // SAFETY: a plain value.
            unsafe { update(style) };
        }
    }

    /// Empties the stack of errors; the first (oldest) that is fatal.
    pub fn drain(&self) -> Result<(), DeviceFault> {
        let mut fatal = Ok(());
        // More than the stack holds.
        for _ in 0..64 {
            // SAFETY: no arguments.
            let code = unsafe { (self.hdGetError)() }.code;
            match code {
                0 => break,
                // Warm motors, force, impulse or speed too great: the library takes the force away for a time and comes back.
                0x200..=0x204 => {}
                // The stack gives the newest first.
                0x302 | 0x303 => fatal = Err(DeviceFault::Disconnected),
                code => fatal = Err(DeviceFault::Refused(code as i32)),
            }
        }
        fatal
    }

    fn first_error(&self) -> Option<c_uint> {
        let mut first = None;
        for _ in 0..64 {
            // SAFETY: no arguments.
            match unsafe { (self.hdGetError)() }.code {
                0 => break,
                code => first = Some(code),
            }
        }
        first
    }
}

/// # Safety
/// Null, or a text with a terminating zero that stays.
unsafe fn text(pointer: *const c_char) -> Option<String> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: as the caller says.
    Some(unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned())
}
