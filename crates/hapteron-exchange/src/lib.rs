//! Wait-free exchange between two threads: the [`newest`] value, and a bounded [`ring`] of values.
//!
//! Neither side ever waits for the other, dead or alive, and after they are made nothing allocates. A crate of its own, so that a model checker can try
//! every meeting of the two sides: see `docs/real-time.md` for the commands (loom, Miri).

mod newest;
mod ring;
mod slot;

pub use newest::{Reader, Writer, newest};
pub use ring::{Consumer, Producer, ring};

/// Atomics and shared pointers: the real ones, or the model checker's.
mod sync {
    #[cfg(loom)]
    pub use loom::sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    };
    #[cfg(not(loom))]
    pub use std::sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    };
}

#[cfg(all(test, loom))]
mod model;
#[cfg(all(test, not(loom)))]
mod tests;
