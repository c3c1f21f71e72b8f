//! The round of control inside the OpenHaptics scheduler allocates nothing. A file of its own: it counts every allocation of the process outside the
//! emulated library (which has an allocator of its own).
#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(unsafe_code, reason = "an allocator that counts")]

mod emulated;

use emulated::EmulatedLibrary;
use hapteron_device::DeviceCommand;
use hapteron_device::drivers::{self, DriverOptions};
use nalgebra::Vector3;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

struct Counting;

static COUNT: AtomicU64 = AtomicU64::new(0);

// SAFETY: passes everything on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Guards the tick: between the 10th and the 500th nothing is allocated.
#[test]
fn ticks_do_not_allocate() {
    let emulator = EmulatedLibrary::new("hd");
    emulator.set("calibrated", 1.0);
    let options = DriverOptions::new().with("library", emulator.path.display()).with("patience", 5.0);
    let mut device = drivers::open("openhaptics", &options).unwrap();
    device.set_force_enabled(true).unwrap();
    let (mut tick, mut before, mut after) = (0, 0, 0);
    device
        .serve(&mut |sample| {
            tick += 1;
            match tick {
                10 => before = COUNT.load(Ordering::Relaxed),
                500 => after = COUNT.load(Ordering::Relaxed),
                _ => {}
            }
            let command = DeviceCommand { force: -100.0 * sample.position, torque: Vector3::x() * 0.01 };
            (tick < 510).then_some(command)
        })
        .unwrap();
    assert!(before > 0, "the allocator does not count");
    assert_eq!(after - before, 0);
}
