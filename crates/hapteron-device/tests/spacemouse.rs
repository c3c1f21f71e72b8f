//! The SpaceMouse driver against an emulated spacenavd of both protocols.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests")]

mod emulated;

use emulated::check_capabilities;
use hapteron_device::drivers::{self, DriverOptions};
use hapteron_device::{Applied, Device, DeviceCommand, DeviceFault, DeviceSample, undeliverable};
use hapteron_emulators::Spacenavd;
use nalgebra::Vector3;
use std::time::{Duration, Instant};

fn open(daemon: &Spacenavd) -> Box<dyn Device> {
    let options = DriverOptions::new()
        .with("socket", daemon.path().display())
        .with("speed", 0.2)
        .with("turn_rate", 2.0);
    drivers::open("spacemouse", &options).unwrap()
}

/// Reads until the sample is as wanted.
fn until(device: &mut dyn Device, wanted: impl Fn(&DeviceSample) -> bool) -> DeviceSample {
    let start = Instant::now();
    loop {
        let sample = device.read().unwrap();
        if wanted(&sample) {
            return sample;
        }
        assert!(start.elapsed() < Duration::from_secs(10), "{sample:?}");
        std::thread::sleep(Duration::from_micros(200));
    }
}

/// Guards signs and scale of all six axes: half way between dead zone and stop is half the speed; z and rz turn round; pose and velocity agree.
#[test]
fn every_axis_in_our_frame() {
    for protocol in [0, 1] {
        for (axis, sign) in [(0, 1.0), (1, 1.0), (2, -1.0), (3, 1.0), (4, 1.0), (5, -1.0)] {
            let mut daemon = Spacenavd::start(protocol);
            let mut device = open(&daemon);
            let mut counts = [0; 6];
            counts[axis] = 180;
            let before = device.read().unwrap();
            daemon.motion(counts, 50);
            let moving = until(&mut *device, |s| s.linear_velocity.norm() + s.angular_velocity.norm() > 0.0);
            let mut expected = Vector3::zeros();
            expected[axis % 3] = sign * if axis < 3 { 0.1 } else { 1.0 };
            let (is, other) = match axis < 3 {
                true => (moving.linear_velocity, moving.angular_velocity),
                false => (moving.angular_velocity, moving.linear_velocity),
            };
            assert!((is - expected).norm() < 1e-12 && other == Vector3::zeros(), "{axis}: {moving:?}");
            let rest = until(&mut *device, |s| s.linear_velocity.norm() + s.angular_velocity.norm() == 0.0);
            let went = if axis < 3 { rest.position } else { rest.orientation.scaled_axis() };
            let direction = went.dot(&expected) / (went.norm() * expected.norm());
            assert!((direction - 1.0).abs() < 1e-9, "{axis}: {went}");
            // No longer than two periods, and never more than the time between two reads beyond.
            assert!(went.norm() <= expected.norm() * (rest.time - before.time), "{axis}: {went}");
        }
    }
}

/// Guards the greeting: sensitivity to an old daemon, a mask of events to a new one.
#[test]
fn greets_in_the_daemons_protocol() {
    let mut old = Spacenavd::start(0);
    let _device = open(&old);
    assert_eq!(old.hear(4), 1.0f32.to_ne_bytes());
    let mut new = Spacenavd::start(1);
    let _device = open(&new);
    assert_eq!(new.hear(32)[..8], [0x7FAA_1003_i32.to_ne_bytes(), 7i32.to_ne_bytes()].concat());
}

/// Guards the emulator against the project's own client library: what it sends, libspnav understands.
#[test]
#[allow(unsafe_code, reason = "calls a C library")]
fn libspnav_understands_the_emulator() {
    // SAFETY: the library has no initialisers that matter here.
    let Ok(library) = (unsafe { libloading::Library::new("libspnav.so.0") }) else {
        println!("skipped: libspnav.so.0 is not installed");
        return;
    };
    for protocol in [0, 1] {
        let mut daemon = Spacenavd::start(protocol);
        // SAFETY: the functions have these types in spnav.h; no other test of this file reads the environment.
        let (open, wait, close) = unsafe {
            std::env::set_var("SPNAV_SOCKET", daemon.path());
            (
                *library.get::<unsafe extern "C" fn() -> i32>(b"spnav_open").unwrap(),
                *library.get::<unsafe extern "C" fn(*mut i32) -> i32>(b"spnav_wait_event").unwrap(),
                *library.get::<unsafe extern "C" fn() -> i32>(b"spnav_close").unwrap(),
            )
        };
        // SAFETY: no arguments.
        assert_eq!(unsafe { open() }, 0);
        daemon.motion([1, -2, 3, -4, 5, -6], 16);
        daemon.button(2, true);
        // More than the library's union of events has; its first eight numbers are the record's.
        let mut event = [0i32; 64];
        // SAFETY: room enough.
        assert!(unsafe { wait(event.as_mut_ptr()) } > 0);
        assert_eq!(event[1..7], [1, -2, 3, -4, 5, -6], "{protocol}");
        // SAFETY: as above.
        assert!(unsafe { wait(event.as_mut_ptr()) } > 0);
        assert_eq!(event[1..3], [1, 2], "button 2 pressed, {protocol}");
        // SAFETY: no arguments.
        unsafe { close() };
    }
}

/// Guards rest: the dead zone, silence after two periods, and a reach that is not left.
#[test]
fn silence_and_dead_zone_are_rest() {
    let mut daemon = Spacenavd::start(1);
    let mut device = open(&daemon);
    daemon.motion([10, -10, 9, 0, 10, -3], 16);
    daemon.button(3, true);
    let sample = until(&mut *device, |s| s.buttons == 8);
    assert_eq!(sample.linear_velocity.norm() + sample.angular_velocity.norm(), 0.0);
    daemon.motion([350, 0, 0, 0, 0, 0], 8);
    until(&mut *device, |s| s.linear_velocity.x > 0.0);
    until(&mut *device, |s| s.linear_velocity.x == 0.0);
    // Held against the end of its reach, with counts that no device sends.
    let start = Instant::now();
    while device.read().unwrap().position.x < 0.1 {
        daemon.motion([i32::MAX, 0, 0, 0, 0, i32::MIN], i32::MAX);
        std::thread::sleep(Duration::from_millis(2));
        assert!(start.elapsed() < Duration::from_secs(20));
    }
    let sample = device.read().unwrap();
    assert_eq!((sample.position.x, sample.linear_velocity.x), (0.1, 0.0));
    assert!((sample.orientation.norm() - 1.0).abs() < 1e-12);
    device.home().unwrap();
    assert_eq!(device.read().unwrap().position.x, 0.0);
}

/// Guards buttons, and records of other kinds: answers to requests, raw events, buttons that there are not.
#[test]
fn buttons_and_foreign_records() {
    let mut daemon = Spacenavd::start(1);
    let mut device = open(&daemon);
    for record in [
        [0x7FAA_2000, 0, 0, 0, 0, 0, 0, -1],
        [5, 3, 9999, 0, 0, 0, 0, 0],
        [1, 32, 0, 0, 0, 0, 0, 0],
        [1, -1, 0, 0, 0, 0, 0, 0],
        [i32::MIN; 8],
    ] {
        daemon.event(record);
    }
    daemon.button(0, true);
    daemon.button(31, true);
    assert_eq!(until(&mut *device, |s| s.buttons & 1 == 1 && s.buttons >> 31 == 1).buttons, 1 | 1 << 31);
    // A record in pieces.
    let record: Vec<u8> = [2, 31, 0, 0, 0, 0, 0, 0i32].iter().flat_map(|n| n.to_ne_bytes()).collect();
    daemon.raw(&record[..7]);
    device.read().unwrap();
    daemon.raw(&record[7..]);
    assert_eq!(until(&mut *device, |s| s.buttons == 1).linear_velocity, Vector3::zeros());
}

/// Guards unplugging of the mouse (it may come back) and the end of the daemon (it is told, and stays so).
#[test]
fn unplugged_and_hung_up() {
    let mut daemon = Spacenavd::start(1);
    let mut device = open(&daemon);
    daemon.motion([350, 0, 0, 0, 0, 0], 16);
    until(&mut *device, |s| s.linear_velocity.x > 0.0);
    daemon.device(false);
    let start = Instant::now();
    while device.read().is_ok() {
        assert!(start.elapsed() < Duration::from_secs(10));
    }
    assert_eq!(device.read().unwrap_err(), DeviceFault::Disconnected);
    daemon.device(true);
    while device.read().is_err() {
        assert!(start.elapsed() < Duration::from_secs(10));
    }
    assert_eq!(device.read().unwrap().linear_velocity, Vector3::zeros(), "it must not go on by itself");
    daemon.hang_up();
    while device.read().is_ok() {
        assert!(start.elapsed() < Duration::from_secs(10));
    }
    assert_eq!(device.read().unwrap_err(), DeviceFault::Disconnected);
    assert_eq!(device.write(&DeviceCommand::zero()).unwrap_err(), DeviceFault::Disconnected);
}

/// Guards an input without motors: everything is undeliverable, nothing is pretended; and reading does not allocate.
#[test]
fn no_force_and_no_allocation() {
    let mut daemon = Spacenavd::start(1);
    let mut device = open(&daemon);
    check_capabilities(device.capabilities());
    let command = DeviceCommand { force: Vector3::x(), torque: Vector3::y() };
    assert_eq!(device.write(&command).unwrap(), Applied::Disabled);
    assert_eq!(undeliverable(device.capabilities(), &command), command);
    daemon.motion([50, 60, 70, 80, 90, 100], 16);
    let counted = allocation_counter::measure(|| {
        for _ in 0..1000 {
            let _ = device.read();
            let _ = device.write(&command);
        }
    });
    assert_eq!(counted.count_total, 0);
}

/// Guards the words when there is no daemon.
#[test]
fn no_daemon_is_told() {
    let options = DriverOptions::new().with("socket", "/nowhere/spnav.sock");
    let text = drivers::open("spacemouse", &options).map(drop).unwrap_err().to_string();
    assert!(text.contains("/nowhere/spnav.sock") && text.contains("apt install spacenavd"), "{text}");
}
