//! The functions of the vendor's library, behind signatures that cannot be misused.
#![allow(unsafe_code, reason = "calls into the vendor's library")]

use crate::drivers::library::vendor_functions;
use nalgebra::{Matrix3, Vector3};
use std::ffi::{CStr, c_char, c_int, c_uint, c_ushort};

/// Which device, as the library numbers them.
pub(super) type Id = c_char;

vendor_functions! {
    /// DHD, and DRD where the library is `libdrd`.
    Functions
    required {
        dhdErrorGetLast() -> c_int;
        dhdGetDeviceCount() -> c_int;
        dhdOpenID(c_char) -> c_int;
        dhdClose(c_char) -> c_int;
        dhdStop(c_char) -> c_int;
        dhdEnableForce(u8, c_char) -> c_int;
        dhdGetSystemType(c_char) -> c_int;
        dhdGetStatus(*mut c_int, c_char) -> c_int;
        dhdGetPositionAndOrientationFrame(*mut f64, *mut f64, *mut f64, *mut f64, c_char) -> c_int;
        dhdGetLinearVelocity(*mut f64, *mut f64, *mut f64, c_char) -> c_int;
        dhdSetForceAndTorqueAndGripperForce(f64, f64, f64, f64, f64, f64, f64, c_char) -> c_int;
    }
    optional {
        dhdErrorGetStr(c_int) -> *const c_char;
        dhdGetSystemName(c_char) -> *const c_char;
        dhdGetSerialNumber(*mut c_ushort, c_char) -> c_int;
        dhdGetSDKVersion(*mut c_int, *mut c_int, *mut c_int, *mut c_int) -> ();
        dhdGetAngularVelocityRad(*mut f64, *mut f64, *mut f64, c_char) -> c_int;
        dhdGetButtonMask(c_char) -> c_uint;
        dhdGetButton(c_int, c_char) -> c_int;
        dhdIsLeftHanded(c_char) -> bool;
        dhdHasWrist(c_char) -> bool;
        dhdHasActiveWrist(c_char) -> bool;
        dhdWaitForReset(c_int, c_char) -> c_int;
        dhdSetGravityCompensation(c_int, c_char) -> c_int;
        dhdGetForceAndTorqueAndGripperForce(*mut f64, *mut f64, *mut f64, *mut f64, *mut f64, *mut f64, *mut f64, c_char) -> c_int;
        dhdGetMaxForce(c_char) -> f64;
        dhdGetMaxTorque(c_char) -> f64;
        dhdEnableExpertMode() -> c_int;
        dhdDisableExpertMode() -> c_int;
        dhdSetWatchdog(u8, c_char) -> c_int;
        drdOpenID(c_char) -> c_int;
        drdClose(c_char) -> c_int;
        drdIsSupported(c_char) -> bool;
        drdIsInitialized(c_char) -> bool;
        drdAutoInit(c_char) -> c_int;
        drdStop(bool, c_char) -> c_int;
    }
}

/// An error code of the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Code(pub c_int);

impl Code {
    pub const COMMUNICATION: Self = Self(2);
    pub const NO_DEVICE: Self = Self(5);
    pub const TIMEOUT: Self = Self(7);
    pub const GEOMETRY: Self = Self(8);
}

/// How a force setter went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Set {
    AsTold,
    Saturated,
}

/// The device's own view of itself: what `dhdGetStatus` tells and this driver needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Status {
    pub power: bool,
    pub connected: bool,
    /// It waits for being brought to its reset position.
    pub reset: bool,
    pub force: bool,
    pub force_off_cause: c_int,
}

impl Functions {
    fn checked(&self, code: c_int) -> Result<c_int, Code> {
        if code >= 0 {
            return Ok(code);
        }
        // SAFETY: no arguments; the error is the calling thread's own.
        Err(Code(unsafe { (self.dhdErrorGetLast)() }))
    }

    pub fn device_count(&self) -> c_int {
        // SAFETY: no arguments.
        unsafe { (self.dhdGetDeviceCount)() }
    }

    /// Opens the device of an index, with the robotic part where there is one.
    pub fn open(&self, index: u8) -> Result<Id, Code> {
        let index = index as c_char;
        if let Some(open) = self.drdOpenID {
            // SAFETY: a plain value; the library checks the index.
            let id = unsafe { open(index) };
            if id >= 0 {
                return Ok(id as Id);
            }
        }
        // SAFETY: as above.
        self.checked(unsafe { (self.dhdOpenID)(index) }).map(|id| id as Id)
    }

    pub fn close(&self, id: Id) {
        // SAFETY: plain values; closing what is closed only gives an error code.
        unsafe {
            match self.drdClose {
                Some(close) => close(id),
                None => (self.dhdClose)(id),
            }
        };
    }

    /// Brakes on, motors off.
    pub fn stop(&self, id: Id) {
        // SAFETY: plain values. `drdStop` ends regulation, if any, before the motors are let go.
        unsafe {
            if let Some(stop) = self.drdStop {
                stop(false, id);
            }
            (self.dhdStop)(id);
        }
    }

    pub fn enable_force(&self, on: bool, id: Id) -> Result<(), Code> {
        // SAFETY: plain values.
        self.checked(unsafe { (self.dhdEnableForce)(u8::from(on), id) }).map(drop)
    }

    pub fn system_type(&self, id: Id) -> c_int {
        // SAFETY: plain value.
        unsafe { (self.dhdGetSystemType)(id) }
    }

    pub fn system_name(&self, id: Id) -> Option<String> {
        // SAFETY: the library answers with a static text or null.
        self.dhdGetSystemName.and_then(|f| unsafe { text(f(id)) })
    }

    pub fn error_text(&self, code: Code) -> String {
        // SAFETY: the library answers with a static text or null.
        let said = self.dhdErrorGetStr.and_then(|f| unsafe { text(f(code.0)) });
        format!("code {}{}", code.0, said.map(|t| format!(", {t}")).unwrap_or_default())
    }

    pub fn serial(&self, id: Id) -> Option<u16> {
        let mut serial = 0;
        // SAFETY: the pointer is good for the call.
        let code = unsafe { (self.dhdGetSerialNumber?)(&raw mut serial, id) };
        (code >= 0).then_some(serial)
    }

    pub fn version(&self) -> Option<[c_int; 4]> {
        let mut v = [0; 4];
        let [a, b, c, d] = &mut v;
        // SAFETY: four pointers, good for the call.
        unsafe { (self.dhdGetSDKVersion?)(a, b, c, d) };
        Some(v)
    }

    pub fn status(&self, id: Id) -> Result<Status, Code> {
        // Longer than the 17 that are documented, should a newer library write more.
        let mut s: [c_int; 32] = [0; 32];
        // SAFETY: the array is longer than any version's status.
        self.checked(unsafe { (self.dhdGetStatus)(s.as_mut_ptr(), id) })?;
        Ok(Status {
            power: s[0] != 0,
            connected: s[1] != 0,
            reset: s[3] != 0,
            force: s[5] != 0,
            force_off_cause: s[14],
        })
    }

    pub fn position_and_frame(&self, id: Id) -> Result<(Vector3<f64>, Matrix3<f64>), Code> {
        let mut p = Vector3::zeros();
        let mut rows = [0.0; 9];
        let [x, y, z] = &mut p.data.0[0];
        // SAFETY: three numbers and a 3x3 array, good for the call.
        let code = unsafe { (self.dhdGetPositionAndOrientationFrame)(x, y, z, rows.as_mut_ptr(), id) };
        self.checked(code)?;
        Ok((p, Matrix3::from_row_slice(&rows)))
    }

    pub fn linear_velocity(&self, id: Id) -> Result<Vector3<f64>, Code> {
        let mut v = Vector3::zeros();
        let [x, y, z] = &mut v.data.0[0];
        // SAFETY: three numbers, good for the call.
        self.checked(unsafe { (self.dhdGetLinearVelocity)(x, y, z, id) })?;
        Ok(v)
    }

    /// `None` where the library has no such function.
    pub fn angular_velocity(&self, id: Id) -> Option<Result<Vector3<f64>, Code>> {
        let function = self.dhdGetAngularVelocityRad?;
        let mut w = Vector3::zeros();
        let [x, y, z] = &mut w.data.0[0];
        // SAFETY: three numbers, good for the call.
        let code = unsafe { function(x, y, z, id) };
        Some(self.checked(code).map(|_| w))
    }

    pub fn buttons(&self, id: Id) -> u32 {
        // SAFETY: plain values.
        unsafe {
            match (self.dhdGetButtonMask, self.dhdGetButton) {
                (Some(mask), _) => mask(id),
                (None, Some(button)) => u32::from(button(0, id) == 1),
                (None, None) => 0,
            }
        }
    }

    pub fn set_force(&self, f: &Vector3<f64>, t: &Vector3<f64>, id: Id) -> Result<Set, Code> {
        // SAFETY: plain values. The gripper is left alone.
        let code =
            unsafe { (self.dhdSetForceAndTorqueAndGripperForce)(f.x, f.y, f.z, t.x, t.y, t.z, 0.0, id) };
        Ok(if self.checked(code)? == 2 { Set::Saturated } else { Set::AsTold })
    }

    /// What the motors really do.
    pub fn force(&self, id: Id) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let function = self.dhdGetForceAndTorqueAndGripperForce?;
        let mut v = [0.0; 7];
        let [a, b, c, d, e, f, g] = &mut v;
        // SAFETY: seven numbers, good for the call.
        let code = unsafe { function(a, b, c, d, e, f, g, id) };
        (code >= 0).then(|| (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5])))
    }

    /// The library's own limits, where it has any: force, torque.
    pub fn limits(&self, id: Id) -> [Option<f64>; 2] {
        // SAFETY: plain values.
        let ask = |f: Option<unsafe extern "system" fn(c_char) -> f64>| f.map(|f| unsafe { f(id) });
        [ask(self.dhdGetMaxForce), ask(self.dhdGetMaxTorque)].map(|l| l.filter(|l| l.is_finite() && *l > 0.0))
    }

    pub fn flag(&self, function: Option<unsafe extern "system" fn(c_char) -> bool>, id: Id) -> bool {
        // SAFETY: plain value.
        function.is_some_and(|f| unsafe { f(id) })
    }

    /// Waits until the user has brought the handle to its reset position.
    pub fn wait_for_reset(&self, milliseconds: c_int, id: Id) -> Option<Result<(), Code>> {
        let wait = self.dhdWaitForReset?;
        // SAFETY: plain values.
        Some(self.checked(unsafe { wait(milliseconds, id) }).map(drop))
    }

    pub fn auto_init(&self, id: Id) -> Option<Result<(), Code>> {
        let init = self.drdAutoInit?;
        // SAFETY: plain value.
        Some(self.checked(unsafe { init(id) }).map(drop))
    }

    /// Ends regulation and leaves the motors under our command.
    pub fn end_regulation(&self, id: Id) {
        if let Some(stop) = self.drdStop {
            // SAFETY: plain values.
            unsafe { stop(true, id) };
        }
    }

    pub fn set_gravity_compensation(&self, on: bool, id: Id) {
        if let Some(set) = self.dhdSetGravityCompensation {
            // SAFETY: plain values.
            unsafe { set(c_int::from(on), id) };
        }
    }

    /// Lets the device drop the force by itself when no new one comes within `steps` times 125 us; whether it can.
    pub fn set_watchdog(&self, steps: u8, id: Id) -> bool {
        let (Some(expert), Some(normal), Some(set)) =
            (self.dhdEnableExpertMode, self.dhdDisableExpertMode, self.dhdSetWatchdog)
        else {
            return false;
        };
        // SAFETY: plain values. Expert mode is left at once: nothing else of it is touched.
        unsafe {
            expert();
            let code = set(steps, id);
            normal();
            code >= 0
        }
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
