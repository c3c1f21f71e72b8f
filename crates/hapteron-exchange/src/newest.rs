//! The newest value from one thread to another.
//!
//! Three slots: one is the writer's, one the reader's, and one lies between them. Each side swaps its slot for the one between, by one atomic
//! exchange that also tells whether the writer's put it there. So no slot is ever two threads', and nobody waits.
#![allow(unsafe_code, reason = "shares memory between threads")]

use crate::slot::{Apart, Slot};
use crate::sync::{Arc, AtomicUsize, Ordering};

/// Beside the slot's number: it holds a value that the reader has not had.
const FRESH: usize = 4;
const NUMBER: usize = 3;

struct Shared<T> {
    slots: [Apart<Slot<T>>; 3],
    /// Number of the slot between, and [`FRESH`].
    between: Apart<AtomicUsize>,
}

impl<T> Shared<T> {
    fn slot(&self, number: usize) -> &Slot<T> {
        // Numbers are 0 to 2; the third arm is for the compiler.
        match number {
            0 => &self.slots[0].0,
            1 => &self.slots[1].0,
            _ => &self.slots[2].0,
        }
    }
}

/// The end that gives values.
pub struct Writer<T> {
    shared: Arc<Shared<T>>,
    mine: usize,
}

/// The end that gets them.
pub struct Reader<T> {
    shared: Arc<Shared<T>>,
    mine: usize,
}

/// Both ends; until the first value is published the reader has `first`. Allocates here, and never again.
pub fn newest<T: Clone + Send>(first: &T) -> (Writer<T>, Reader<T>) {
    let slot = || Apart(Slot::new(first.clone()));
    let shared = Arc::new(Shared { slots: [slot(), slot(), slot()], between: Apart(AtomicUsize::new(1)) });
    (Writer { shared: Arc::clone(&shared), mine: 0 }, Reader { shared, mine: 2 })
}

impl<T> Writer<T> {
    /// The writer's slot, to be filled in place. It holds an older value.
    pub fn slot(&mut self) -> &mut T {
        // SAFETY: a slot's number is in one of three places (here, between, at the reader), so that only this end has this slot; the
        // exchange that brought the number came after the other end's last use of it.
        unsafe { self.shared.slot(self.mine).get_mut() }
    }

    /// Makes what is in the slot the newest value. Wait-free.
    pub fn publish(&mut self) {
        self.shared.slot(self.mine).trace_write();
        // Release: the value goes with the number. Acquire: the reader has done with the slot that comes back.
        let before = self.shared.between.0.swap(self.mine | FRESH, Ordering::AcqRel);
        self.mine = before & NUMBER;
    }

    /// Both. Wait-free.
    pub fn write(&mut self, value: T) {
        *self.slot() = value;
        self.publish();
    }
}

impl<T> Reader<T> {
    /// Takes the newest value, if there is one that it has not had; whether there was. Wait-free.
    pub fn update(&mut self) -> bool {
        if self.shared.between.0.load(Ordering::Relaxed) & FRESH == 0 {
            return false;
        }
        self.shared.slot(self.mine).trace_read();
        // Acquire: the value came with the number. Release: this end has done with the slot that it gives back.
        let before = self.shared.between.0.swap(self.mine, Ordering::AcqRel);
        self.mine = before & NUMBER;
        true
    }

    /// The value taken last.
    #[must_use]
    pub fn value(&self) -> &T {
        // SAFETY: as in `Writer::slot`; this end gives its slot away by `&mut self` only.
        unsafe { self.shared.slot(self.mine).get() }
    }

    /// The newest value. Wait-free.
    pub fn read(&mut self) -> &T {
        self.update();
        self.value()
    }
}
