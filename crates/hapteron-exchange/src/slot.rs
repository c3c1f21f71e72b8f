//! A place that belongs to one thread at a time, by the protocol of whoever uses it.
#![allow(unsafe_code, reason = "shares memory between threads")]

use std::cell::UnsafeCell;

/// Kept apart from its neighbours, so that two threads do not fight for one cache line.
#[derive(Debug)]
#[repr(align(128))]
pub struct Apart<T>(pub T);

/// A place. Under the model checker each access is told to it, so that it finds any two that are not ordered.
#[derive(Debug)]
pub struct Slot<T> {
    value: UnsafeCell<T>,
    #[cfg(loom)]
    trace: loom::cell::UnsafeCell<()>,
}

// SAFETY: a slot hands out its value only through the unsafe functions below, whose callers see to it that one thread has it at a time.
unsafe impl<T: Send> Sync for Slot<T> {}

impl<T> Slot<T> {
    pub fn new(value: T) -> Self {
        Self {
            value: UnsafeCell::new(value),
            #[cfg(loom)]
            trace: loom::cell::UnsafeCell::new(()),
        }
    }

    /// Tells the model checker that the value is read now, or was until now.
    pub fn trace_read(&self) {
        #[cfg(loom)]
        self.trace.with(|_| ());
    }

    /// Tells the model checker that the value is written now, or was until now.
    pub fn trace_write(&self) {
        #[cfg(loom)]
        self.trace.with_mut(|_| ());
    }

    /// # Safety
    /// No other thread writes the value while the reference lives.
    pub unsafe fn get(&self) -> &T {
        self.trace_read();
        // SAFETY: the caller's promise.
        unsafe { &*self.value.get() }
    }

    /// # Safety
    /// The value is used through nothing else while the reference lives.
    #[allow(clippy::mut_from_ref, reason = "exclusive by the caller's promise")]
    pub unsafe fn get_mut(&self) -> &mut T {
        self.trace_write();
        // SAFETY: the caller's promise.
        unsafe { &mut *self.value.get() }
    }
}
