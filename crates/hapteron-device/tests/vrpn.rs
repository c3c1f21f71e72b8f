//! The VRPN driver against an emulated server.

#![allow(clippy::unwrap_used, reason = "tests")]

mod emulated;

use emulated::{check_capabilities, resting_depth, wall_force};
use hapteron_device::drivers::{self, DriverOptions, OpenError};
use hapteron_device::{Applied, Device, DeviceCommand, DeviceFault, DeviceSample, undeliverable};
use hapteron_emulators::{VrpnServer, VrpnState, vrpn_message, vrpn_pose};
use nalgebra::{UnitQuaternion, Vector3};
use std::time::{Duration, Instant};

const COOKIE: &[u8; 24] = b"vrpn: ver. 07.35  0\0\0\0\0\0";

fn options(server: &VrpnServer) -> DriverOptions {
    DriverOptions::new()
        .with("address", format!("tcp://{}", server.address()))
        .with("tracker", "Phantom0")
        .with("buttons", "Button0")
        .with("force_device", "Phantom0")
        .with("patience", 5.0)
}

fn ready(server: &VrpnServer) -> Box<dyn Device> {
    let mut device = drivers::open("vrpn", &options(server)).unwrap();
    device.home().unwrap();
    device.set_force_enabled(true).unwrap();
    device
}

fn push(x: f64) -> DeviceCommand {
    DeviceCommand { force: Vector3::new(x, 0.0, 0.0), torque: Vector3::zeros() }
}

fn within_seconds(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < Duration::from_secs(20), "{what}");
        std::thread::sleep(Duration::from_micros(100));
    }
}

fn eventually(server: &VrpnServer, done: impl Fn(&VrpnState) -> bool) {
    within_seconds("the server's state", || done(&server.state()));
}

/// A new sample of the server for each round.
fn run(
    device: &mut dyn Device,
    rounds: u32,
    control: impl Fn(&DeviceSample) -> DeviceCommand,
) -> DeviceSample {
    let mut last = device.read().unwrap();
    for _ in 0..rounds {
        let old = last.time;
        within_seconds("a new pose", || {
            last = device.read().unwrap();
            last.time > old
        });
        device.write(&control(&last)).unwrap();
    }
    last
}

/// Guards signs, byte order and the force field from end to end: pushed on a wall, the hand rests where two springs balance; let go, all is zero.
#[test]
fn push_on_a_wall_and_release() {
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        let server = VrpnServer::start(COOKIE);
        let mut device = ready(&server);
        server.state().hand.target = axis * 0.005;
        let sample = run(&mut *device, 1500, |s| wall_force(s, &axis));
        let rest = resting_depth(0.005);
        // The force goes as 32-bit numbers.
        assert!((sample.position - axis * rest).norm() < 1e-6, "{sample:?}");
        let force = server.state().field.1;
        assert!((force + axis * (rest * emulated::WALL)).norm() < 1e-3, "{force}");
        server.state().hand.target = axis * -0.005;
        let sample = run(&mut *device, 1500, |s| wall_force(s, &axis));
        assert!((sample.position + axis * 0.005).norm() < 1e-6);
        eventually(&server, |s| s.field.1 == Vector3::zeros());
    }
}

/// Guards axes that are not ours: y forward and z up, for positions, turns, velocities and forces.
#[test]
fn axes_of_the_server() {
    for (theirs, ours) in
        [(Vector3::x(), Vector3::x()), (Vector3::y(), -Vector3::z()), (Vector3::z(), Vector3::y())]
    {
        let server = VrpnServer::start(COOKIE);
        let mut device = drivers::open("vrpn", &options(&server).with("axes", "x z -y")).unwrap();
        device.set_force_enabled(true).unwrap();
        server.state().hand.target = theirs * 0.01;
        server.state().hand.target_rotation = theirs * 0.3;
        within_seconds("a movement", || {
            let s = device.read().unwrap();
            s.linear_velocity.dot(&ours) > 0.0 && s.angular_velocity.dot(&ours) > 0.0
        });
        within_seconds("the target", || {
            let s = device.read().unwrap();
            (s.position - ours * 0.01).norm() < 1e-4
                && s.orientation.angle_to(&UnitQuaternion::from_scaled_axis(ours * 0.3)) < 1e-3
        });
        device.write(&DeviceCommand { force: ours * 2.0, torque: Vector3::zeros() }).unwrap();
        eventually(&server, |s| s.field.1 == theirs * 2.0);
    }
}

/// Guards the tables of names: each side numbers its own; and that pings are answered and sent.
#[test]
fn names_and_pings() {
    let server = VrpnServer::start(COOKIE);
    let _device = ready(&server);
    eventually(&server, |s| s.signs_of_life.0 >= 1 && s.signs_of_life.1 >= 1);
    let s = server.state();
    assert!(s.client_senders.values().any(|n| n == "Phantom0"), "{:?}", s.client_senders);
    assert!(s.client_types.values().any(|n| n == "vrpn_ForceDevice Force_Field"));
}

/// Guards velocities when the server sends none, and poses that come out of order.
#[test]
fn velocities_are_estimated_and_old_poses_left_out() {
    let server = VrpnServer::start(COOKIE);
    server.state().velocities = false;
    let mut device = ready(&server);
    server.state().overtaken = Some((10_000, 0.5));
    server.state().hand.target = Vector3::new(0.05, 0.0, 0.0);
    within_seconds("a movement", || {
        let s = device.read().unwrap();
        assert!(s.position.x < 0.06, "an old pose was taken: {s:?}");
        assert!(s.linear_velocity.norm() < 5.0, "{s:?}");
        s.linear_velocity.x > 0.01
    });
    within_seconds("rest", || device.read().unwrap().linear_velocity.norm() < 1e-3);
}

/// Guards buttons of a button device with a name of its own, and buttons that there are not.
#[test]
fn buttons() {
    let server = VrpnServer::start(COOKIE);
    let mut device = ready(&server);
    server.state().buttons = vec![(0, 1), (5, 1), (40, 1), (-1, 1), (0, 0), (31, 1)];
    within_seconds("buttons", || device.read().unwrap().buttons == 1 << 5 | 1 << 31);
}

/// Guards the start: no force until asked for; an input alone has none at all; no torque.
#[test]
fn starts_without_force() {
    let server = VrpnServer::start(COOKIE);
    let mut device = drivers::open("vrpn", &options(&server)).unwrap();
    check_capabilities(device.capabilities());
    assert!(device.capabilities().force_persists);
    assert_eq!(device.write(&push(1.0)).unwrap(), Applied::Disabled);
    let command = DeviceCommand { torque: Vector3::x(), ..push(1.0) };
    assert_eq!(
        undeliverable(device.capabilities(), &command),
        DeviceCommand { force: Vector3::zeros(), ..command }
    );
    drop(device);
    assert_eq!(server.state().field.1, Vector3::zeros());
    eventually(&server, |s| !s.connected);
    let input = DriverOptions::new().with("address", server.address()).with("tracker", "Phantom0");
    let mut device = drivers::open("vrpn", &input).unwrap();
    check_capabilities(device.capabilities());
    device.set_force_enabled(true).unwrap();
    assert_eq!(device.write(&push(1.0)).unwrap(), Applied::Disabled);
    assert_eq!(undeliverable(device.capabilities(), &command), command);
}

/// Guards bytes that are no VRPN, poses that are none, and errors of the force device.
#[test]
fn malformed_and_troubled() {
    let bad = [
        vrpn_message(0, 7, 20, &vrpn_pose(0, &Vector3::new(f64::NAN, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])),
        vrpn_message(0, 7, 20, &vrpn_pose(0, &Vector3::zeros(), [0.0; 4])),
        vrpn_message(0, 7, 20, &[0; 10]),
    ];
    for bytes in bad {
        let server = VrpnServer::start(COOKIE);
        let mut device = ready(&server);
        server.state().raw = bytes;
        within_seconds("a fault", || device.read() == Err(DeviceFault::Malformed));
        within_seconds("good poses again", || device.read().is_ok());
    }
    let server = VrpnServer::start(COOKIE);
    let mut device = ready(&server);
    run(&mut *device, 3, |_| push(2.0));
    server.state().raw = vec![0x7F; 64];
    within_seconds("a fault", || device.read() == Err(DeviceFault::Malformed));
    assert_eq!(device.write(&push(2.0)).unwrap_err(), DeviceFault::Malformed, "a lost stream stays lost");
    eventually(&server, |s| s.field.1 == Vector3::zeros());
    for (code, fault) in
        [(1, DeviceFault::SafetyStop), (2, DeviceFault::SafetyStop), (3, DeviceFault::Refused(3))]
    {
        let server = VrpnServer::start(COOKIE);
        let mut device = ready(&server);
        run(&mut *device, 3, |_| push(2.0));
        server.state().error = Some(code);
        within_seconds("a fault", || device.read() == Err(fault));
        assert_eq!(device.write(&push(2.0)).unwrap_err(), fault);
        eventually(&server, |s| s.field.1 == Vector3::zeros());
        device.set_force_enabled(true).unwrap();
        run(&mut *device, 3, |_| push(2.0));
    }
    // The last goes out in single precision.
    for bad in [f64::INFINITY, f64::NAN, 1e39] {
        let server = VrpnServer::start(COOKIE);
        let mut device = ready(&server);
        run(&mut *device, 3, |_| push(2.0));
        assert_eq!(device.write(&push(bad)).unwrap_err(), DeviceFault::Malformed);
        eventually(&server, |s| s.field.1 == Vector3::zeros());
    }
}

/// Guards silence, the end of the server, and a server that reads no more: bounded, told, and without a force that stands.
#[test]
fn late_hung_up_and_deaf() {
    let server = VrpnServer::start(COOKIE);
    let mut device = drivers::open("vrpn", &options(&server).with("patience", 0.05)).unwrap();
    server.state().silent = true;
    within_seconds("a fault", || device.read() == Err(DeviceFault::Late));
    server.state().silent = false;
    within_seconds("poses again", || device.read().is_ok());
    server.state().hang_up = true;
    within_seconds("a fault", || device.read() == Err(DeviceFault::Disconnected));
    assert_eq!(device.write(&push(1.0)).unwrap_err(), DeviceFault::Disconnected);
    drop(device);
    let server = VrpnServer::start(COOKIE);
    let mut device = ready(&server);
    server.state().deaf = true;
    let (mut longest, mut fault) = (Duration::ZERO, None);
    for _ in 0..1_000_000 {
        let start = Instant::now();
        if let Err(f) = device.write(&push(1.0)) {
            fault = Some(f);
        }
        if device.read().is_err() {
            break;
        }
        longest = longest.max(start.elapsed());
    }
    assert_eq!(fault, Some(DeviceFault::Late));
    // Writing never waits for the server; what is allowed here is a busy machine.
    assert!(longest < Duration::from_secs(2), "{longest:?}");
    server.state().deaf = false;
    drop(device);
    eventually(&server, |s| !s.connected && s.field.1 == Vector3::zeros());
}

/// Guards the promise of the trait: an owner that is gone, even by a panic, leaves no force.
#[test]
fn a_dropped_or_panicking_owner_leaves_no_force() {
    let server = VrpnServer::start(COOKIE);
    let mut device = ready(&server);
    run(&mut *device, 5, |_| push(5.0));
    device.stop();
    eventually(&server, |s| s.connected && s.field.1 == Vector3::zeros());
    device.set_force_enabled(true).unwrap();
    let owner = std::thread::spawn(move || {
        run(&mut *device, 5, |_| push(5.0));
        panic!("the owner fails");
    });
    assert!(owner.join().is_err());
    eventually(&server, |s| !s.connected && s.field.1 == Vector3::zeros());
}

/// Guards the tick: no allocation in read and write.
#[test]
fn read_and_write_do_not_allocate() {
    let server = VrpnServer::start(COOKIE);
    let mut device = ready(&server);
    run(&mut *device, 3, |_| push(1.0));
    let counted = allocation_counter::measure(|| {
        for _ in 0..500 {
            let _ = device.read();
            let _ = device.write(&push(1.0));
        }
    });
    assert_eq!(counted.count_total, 0);
}

/// Guards the words for servers of another kind, trackers that there are not, and nobody at all.
#[test]
fn unreachable_unknown_or_another_protocol() {
    let text = |options: &DriverOptions| {
        drivers::open("vrpn", &options.clone().with("connect_timeout", 0.5))
            .map(drop)
            .unwrap_err()
            .to_string()
    };
    let server = VrpnServer::start(COOKIE);
    let unknown = text(&options(&server).with("tracker", "Tracker7"));
    assert!(unknown.contains("no tracker 'Tracker7'") && unknown.contains("vrpn.cfg"), "{unknown}");
    let axes = drivers::open("vrpn", &options(&server).with("axes", "x y -z")).map(drop).unwrap_err();
    assert!(matches!(axes, OpenError::BadOption { key: "axes", .. }), "{axes}");
    let old = VrpnServer::start(b"vrpn: ver. 06.00  0\0\0\0\0\0");
    let other = text(&options(&old));
    assert!(other.contains("does not speak VRPN version 7") && other.contains("06.00"), "{other}");
    let nobody = text(&DriverOptions::new().with("address", "127.0.0.1:1"));
    assert!(nobody.contains("127.0.0.1:1") && nobody.contains("vrpn_server"), "{nobody}");
}
