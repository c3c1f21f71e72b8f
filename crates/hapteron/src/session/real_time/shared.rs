//! What all threads of a session see, and how one ends.

use super::telemetry::Telemetry;
use hapteron_device::{Device, DeviceFault};
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

/// Why a session ended. In every case the device was told zero force and stopped; see [`End::HapticFrozen`] for the one exception.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum End {
    /// It was told to.
    Stopped,
    /// Its time was over.
    Elapsed,
    /// The device could not go on.
    Device(DeviceFault),
    /// The haptic thread panicked, with this message.
    HapticPanicked(String),
    /// The contact thread panicked, with this message.
    ContactPanicked(String),
    /// The haptic thread did not tick for longer than [`super::RealTimeOptions::watchdog`]. The supervisor stopped the device, unless the
    /// thread hangs inside a call of the device: then only the device's own watchdog can.
    HapticFrozen,
}

impl End {
    /// Whether it is how sessions should end.
    #[must_use]
    pub fn is_regular(&self) -> bool {
        matches!(self, Self::Stopped | Self::Elapsed)
    }
}

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Stopped => f.write_str("stopped"),
            Self::Elapsed => f.write_str("the time was over"),
            Self::Device(fault) => write!(f, "device: {fault}"),
            Self::HapticPanicked(text) => write!(f, "the haptic thread failed: {text}"),
            Self::ContactPanicked(text) => write!(f, "the contact thread failed: {text}"),
            Self::HapticFrozen => f.write_str("the haptic thread did not go on"),
        }
    }
}

/// Why the haptic loop is to end, as it is asked in every tick.
const GO_ON: u8 = 0;
const STOP: u8 = 1;
const CONTACT_DIED: u8 = 2;
const FROZEN: u8 = 3;

/// The part of the state that threads share without waiting for each other.
#[derive(Debug, Default)]
pub struct Shared {
    pub(super) telemetry: Telemetry,
    request: AtomicU8,
    haptic_done: AtomicBool,
    /// Somebody looks at the contact levels.
    levels_watched: AtomicBool,
    /// Clock of the last sign of life of the haptic thread.
    pub(super) pulse_ns: AtomicU64,
}

impl Shared {
    pub(super) fn stop(&self) {
        self.ask(STOP);
    }

    pub(super) fn contact_died(&self) {
        self.ask(CONTACT_DIED);
    }

    pub(super) fn frozen(&self) {
        self.ask(FROZEN);
    }

    /// The first reason stands.
    fn ask(&self, what: u8) {
        let _ = self.request.compare_exchange(GO_ON, what, Ordering::AcqRel, Ordering::Acquire);
    }

    pub(super) fn is_ending(&self) -> bool {
        self.request.load(Ordering::Acquire) != GO_ON
    }

    /// What the haptic loop is to end with. Real time.
    pub(super) fn requested(&self) -> Option<End> {
        match self.request.load(Ordering::Acquire) {
            GO_ON => None,
            CONTACT_DIED => Some(End::ContactPanicked(String::new())),
            FROZEN => Some(End::HapticFrozen),
            _ => Some(End::Stopped),
        }
    }

    pub(super) fn watch_levels(&self, on: bool) {
        self.levels_watched.store(on, Ordering::Relaxed);
    }

    pub(super) fn levels_watched(&self) -> bool {
        self.levels_watched.load(Ordering::Relaxed)
    }

    pub(super) fn haptic_ended(&self) {
        self.haptic_done.store(true, Ordering::Release);
        self.stop();
    }

    pub(super) fn is_haptic_done(&self) -> bool {
        self.haptic_done.load(Ordering::Acquire)
    }
}

/// The device, which the haptic thread uses and the supervisor stops when that thread no longer can.
///
/// A mutex, but never waited for: both sides only try. The haptic thread holds it for one call of the device at a time, so that the supervisor
/// finds it free when the thread hangs anywhere else. A failed try means that the supervisor has taken over.
pub struct SharedDevice(Mutex<Box<dyn Device>>);

impl SharedDevice {
    pub(super) fn new(device: Box<dyn Device>) -> Self {
        Self(Mutex::new(device))
    }

    /// The device, unless the other side has it. Real time: one atomic exchange.
    pub(super) fn claim(&self) -> Option<MutexGuard<'_, Box<dyn Device>>> {
        match self.0.try_lock() {
            Ok(guard) => Some(guard),
            // It was being used while its thread panicked; it can still be stopped.
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// Zero force and motors off, if the device is free.
    pub(super) fn stop(&self) -> bool {
        self.claim().map(|mut device| device.stop()).is_some()
    }

    pub(super) fn into_inner(self) -> Box<dyn Device> {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What a panic said.
pub(super) fn message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "panic".to_owned())
}
