//! The vendor's scheduler is one for all devices of a library: the first user starts it, the last one stops it.

use super::functions::Functions;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Users by library (the address of its start function).
static USERS: Mutex<BTreeMap<usize, u32>> = Mutex::new(BTreeMap::new());

/// Starts it, if nobody has.
pub(super) fn start(functions: &Functions) {
    let mut users = USERS.lock().unwrap_or_else(PoisonError::into_inner);
    let count = users.entry(functions.hdStartScheduler as usize).or_insert(0);
    if *count == 0 {
        functions.start_scheduler();
    }
    *count += 1;
}

/// Stops it, if nobody else uses it; then all forces are off.
pub(super) fn stop(functions: &Functions) {
    let mut users = USERS.lock().unwrap_or_else(PoisonError::into_inner);
    let count = users.entry(functions.hdStartScheduler as usize).or_insert(0);
    *count = count.saturating_sub(1);
    if *count == 0 {
        functions.stop_scheduler();
    }
}
