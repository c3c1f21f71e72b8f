//! The oscillation detector: what it must see, and what it must not take for an oscillation.

use super::rig::{DT, Rig, Tool, at, floor, premium};
use hapteron::device::guard::{Guard, GuardFault, GuardInput, GuardSettings};
use hapteron::device::simulated::{SimulatedDevice, SimulatedSettings};
use hapteron::device::{Device, DeviceCommand, DeviceSample, Grip};
use nalgebra::Vector3;

const TAU: f64 = std::f64::consts::TAU;

fn guard(device: &SimulatedSettings) -> Guard {
    let usual = GuardSettings::for_device(&device.model.capabilities(), DT);
    Guard::new(GuardSettings { delay: device.delay, ramp_time: DT, ..usual }).unwrap()
}

/// A device that is told forces by a law of (time, sample), with a hand on its way along z; when a fault came and which, and
/// the greatest force of the last tenth of a second.
fn direct(
    device: SimulatedSettings,
    seconds: f64,
    goal: impl Fn(f64) -> (f64, f64),
    mut law: impl FnMut(f64, &DeviceSample) -> f64,
) -> (Option<(f64, GuardFault)>, f64) {
    let mut guard = guard(&device);
    let (z, v) = goal(0.0);
    let start = DeviceSample { linear_velocity: Vector3::z() * v, ..at(z) };
    let mut device = SimulatedDevice::new(device, &start).unwrap();
    device.set_force_enabled(true).unwrap();
    let (mut fault, mut late) = (None, 0.0f64);
    for i in 1..=(seconds / DT) as u32 {
        let time = f64::from(i) * DT;
        let (z, v) = goal(time);
        device.set_goal(&DeviceSample { time, linear_velocity: Vector3::z() * v, ..at(z) });
        device.advance(DT);
        let sample = device.read().unwrap();
        let command = DeviceCommand { force: Vector3::z() * law(time, &sample), torque: Vector3::zeros() };
        let out = guard.pass(&GuardInput {
            command,
            sample,
            time,
            contact_age: DT,
            sample_age: 0.0,
            simulation_fault: false,
        });
        if let (None, Some(f)) = (fault, guard.fault()) {
            fault = Some((time, f));
        }
        if time > seconds - 0.1 {
            late = late.max(out.command.force.norm());
        }
        let _ = device.write(&out.command);
    }
    (fault, late)
}

/// Would catch a detector that is asleep: walls rendered directly, too stiff for the hand at their delay.
///
/// Not among them: a released handle. It ends in swings of 2 to 5 Hz between the motors' limits, which no detector tells from a hand's.
#[test]
fn true_oscillations_take_the_force_away() {
    let cases = [(Grip::Light, 2, 3000.0), (Grip::Medium, 2, 6000.0), (Grip::Firm, 1, 9000.0)];
    for (grip, delay, k) in cases {
        let mut device = SimulatedSettings { delay, ..premium(grip.parameters()) };
        // Friction would hide small ones. The wall is on both sides, and the handle is struck.
        device.model.friction = 0.0;
        let (fault, late) =
            direct(device, 3.0, |_| (0.0, 0.0), |t, s| if t < 0.02 { 2.0 } else { -k * s.position.z });
        println!("{grip:?}, {delay} samples late, {k} N/m: {fault:?}");
        assert!(matches!(fault, Some((t, GuardFault::Oscillation)) if t < 2.5), "{grip:?}: {fault:?}");
        assert_eq!(late, 0.0);
    }
}

/// Would catch a detector that takes taps for an oscillation: a hand knocks on a stiff wall five times a second.
#[test]
fn impacts_are_no_oscillation() {
    for grip in [Grip::Light, Grip::Medium, Grip::Firm] {
        for mass in [0.01, 0.1] {
            let device = premium(grip.parameters());
            let tool = Tool { mass, stiffness: 500.0, damping: 4.0 };
            let mut rig = Rig::new(tool, device, floor(10e3, mass), 0.01).guarded(guard(&device));
            let (mut knocks, mut touching) = (0, false);
            while rig.time() < 10.0 {
                let phase = TAU * 5.0 * (rig.time() + DT);
                let out = rig.advance(0.01 * phase.cos(), -0.01 * TAU * 5.0 * phase.sin());
                assert!(!out.flags.no_force(), "{grip:?}: {:?}", rig.haptic.guard.unwrap().fault());
                let now = out.step.contact.force.z > 0.0;
                knocks += u32::from(now && !touching);
                touching = now;
            }
            assert!(knocks > 30, "{grip:?}: {knocks} knocks");
        }
    }
}

/// Would catch a detector that takes a texture for an oscillation: a firm hand strokes over ridges of 1 N, 2.5 mm apart, at up to 0.3 m/s.
#[test]
fn textures_are_no_oscillation() {
    let device = premium(Grip::Firm.parameters());
    for (frequency, drag) in [(1.0, 0.0), (1.0, 0.5), (0.5, 0.0)] {
        let w = TAU * frequency;
        let (mut ridges_felt, mut high) = (0, false);
        let (fault, _) = direct(
            device,
            20.0,
            |t| (0.05 * (w * t).sin(), 0.05 * w * (w * t).cos()),
            |_, s| {
                let ridges = (TAU * s.position.z / 2.5e-3).sin();
                if ridges > 0.9 && !high {
                    ridges_felt += 1;
                }
                high = ridges > 0.9 || high && ridges > -0.9;
                -ridges - drag * (s.linear_velocity.z / 0.01).tanh()
            },
        );
        assert_eq!(fault, None, "{frequency} Hz, drag {drag}");
        assert!(ridges_felt > 500, "{ridges_felt} ridges");
    }
}

/// Would catch a detector that takes the steps of a slow contact thread for an oscillation: forces held for 10 to 40 ms while a hand goes in and out.
#[test]
fn steps_of_a_slow_contact_thread_are_no_oscillation() {
    let device = SimulatedSettings { tremor: 1e-4, ..premium(Grip::Firm.parameters()) };
    for (hold, k) in [(10, 500.0), (20, 300.0), (40, 150.0)] {
        let (mut held, mut ticks, mut largest) = (0.0f64, 0u32, 0.0f64);
        let w = TAU * 1.5;
        let (fault, _) = direct(
            device,
            30.0,
            |t| (0.02 * (w * t).sin(), 0.02 * w * (w * t).cos()),
            |_, s| {
                if ticks.is_multiple_of(hold) {
                    let new = -k * s.position.z.min(0.0);
                    largest = largest.max((new - held).abs());
                    held = new;
                }
                ticks += 1;
                held
            },
        );
        assert_eq!(fault, None, "steps of {hold} ms, {k} N/m");
        assert!(largest > 0.7, "steps of {largest} N only");
    }
}
