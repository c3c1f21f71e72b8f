//! The Haply driver against an emulated service of both generations.

#![allow(clippy::unwrap_used, reason = "tests")]

mod emulated;

use emulated::{check_capabilities, resting_depth, run, wall_force};
use hapteron_device::drivers::{self, DriverOptions, OpenError};
use hapteron_device::{Applied, Device, DeviceCommand, DeviceFault, undeliverable};
use hapteron_emulators::{Generation, HaplyService};
use nalgebra::{UnitQuaternion, Vector3};
use std::time::{Duration, Instant};

const BOTH: [Generation; 2] = [Generation::V31, Generation::V35];

/// Where the service's x, y and z axes point in ours: right (x), away from the user (-z), up (y).
const SERVICE: [(Vector3<f64>, Vector3<f64>); 3] = [
    (Vector3::new(1.0, 0.0, 0.0), Vector3::new(1.0, 0.0, 0.0)),
    (Vector3::new(0.0, 1.0, 0.0), Vector3::new(0.0, 0.0, -1.0)),
    (Vector3::new(0.0, 0.0, 1.0), Vector3::new(0.0, 1.0, 0.0)),
];

fn options(service: &HaplyService) -> DriverOptions {
    // The machine that runs the tests may be busy: what is tested is what happens, not how fast.
    DriverOptions::new().with("address", service.address()).with("patience", 1.0)
}

fn ready(service: &HaplyService) -> Box<dyn Device> {
    let mut device = drivers::open("haply", &options(service)).unwrap();
    device.home().unwrap();
    device.set_force_enabled(true).unwrap();
    device
}

fn push(x: f64) -> DeviceCommand {
    DeviceCommand { force: Vector3::new(x, 0.0, 0.0), torque: Vector3::zeros() }
}

/// Waits for what the service does in its own thread.
fn eventually(service: &HaplyService, what: impl Fn(&hapteron_emulators::HaplyState) -> bool) {
    let start = Instant::now();
    while !what(&service.state()) {
        assert!(start.elapsed() < Duration::from_secs(10), "{:?}", service.state());
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Guards axes, signs and the spelling of both generations from end to end: pushed on a wall in each direction, the hand rests where two springs balance;
/// let go, all is zero.
#[test]
fn push_on_a_wall_and_release() {
    for generation in BOTH {
        for (service_axis, ours) in SERVICE {
            let service = HaplyService::start(generation);
            let mut device = ready(&service);
            service.state().hand.target = service_axis * 0.005;
            let sample = run(&mut *device, 2000, |s| wall_force(s, &ours));
            let rest = resting_depth(0.005);
            assert!((sample.position - ours * rest).norm() < 1e-6, "{service_axis}: {sample:?}");
            eventually(&service, |s| (s.hand.force + service_axis * (rest * emulated::WALL)).norm() < 1e-3);
            service.state().hand.target = service_axis * -0.005;
            let sample = run(&mut *device, 2000, |s| wall_force(s, &ours));
            assert!((sample.position + ours * 0.005).norm() < 1e-6);
            eventually(&service, |s| s.hand.force == Vector3::zeros());
            assert_eq!(service.state().unknown, Vec::<String>::new(), "{generation:?}");
        }
    }
}

/// Guards the grip: orientation in our axes, the angular velocity that it implies, buttons.
#[test]
fn the_grip_gives_orientation_and_buttons() {
    for (service_axis, ours) in SERVICE {
        let service = HaplyService::start(Generation::V35);
        let mut device = ready(&service);
        service.state().hand.target_rotation = service_axis * 0.3;
        let moving = run(&mut *device, 10, |_| DeviceCommand::zero());
        assert!(moving.angular_velocity.dot(&ours) > 0.0, "{moving:?}");
        service.state().button = true;
        let sample = run(&mut *device, 1000, |_| DeviceCommand::zero());
        assert!(sample.orientation.angle_to(&UnitQuaternion::from_scaled_axis(ours * 0.3)) < 1e-6);
        assert_eq!(sample.buttons, 0b10);
    }
}

/// Guards the choice of devices when there are several, and frames with keys in other orders.
#[test]
fn reordered_frames_and_more_devices() {
    let service = HaplyService::start(Generation::V35);
    let mut device = ready(&service);
    service.state().hand.target = Vector3::new(0.003, 0.0, 0.0);
    service.state().reordered = true;
    let sample = run(&mut *device, 1500, |_| DeviceCommand::zero());
    assert!((sample.position - Vector3::new(0.003, 0.0, 0.0)).norm() < 1e-6);
    assert_eq!(sample.orientation, UnitQuaternion::identity());
    drop(device);
    let wanted = options(&service).with("device", "04C3").with("grip", "1102");
    let mut device = drivers::open("haply", &wanted).unwrap();
    assert!((device.read().unwrap().position.x - 0.003).abs() < 1e-6);
    drop(device);
    let error = drivers::open("haply", &options(&service).with("device", "none")).map(drop).unwrap_err();
    assert!(matches!(error, OpenError::NoDevice { .. }), "{error}");
}

/// Guards the start: no force until asked for; and devices that drive no torque.
#[test]
fn starts_without_force_and_drives_no_torque() {
    for generation in BOTH {
        let service = HaplyService::start(generation);
        let mut device = drivers::open("haply", &options(&service).with("preset", "arm_front")).unwrap();
        check_capabilities(device.capabilities());
        device.read().unwrap();
        assert_eq!(device.write(&push(2.0)).unwrap(), Applied::Disabled);
        device.read().unwrap();
        assert_eq!(service.state().hand.force, Vector3::zeros());
        assert_eq!(service.state().configured, [r#"{"preset":{"preset":"arm_front"}}"#]);
        let command = DeviceCommand { torque: Vector3::new(0.1, 0.0, 0.0), ..push(1.0) };
        let left = undeliverable(device.capabilities(), &command);
        assert_eq!(left, DeviceCommand { force: Vector3::zeros(), ..command });
    }
}

/// Guards limits: a greater force keeps its direction, and is told.
#[test]
fn too_great_forces_are_scaled() {
    let service = HaplyService::start(Generation::V35);
    let mut device = ready(&service);
    let command = DeviceCommand { force: Vector3::new(30.0, 40.0, 0.0), torque: Vector3::zeros() };
    device.read().unwrap();
    assert_eq!(device.write(&command).unwrap(), Applied::Scaled(0.2));
    device.read().unwrap();
    let force = service.state().hand.force;
    assert!((force - Vector3::new(6.0, 0.0, 8.0)).norm() < 1e-9, "{force}");
}

/// Guards a device that is not calibrated, and one without power.
#[test]
fn uncalibrated_or_without_power() {
    let service = HaplyService::start(Generation::V35);
    service.state().calibrated = false;
    let mut device = drivers::open("haply", &options(&service).with("homing_timeout", 0.05)).unwrap();
    assert_eq!(device.read().unwrap_err(), DeviceFault::NotHomed);
    assert_eq!(device.home().unwrap_err(), DeviceFault::NotHomed);
    assert_eq!(device.set_force_enabled(true).unwrap_err(), DeviceFault::NotHomed);
    service.state().calibrated = true;
    device.home().unwrap();
    device.set_force_enabled(true).unwrap();
    service.state().powered = false;
    run(&mut *device, 3, |_| push(1.0));
    device.read().unwrap();
    assert_eq!(device.write(&push(1.0)).unwrap(), Applied::Disabled);
}

/// Guards messages that cannot be understood: told for that tick, and the next one is good again.
#[test]
fn malformed_frames_are_told_and_left_behind() {
    let service = HaplyService::start(Generation::V35);
    let mut device = ready(&service);
    let huge = r#"{"inverse3":[{"device_id":"04C3","state":{"cursor_position":{"x":1e999,"y":0,"z":0}}}]}"#;
    for text in ["", "[]", "{\"inverse3\":[{\"device_id\":\"04C3\",\"state\":{\"cursor_po", huge, "{}x"] {
        run(&mut *device, 3, |_| push(1.0));
        // One answer is on its way already; the one after it is bad.
        device.read().unwrap();
        service.state().instead = Some(text.into());
        device.write(&push(1.0)).unwrap();
        assert_eq!(device.read().unwrap_err(), DeviceFault::Malformed, "{text}");
        device.write(&push(1.0)).unwrap();
        assert!(device.read().is_ok(), "{text}");
        device.write(&push(1.0)).unwrap();
    }
}

/// Guards late and lost answers: told within the time, never a lag that stays, and not more and more messages to a service that is silent.
#[test]
fn late_and_lost_answers() {
    let service = HaplyService::start(Generation::V35);
    let mut device = drivers::open("haply", &options(&service).with("patience", 0.05)).unwrap();
    device.set_force_enabled(true).unwrap();
    device.read().unwrap();
    service.state().swallow = 1;
    device.write(&push(1.0)).unwrap();
    let start = Instant::now();
    assert_eq!(device.read().unwrap_err(), DeviceFault::Late);
    assert!(start.elapsed() >= Duration::from_millis(50));
    device.write(&push(1.0)).unwrap();
    device.read().unwrap();
    // A service that is silent for good: after a few ticks the driver stops sending and ends.
    service.state().swallow = u32::MAX;
    let before = service.state().messages;
    let mut fault = None;
    for _ in 0..20 {
        let _ = device.read();
        if let Err(f) = device.write(&push(1.0)) {
            fault = Some(f);
        }
    }
    assert_eq!(fault, Some(DeviceFault::Late));
    assert!(service.state().messages - before <= 12, "{}", service.state().messages - before);
    eventually(&service, |s| s.force == Vector3::zeros());
}

/// Guards the end of the service and of the device.
#[test]
fn hung_up_or_unplugged() {
    let service = HaplyService::start(Generation::V31);
    let mut device = ready(&service);
    service.state().present = false;
    assert_eq!(first_fault(&mut *device), DeviceFault::Disconnected);
    assert_eq!(device.read().unwrap_err(), DeviceFault::Disconnected);
    assert_eq!(device.write(&push(1.0)).unwrap_err(), DeviceFault::Disconnected);
    drop(device);
    let service = HaplyService::start(Generation::V31);
    let mut device = ready(&service);
    service.state().hang_up = true;
    assert_eq!(first_fault(&mut *device), DeviceFault::Disconnected);
}

/// The first fault of the next ticks: an answer from before may still be on its way.
fn first_fault(device: &mut dyn Device) -> DeviceFault {
    let mut tick = || device.read().err().or(device.write(&push(1.0)).err());
    (0..50).find_map(|_| tick()).expect("a fault within 50 ticks")
}

/// Guards the promise of the trait: an owner that is gone, even by a panic, leaves no force.
#[test]
fn a_dropped_or_panicking_owner_leaves_no_force() {
    let service = HaplyService::start(Generation::V35);
    let mut device = ready(&service);
    run(&mut *device, 5, |_| push(5.0));
    drop(device);
    eventually(&service, |s| !s.connected && s.force == Vector3::zeros());
    let mut device = ready(&service);
    let owner = std::thread::spawn(move || {
        run(&mut *device, 5, |_| push(5.0));
        panic!("the owner fails");
    });
    assert!(owner.join().is_err());
    eventually(&service, |s| !s.connected && s.force == Vector3::zeros());
    let mut device = ready(&service);
    run(&mut *device, 5, |_| push(5.0));
    device.stop();
    device.stop();
    eventually(&service, |s| s.connected && s.force == Vector3::zeros());
}

/// Guards what the module says about memory: no more than a few allocations a tick, all in the WebSocket library, and none that grows.
#[test]
fn few_allocations() {
    let service = HaplyService::start(Generation::V35);
    let mut device = ready(&service);
    run(&mut *device, 20, |_| push(1.0));
    let counted = allocation_counter::measure(|| {
        run(&mut *device, 200, |_| push(1.0));
    });
    println!("allocations a tick: {}", counted.count_total as f64 / 200.0);
    assert!(counted.count_total <= 200 * 6, "{counted:?}");
    assert!(counted.count_current.abs() <= 4, "{counted:?}");
}

/// Guards the words when nobody listens, or somebody else does.
#[test]
fn unreachable_or_another_protocol() {
    let open = |address: &str| {
        drivers::open("haply", &DriverOptions::new().with("address", address)).map(drop).unwrap_err()
    };
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let text = std::thread::scope(|scope| {
        let other = scope.spawn(|| {
            use std::io::{Read, Write};
            let (mut stream, _) = listener.accept().unwrap();
            let _ = stream.read(&mut [0; 1000]);
            let _ = stream.write_all(b"HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\n\r\n");
        });
        let text = open(&address).to_string();
        other.join().unwrap();
        text
    });
    assert!(text.contains("does not speak WebSocket"), "{text}");
    drop(listener);
    let text = open(&address).to_string();
    assert!(text.contains(&address) && text.contains("haply-inverse-service"), "{text}");
}
