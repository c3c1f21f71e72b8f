//! The device and the scheduler behind OpenHaptics' HDAPI. Axes are x right, y up, z toward the user; millimetres, millinewton metres.
//!
//! A tick of the scheduler is 1 ms of the hand's time, and passes as fast as the script says (`period_us`), so that tests are short.
#![allow(unsafe_code, reason = "calls back through C pointers")]

mod symbols;

use crate::HandAndHandle;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::ffi::{c_uint, c_ulong, c_void};
use std::sync::Mutex;
use std::thread::JoinHandle;

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
