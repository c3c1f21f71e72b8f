//! Force Dimension's DHD and DRD: the symbols, and a device behind them. Vendor axes: x toward the user, y right, z up.
//!
//! Time goes 1 ms forward with every force that is set, so that tests do not depend on the machine.
#![allow(unsafe_code, reason = "C symbols")]

use crate::HandAndHandle;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::ffi::{c_char, c_int, c_uint, c_ushort};
use std::sync::Mutex;

const TICK: f64 = 1e-3;
const ERROR_COMMUNICATION: c_int = 2;
const ERROR_TIMEOUT: c_int = 7;
const ERROR_NOT_AVAILABLE: c_int = 6;
const ERROR_EXPERT_MODE: c_int = 9;
const CAUSE_VELOCITY: c_int = 2;
const CAUSE_WATCHDOG: c_int = 3;
const CAUSE_SOFTWARE: c_int = 4;

pub(crate) struct Dhd {
    hand: HandAndHandle,
    /// What a test has set: switches and numbers by name.
    script: BTreeMap<String, f64>,
    opened: bool,
    homed: bool,
    force_on: bool,
    cause: c_int,
    expert: bool,
    watchdog: u8,
    force: Vector3<f64>,
    torque: Vector3<f64>,
    /// What motors would do now: the last force set, as long as they are on.
    gripper: f64,
    error: c_int,
    writes: u32,
    stops: u32,
    gravity: c_int,
}

static DEVICE: Mutex<Option<Dhd>> = Mutex::new(None);

pub(crate) fn with<T>(work: impl FnOnce(&mut Dhd) -> T) -> T {
    let mut device = DEVICE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    work(device.get_or_insert_with(Dhd::new))
}

impl Dhd {
    fn new() -> Self {
        Self {
            hand: HandAndHandle::default(),
            script: BTreeMap::new(),
            opened: false,
            homed: false,
            force_on: false,
            cause: 0,
            expert: false,
            watchdog: 0,
            force: Vector3::zeros(),
            torque: Vector3::zeros(),
            gripper: 0.0,
            error: 0,
            writes: 0,
            stops: 0,
            gravity: 1,
        }
    }

    pub(crate) fn set(&mut self, name: &str, value: f64) -> bool {
        if let Some(part) = self.hand.part(name) {
            *part = value;
            return true;
        }
        match name {
            // Switched off by the button on the front panel, the dead-man switch, ...
            "force_off" => (self.force_on, self.cause) = (false, value as c_int),
            "homed" => self.homed = value != 0.0,
            // The host says nothing for a time: the watchdog, and the hand goes on under the last force.
            "silence" => self.silence(value),
            "type" | "left" | "wrist" | "active_wrist" | "count" | "serial" | "velocity_unknown"
            | "refuse_forces" | "refuse_velocity" | "malformed" | "skewed" | "disconnected" | "unpowered"
            | "max_force" | "watchdog_missing" | "buttons" | "late" | "auto_init_fails" | "robotic"
            | "by_hand" | "open_fails" => {
                self.script.insert(name.into(), value);
            }
            _ => return false,
        }
        true
    }

    pub(crate) fn get(&mut self, name: &str) -> Option<f64> {
        if let Some(part) = self.hand.part(name) {
            return Some(*part);
        }
        Some(match name {
            "applied_x" => self.applied().0.x,
            "applied_y" => self.applied().0.y,
            "applied_z" => self.applied().0.z,
            "applied_torque" => self.applied().1.norm(),
            "applied" => self.applied().0.norm() + self.applied().1.norm(),
            "force_on" => f64::from(self.force_on),
            "opened" => f64::from(self.opened),
            "homed" => f64::from(self.homed),
            "watchdog" => f64::from(self.watchdog),
            "expert" => f64::from(self.expert),
            "gripper" => self.gripper,
            "writes" => f64::from(self.writes),
            "stops" => f64::from(self.stops),
            "gravity" => f64::from(self.gravity),
            _ => return None,
        })
    }

    fn scripted(&self, name: &str, default: f64) -> f64 {
        self.script.get(name).copied().unwrap_or(default)
    }

    fn is(&self, name: &str) -> bool {
        self.scripted(name, 0.0) != 0.0
    }

    /// What the motors do.
    fn applied(&self) -> (Vector3<f64>, Vector3<f64>) {
        if self.force_on { (self.force, self.torque) } else { (Vector3::zeros(), Vector3::zeros()) }
    }

    fn advance(&mut self) {
        let (force, torque) = self.applied();
        self.hand.step(force, torque, TICK);
        if self.hand.velocity.norm() > 2.0 && self.force_on {
            (self.force_on, self.cause) = (false, CAUSE_VELOCITY);
        }
    }

    fn silence(&mut self, seconds: f64) {
        let mut past = 0.0;
        while past < seconds {
            past += TICK;
            if self.force_on && self.watchdog > 0 && past > f64::from(self.watchdog) * 125e-6 {
                (self.force_on, self.cause) = (false, CAUSE_WATCHDOG);
            }
            self.advance();
        }
    }

    fn fail(&mut self, code: c_int) -> c_int {
        self.error = code;
        -1
    }

    /// The answer to any call that needs the device.
    fn reach(&mut self) -> Result<(), c_int> {
        if self.is("disconnected") || !self.opened {
            return Err(self.fail(ERROR_COMMUNICATION));
        }
        Ok(())
    }

    fn set_force(&mut self, force: Vector3<f64>, torque: Vector3<f64>, gripper: f64) -> c_int {
        if let Err(code) = self.reach() {
            return code;
        }
        let refusals = self.scripted("refuse_forces", 0.0);
        if refusals > 0.0 && force.norm() + torque.norm() > 0.0 {
            self.script.insert("refuse_forces".into(), refusals - 1.0);
            return self.fail(ERROR_NOT_AVAILABLE);
        }
        self.writes += 1;
        let limit = self.scripted("max_force", f64::INFINITY);
        let factor = (limit / force.norm()).min(1.0);
        (self.force, self.torque, self.gripper) = (force * factor, torque * factor, gripper);
        self.advance();
        if factor < 1.0 { 2 } else { 0 }
    }

    fn velocity(&mut self, value: fn(&HandAndHandle) -> Vector3<f64>) -> Result<Vector3<f64>, c_int> {
        self.reach()?;
        if self.is("velocity_unknown") {
            return Err(self.fail(ERROR_TIMEOUT));
        }
        let malformed = if self.scripted("malformed", 0.0) == 2.0 { f64::NAN } else { 1.0 };
        Ok(value(&self.hand) * malformed)
    }

    fn status(&mut self) -> [c_int; 17] {
        let mut s = [0; 17];
        s[0] = c_int::from(!self.is("unpowered"));
        s[1] = c_int::from(!self.is("disconnected"));
        s[3] = c_int::from(!self.homed);
        s[5] = c_int::from(self.force_on);
        s[10] = self.gravity;
        s[14] = self.cause;
        s
    }
}

unsafe fn write3(v: &Vector3<f64>, x: *mut f64, y: *mut f64, z: *mut f64) {
    // SAFETY: the caller of the C function gives three good pointers.
    unsafe { (*x, *y, *z) = (v.x, v.y, v.z) };
}

/// Makes C symbols of plain values: arguments in, a number out.
macro_rules! plain {
    ($($name:ident($($a:ident: $t:ty),*) -> $r:ty = |$d:ident| $body:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            #[allow(non_snake_case, unused_variables, reason = "the vendor's signature")]
            extern "system" fn $name($($a: $t),*) -> $r {
                with(|$d| $body)
            }
        )*
    };
}

plain! {
    dhdErrorGetLast() -> c_int = |d| d.error;
    dhdGetDeviceCount() -> c_int = |d| d.scripted("count", 1.0) as c_int;
    dhdOpenID(id: c_char) -> c_int = |d| open(d, id);
    drdOpenID(id: c_char) -> c_int = |d| open(d, id);
    dhdClose(id: c_char) -> c_int = |d| { d.opened = false; 0 };
    drdClose(id: c_char) -> c_int = |d| { d.opened = false; 0 };
    dhdStop(id: c_char) -> c_int = |d| stop(d);
    drdStop(keep_force: bool, id: c_char) -> c_int = |d| if keep_force { d.force_on = true; 0 } else { stop(d) };
    dhdEnableForce(on: u8, id: c_char) -> c_int = |d| match d.reach() {
        Err(code) => code,
        Ok(()) => {
            (d.force_on, d.cause) = (on != 0, if on != 0 { 0 } else { CAUSE_SOFTWARE });
            0
        }
    };
    dhdGetSystemType(id: c_char) -> c_int = |d| d.scripted("type", 104.0) as c_int;
    dhdGetButtonMask(id: c_char) -> c_uint = |d| d.scripted("buttons", 0.0) as c_uint;
    dhdIsLeftHanded(id: c_char) -> bool = |d| d.is("left");
    dhdHasWrist(id: c_char) -> bool = |d| d.scripted("wrist", 1.0) != 0.0;
    dhdHasActiveWrist(id: c_char) -> bool = |d| d.scripted("active_wrist", 1.0) != 0.0;
    dhdWaitForReset(ms: c_int, id: c_char) -> c_int = |d| {
        if d.is("by_hand") { d.homed = true; 0 } else { d.fail(ERROR_TIMEOUT) }
    };
    dhdSetGravityCompensation(on: c_int, id: c_char) -> c_int = |d| { d.gravity = on; 0 };
    dhdEnableExpertMode() -> c_int = |d| { d.expert = true; 0 };
    dhdDisableExpertMode() -> c_int = |d| { d.expert = false; 0 };
    dhdSetWatchdog(steps: u8, id: c_char) -> c_int = |d| {
        if !d.expert {
            d.fail(ERROR_EXPERT_MODE)
        } else if d.is("watchdog_missing") {
            d.fail(ERROR_NOT_AVAILABLE)
        } else {
            d.watchdog = steps;
            0
        }
    };
    drdIsSupported(id: c_char) -> bool = |d| d.scripted("robotic", 1.0) != 0.0;
    drdIsInitialized(id: c_char) -> bool = |d| d.homed;
    drdAutoInit(id: c_char) -> c_int = |d| {
        if d.is("auto_init_fails") { return d.fail(ERROR_TIMEOUT) }
        // As the real one does: the motors are left on after it.
        (d.homed, d.force_on, d.cause) = (true, true, 0);
        0
    };
    dhdSetForceAndTorqueAndGripperForce(
        fx: f64, fy: f64, fz: f64, tx: f64, ty: f64, tz: f64, fg: f64, id: c_char
    ) -> c_int = |d| d.set_force(Vector3::new(fx, fy, fz), Vector3::new(tx, ty, tz), fg);
}

fn open(d: &mut Dhd, id: c_char) -> c_int {
    if d.is("open_fails") || d.is("disconnected") {
        return d.fail(ERROR_COMMUNICATION);
    }
    d.opened = true;
    c_int::from(id)
}

fn stop(d: &mut Dhd) -> c_int {
    d.stops += 1;
    (d.force_on, d.cause) = (false, CAUSE_SOFTWARE);
    0
}

#[unsafe(no_mangle)]
extern "system" fn dhdGetSystemName(_id: c_char) -> *const c_char {
    c"emulated".as_ptr()
}

#[unsafe(no_mangle)]
extern "system" fn dhdErrorGetStr(_code: c_int) -> *const c_char {
    c"emulated error".as_ptr()
}

#[unsafe(no_mangle)]
unsafe extern "system" fn dhdGetSerialNumber(serial: *mut c_ushort, _id: c_char) -> c_int {
    // SAFETY: a good pointer, as the vendor's header asks.
    unsafe { *serial = with(|d| d.scripted("serial", 1234.0) as c_ushort) };
    0
}

#[unsafe(no_mangle)]
unsafe extern "system" fn dhdGetSDKVersion(a: *mut c_int, b: *mut c_int, c: *mut c_int, d: *mut c_int) {
    // SAFETY: four good pointers, as the vendor's header asks.
    unsafe { (*a, *b, *c, *d) = (3, 17, 0, 0) };
}

#[unsafe(no_mangle)]
unsafe extern "system" fn dhdGetStatus(status: *mut c_int, _id: c_char) -> c_int {
    let s = with(Dhd::status);
    // SAFETY: room for 17 numbers, as the vendor's header asks.
    unsafe { std::ptr::copy_nonoverlapping(s.as_ptr(), status, s.len()) };
    0
}

#[unsafe(no_mangle)]
unsafe extern "system" fn dhdGetPositionAndOrientationFrame(
    x: *mut f64,
    y: *mut f64,
    z: *mut f64,
    frame: *mut f64,
    _id: c_char,
) -> c_int {
    let (code, position, rows) = with(|d| {
        let mut code = d.reach().err().unwrap_or(1);
        if d.is("late") {
            code = d.fail(ERROR_TIMEOUT);
        }
        let mut position = d.hand.position;
        if !d.homed || d.scripted("malformed", 0.0) == 1.0 {
            position.y = f64::NAN;
        }
        let matrix = d.hand.orientation().to_rotation_matrix().into_inner();
        let matrix = if d.is("skewed") { matrix * 1.5 } else { matrix };
        (code, position, matrix.transpose())
    });
    // SAFETY: three numbers and a 3x3 array, as the vendor's header asks; the transpose's columns are the rows.
    unsafe {
        write3(&position, x, y, z);
        std::ptr::copy_nonoverlapping(rows.as_ptr(), frame, 9);
    }
    code
}

#[unsafe(no_mangle)]
unsafe extern "system" fn dhdGetLinearVelocity(x: *mut f64, y: *mut f64, z: *mut f64, _id: c_char) -> c_int {
    match with(|d| d.velocity(|h| h.velocity)) {
        // SAFETY: three good pointers, as the vendor's header asks.
        Ok(v) => unsafe { write3(&v, x, y, z) },
        Err(code) => return code,
    }
    0
}

#[unsafe(no_mangle)]
unsafe extern "system" fn dhdGetAngularVelocityRad(
    x: *mut f64,
    y: *mut f64,
    z: *mut f64,
    _id: c_char,
) -> c_int {
    match with(|d| d.velocity(|h| h.angular_velocity)) {
        // SAFETY: three good pointers, as the vendor's header asks.
        Ok(v) => unsafe { write3(&v, x, y, z) },
        Err(code) => return code,
    }
    0
}

#[unsafe(no_mangle)]
unsafe extern "system" fn dhdGetForceAndTorqueAndGripperForce(
    fx: *mut f64,
    fy: *mut f64,
    fz: *mut f64,
    tx: *mut f64,
    ty: *mut f64,
    tz: *mut f64,
    grip: *mut f64,
    _id: c_char,
) -> c_int {
    let (force, torque) = with(|d| d.applied());
    // SAFETY: seven good pointers, as the vendor's header asks.
    unsafe {
        write3(&force, fx, fy, fz);
        write3(&torque, tx, ty, tz);
        *grip = 0.0;
    }
    0
}
