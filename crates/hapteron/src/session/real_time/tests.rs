//! The haptic loop from inside.

use super::*;
use crate::scene::file::Method;
use crate::scenes::spoon_in_cup;
use crate::session::{Command, Gains};
use hapteron_device::DeviceCommand;
use hapteron_device::guard::{GuardSettings, GuardStatus};
use std::thread;

/// The haptic loop with both other ends of its exchange, and no thread.
fn parts(scene: &Arc<Scene>) -> (Loop, exchange::ContactsEnd, exchange::OuterEnd) {
    let settings = Settings::of(scene);
    let haptic = HapticState::new(scene.start);
    let sample = scene.trajectory.sample(0.0, scene.time_step);
    let (_, found, first_pass) = first_contacts(scene, &sample);
    let seen = Seen {
        of_tick: 0,
        time: 0.0,
        state: scene.start,
        handle: handle_at(&sample),
        body: scene.body,
        law: settings.contact_law,
        model: settings.contact_model,
        next_ns: 0,
    };
    let first = first_record(&settings, &haptic, &sample, &found);
    let (haptic_end, contacts, outer) = exchange(&found, &seen, &first, &first_pass, 4096);
    let haptic_loop = Loop {
        settings,
        haptic,
        ends: haptic_end,
        shared: Arc::new(Shared::default()),
        epoch_ns: 0,
        period_ns: 1_000_000,
        spin: clock::SPIN,
        duration: None,
        late_limit_ns: 0,
        capabilities: SceneDevice::new(Arc::clone(scene), false).unwrap().capabilities().clone(),
        bare: false,
        hook: None,
        ticks: 0,
        device_off: false,
        last: sample,
        last_fresh_ns: 0,
        last_time: 0.0,
        last_start_ns: 0,
    };
    (haptic_loop, contacts, outer)
}

/// Would catch any allocation or release of memory on the way of a real-time tick: newest contacts, command, tick, histograms, record; a
/// million times, with contacts that come and go and commands of every kind; without a guard, as replays have it, and with one, as hands do.
#[test]
fn a_million_rounds_allocate_nothing() {
    let limits = GuardSettings { ramp_time: 0.05, max_speed: 1e3, ..GuardSettings::within(8.5, 0.5, 1e-3) };
    rounds_allocate_nothing(None);
    rounds_allocate_nothing(Some(Guard::new(limits).unwrap()));
}

fn rounds_allocate_nothing(guard: Option<Guard>) {
    let mut file = spoon_in_cup(0.01, 2e3, Method::BackwardEuler);
    file.contact.max_clusters = Some(0);
    let scene = Arc::new(Scene::from_file(file).unwrap());
    let (mut haptic_loop, mut contacts, mut outer) = parts(&scene);
    // Samples and contacts along the motion, forth and back.
    let mut pass = ContactPass::new(&scene);
    let prepared: Vec<(DeviceSample, ContactSnapshot)> = (0..650)
        .map(|i| {
            let sample = scene.trajectory.sample(f64::from(i) * 1e-3, 1e-3);
            let record = outer.latest.read();
            let state = record.result.after.state;
            let mut snapshot = ContactSnapshot::empty(&scene.body, &state);
            pass.run(&scene, &state, 0.3, f64::from(i) * 1e-3, &mut snapshot);
            contacts.contacts.slot().snapshot.clone_from(&snapshot);
            contacts.contacts.publish();
            haptic_loop.round_at(&sample, f64::from(i) * 1e-3);
            (sample, snapshot)
        })
        .collect();
    let gains = Gains::of(&scene.coupling);
    let commands = [
        Command::coupling(&gains).unwrap(),
        Command::mass(&scene, 0.011).unwrap(),
        Command::gravity([0.0; 3]).unwrap(),
        Command::Clutch(true),
        Command::Clutch(false),
        Command::Pause(true),
        Command::Pause(false),
        Command::Grasp(false),
        Command::Grasp(true),
        Command::Rearm,
    ];
    // Each of these puts the workspace elsewhere: after them the hand starts again where the body is at the beginning.
    let start = HapticState { guard, ..haptic_loop.haptic };
    let (mut touching, mut free, mut recorded, mut pushing, mut ramping) = (0u32, 0u32, 0u32, 0u32, 0u32);
    let info = allocation_counter::measure(|| {
        for i in 0..1_000_000usize {
            let place = i % (2 * prepared.len());
            let place = if place < prepared.len() { place } else { 2 * prepared.len() - 1 - place };
            let (sample, snapshot) = &prepared[place];
            let found = &mut contacts.contacts.slot().snapshot;
            found.clone_from(snapshot);
            // As fresh as in a session.
            found.time = i as f64 * 1e-3 - 2e-3;
            contacts.contacts.publish();
            contacts.states.update();
            if i % 20_000 == 10_000 {
                let _ = outer.commands.push(commands[i / 20_000 % commands.len()]);
            }
            if i % 20_000 == 0 {
                haptic_loop.haptic = start;
            }
            let command = haptic_loop.round_at(sample, i as f64 * 1e-3);
            if command == DeviceCommand::zero() {
                free += 1;
            }
            while let Some(record) = outer.records.pop() {
                recorded += 1;
                touching += u32::from(record.result.step.contact.force.norm_squared() > 0.0);
                pushing += u32::from(record.result.command.force.norm_squared() > 0.0);
                ramping += u32::from(record.result.flags.contains(Flags::from_guard(GuardStatus::RAMPING)));
            }
        }
    });
    assert_eq!((info.count_total, info.bytes_total), (0, 0));
    assert!(touching > 100_000 && touching < 900_000, "{touching} ticks in contact");
    assert!(recorded >= 1_000_000 && free > 1000, "{recorded} records, {free} without force");
    assert!(pushing > 100_000, "{pushing} ticks pushed the hand");
    assert!(guard.is_none() || ramping > 1000 && ramping < 500_000, "{ramping} ticks on the guard's ramp");
}

/// Would catch a force that reaches a device after the supervisor has stopped it, from a tick that hung between reading and writing.
#[test]
fn nothing_is_written_once_the_session_is_to_end() {
    let scene = Arc::new(Scene::from_file(spoon_in_cup(0.01, 2e3, Method::BackwardEuler)).unwrap());
    let (mut haptic_loop, _contacts, _outer) = parts(&scene);
    let device = SharedDevice::new(Box::new(SceneDevice::new(Arc::clone(&scene), false).unwrap()));
    let command = DeviceCommand { force: nalgebra::Vector3::x(), ..DeviceCommand::zero() };
    assert_eq!(haptic_loop.write(&device, &command), Ok(()));
    haptic_loop.shared.frozen();
    assert_eq!(haptic_loop.write(&device, &command), Err(End::HapticFrozen));
}

/// Would catch records that block the loop, or go astray without being counted, when nobody drains them.
#[test]
fn records_that_nobody_drains_are_counted() {
    let scene = Arc::new(Scene::from_file(spoon_in_cup(0.01, 2e3, Method::BackwardEuler)).unwrap());
    let (mut haptic_loop, _contacts, mut outer) = parts(&scene);
    let sample = scene.trajectory.sample(0.0, 1e-3);
    for i in 0..5000 {
        haptic_loop.round_at(&sample, f64::from(i) * 1e-3);
    }
    assert_eq!(haptic_loop.shared.telemetry.timing().lost, 5000 - 4096);
    assert_eq!(outer.latest.read().tick, 5000);
    assert_eq!(outer.records.waiting(), 4096);
}

/// Would catch a torn or stale value between the threads: a writer and a reader as fast as they can. (Under ThreadSanitizer it also catches a data
/// race: see docs/real-time.md.)
#[test]
fn snapshots_and_states_cross_whole_and_in_order() {
    let scene = Arc::new(Scene::from_file(spoon_in_cup(0.01, 2e3, Method::BackwardEuler)).unwrap());
    let (mut haptic_loop, contacts, mut outer) = parts(&scene);
    let sample = scene.trajectory.sample(0.0, 1e-3);
    let most = 20_000u64;
    let stop = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let writer = thread::spawn(move || {
        let mut contacts = contacts;
        let mut last = 0;
        let mut published = 0;
        while !stopped.load(std::sync::atomic::Ordering::Relaxed) {
            if !contacts.states.update() {
                thread::yield_now();
                continue;
            }
            let seen = *contacts.states.value();
            assert!(seen.of_tick > last, "an old state came again");
            last = seen.of_tick;
            assert!(seen.time == seen.of_tick as f64 * 1e-3, "a state with another's time");
            let found = contacts.contacts.slot();
            (found.of_tick, found.snapshot.time) = (seen.of_tick, seen.time);
            contacts.contacts.publish();
            published += 1;
        }
        published
    });
    for i in 1..=most {
        haptic_loop.round_at(&sample, i as f64 * 1e-3);
        while let Some(record) = outer.records.pop() {
            let time = record.time - record.result.contact_age;
            assert!((time - record.contacts_of as f64 * 1e-3).abs() < 1e-9, "a snapshot with another's time");
        }
        if i % 64 == 0 {
            thread::yield_now();
        }
    }
    stop.store(true, std::sync::atomic::Ordering::Relaxed);
    assert!(writer.join().unwrap() > 10);
}
