//! The oscillation detector: what it must see, and what it must not take for an oscillation.

use super::rig::{DT, Rig, Tool, at, bilateral, floor, premium};
use hapteron::device::guard::{Guard, GuardFault, GuardInput, GuardSettings};
use hapteron::device::simulated::{SimulatedDevice, SimulatedSettings};
use hapteron::device::{Device, DeviceCommand, DeviceSample, Grip};
use hapteron::trajectory::Trajectory;
use nalgebra::Vector3;
use std::path::Path;

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

/// Would catch a detector that is asleep: walls rendered directly, too stiff for the hand, or for the handle that nobody holds, at their delay; some
/// swing by less than a tenth of the motors' greatest force, some more slowly than 8 Hz.
#[test]
fn true_oscillations_take_the_force_away() {
    let mut slowest = (0.0, String::new());
    for (grip, walls) in [
        // Below 6 kN/m it swings between the motors' limits twice a second, just below the greatest speed.
        (Grip::Released, [1500.0, 3000.0, 6000.0, 15_000.0]),
        (Grip::Released, [1000.0, 1750.0, 2000.0, 2500.0]),
        (Grip::Light, [1500.0, 3000.0, 6000.0, 15_000.0]),
        (Grip::Medium, [3000.0, 4500.0, 6000.0, 15_000.0]),
        (Grip::Firm, [4500.0, 6000.0, 9000.0, 15_000.0]),
    ] {
        for (delay, k, most) in
            [1, 2].iter().flat_map(|d| walls.iter().flat_map(move |k| [8.5, 1.0, 0.6].map(|f| (*d, *k, f))))
        {
            let mut device = SimulatedSettings { delay, ..premium(grip.parameters()) };
            // Friction would hide small ones. The wall is on both sides, pushes with `most` newtons at the most, and the handle is struck.
            device.model.friction = 0.0;
            let law = |t: f64, s: &DeviceSample| {
                if t < 0.02 { 0.5 } else { (-k * s.position.z).clamp(-most, most) }
            };
            let (fault, late) = direct(device, 4.0, |_| (0.0, 0.0), law);
            let case = format!("{grip:?}, {delay} samples late, {k} N/m up to {most} N: {fault:?}");
            // A handle that nobody holds is caught by its speed where the motors are strong.
            let seen = |f| matches!(f, GuardFault::Oscillation | GuardFault::OverSpeed if grip == Grip::Released || f == GuardFault::Oscillation);
            assert!(fault.is_some_and(|(t, f)| t < 2.0 && seen(f)), "{case}");
            assert_eq!(late, 0.0, "{case}");
            if let Some((t, _)) = fault
                && t > slowest.0
            {
                slowest = (t, case);
            }
        }
    }
    println!("the latest: {}", slowest.1);
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

/// Would catch a detector that takes a hand for an oscillation: one that shakes what is held fast, from once a second to six times, and trembles.
#[test]
fn shaking_is_no_oscillation() {
    for grip in [Grip::Light, Grip::Medium, Grip::Firm] {
        let soft =
            [(1.1, 0.5), (1.1, 4.0), (1.5, 4.0), (1.9, 4.0), (2.5, 4.0), (6.0, 4.0), (2.5, 0.5), (6.0, 0.5)];
        let stiff = [(1.1, 3.0), (1.5, 3.0), (2.5, 3.0), (6.0, 3.0)];
        let cases = soft.map(|(f, b)| (300.0, f, b)).into_iter().chain(stiff.map(|(f, b)| (1000.0, f, b)));
        for (stiffness, frequency, damping) in cases {
            let device = SimulatedSettings { tremor: 1e-4, ..premium(grip.parameters()) };
            let tool = Tool { mass: 0.01, stiffness, damping };
            let mut rig = Rig::new(tool, device, bilateral(5e3, 5.0), 0.0).guarded(guard(&device));
            let (mut most, mut least) = (0.0f64, 0.0f64);
            while rig.time() < 20.0 {
                let w = TAU * frequency;
                let phase = w * (rig.time() + DT);
                let out = rig.advance(0.015 * phase.sin(), 0.015 * w * phase.cos());
                let at = rig.time();
                assert!(
                    !out.flags.no_force(),
                    "{grip:?}, {stiffness} N/m, {frequency} Hz, b_c {damping}, at {at}"
                );
                (most, least) = (most.max(out.command.force.z), least.min(out.command.force.z));
            }
            assert!(most > 0.6 && least < -0.6, "{grip:?}: only {least} to {most} N");
        }
    }
}

/// Would catch a detector that takes what people did for an oscillation: three recorded motions of hands, each along its three axes, at what is held fast.
#[test]
fn recorded_hands_are_no_oscillation() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/motions");
    if !data.is_dir() {
        return println!("skipped: {} is not there", data.display());
    }
    let mut most = 0.0f64;
    for name in ["handover_baton", "handover_giver_hand", "handover_taker_hand"] {
        let motion = Trajectory::load(data.join(format!("{name}.csv"))).unwrap();
        let middle = motion.sample(motion.start() + 0.5 * motion.duration(), DT).position;
        for (axis, grip) in [0, 1, 2].into_iter().flat_map(|a| Grip::ALL.map(|g| (a, g))) {
            if grip == Grip::Released {
                continue;
            }
            for (stiffness, damping, scale) in [(300.0, 3.0, 1.0), (1000.0, 4.0, 1.0), (1000.0, 3.0, 0.1)] {
                let device = SimulatedSettings { tremor: 1e-4, ..premium(grip.parameters()) };
                let tool = Tool { mass: 0.01, stiffness, damping };
                let mut rig = Rig::new(tool, device, bilateral(5e3, 5.0), 0.0).guarded(guard(&device));
                while rig.time() < motion.duration() {
                    let goal = motion.sample(motion.start() + rig.time() + DT, DT);
                    // The hand begins where the body is.
                    let share = scale * rig.time().min(1.0);
                    let z = share * (goal.position - middle)[axis];
                    let out = rig.advance(z, share * goal.linear_velocity[axis]);
                    let fault = rig.haptic.guard.and_then(|g| g.fault());
                    let case = format!("{name}, axis {axis}, {grip:?}, {stiffness} N/m");
                    assert!(!out.flags.no_force(), "{case}: {fault:?} at {}", rig.time());
                    most = most.max(out.command.force.norm());
                }
            }
        }
    }
    assert!(most > 5.0, "no more than {most} N");
}

/// Would catch a detector that takes a texture for an oscillation: a firm hand strokes over ridges of 1 N, 2.5 mm apart, at up to 0.3 m/s.
#[test]
fn textures_are_no_oscillation() {
    let device = premium(Grip::Firm.parameters());
    for (frequency, drag, least_ridges) in
        [(1.0, 0.0, 500), (1.0, 0.5, 500), (0.5, 0.0, 400), (0.2, 0.0, 150), (0.1, 0.0, 75)]
    {
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
        assert!(ridges_felt > least_ridges, "{ridges_felt} ridges at {frequency} Hz");
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
