//! A loop that does nothing but come on time: what the machine can do at best.

use super::clock::{self, Metronome};
use super::histogram::{Distribution, Histogram};
use super::system::{self, Grant};
use std::thread;
use std::time::Duration;

/// What a bare loop measured.
#[derive(Clone, Debug)]
pub struct Bare {
    /// From each deadline to its beat.
    pub lateness: Distribution,
    /// Deadlines that passed by without a beat.
    pub missed: u64,
    /// What the system granted.
    pub priority: Grant,
}

/// Runs a bare loop with the haptic thread's clock, for some seconds.
///
/// # Errors
/// When the system has no more threads.
pub fn bare_loop(period: f64, seconds: f64, priority: Option<i32>, spin: Duration) -> std::io::Result<Bare> {
    let beats = (seconds / period).round().max(1.0) as u64;
    let period_ns = (period * 1e9).round().max(1.0) as u64;
    let bare = thread::Builder::new().name("bare".into()).spawn(move || {
        system::wake_exactly();
        let priority = priority.map_or(Grant::NotAsked, system::raise_priority);
        let histogram = Histogram::new();
        let mut metronome = Metronome::new(clock::quiet_epoch(period_ns), period_ns, spin);
        let mut missed = 0;
        loop {
            let beat = metronome.wait();
            histogram.record(beat.lateness_ns);
            missed += beat.missed;
            if beat.index >= beats {
                return Bare { lateness: histogram.distribution(), missed, priority };
            }
        }
    })?;
    bare.join().map_err(|_| std::io::Error::other("the bare loop failed"))
}
