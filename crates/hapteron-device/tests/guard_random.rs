//! Nothing whatever gets more than the limits past the guard.
//!
//! The number of random ticks is `HAPTERON_GUARD_TICKS` (default 10^6; the documented figure is of 10^8, in release).
#![allow(clippy::unwrap_used)]

mod common;

use common::{DT, Rng, premium};
use hapteron_device::guard::{Guard, GuardFault, GuardInput, GuardSettings};
use hapteron_device::{DeviceCommand, DeviceSample};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use proptest::prelude::*;

/// A number of any kind: mostly of a natural size, at times absurd or none at all.
fn wild(rng: &mut Rng, natural: f64, absurd: bool) -> f64 {
    const ABSURD: [f64; 10] =
        [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 1e160, 5e-324, f64::MIN, f64::MAX, -0.0];
    match rng.bits() % 64 {
        0 if absurd => ABSURD[(rng.bits() % 10) as usize],
        0..8 => natural * 1e3 * rng.unit(),
        8..12 => 0.0,
        _ => natural * rng.unit(),
    }
}

fn vector(rng: &mut Rng, natural: f64, absurd: bool) -> Vector3<f64> {
    Vector3::new(wild(rng, natural, absurd), wild(rng, natural, absurd), wild(rng, natural, absurd))
}

/// What holds between two passes, whatever went in.
fn check(settings: &GuardSettings, before: &DeviceCommand, out: &DeviceCommand, tick: u64) {
    let finite = |v: &Vector3<f64>| v.iter().all(|c| c.is_finite());
    assert!(finite(&out.force) && finite(&out.torque), "tick {tick}: {out:?}");
    let (force, torque) = (out.force.norm(), out.torque.norm());
    assert!(force <= settings.max_force * (1.0 + 1e-12), "tick {tick}: {force} N");
    assert!(torque <= settings.max_torque * (1.0 + 1e-12), "tick {tick}: {torque} N m");
    let grown = [force - before.force.norm(), torque - before.torque.norm()];
    assert!(grown[0] <= settings.max_slew * 2.0 * DT + 1e-12, "tick {tick}: force by {}", grown[0]);
    assert!(grown[1] <= settings.max_torque_slew * 2.0 * DT + 1e-12, "tick {tick}: torque by {}", grown[1]);
}

/// Random ticks: commands and samples jump, are absurd, time stands still, jumps and runs backward, ages are anything.
fn random_ticks(seed: u64, ticks: u64) -> [u64; 2] {
    let mut rng = Rng(seed);
    let settings = GuardSettings { passivity: seed % 2 == 1, ..premium() };
    let mut guard = Guard::new(settings).unwrap();
    let (mut before, mut time) = (DeviceCommand::zero(), 0.0);
    let (mut faults, mut pushing) = (0, 0);
    // Long stretches without absurd numbers, or the guard would be faulted all the time.
    let (mut absurd, mut calm) = (false, true);
    let mut command = DeviceCommand::zero();
    let mut sample = common::at(Vector3::zeros());
    for tick in 0..ticks {
        if rng.one_in(1000) {
            absurd = rng.one_in(4);
            calm = rng.one_in(2);
        }
        if !calm || rng.one_in(8) {
            command = DeviceCommand {
                force: vector(&mut rng, 10.0, absurd),
                torque: vector(&mut rng, 0.6, absurd),
            };
        }
        let speed = if calm { 0.0005 } else { 0.3 };
        let orientation = Quaternion::new(rng.unit(), rng.unit(), rng.unit(), wild(&mut rng, 1.0, absurd));
        sample = DeviceSample {
            time,
            position: vector(&mut rng, 0.1, absurd),
            orientation: if calm { sample.orientation } else { UnitQuaternion::new_unchecked(orientation) },
            linear_velocity: vector(&mut rng, speed, absurd),
            angular_velocity: vector(&mut rng, 10.0 * speed, absurd),
            buttons: rng.bits() as u32,
        };
        let clock = if calm { 63 } else { rng.bits() % 64 };
        time = match clock {
            0 => wild(&mut rng, 100.0, absurd),
            1..4 => time,
            4..6 => time - DT * rng.unit().abs(),
            6..8 => time + rng.unit().abs(),
            _ => time + DT * (1.0 + 0.1 * rng.unit()),
        };
        let age = |rng: &mut Rng| if calm { DT } else { wild(rng, 0.05, absurd) };
        let input = GuardInput {
            command,
            sample,
            time,
            contact_age: age(&mut rng),
            sample_age: age(&mut rng) / 10.0,
            simulation_fault: absurd && rng.one_in(1000),
        };
        let out = guard.pass(&input).command;
        check(&settings, &before, &out, tick);
        pushing += u64::from(out.force.norm_squared() > 1.0);
        before = out;
        if guard.fault().is_some() && rng.one_in(50) {
            faults += 1;
            guard.rearm();
            if !time.is_finite() || time.abs() > 1e9 {
                time = 0.0;
            }
        }
    }
    [faults, pushing]
}

/// Would catch any number that gets past the limits, in a run long enough to meet rare sequences of faults, staleness and re-arming.
#[test]
fn nothing_gets_past_the_limits() {
    let ticks = std::env::var("HAPTERON_GUARD_TICKS").map_or(1_000_000, |t| t.parse().unwrap());
    let started = std::time::Instant::now();
    let halves = std::thread::scope(|scope| {
        let threads = [0, 1].map(|seed| scope.spawn(move || random_ticks(seed, ticks / 2)));
        threads.map(|t| t.join().unwrap())
    });
    println!(
        "{ticks} random ticks in {:.1} s; faults and ticks that pushed with more than 1 N: {halves:?}",
        started.elapsed().as_secs_f64()
    );
    for [faults, pushing] in halves {
        // The test means something only if force and faults both came often.
        assert!(faults > ticks / 20_000 && pushing > ticks / 50, "{faults} faults, {pushing} pushing");
    }
}

fn any_vector() -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(any::<f64>()).prop_map(Vector3::from)
}

fn sized_vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

prop_compose! {
    fn any_input()(
        force in prop_oneof![any_vector(), sized_vector(20.0)],
        torque in prop_oneof![any_vector(), sized_vector(1.0)],
        position in prop_oneof![any_vector(), sized_vector(0.1)],
        linear_velocity in prop_oneof![1 => any_vector(), 3 => sized_vector(2.0)],
        angular_velocity in prop_oneof![1 => any_vector(), 3 => sized_vector(20.0)],
        q in prop::array::uniform4(any::<f64>()),
        time in prop_oneof![1 => any::<f64>(), 3 => 0.0..1.0],
        ages in prop::array::uniform2(prop_oneof![any::<f64>(), 0.0..0.2]),
        simulation_fault in prop::bool::weighted(0.02),
    ) -> GuardInput {
        GuardInput {
            command: DeviceCommand { force, torque },
            sample: DeviceSample {
                time,
                position,
                orientation: UnitQuaternion::new_unchecked(Quaternion::from(q)),
                linear_velocity,
                angular_velocity,
                buttons: 0,
            },
            time,
            contact_age: ages[0],
            sample_age: ages[1],
            simulation_fault,
        }
    }
}

proptest! {
    /// Would catch a sequence that the other test's generator does not make: every bit pattern of a number, shrunk to the shortest.
    #[test]
    fn any_sequence_stays_within_the_limits(inputs in prop::collection::vec(any_input(), 1..60), passivity: bool) {
        let settings = GuardSettings { passivity, ..premium() };
        let mut guard = Guard::new(settings).unwrap();
        let mut before = DeviceCommand::zero();
        for (tick, input) in inputs.iter().enumerate() {
            let fault = guard.fault();
            let out = guard.pass(input).command;
            check(&settings, &before, &out, tick as u64);
            prop_assert!(fault.is_none() || guard.fault() == fault, "a fault changed by itself");
            if fault.is_some() {
                prop_assert_eq!(out, DeviceCommand::zero());
            }
            before = out;
            if fault == Some(GuardFault::NotFinite) && tick % 3 == 0 {
                guard.rearm();
            }
        }
    }
}
