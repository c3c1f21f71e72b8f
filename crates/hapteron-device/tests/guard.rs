//! What the guard lets through, and when it takes the force away.
#![allow(clippy::unwrap_used)]

mod common;

use common::{DT, at, input, premium, pushing};
use hapteron_device::guard::{Guard, GuardFault, GuardInput, GuardSettings, GuardStatus};
use hapteron_device::{DeviceCommand, DeviceSample};
use nalgebra::Vector3;

/// Passes the same command for a time, with the clock going on; what came out last.
fn hold(guard: &mut Guard, from: &mut u32, ticks: u32, command: DeviceCommand) -> DeviceCommand {
    let mut out = DeviceCommand::zero();
    for _ in 0..ticks {
        *from += 1;
        out = guard.pass(&input(command, at(Vector3::zeros()), *from)).command;
    }
    out
}

/// Would catch a force that starts with a jump.
#[test]
fn the_force_ramps_up_at_the_start_and_after_rearming() {
    let mut guard = Guard::new(premium()).unwrap();
    let mut tick = 0;
    let command = pushing(4.0);
    for _ in 0..2 {
        let mut before = 0.0;
        for i in 1..=250 {
            let out = hold(&mut guard, &mut tick, 1, command).force.z;
            let ramp = 4.0 * f64::from(i) / 250.0;
            assert!((out - ramp).abs() < 1e-9, "tick {i}: {out}, ramp {ramp}");
            assert!(out > before);
            before = out;
        }
        let nan = input(pushing(f64::NAN), at(Vector3::zeros()), tick + 1);
        assert_eq!(guard.pass(&nan).command.force.z, 2.0);
        assert_eq!(guard.fault(), Some(GuardFault::NotFinite));
        assert_eq!(
            hold(&mut guard, &mut tick, 500, command),
            DeviceCommand::zero(),
            "it came back by itself"
        );
        guard.rearm();
        assert_eq!(guard.fault(), None);
    }
}

/// Would catch a clamp that turns the force, or the force against the torque.
#[test]
fn the_clamp_keeps_the_wrench_s_direction() {
    let mut guard = Guard::new(premium()).unwrap();
    let wild = DeviceCommand { force: Vector3::new(30.0, -10.0, 5.0), torque: Vector3::new(0.1, 0.2, -0.3) };
    let out = hold(&mut guard, &mut 0, 1000, wild);
    let share = out.force.x / wild.force.x;
    assert!((out.force - wild.force * share).norm() < 1e-12);
    assert!((out.torque - wild.torque * share).norm() < 1e-12);
    assert!((out.force.norm() - 8.5).abs() < 1e-9);
    let twisted = DeviceCommand { force: Vector3::x(), torque: Vector3::new(0.0, 5.0, 0.0) };
    let out = hold(&mut guard, &mut 1000, 100, twisted);
    assert!((out.torque.y - 0.5).abs() < 1e-9 && (out.force.x - 0.1).abs() < 1e-9, "{out:?}");
}

/// Would catch a step of the force that is passed on at once, and one that is never reached.
#[test]
fn a_step_is_slewed() {
    let settings = GuardSettings { max_slew: 1000.0, ramp_time: DT, ..premium() };
    let mut guard = Guard::new(settings).unwrap();
    let mut tick = 0;
    hold(&mut guard, &mut tick, 10, DeviceCommand::zero());
    for i in 1..=6 {
        let out = hold(&mut guard, &mut tick, 1, pushing(4.5)).force.z;
        assert!((out - f64::from(i).min(4.5)).abs() < 1e-9, "{out}");
    }
    // A late tick may make up for two.
    let mut late = input(pushing(-4.5), at(Vector3::zeros()), tick);
    late.time += 0.1;
    assert!((guard.pass(&late).command.force.z - 2.5).abs() < 1e-9);
}

/// Would catch a force that accelerates the hand without bound.
#[test]
fn power_is_limited_only_where_the_hand_is_driven() {
    let settings = GuardSettings { max_power: 2.0, ramp_time: DT, ..premium() };
    for (speed, expected) in [(1.0, 2.0), (0.25, 4.0), (-1.0, 4.0)] {
        let mut guard = Guard::new(settings).unwrap();
        let sample = DeviceSample { linear_velocity: Vector3::z() * speed, ..at(Vector3::zeros()) };
        let mut out = DeviceCommand::zero();
        for i in 1..100 {
            out = guard.pass(&input(pushing(4.0), sample, i)).command;
        }
        assert!((out.force.z - expected).abs() < 1e-9, "{speed}: {out:?}");
    }
}

/// Would catch a wall that stays when nobody knows any more where it is.
#[test]
fn stale_contacts_and_samples_fade_and_come_back_on_a_ramp() {
    for (stale, bit) in [(0, GuardStatus::CONTACTS_STALE), (1, GuardStatus::SAMPLES_STALE)] {
        let mut guard = Guard::new(premium()).unwrap();
        let mut tick = 0;
        hold(&mut guard, &mut tick, 300, pushing(4.0));
        let limit = [premium().stale_after, premium().samples_stale_after][stale];
        let mut out = 4.0;
        for i in 1..=500 {
            tick += 1;
            let mut input = input(pushing(4.0), at(Vector3::zeros()), tick);
            let age = f64::from(i) * DT;
            *[&mut input.contact_age, &mut input.sample_age][stale] = age;
            let guarded = guard.pass(&input);
            let step = out - guarded.command.force.z;
            out = guarded.command.force.z;
            assert_eq!(guarded.status.contains(bit), age > limit);
            assert!(age <= limit && out == 4.0 || age > limit, "{age}");
            assert!(step <= 4.0 * DT / limit + 1e-9, "{step}");
            assert!(age < 2.0 * limit + 2.0 * DT || out == 0.0, "{age} {out}");
        }
        assert_eq!(guard.fault(), None);
        // Back: from nothing, on the ramp.
        assert!((hold(&mut guard, &mut tick, 25, pushing(4.0)).force.z - 0.4).abs() < 1e-9);
    }
}

/// Would catch a blow after the program stood still and the hand went on: the whole force within the slew.
#[test]
fn after_a_gap_the_force_begins_anew_on_its_ramp() {
    for (gap, anew) in [(0.04, false), (0.06, true), (3.0, true)] {
        let mut guard = Guard::new(premium()).unwrap();
        let mut tick = 0;
        hold(&mut guard, &mut tick, 300, pushing(4.0));
        let later = |tick: u32| {
            let input = input(pushing(8.0), at(Vector3::new(0.05, 0.0, 0.0)), tick);
            GuardInput {
                time: input.time + gap,
                sample: DeviceSample { time: input.time + gap, ..input.sample },
                ..input
            }
        };
        let mut greatest = 0.0_f64;
        for i in 1..=50 {
            let guarded = guard.pass(&later(tick + i));
            greatest = greatest.max(if i > 5 { guarded.command.force.z } else { 0.0 });
            assert_eq!(guarded.status.contains(GuardStatus::RAMPING), anew, "{gap} s, tick {i}");
        }
        // After what was there is gone: of 8 N so much as the ramp gives in 50 ms.
        assert!(if anew { greatest < 8.0 * 0.052 / 0.25 } else { greatest > 7.9 }, "{gap} s: {greatest} N");
        assert_eq!(guard.fault(), None);
        // And it comes back.
        let last = (51..=300).map(|i| guard.pass(&later(tick + i)).command.force.z).last();
        assert!((last.unwrap() - 8.0).abs() < 1e-9);
    }
}

/// Would catch a force that lives on when a thread has died.
#[test]
fn what_stays_away_for_a_second_is_a_fault() {
    for (stale, fault) in [(0, GuardFault::ContactsLost), (1, GuardFault::SamplesLost)] {
        let mut guard = Guard::new(premium()).unwrap();
        for tick in 1..1200 {
            let mut input = input(pushing(4.0), at(Vector3::zeros()), tick);
            *[&mut input.contact_age, &mut input.sample_age][stale] = f64::NAN;
            assert_eq!(guard.pass(&input).command, DeviceCommand::zero());
        }
        assert_eq!(guard.fault(), Some(fault));
    }
}

/// Would catch a fault that is not seen, is seen too early, or keeps the force.
#[test]
fn over_speed_clock_and_simulation_faults_latch() {
    type Change = fn(&mut GuardInput);
    let cases: [(GuardFault, u32, Change); 5] = [
        (GuardFault::OverSpeed, 3, |i| i.sample.linear_velocity.x = 2.1),
        (GuardFault::OverSpeed, 3, |i| i.sample.angular_velocity.x = -31.0),
        (GuardFault::Clock, 20, |i| i.time = 0.3),
        (GuardFault::Simulation, 1, |i| i.simulation_fault = true),
        (GuardFault::NotFinite, 1, |i| i.command.torque.y = f64::INFINITY),
    ];
    for (fault, after, change) in cases {
        let mut guard = Guard::new(premium()).unwrap();
        let mut tick = 0;
        hold(&mut guard, &mut tick, 300, pushing(4.0));
        for i in 1..=after + 1 {
            assert_eq!(guard.fault(), (i > after).then_some(fault), "{fault:?} after {i}");
            tick += 1;
            let mut input = input(pushing(4.0), at(Vector3::zeros()), tick);
            change(&mut input);
            let out = guard.pass(&input).command.force.z;
            let expected = if i < after { 4.0 } else { [2.0, 0.0][(i - after) as usize] };
            assert_eq!(out, expected, "{fault:?}, {i}");
        }
    }
}

/// Would catch a torque that vanishes without a word.
#[test]
fn an_undeliverable_torque_is_told_and_leaves_the_force_alone() {
    let settings = GuardSettings { ramp_time: DT, ..GuardSettings::within(3.3, 0.0, DT) };
    let mut guard = Guard::new(settings).unwrap();
    let command = DeviceCommand { force: Vector3::x(), torque: Vector3::y() };
    hold(&mut guard, &mut 0, 10, command);
    let guarded = guard.pass(&input(command, at(Vector3::zeros()), 11));
    assert_eq!(guarded.command, DeviceCommand { force: Vector3::x(), torque: Vector3::zeros() });
    assert!(guarded.status.contains(GuardStatus::TORQUE_UNDELIVERED));
}

#[test]
fn settings_must_be_positive() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e12] {
        assert!(Guard::new(GuardSettings { max_slew: bad, ..premium() }).is_err());
        assert!(Guard::new(GuardSettings { ramp_time: bad, ..premium() }).is_err());
        assert!(Guard::new(GuardSettings { max_force: bad, ..premium() }).is_err() || bad == 0.0);
    }
}
