//! The supervisor: stops the device when the haptic thread no longer can.

use super::clock;
use super::shared::{Shared, SharedDevice};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Between two looks; away from whole milliseconds and from the haptic thread's deadlines ([`clock::quiet_epoch`]), which a timer at the same time would
/// delay.
const LOOK_NS: u64 = 2_000_000;
const PHASE_NS: u64 = 500_000;

/// Watches until the haptic thread has ended. Answers whether it had to stop the device.
pub(super) fn watch(shared: &Arc<Shared>, device: &Arc<SharedDevice>, watchdog: Duration) -> bool {
    let limit = watchdog.as_nanos() as u64;
    let mut taken_over = false;
    loop {
        let now = clock::now_ns();
        clock::sleep_until((now / LOOK_NS + 1) * LOOK_NS + PHASE_NS);
        if shared.is_haptic_done() {
            return taken_over;
        }
        let woke = clock::now_ns();
        // When this thread did not run for as long itself, the whole machine stood still: the haptic thread gets its chance first.
        if woke - now > limit {
            continue;
        }
        let pulse = shared.pulse_ns.load(Ordering::Relaxed);
        if woke.saturating_sub(pulse) > limit {
            shared.frozen();
            // Again and again until it is done: the thread may hang in a call of the device, and come out of it.
            if device.stop() {
                taken_over = true;
                return taken_over;
            }
        }
    }
}
