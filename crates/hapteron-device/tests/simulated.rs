//! The simulated device against closed forms.
#![allow(clippy::unwrap_used)]

mod common;

use common::{DT, at, pushing};
use hapteron_device::simulated::{CATALOGUE, DeviceModel, SimulatedDevice, SimulatedSettings, model};
use hapteron_device::{
    Applied, Device, DeviceCommand, DeviceFault, DeviceSample, GRIP_RADIUS, Grip, HandParameters,
};
use nalgebra::{UnitQuaternion, Vector3};

/// Neither friction nor encoders.
fn smooth() -> DeviceModel {
    DeviceModel {
        friction: 0.0,
        angular_friction: 0.0,
        resolution: 0.0,
        angular_resolution: 0.0,
        ..model("premium-1.5-6dof").unwrap()
    }
}

fn device(settings: SimulatedSettings) -> SimulatedDevice {
    let mut device = SimulatedDevice::new(settings, &at(Vector3::zeros())).unwrap();
    device.set_force_enabled(true).unwrap();
    device
}

/// Would catch a wrong integrator: the step response of a mass with spring and damper, to 1e-6 of its size.
#[test]
fn a_pushed_hand_moves_as_the_closed_form_says() {
    let hand = HandParameters { mass: 0.1, damping: 3.0, stiffness: 300.0 };
    let mut device = device(SimulatedSettings { delay: 0, ..SimulatedSettings::new(smooth(), hand) });
    let (m, b, k, f) = (0.136 + 0.1, 3.0 + 0.05, 300.0, 2.0);
    let decay: f64 = b / (2.0 * m);
    let omega = (k / m - decay * decay).sqrt();
    let command = DeviceCommand { force: Vector3::y() * f, torque: Vector3::x() * 0.01 };
    device.write(&command).unwrap();
    for i in 1..=400 {
        device.advance(DT);
        let t = f64::from(i) * DT;
        let expected =
            f / k * (1.0 - (-decay * t).exp() * ((omega * t).cos() + decay / omega * (omega * t).sin()));
        let error = device.position().y - expected;
        assert!(error.abs() < 1e-6 * f / k * 10.0, "{t}: {error}");
    }
    for _ in 0..5000 {
        device.advance(DT);
    }
    let sample = device.read().unwrap();
    assert!((sample.position.y - f / k).abs() < 1e-9);
    let angle = 0.01 / (k * GRIP_RADIUS * GRIP_RADIUS);
    assert!((sample.orientation.scaled_axis().x - angle).abs() < 1e-6);
    assert!((sample.time - 5.4).abs() < 1e-9);
}

/// Would catch friction that lets a handle creep, holds it for ever, or pushes.
#[test]
fn coulomb_friction_holds_and_stops() {
    let with = DeviceModel { friction: 0.5, damping: 0.0, ..smooth() };
    let mut held =
        device(SimulatedSettings { delay: 0, ..SimulatedSettings::new(with, Grip::Released.parameters()) });
    held.write(&pushing(0.499)).unwrap();
    for _ in 0..1000 {
        held.advance(DT);
    }
    assert_eq!(held.position(), Vector3::zeros());
    held.write(&pushing(1.5)).unwrap();
    for _ in 0..100 {
        held.advance(DT);
    }
    // 1 N on 0.136 kg for 0.1 s, then stopped by 0.5 N.
    let (v, way) = (0.1 / 0.136, 0.5 * 0.01 / 0.136);
    assert!((held.position().z - way).abs() < 1e-6, "{}", held.position().z);
    held.write(&pushing(0.0)).unwrap();
    for _ in 0..1000 {
        held.advance(DT);
    }
    let whole = way + v * v * 0.136 / (2.0 * 0.5);
    assert!((held.position().z - whole).abs() < 1e-5, "{} {whole}", held.position().z);
}

/// Would catch a command that acts too early or too late.
#[test]
fn commands_act_after_their_delay() {
    for delay in 0..=2 {
        let settings =
            SimulatedSettings { delay, ..SimulatedSettings::new(smooth(), HandParameters::default()) };
        let mut device = device(settings);
        for i in 0..5 {
            device.write(&pushing(f64::from(i) + 1.0)).unwrap();
            let expected = (f64::from(i) + 1.0 - delay as f64).max(0.0);
            assert_eq!(device.acting().force.z, expected, "delay {delay}, sample {i}");
            device.advance(DT);
        }
    }
    assert!(
        SimulatedDevice::new(
            SimulatedSettings { delay: 3, ..SimulatedSettings::new(smooth(), HandParameters::default()) },
            &at(Vector3::zeros())
        )
        .is_err()
    );
}

/// Would catch encoders of another resolution, and a velocity that is not theirs.
#[test]
fn samples_are_quantised_and_velocities_come_of_differences() {
    let coarse = DeviceModel { resolution: 1e-3, angular_resolution: 0.01, ..smooth() };
    let settings =
        SimulatedSettings { velocity_filter: 1.0, ..SimulatedSettings::new(coarse, Grip::Firm.parameters()) };
    let mut device = device(settings);
    let mut before = device.read().unwrap();
    for i in 1..200 {
        let time = f64::from(i) * DT;
        device.set_goal(&DeviceSample {
            time,
            position: Vector3::x() * (0.1 * time),
            orientation: UnitQuaternion::from_scaled_axis(Vector3::z() * time),
            linear_velocity: Vector3::x() * 0.1,
            angular_velocity: Vector3::z(),
            ..at(Vector3::zeros())
        });
        device.advance(DT);
        let now = device.read().unwrap();
        let steps = now.position.x / 1e-3;
        assert!((steps - steps.round()).abs() < 1e-9);
        assert!((now.position.x - device.position().x).abs() <= 0.5e-3 + 1e-12);
        let turns = now.orientation.scaled_axis().z / 0.01;
        assert!((turns - turns.round()).abs() < 1e-6);
        assert!((now.linear_velocity.x - (now.position.x - before.position.x) / DT).abs() < 1e-9);
        before = now;
    }
    assert!((before.position.x - 0.0199).abs() < 2e-3 && before.orientation.angle() > 0.15);
}

/// Would catch motors without limits, axes limited one by one, motors that never get hot, and a wrong number told.
#[test]
fn motors_saturate_and_get_hot() {
    let mut device =
        device(SimulatedSettings { delay: 0, ..SimulatedSettings::new(smooth(), Grip::Firm.parameters()) });
    let wild = DeviceCommand { force: Vector3::new(17.0, 0.0, 0.0), torque: Vector3::new(0.0, 0.2, 0.0) };
    assert_eq!(device.write(&wild).unwrap(), Applied::Scaled(0.5));
    assert_eq!(device.acting().torque.y, 0.1);
    assert_eq!(device.write(&pushing(8.0)).unwrap(), Applied::Fully);
    for _ in 0..60_000 {
        device.write(&pushing(8.0)).unwrap();
        device.advance(DT);
    }
    let hot = device.acting().force.z;
    assert!((hot - 1.4).abs() < 0.1, "{hot} N after a minute at 8 N");
    assert_eq!(device.write(&pushing(f64::NAN)), Err(DeviceFault::Malformed));
    assert_eq!(device.acting(), DeviceCommand::zero());
    device.write(&pushing(1.0)).unwrap();
    device.stop();
    assert_eq!(device.acting(), DeviceCommand::zero());
    assert_eq!(device.write(&pushing(1.0)).unwrap(), Applied::Disabled);
}

/// Would catch anything random that the seed does not decide, and a device that cannot be simulated.
#[test]
fn the_seed_decides_and_every_model_runs() {
    for m in CATALOGUE {
        let run = |seed| {
            let settings = SimulatedSettings {
                jitter: 5e-5,
                tremor: 1e-4,
                seed,
                ..SimulatedSettings::new(m, Grip::Light.parameters())
            };
            let mut device = device(settings);
            for i in 0..500 {
                let z = device.read().unwrap().position.z;
                device.write(&pushing(-100.0 * z + f64::from(i % 7) * 0.1)).unwrap();
                device.advance(DT);
            }
            device.read().unwrap()
        };
        assert_eq!(run(1), run(1), "{}", m.id);
        assert_ne!(run(1), run(2), "{}", m.id);
        assert!(run(1).position.norm() < 0.05 && run(1).orientation.angle() < 0.2, "{}: {:?}", m.id, run(1));
    }
}
