//! The round of control inside the vendor's scheduler.
//!
//! The library gets a pointer to a [`Gate`], which is never freed; the gate lets the callback reach the caller's control only between opening and
//! closing, so that a callback that comes late finds a closed gate and not a dead pointer.
#![allow(unsafe_code, reason = "a callback from the vendor's library")]

use super::functions::{
    AGAIN, CURRENT_ANGULAR_VELOCITY, CURRENT_BUTTONS, CURRENT_FORCE, CURRENT_POSITION, CURRENT_TORQUE,
    CURRENT_TRANSFORM, CURRENT_VELOCITY, DONE, Functions,
};
use crate::drivers::motion::{command_is_finite, limited, rotation, sample_is_finite};
use crate::{DeviceCommand, DeviceFault, DeviceSample};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::any::Any;
use std::cell::UnsafeCell;
use std::ffi::{c_uint, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Millimetres to metres, millinewton metres to newton metres.
const MILLI: f64 = 1e-3;

/// How long the scheduler may take to start.
const START: Duration = Duration::from_secs(2);

type ControlPointer = *mut (dyn FnMut(&DeviceSample) -> Option<DeviceCommand> + Send + 'static);

/// What the callback needs of the device.
#[derive(Clone, Copy)]
pub(super) struct Target {
    pub functions: Functions,
    pub device: c_uint,
    pub senses_rotation: bool,
    pub drives_torque: bool,
    pub peak_force: f64,
    pub peak_torque: f64,
    pub opened: Instant,
}

/// Why a service ended.
pub(super) enum Outcome {
    Finished,
    Fault(DeviceFault),
    Panic(Box<dyn Any + Send>),
}

/// Between the vendor's thread and the caller of `serve`.
pub(super) struct Gate {
    target: Target,
    open: AtomicBool,
    inside: AtomicBool,
    ticks: AtomicU32,
    ended: AtomicBool,
    outcome: Mutex<Option<Outcome>>,
    control: UnsafeCell<Option<ControlPointer>>,
}

// SAFETY: `control` is written only while the gate is closed and nobody is inside, and used only by the one callback that is inside while it is open;
// what it points to is `Send`.
unsafe impl Sync for Gate {}
// SAFETY: as above.
unsafe impl Send for Gate {}

impl Gate {
    pub fn new(target: Target) -> Self {
        Self {
            target,
            open: AtomicBool::new(false),
            inside: AtomicBool::new(false),
            ticks: AtomicU32::new(0),
            ended: AtomicBool::new(false),
            outcome: Mutex::new(None),
            control: UnsafeCell::new(None),
        }
    }

    /// Serves `control` from the vendor's thread until it ends, a fault comes, or no tick comes for `patience`.
    pub fn serve(
        &'static self,
        control: &mut (dyn FnMut(&DeviceSample) -> Option<DeviceCommand> + Send),
        patience: Duration,
    ) -> Outcome {
        let pointer: *mut (dyn FnMut(&DeviceSample) -> Option<DeviceCommand> + Send + '_) = control;
        // SAFETY: only the lifetime is changed; the gate is closed and empty before this function returns.
        let pointer: ControlPointer = unsafe { std::mem::transmute(pointer) };
        // SAFETY: the gate is closed and nobody inside (new, or closed by the last service).
        unsafe { *self.control.get() = Some(pointer) };
        self.ended.store(false, Ordering::SeqCst);
        *self.lock() = None;
        self.open.store(true, Ordering::SeqCst);
        let functions = &self.target.functions;
        let data = std::ptr::from_ref(self).cast_mut().cast();
        // SAFETY: the gate is never freed.
        let handle = unsafe { functions.schedule(callback, data) };
        super::scheduler::start(functions);
        let ended = self.wait(patience);
        self.close();
        super::scheduler::stop(functions);
        functions.unschedule(handle);
        match self.lock().take() {
            // A tick that came after all, and found the gate closed, is no end that the control wanted.
            None => Outcome::Fault(DeviceFault::Late),
            Some(Outcome::Finished) if !ended => Outcome::Fault(DeviceFault::Late),
            Some(outcome) => outcome,
        }
    }

    /// Answers whether the service has ended; else no tick came for `patience`.
    fn wait(&self, patience: Duration) -> bool {
        let first = self.ticks.load(Ordering::Relaxed);
        let mut seen = (first, Instant::now());
        while !self.ended.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
            let ticks = self.ticks.load(Ordering::Relaxed);
            if ticks != seen.0 {
                seen = (ticks, Instant::now());
            } else if seen.1.elapsed() > if ticks == first { patience.max(START) } else { patience } {
                return false;
            }
        }
        true
    }

    /// Nobody is inside and nobody comes in any more.
    fn close(&self) {
        self.open.store(false, Ordering::SeqCst);
        // Inside is only the caller's own control, which is bounded in time.
        while self.inside.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_micros(100));
        }
        // SAFETY: closed, and nobody inside.
        unsafe { *self.control.get() = None };
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Option<Outcome>> {
        self.outcome.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn end(&self, outcome: Outcome) -> c_uint {
        *self.lock() = Some(outcome);
        self.ended.store(true, Ordering::SeqCst);
        DONE
    }

    /// What the control wants; `None` where there is none any more. A panic of it comes out as an error.
    fn command(&self, sample: &DeviceSample) -> Result<Option<DeviceCommand>, Outcome> {
        self.inside.store(true, Ordering::SeqCst);
        let mut command = Ok(None);
        if self.open.load(Ordering::SeqCst) {
            // SAFETY: the gate is open, so the pointer is good, and `close` waits until we are out. Only one callback is scheduled.
            if let Some(control) = unsafe { *self.control.get() } {
                // SAFETY: as above.
                let call = AssertUnwindSafe(|| unsafe { (*control)(sample) });
                command = catch_unwind(call).map_err(Outcome::Panic);
            }
        }
        self.inside.store(false, Ordering::SeqCst);
        command
    }

    /// One tick. The commanded force is zero in each frame until it is set, so every way out without setting it means zero force.
    fn tick(&self) -> Option<Outcome> {
        let Target { functions, device, .. } = &self.target;
        functions.make_current(*device);
        functions.begin(*device);
        let outcome = match self.sample() {
            Err(fault) => Some(Outcome::Fault(fault)),
            Ok(sample) => match self.command(&sample) {
                Err(panic) => Some(panic),
                Ok(None) => Some(Outcome::Finished),
                Ok(Some(command)) if !command_is_finite(&command) => {
                    Some(Outcome::Fault(DeviceFault::Malformed))
                }
                Ok(Some(command)) => {
                    self.push(&command);
                    None
                }
            },
        };
        if outcome.is_some() {
            self.push(&DeviceCommand::zero());
        }
        functions.end(*device);
        let drained = functions.drain();
        outcome.or_else(|| drained.err().map(Outcome::Fault))
    }

    fn sample(&self) -> Result<DeviceSample, DeviceFault> {
        let f = &self.target.functions;
        let position = Vector3::from(f.doubles::<3>(CURRENT_POSITION)) * MILLI;
        let linear_velocity = Vector3::from(f.doubles::<3>(CURRENT_VELOCITY)) * MILLI;
        let (mut orientation, mut angular_velocity) = (UnitQuaternion::identity(), Vector3::zeros());
        if self.target.senses_rotation {
            let m = f.doubles::<16>(CURRENT_TRANSFORM);
            let matrix = Matrix3::new(m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]);
            orientation = rotation(&matrix).ok_or(DeviceFault::Malformed)?;
            angular_velocity = f.doubles::<3>(CURRENT_ANGULAR_VELOCITY).into();
        }
        let buttons = (f.integer(CURRENT_BUTTONS) & 15) as u32;
        f.drain()?;
        let time = self.target.opened.elapsed().as_secs_f64();
        let sample = DeviceSample { time, position, orientation, linear_velocity, angular_velocity, buttons };
        if sample_is_finite(&sample) { Ok(sample) } else { Err(DeviceFault::Malformed) }
    }

    /// Within the device's limits: beyond them the library would take all force away for a time.
    fn push(&self, command: &DeviceCommand) {
        let force = limited(&command.force, self.target.peak_force).0;
        self.target.functions.set(CURRENT_FORCE, force.into());
        if self.target.drives_torque {
            let torque = limited(&command.torque, self.target.peak_torque).0 / MILLI;
            self.target.functions.set(CURRENT_TORQUE, torque.into());
        }
    }
}

/// What the vendor's scheduler calls.
unsafe extern "system" fn callback(data: *mut c_void) -> c_uint {
    // SAFETY: the pointer is the gate's, which is never freed.
    let gate = unsafe { &*data.cast::<Gate>() };
    if !gate.open.load(Ordering::SeqCst) || gate.ended.load(Ordering::SeqCst) {
        return DONE;
    }
    gate.ticks.fetch_add(1, Ordering::Relaxed);
    match catch_unwind(AssertUnwindSafe(|| gate.tick())) {
        Ok(None) => AGAIN,
        Ok(Some(outcome)) => gate.end(outcome),
        Err(panic) => gate.end(Outcome::Panic(panic)),
    }
}
