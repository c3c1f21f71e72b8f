//! The Force Dimension driver against a library with the same symbols.

#![allow(clippy::unwrap_used, reason = "tests")]

mod emulated;

use emulated::{EmulatedLibrary, check_capabilities, resting_depth, run, wall_force};
use hapteron_device::drivers::{self, DriverOptions, OpenError};
use hapteron_device::{Applied, Device, DeviceCommand, DeviceFault, undeliverable};
use nalgebra::{UnitQuaternion, Vector3};

/// Where the vendor's x, y and z axes point in ours: toward the user (z), right (x), up (y).
const VENDOR: [(Vector3<f64>, Vector3<f64>); 3] = [
    (Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 0.0, 1.0)),
    (Vector3::new(0.0, 1.0, 0.0), Vector3::new(1.0, 0.0, 0.0)),
    (Vector3::new(0.0, 0.0, 1.0), Vector3::new(0.0, 1.0, 0.0)),
];

fn open(emulator: &EmulatedLibrary) -> Box<dyn Device> {
    let options = DriverOptions::new().with("library", emulator.path.display());
    drivers::open("force-dimension", &options).unwrap()
}

/// Open, homed, motors on.
fn ready(emulator: &EmulatedLibrary) -> Box<dyn Device> {
    let mut device = open(emulator);
    device.home().unwrap();
    device.set_force_enabled(true).unwrap();
    device
}

fn push(x: f64) -> DeviceCommand {
    DeviceCommand { force: Vector3::new(x, 0.0, 0.0), torque: Vector3::zeros() }
}

/// Guards axes, signs and units from end to end: pushed on a wall in each direction, the hand rests where two springs balance; let go, all is zero.
#[test]
fn push_on_a_wall_and_release() {
    for (vendor, ours) in VENDOR {
        for sign in [1.0, -1.0] {
            let emulator = EmulatedLibrary::new("dhd");
            let mut device = ready(&emulator);
            emulator.set_vector("target", vendor * (sign * 0.005));
            let inward = ours * sign;
            let sample = run(&mut *device, 3000, |s| wall_force(s, &inward));
            let rest = resting_depth(0.005);
            assert!((sample.position - inward * rest).norm() < 1e-6, "{vendor}: {sample:?}");
            let applied = emulator.vector("applied");
            assert!((applied + vendor * (sign * rest * emulated::WALL)).norm() < 1e-3, "{applied}");
            emulator.set_vector("target", vendor * (sign * -0.005));
            let sample = run(&mut *device, 3000, |s| wall_force(s, &inward));
            assert!((sample.position + inward * 0.005).norm() < 1e-6);
            assert_eq!(emulator.get("applied"), 0.0);
            assert_eq!(emulator.get("gripper"), 0.0);
        }
    }
}

/// Guards orientation, angular velocity and torque: a torque about each axis turns the handle about the same axis in our frame.
#[test]
fn torque_turns_the_handle_about_the_same_axis() {
    for (vendor, ours) in VENDOR {
        let emulator = EmulatedLibrary::new("dhd");
        let mut device = ready(&emulator);
        let command = DeviceCommand { force: Vector3::zeros(), torque: ours * 0.04 };
        let early = run(&mut *device, 3, |_| command);
        assert!(early.angular_velocity.dot(&ours) > 0.1, "{early:?}");
        let sample = run(&mut *device, 3000, |_| command);
        let expected = UnitQuaternion::from_scaled_axis(ours * 0.2);
        assert!(sample.orientation.angle_to(&expected) < 1e-6, "{vendor}: {}", sample.orientation);
    }
}

/// Guards velocities: the library's own, in our axes; and when it knows none, those of the past positions, always finite.
#[test]
fn velocities_are_known_or_estimated() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    emulator.set("target_y", 0.05);
    let known = run(&mut *device, 20, |_| DeviceCommand::zero());
    assert!((known.linear_velocity.x - emulator.get("velocity_y")).abs() < 0.2 * known.linear_velocity.x);
    emulator.set("velocity_unknown", 1.0);
    let estimated = run(&mut *device, 20, |_| DeviceCommand::zero());
    assert!(estimated.linear_velocity.x > 0.0 && estimated.linear_velocity.x.is_finite());
    assert!(estimated.linear_velocity.yz().norm() < 1e-9);
}

/// Guards the start: motors off and no force until asked for, no motion before homing, watchdog on, expert mode left, velocity safety untouched.
#[test]
fn starts_without_force_and_unhomed() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = open(&emulator);
    check_capabilities(device.capabilities());
    assert_eq!(emulator.get("force_on"), 0.0);
    assert_eq!(emulator.get("watchdog"), 160.0, "20 ms in steps of 125 us");
    assert_eq!(emulator.get("expert"), 0.0);
    assert_eq!(device.read().unwrap_err(), DeviceFault::NotHomed);
    assert_eq!(device.set_force_enabled(true).unwrap_err(), DeviceFault::NotHomed);
    assert_eq!(emulator.get("force_on"), 0.0);
    device.home().unwrap();
    assert_eq!(emulator.get("force_on"), 0.0, "homing left the motors on");
    assert_eq!(device.write(&push(1.0)).unwrap(), Applied::Disabled);
    assert_eq!(emulator.vector("force"), Vector3::zeros(), "a force waits for the front panel's button");
    device.set_force_enabled(true).unwrap();
    assert_eq!(device.write(&push(1.0)).unwrap(), Applied::Fully);
    assert_eq!(emulator.get("applied_y"), 1.0);
}

/// Guards homing by hand: the user's part done, not done in time, and a device that cannot move by itself.
#[test]
fn homing_by_hand() {
    let emulator = EmulatedLibrary::new("dhd");
    emulator.set("robotic", 0.0);
    let mut device = open(&emulator);
    assert_eq!(device.home().unwrap_err(), DeviceFault::NotHomed);
    emulator.set("by_hand", 1.0);
    device.home().unwrap();
    assert!(device.read().is_ok());
    let failing = EmulatedLibrary::new("dhd");
    failing.set("auto_init_fails", 1.0);
    assert_eq!(open(&failing).home().unwrap_err(), DeviceFault::NotHomed);
}

/// Guards saturation: told with its factor, direction kept.
#[test]
fn saturated_motors_are_told() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    emulator.set("max_force", 2.0);
    match device.write(&push(8.0)).unwrap() {
        Applied::Scaled(factor) => assert!((factor - 0.25).abs() < 1e-12, "{factor}"),
        other => panic!("{other:?}"),
    }
    assert_eq!(emulator.vector("applied"), Vector3::new(0.0, 2.0, 0.0));
}

/// Guards every cause for which the device takes the force away.
#[test]
fn causes_of_lost_force() {
    for (cause, fault) in [
        (2.0, DeviceFault::SafetyStop),
        (3.0, DeviceFault::Watchdog),
        (5.0, DeviceFault::Disconnected),
        (6.0, DeviceFault::SafetyStop),
    ] {
        let emulator = EmulatedLibrary::new("dhd");
        let mut device = ready(&emulator);
        emulator.set("force_off", cause);
        assert_eq!(device.write(&push(1.0)).unwrap_err(), fault);
        assert_eq!(device.read().unwrap_err(), fault, "a fault must latch");
        assert_eq!(device.write(&push(1.0)).unwrap_err(), fault);
        assert_eq!(emulator.get("applied"), 0.0);
        device.set_force_enabled(true).unwrap();
        assert_eq!(device.write(&push(1.0)).unwrap(), Applied::Fully, "re-arming must work");
    }
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    emulator.set("force_off", 1.0);
    assert_eq!(device.write(&push(1.0)).unwrap(), Applied::Disabled, "the button on the front panel");
}

/// Guards the device's own watchdog: a host that freezes loses the force after 20 ms, and is told.
#[test]
fn frozen_host_loses_the_force() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    device.write(&push(3.0)).unwrap();
    emulator.set("silence", 0.015);
    assert_eq!(emulator.get("applied"), 3.0);
    emulator.set("silence", 0.030);
    assert_eq!(emulator.get("applied"), 0.0);
    assert_eq!(device.write(&push(3.0)).unwrap_err(), DeviceFault::Watchdog);
}

/// Guards against a force that stands: readings go on, commands are refused. One refusal is tried again; the second ends at zero force.
#[test]
fn refused_commands_end_at_zero_force() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    device.write(&push(5.0)).unwrap();
    emulator.set("refuse_forces", 1.0);
    assert_eq!(device.write(&push(4.0)).unwrap(), Applied::Fully, "a single refusal is tried again");
    assert_eq!(emulator.get("applied"), 4.0);
    emulator.set("refuse_forces", 1e9);
    assert_eq!(device.write(&push(4.0)).unwrap_err(), DeviceFault::Refused(6));
    assert_eq!(emulator.get("applied"), 0.0);
    assert_eq!(emulator.get("force_on"), 0.0);
    assert_eq!(device.read().unwrap_err(), DeviceFault::Refused(6));
}

/// Guards against numbers that are not finite, in both directions.
#[test]
fn malformed_numbers_go_nowhere() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    for (name, value) in [("malformed", 1.0), ("malformed", 2.0), ("skewed", 1.0)] {
        emulator.set(name, value);
        assert_eq!(device.read().unwrap_err(), DeviceFault::Malformed, "{name} {value}");
        emulator.set(name, 0.0);
        assert!(device.read().is_ok());
    }
    device.write(&push(2.0)).unwrap();
    assert_eq!(device.write(&push(f64::NAN)).unwrap_err(), DeviceFault::Malformed);
    assert_eq!(emulator.get("applied"), 0.0);
}

/// Guards a reading that does not come in time: told for that tick, and over with it.
#[test]
fn late_readings_are_told_and_left_behind() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    emulator.set("late", 1.0);
    assert_eq!(device.read().unwrap_err(), DeviceFault::Late);
    emulator.set("late", 0.0);
    assert!(device.read().is_ok());
    assert_eq!(device.write(&push(1.0)).unwrap(), Applied::Fully);
}

/// Guards unplugging: told at once, by read and by write; stopping and dropping stay harmless.
#[test]
fn unplugged() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    emulator.set("disconnected", 1.0);
    assert_eq!(device.read().unwrap_err(), DeviceFault::Disconnected);
    assert_eq!(device.write(&push(2.0)).unwrap_err(), DeviceFault::Disconnected);
    device.stop();
    drop(device);
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    emulator.set("unpowered", 1.0);
    assert_eq!(device.write(&push(2.0)).unwrap_err(), DeviceFault::Disconnected);
}

/// Guards the promise of the trait: an owner that is gone, even by a panic, leaves no force and motors off.
#[test]
fn a_dropped_or_panicking_owner_leaves_no_force() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    device.write(&push(5.0)).unwrap();
    drop(device);
    assert_eq!([emulator.get("applied"), emulator.get("force_on"), emulator.get("opened")], [0.0, 0.0, 0.0]);
    assert_eq!(emulator.vector("force"), Vector3::zeros());
    let mut device = ready(&emulator);
    let panicked = std::thread::scope(|scope| {
        let owner = scope.spawn(move || {
            device.write(&push(5.0)).unwrap();
            panic!("the owner fails");
        });
        owner.join().is_err()
    });
    assert!(panicked);
    assert_eq!([emulator.get("applied"), emulator.get("opened")], [0.0, 0.0]);
}

/// Guards devices that sense six axes and drive three: the torque is told as undeliverable and never sent.
#[test]
fn senses_six_drives_three() {
    let emulator = EmulatedLibrary::new("dhd");
    emulator.set("type", 34.0).set("active_wrist", 0.0);
    let mut device = ready(&emulator);
    check_capabilities(device.capabilities());
    assert!(device.capabilities().senses_rotation && !device.capabilities().drives_torque);
    let command = DeviceCommand { force: Vector3::new(1.0, 2.0, 3.0), torque: Vector3::new(0.1, 0.0, 0.0) };
    assert_eq!(device.write(&command).unwrap(), Applied::Fully);
    assert_eq!(emulator.get("applied_torque"), 0.0);
    let left = undeliverable(device.capabilities(), &command);
    assert_eq!(left, DeviceCommand { force: Vector3::zeros(), ..command });
}

/// Guards the tick: no allocation in read and write.
#[test]
fn read_and_write_do_not_allocate() {
    let emulator = EmulatedLibrary::new("dhd");
    let mut device = ready(&emulator);
    let mut sum = 0.0;
    let counted = allocation_counter::measure(|| {
        for _ in 0..1000 {
            sum += device.read().unwrap().position.x;
            device.write(&push(0.5)).unwrap();
        }
    });
    assert!(sum != 0.0);
    assert_eq!(counted.count_total, 0);
}

/// Guards how a device is found: by index, by serial number, and what is said when it is not there.
#[test]
fn found_by_serial_or_told_what_is_there() {
    let emulator = EmulatedLibrary::new("dhd");
    let options = DriverOptions::new().with("library", emulator.path.display());
    let with = |key: &str, value: &str| {
        drivers::open("force-dimension", &options.clone().with(key, value)).map(drop)
    };
    with("serial", "1234").unwrap();
    let error = with("serial", "99").unwrap_err().to_string();
    assert!(error.contains("serial number 99") && error.contains("1234"), "{error}");
    assert_eq!(emulator.get("opened"), 0.0, "a device that is not wanted stays open");
    let error = with("index", "1").unwrap_err().to_string();
    assert!(error.contains("sees 1 devices"), "{error}");
    emulator.set("open_fails", 1.0);
    assert!(matches!(with("index", "0").unwrap_err(), OpenError::NoDevice { .. }));
}
