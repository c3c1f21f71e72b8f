//! The haptic tick as a thread would call it.
#![allow(clippy::unwrap_used)]

use hapteron::device::DeviceSample;
use hapteron::device::guard::{Guard, GuardSettings, GuardStatus};
use hapteron::scene::file::{ContactModel, Method};
use hapteron::scene::{Scene, SceneFile};
use hapteron::scenes::spoon_in_cup;
use hapteron::session::{ContactPass, ContactSnapshot, Flags, HapticState, Settings, tick};
use nalgebra::Vector3;

fn scene(change: impl FnOnce(&mut SceneFile)) -> Scene {
    let mut file = spoon_in_cup(0.01, 2e3, Method::BackwardEuler);
    change(&mut file);
    Scene::from_file(file).unwrap()
}

/// Device samples and the contacts of the states they lead to, along the whole motion.
fn samples_and_snapshots(scene: &Scene) -> (Vec<DeviceSample>, Vec<ContactSnapshot>) {
    let dt = scene.time_step;
    let settings = Settings::of(scene);
    let mut haptic = HapticState::new(scene.start);
    let mut pass = ContactPass::new(scene);
    let mut samples = Vec::new();
    let mut snapshots = Vec::new();
    for i in 1..=650 {
        let now = f64::from(i) * dt;
        let mut snapshot = ContactSnapshot::empty(&scene.body, &haptic.state);
        pass.run(scene, &haptic.state, 0.3, now - dt, &mut snapshot);
        let sample = scene.trajectory.sample(now, dt);
        haptic = tick(&settings, &haptic, &sample, &snapshot, now).after;
        samples.push(sample);
        snapshots.push(snapshot);
    }
    (samples, snapshots)
}

/// Would catch any allocation in the tick: a million ticks in which contacts come and go, with every contact model.
#[test]
fn a_million_ticks_allocate_nothing() {
    for model in [ContactModel::Planes, ContactModel::Linearized, ContactModel::Held] {
        let scene = scene(|file| {
            file.contact.model = Some(model);
            file.contact.max_clusters = Some(0);
        });
        let settings = Settings::of(&scene);
        let (samples, snapshots) = samples_and_snapshots(&scene);
        let (mut touching, mut free) = (0u32, 0u32);
        let info = allocation_counter::measure(|| {
            let mut haptic = HapticState::new(scene.start);
            for i in 0..334_000usize {
                // Forth and back along the motion, so that the body is never thrown.
                let place = i % (2 * samples.len());
                let place = if place < samples.len() { place } else { 2 * samples.len() - 1 - place };
                let result = tick(&settings, &haptic, &samples[place], &snapshots[place], i as f64 * 1e-3);
                haptic = result.after;
                if result.step.contact.force.norm_squared() > 0.0 {
                    touching += 1
                } else {
                    free += 1
                }
                assert!(haptic.fault.is_none());
            }
        });
        assert_eq!((info.count_total, info.bytes_total), (0, 0), "{model:?}");
        assert!(touching > 50_000 && free > 50_000, "{model:?}: {touching} ticks in contact, {free} free");
    }
}

/// Would catch a force that goes on after a number was not finite, or comes back by itself.
#[test]
fn a_fault_latches_and_sends_zero_force() {
    let scene = scene(|_| {});
    let settings = Settings::of(&scene);
    let contacts = ContactSnapshot::empty(&scene.body, &scene.start);
    let good = scene.trajectory.sample(0.1, scene.time_step);
    let mut haptic = HapticState::new(scene.start);
    let before = tick(&settings, &haptic, &good, &contacts, 0.001);
    assert!(before.command.force.norm() > 0.0, "the test needs a force that could go wrong");
    haptic = before.after;
    for bad in [f64::NAN, f64::INFINITY] {
        let sample = DeviceSample { position: Vector3::new(bad, 0.0, 0.0), ..good };
        let result = tick(&settings, &haptic, &sample, &contacts, 0.002);
        assert!(result.flags.contains(Flags::FAULT_LATCHED));
        assert_eq!(result.command, hapteron::device::DeviceCommand::zero());
        assert_eq!(result.after.state, haptic.state);
        let after = tick(&settings, &result.after, &good, &contacts, 0.003);
        assert!(after.flags.contains(Flags::FAULT_LATCHED), "it came back by itself");
        assert_eq!(after.command, hapteron::device::DeviceCommand::zero());
        assert_eq!(after.after.fault, result.after.fault, "the reason is the first one");
    }
}

/// Would catch force, torque and position that are scaled inconsistently (section 7.4).
#[test]
fn the_device_gets_the_scaled_force_and_the_world_the_scaled_motion() {
    let plain = scene(|_| {});
    let scaled = scene(|file| file.device.position_scale = Some(0.4));
    let contacts = ContactSnapshot::empty(&plain.body, &plain.start);
    let world = plain.trajectory.sample(0.12, plain.time_step);
    let device = scaled.scaling.from_world(&world);
    assert!((device.position * 0.4 - world.position).norm() < 1e-15);
    let start = HapticState::new(plain.start);
    let a = tick(&Settings::of(&plain), &start, &world, &contacts, 0.001);
    let b = tick(&Settings::of(&scaled), &start, &device, &contacts, 0.001);
    assert!((b.command.force - a.command.force / 0.4).norm() < 1e-12);
    assert!((b.command.torque - a.command.torque / 0.16).norm() < 1e-12);
}

/// Would catch a tick whose command bypasses the guard, or whose guard does not hear of a fault of the simulation.
#[test]
fn the_guard_is_the_last_to_touch_the_command() {
    // The hand carries the body's weight, 0.29 N.
    let scene = scene(|file| file.scene.gravity = Some([0.0, 0.0, -29.0]));
    let settings = Settings::of(&scene);
    let contacts = ContactSnapshot::empty(&scene.body, &scene.start);
    let limits = GuardSettings { ramp_time: 1e-3, ..GuardSettings::within(0.05, 0.1, 1e-3) };
    let mut haptic = HapticState::guarded(scene.start, Guard::new(limits).unwrap());
    let rest = scene.trajectory.sample(0.0, 1e-3);
    let mut last = None;
    for i in 1..=50u32 {
        let now = f64::from(i) * 1e-3;
        let result = tick(&settings, &haptic, &DeviceSample { time: now, ..rest }, &contacts, now);
        assert!(result.command.force.norm() <= 0.05 + 1e-12);
        assert!(i < 30 || result.flags.contains(Flags::from_guard(GuardStatus::LIMITED)), "{i}");
        assert!(i < 30 || result.step.feedback.force.norm() > 0.2, "the test needs a force beyond the limit");
        haptic = result.after;
        last = Some(result.command.force);
    }
    let nan = DeviceSample { position: Vector3::repeat(f64::NAN), time: 0.051, ..rest };
    let first = tick(&settings, &haptic, &nan, &contacts, 0.051);
    assert!(first.flags.contains(Flags::GUARD_FAULT) && first.flags.contains(Flags::FAULT_LATCHED));
    assert_eq!(first.command.force, last.unwrap() * 0.5, "half in the first tick");
    let second = tick(&settings, &first.after, &DeviceSample { time: 0.052, ..rest }, &contacts, 0.052);
    assert_eq!(second.command, hapteron::device::DeviceCommand::zero(), "none in the second");
}
