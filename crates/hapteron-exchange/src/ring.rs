//! A bounded queue from one thread to another.
//!
//! Values are counted as they go in and as they come out, and never start over; a count's lowest bits are the place. Each side writes its own count
//! and looks at the other's only when the one that it remembers says full, or empty.
#![allow(unsafe_code, reason = "shares memory between threads")]

use crate::slot::{Apart, Slot};
use crate::sync::{Arc, AtomicUsize, Ordering};

struct Shared<T> {
    /// As many as a power of two.
    slots: Box<[Slot<T>]>,
    /// How many came out.
    taken: Apart<AtomicUsize>,
    /// How many went in.
    given: Apart<AtomicUsize>,
}

impl<T> Shared<T> {
    fn slot(&self, count: usize) -> Option<&Slot<T>> {
        self.slots.get(count & (self.slots.len() - 1))
    }
}

/// The end that values go in by.
pub struct Producer<T> {
    shared: Arc<Shared<T>>,
    given: usize,
    /// No more than came out.
    taken: usize,
}

/// The end that they come out of, in their order.
pub struct Consumer<T> {
    shared: Arc<Shared<T>>,
    taken: usize,
    /// No more than went in.
    given: usize,
}

/// Both ends of a queue for at least `room` values. Every place is filled with `first`, so that its memory is there. Allocates here, and never
/// again.
pub fn ring<T: Copy + Send>(first: T, room: usize) -> (Producer<T>, Consumer<T>) {
    let shared = Arc::new(Shared {
        slots: (0..room.max(1).next_power_of_two()).map(|_| Slot::new(first)).collect(),
        taken: Apart(AtomicUsize::new(0)),
        given: Apart(AtomicUsize::new(0)),
    });
    let producer = Producer { shared: Arc::clone(&shared), given: 0, taken: 0 };
    (producer, Consumer { shared, taken: 0, given: 0 })
}

impl<T: Copy> Producer<T> {
    /// Puts a value in. Wait-free.
    ///
    /// # Errors
    /// The value, when there is no room for it.
    pub fn push(&mut self, value: T) -> Result<(), T> {
        if self.given.wrapping_sub(self.taken) == self.shared.slots.len() {
            // Acquire: the consumer has read what it counts as taken.
            self.taken = self.shared.taken.0.load(Ordering::Acquire);
        }
        if self.given.wrapping_sub(self.taken) == self.shared.slots.len() {
            return Err(value);
        }
        let Some(slot) = self.shared.slot(self.given) else { return Err(value) };
        // SAFETY: places between `given` and `taken` plus all are the producer's; the consumer has done with this one.
        unsafe { *slot.get_mut() = value };
        self.given = self.given.wrapping_add(1);
        // Release: the value is there when the count is seen.
        self.shared.given.0.store(self.given, Ordering::Release);
        Ok(())
    }
}

impl<T: Copy> Consumer<T> {
    /// The value that has waited longest. Wait-free.
    pub fn pop(&mut self) -> Option<T> {
        if self.given == self.taken && self.waiting() == 0 {
            return None;
        }
        // SAFETY: places from `taken` up to `given` are the consumer's; the producer has written this one.
        let value = unsafe { *self.shared.slot(self.taken)?.get() };
        self.taken = self.taken.wrapping_add(1);
        // Release: the value has been read when the count is seen.
        self.shared.taken.0.store(self.taken, Ordering::Release);
        Some(value)
    }

    /// How many wait now. Wait-free.
    pub fn waiting(&mut self) -> usize {
        // Acquire: what it counts as given has been written.
        self.given = self.shared.given.0.load(Ordering::Acquire);
        self.given.wrapping_sub(self.taken)
    }
}
