//! OpenHaptics' HDAPI: the symbols, a scheduler thread, and a device behind them. Axes are x right, y up, z toward the user; millimetres, millinewton metres.
//!
//! A tick of the scheduler is 1 ms of the hand's time, and passes as fast as the script says (`period_us`), so that tests are short.
#![allow(unsafe_code, reason = "C symbols")]

use crate::HandAndHandle;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::ffi::{c_char, c_int, c_uint, c_ulong, c_ushort, c_void};
use std::sync::Mutex;
use std::thread::JoinHandle;
use std::time::Duration;

const TICK: f64 = 1e-3;
/// The one device's handle: zero is as good as any.
const DEVICE: c_uint = 0;
const INVALID_ENUM: c_uint = 0x100;
const INVALID_VALUE: c_uint = 0x101;
const INVALID_OPERATION: c_uint = 0x102;
const BAD_HANDLE: c_uint = 0x104;
const WARM_MOTORS: c_uint = 0x200;
const EXCEEDED_MAX_FORCE: c_uint = 0x201;
const COMM_ERROR: c_uint = 0x302;
const ILLEGAL_BEGIN: c_uint = 0x400;
const ILLEGAL_END: c_uint = 0x401;

type Callback = unsafe extern "system" fn(*mut c_void) -> c_uint;

struct Scheduled {
    handle: c_ulong,
    callback: Callback,
    data: usize,
}

pub(crate) struct Hd {
    hand: HandAndHandle,
    script: BTreeMap<String, f64>,
    initialised: bool,
    force_on: bool,
    calibrated: bool,
    in_frame: bool,
    /// What this frame commands; zero at its start.
    frame: (Vector3<f64>, Vector3<f64>),
    /// What the motors were told at the end of the last frame, N and N m.
    latched: (Vector3<f64>, Vector3<f64>),
    errors: Vec<c_uint>,
    running: bool,
    ticks: u32,
    updates: u32,
    scheduled: Vec<Scheduled>,
    handles: c_ulong,
    thread: Option<JoinHandle<()>>,
}

static HD: Mutex<Option<Hd>> = Mutex::new(None);
/// Held during a tick, so that unscheduling waits for its end.
static IN_TICK: Mutex<()> = Mutex::new(());

pub(crate) fn with<T>(work: impl FnOnce(&mut Hd) -> T) -> T {
    let mut device = HD.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    work(device.get_or_insert_with(Hd::new))
}

impl Hd {
    fn new() -> Self {
        let zero = (Vector3::zeros(), Vector3::zeros());
        Self {
            hand: HandAndHandle::default(),
            script: BTreeMap::new(),
            initialised: false,
            force_on: false,
            calibrated: false,
            in_frame: false,
            frame: zero,
            latched: zero,
            errors: Vec::new(),
            running: false,
            ticks: 0,
            updates: 0,
            scheduled: Vec::new(),
            handles: 0,
            thread: None,
        }
    }

    pub(crate) fn set(&mut self, name: &str, value: f64) -> bool {
        if let Some(part) = self.hand.part(name) {
            *part = value;
            return true;
        }
        match name {
            "calibrated" => self.calibrated = value != 0.0,
            "output_dof" | "input_dof" | "buttons" | "period_us" | "warm" | "comm_error"
            | "refuse_forces" | "malformed" | "skewed" | "stalled" | "needs_hand" | "absent"
            | "max_force" => {
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
            "applied" => self.applied().0.norm() + self.applied().1.norm(),
            "latched" => self.latched.0.norm() + self.latched.1.norm(),
            "force_on" => f64::from(self.force_on),
            "initialised" => f64::from(self.initialised),
            "running" => f64::from(self.running),
            "ticks" => f64::from(self.ticks),
            "updates" => f64::from(self.updates),
            "scheduled" => self.scheduled.len() as f64,
            "errors" => self.errors.len() as f64,
            _ => return None,
        })
    }

    fn scripted(&self, name: &str, default: f64) -> f64 {
        self.script.get(name).copied().unwrap_or(default)
    }

    fn is(&self, name: &str) -> bool {
        self.scripted(name, 0.0) != 0.0
    }

    /// What the motors do: nothing when the scheduler stands, the output is off or the motors are warm.
    fn applied(&self) -> (Vector3<f64>, Vector3<f64>) {
        match self.running && self.force_on && !self.is("warm") {
            true => self.latched,
            false => (Vector3::zeros(), Vector3::zeros()),
        }
    }

    fn begin(&mut self, device: c_uint) {
        if device != DEVICE || !self.initialised {
            self.errors.push(BAD_HANDLE);
        } else if self.in_frame {
            self.errors.push(ILLEGAL_BEGIN);
        }
        self.in_frame = true;
        self.frame = (Vector3::zeros(), Vector3::zeros());
        if self.is("comm_error") {
            self.errors.push(COMM_ERROR);
        }
        if self.is("warm") {
            self.errors.push(WARM_MOTORS);
        }
    }

    fn end(&mut self, _device: c_uint) {
        if !self.in_frame {
            self.errors.push(ILLEGAL_END);
        }
        self.in_frame = false;
        if self.frame.0.norm() > self.scripted("max_force", 8.5) * (1.0 + 1e-9) {
            self.errors.push(EXCEEDED_MAX_FORCE);
            self.frame = (Vector3::zeros(), Vector3::zeros());
        }
        self.latched = self.frame;
    }

    fn assign(&mut self, parameter: c_uint, value: Vector3<f64>) {
        if !self.in_frame {
            self.errors.push(INVALID_OPERATION);
        } else if self.is("refuse_forces") && value.norm() > 0.0 {
            self.errors.push(INVALID_VALUE);
        } else {
            match parameter {
                0x2700 => self.frame.0 = value,
                0x2701 if self.scripted("output_dof", 6.0) >= 6.0 => self.frame.1 = value * 1e-3,
                _ => self.errors.push(INVALID_ENUM),
            }
        }
    }

    fn doubles(&mut self, parameter: c_uint) -> Vec<f64> {
        let position = self.hand.position * 1e3;
        let bad = if self.is("malformed") { f64::NAN } else { 1.0 };
        let six = self.scripted("output_dof", 6.0) >= 6.0;
        match parameter {
            0x2050 => (position * bad).as_slice().into(),
            0x2051 => (self.hand.velocity * 1e3).as_slice().into(),
            0x2053 => self.hand.angular_velocity.as_slice().into(),
            0x2052 => {
                let turn = self.hand.orientation().to_rotation_matrix().into_inner();
                let turn = if self.is("skewed") { turn * 2.0 } else { turn };
                let mut m = nalgebra::Matrix4::identity();
                m.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
                m.fixed_view_mut::<3, 1>(0, 3).copy_from(&position);
                // Column by column, as the vendor has it.
                m.as_slice().into()
            }
            0x2551 => vec![-190.0, -135.0, -85.0, 190.0, 135.0, 85.0],
            0x2602 => vec![3.5],
            0x2603 => vec![self.scripted("max_force", 8.5)],
            0x2604 => vec![1.4],
            0x2609 => vec![0.005],
            0x2622 if six => vec![188.0],
            0x2623 if six => vec![48.0],
            0x2620 if six => vec![300.0],
            0x2620..=0x2623 => vec![0.0],
            _ => {
                self.errors.push(INVALID_ENUM);
                Vec::new()
            }
        }
    }
}

/// One tick: the callbacks in their order, then 1 ms of the hand.
fn tick() {
    let _guard = IN_TICK.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let due: Vec<(c_ulong, Callback, usize)> = with(|d| match d.is("stalled") {
        true => Vec::new(),
        false => d.scheduled.iter().map(|s| (s.handle, s.callback, s.data)).collect(),
    });
    for (handle, callback, data) in due {
        // SAFETY: whoever scheduled it promised that the pointer is good until it is unscheduled, which waits for this tick.
        let answer = unsafe { callback(data as *mut c_void) };
        if answer == 0 {
            with(|d| d.scheduled.retain(|s| s.handle != handle));
        }
    }
    with(|d| {
        if !d.is("stalled") {
            d.ticks += 1;
        }
        let (force, torque) = d.applied();
        d.hand.step(force, torque, TICK);
    });
}

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
