//! The OpenHaptics driver against a library with the same symbols and a scheduler of its own.

#![allow(clippy::unwrap_used, reason = "tests")]

mod emulated;

use emulated::{EmulatedLibrary, check_capabilities, resting_depth, wall_force};
use hapteron_device::drivers::{self, DriverOptions};
use hapteron_device::{Applied, Device, DeviceCommand, DeviceFault, DeviceSample, Pacing, undeliverable};
use nalgebra::{UnitQuaternion, Vector3};

fn open(emulator: &EmulatedLibrary) -> Box<dyn Device> {
    let options = DriverOptions::new()
        .with("library", emulator.path.display())
        .with("homing_timeout", 0.05)
        .with("patience", 1.0);
    drivers::open("openhaptics", &options).unwrap()
}

/// Open, calibrated, motors on.
fn ready(emulator: &EmulatedLibrary) -> Box<dyn Device> {
    let mut device = open(emulator);
    device.home().unwrap();
    device.set_force_enabled(true).unwrap();
    device
}

/// Serves for a number of ticks; the last sample.
fn run(
    device: &mut dyn Device,
    ticks: u32,
    control: impl Fn(&DeviceSample) -> DeviceCommand + Send + Sync,
) -> DeviceSample {
    let (mut count, mut last) = (0, None);
    device
        .serve(&mut |sample| {
            count += 1;
            last = Some(*sample);
            (count < ticks).then(|| control(sample))
        })
        .unwrap();
    last.unwrap()
}

fn push(x: f64) -> DeviceCommand {
    DeviceCommand { force: Vector3::new(x, 0.0, 0.0), torque: Vector3::zeros() }
}

/// Serves until a script has been run in tick 50 and the service has ended by itself.
fn fault_after(device: &mut dyn Device, script: impl Fn() + Send + Sync) -> DeviceFault {
    let mut count = 0;
    let outcome = device.serve(&mut |_| {
        count += 1;
        if count == 50 {
            script();
        }
        (count < 5000).then(|| push(2.0))
    });
    outcome.expect_err("the service must end with a fault")
}

/// Guards axes, signs and units from end to end: pushed on a wall in each direction, the hand rests where two springs balance; let go, all is zero.
#[test]
fn push_on_a_wall_and_release() {
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        let emulator = EmulatedLibrary::new("hd");
        let mut device = ready(&emulator);
        emulator.set_vector("target", axis * 0.005);
        let inward = axis;
        let during = std::sync::Mutex::new(Vector3::zeros());
        let sample = run(&mut *device, 2000, |s| {
            *during.lock().unwrap() = emulator.vector("applied");
            wall_force(s, &inward)
        });
        let rest = resting_depth(0.005);
        assert!((sample.position - inward * rest).norm() < 1e-6, "{sample:?}");
        let applied = *during.lock().unwrap();
        assert!((applied + axis * (rest * emulated::WALL)).norm() < 1e-3, "{applied}");
        emulator.set_vector("target", axis * -0.005);
        let sample = run(&mut *device, 2000, |s| wall_force(s, &inward));
        assert!((sample.position + inward * 0.005).norm() < 1e-6);
        assert_eq!(emulator.get("latched"), 0.0);
    }
}

/// Guards orientation (column by column), angular velocity, and torque in millinewton metres.
#[test]
fn torque_turns_the_handle_about_the_same_axis() {
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        let emulator = EmulatedLibrary::new("hd");
        let mut device = ready(&emulator);
        let command = DeviceCommand { force: Vector3::zeros(), torque: axis * 0.04 };
        let early = run(&mut *device, 4, |_| command);
        assert!(early.angular_velocity.dot(&axis) > 0.1, "{early:?}");
        let sample = run(&mut *device, 2000, |_| command);
        let expected = UnitQuaternion::from_scaled_axis(axis * 0.2);
        assert!(sample.orientation.angle_to(&expected) < 1e-6, "{axis}: {}", sample.orientation);
    }
}

/// Guards limits read from the library, and their units.
#[test]
fn limits_come_from_the_library() {
    let emulator = EmulatedLibrary::new("hd");
    let device = open(&emulator);
    let c = device.capabilities();
    check_capabilities(c);
    assert_eq!(c.name, "OpenHaptics Emulated Premium 1.5");
    assert_eq!(c.pacing, Pacing::Callback);
    assert_eq!([c.peak_force, c.continuous_force, c.max_stiffness], [8.5, 1.4, 3500.0]);
    assert!((c.peak_torque - 0.188).abs() < 1e-12 && (c.continuous_torque - 0.048).abs() < 1e-12);
    assert!((c.workspace[1] - Vector3::new(0.19, 0.135, 0.085)).norm() < 1e-12);
}

/// Guards the start: no force, nothing served before calibration, calibration not inside a frame and with a style that the device has.
#[test]
fn starts_without_force_and_uncalibrated() {
    let emulator = EmulatedLibrary::new("hd");
    let mut device = open(&emulator);
    assert_eq!(emulator.get("force_on"), 0.0);
    assert_eq!(device.set_force_enabled(true).unwrap_err(), DeviceFault::NotHomed);
    assert_eq!(device.serve(&mut |_| Some(push(1.0))).unwrap_err(), DeviceFault::NotHomed);
    emulator.set("needs_hand", 1.0);
    assert_eq!(device.home().unwrap_err(), DeviceFault::NotHomed);
    emulator.set("needs_hand", 0.0);
    device.home().unwrap();
    assert_eq!([emulator.get("updates"), emulator.get("running")], [1.0, 0.0]);
    let forced = std::sync::atomic::AtomicBool::new(false);
    run(&mut *device, 50, |_| {
        forced.fetch_or(emulator.get("applied") != 0.0, std::sync::atomic::Ordering::Relaxed);
        push(1.0)
    });
    assert!(!forced.into_inner(), "force although the motors were not switched on");
    assert_eq!(device.read().unwrap_err(), DeviceFault::WrongPacing);
    assert_eq!(device.write(&push(1.0)), Err::<Applied, _>(DeviceFault::WrongPacing));
}

/// Guards the end of a service: zero force, scheduler stopped, nothing scheduled, no error left; and that it can begin again.
#[test]
fn the_end_of_a_service_is_clean() {
    let emulator = EmulatedLibrary::new("hd");
    let mut device = ready(&emulator);
    for _ in 0..3 {
        run(&mut *device, 30, |_| push(3.0));
        let state = ["applied", "latched", "running", "scheduled", "errors"].map(|n| emulator.get(n));
        assert_eq!(state, [0.0; 5]);
    }
}

/// Guards the library's transient errors: warm motors and too great a force do not end the service; a too great force is limited, not lost.
#[test]
fn warm_motors_go_on() {
    let emulator = EmulatedLibrary::new("hd");
    let mut device = ready(&emulator);
    let mut seen = Vec::new();
    let mut count = 0;
    device
        .serve(&mut |_| {
            count += 1;
            emulator.set("warm", f64::from((20..40).contains(&count)));
            seen.push(emulator.get("applied"));
            (count < 60).then(|| push(20.0))
        })
        .unwrap();
    assert!((seen[10] - 8.5).abs() < 1e-9, "limited to what the library takes: {}", seen[10]);
    assert_eq!(seen[30], 0.0, "warm");
    assert!((seen[50] - 8.5).abs() < 1e-9, "back again");
}

/// Guards every fatal fault: it is told, latched, and leaves no force and motors off.
#[test]
fn fatal_faults_end_without_force() {
    let scripts: [(&str, DeviceFault); 4] = [
        ("comm_error", DeviceFault::Disconnected),
        ("malformed", DeviceFault::Malformed),
        ("skewed", DeviceFault::Malformed),
        ("refuse_forces", DeviceFault::Refused(0x101)),
    ];
    for (name, fault) in scripts {
        let emulator = EmulatedLibrary::new("hd");
        let mut device = ready(&emulator);
        assert_eq!(
            fault_after(&mut *device, || {
                emulator.set(name, 1.0);
            }),
            fault,
            "{name}"
        );
        let state = ["applied", "latched", "force_on", "running"].map(|n| emulator.get(n));
        assert_eq!(state, [0.0; 4], "{name}");
        assert_eq!(device.serve(&mut |_| None).unwrap_err(), fault, "{name}: a fault must latch");
    }
}

/// Guards against a scheduler that stands still: the caller comes back, with the motors off.
#[test]
fn a_stalled_scheduler_is_late() {
    let emulator = EmulatedLibrary::new("hd");
    let mut device = ready(&emulator);
    let fault = fault_after(&mut *device, || {
        emulator.set("stalled", 1.0);
    });
    assert_eq!(fault, DeviceFault::Late);
    assert_eq!([emulator.get("applied"), emulator.get("force_on")], [0.0, 0.0]);
}

/// Guards a command that is not finite: zero force and the end of the service.
#[test]
fn malformed_commands_go_nowhere() {
    let emulator = EmulatedLibrary::new("hd");
    let mut device = ready(&emulator);
    let outcome = device.serve(&mut |_| Some(push(f64::NAN)));
    assert_eq!(outcome.unwrap_err(), DeviceFault::Malformed);
    assert_eq!([emulator.get("latched"), emulator.get("force_on")], [0.0, 0.0]);
}

/// Guards the promise of the trait: a panic in the control comes out of `serve` with zero force before; a dropped device is released.
#[test]
fn a_panicking_or_dropped_owner_leaves_no_force() {
    let emulator = EmulatedLibrary::new("hd");
    let mut device = ready(&emulator);
    let mut count = 0;
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        device.serve(&mut |_| {
            count += 1;
            assert!(count < 50, "the owner fails");
            Some(push(3.0))
        })
    }));
    assert!(panicked.is_err());
    let state = ["applied", "latched", "force_on", "running", "scheduled"].map(|n| emulator.get(n));
    assert_eq!(state, [0.0; 5]);
    drop(device);
    assert_eq!([emulator.get("initialised"), emulator.get("force_on")], [0.0, 0.0]);
}

/// Guards devices that sense six axes and drive three (Touch): no torque is written, and it is told as undeliverable.
#[test]
fn senses_six_drives_three() {
    let emulator = EmulatedLibrary::new("hd");
    emulator.set("output_dof", 3.0);
    let mut device = ready(&emulator);
    check_capabilities(device.capabilities());
    let command = DeviceCommand { force: Vector3::new(1.0, 0.0, 0.0), torque: Vector3::new(0.0, 0.1, 0.0) };
    // The emulator refuses a torque of such a device with a fatal error.
    run(&mut *device, 50, |_| command);
    let left = undeliverable(device.capabilities(), &command);
    assert_eq!(left, DeviceCommand { force: Vector3::zeros(), ..command });
}

/// Guards the words for a device that is not there.
#[test]
fn absent_device_is_told() {
    let emulator = EmulatedLibrary::new("hd");
    emulator.set("absent", 1.0);
    let options = DriverOptions::new().with("library", emulator.path.display()).with("name", "Left");
    let error = drivers::open("openhaptics", &options).map(drop).unwrap_err().to_string();
    assert!(error.contains("'Left'") && error.contains("0x301"), "{error}");
}
