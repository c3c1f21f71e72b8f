//! What the threads do when one of them, or the device, is not well.

use crate::common::csv;
use crate::rig::{Trouble, Troubled, options, run, scene};
use hapteron::device::{DeviceCommand, DeviceFault, Pacing};
use hapteron::scene::Scene;
use hapteron::session::real_time::{End, PassHook, RealTime, RealTimeOptions, TickRecord};
use hapteron::session::{Flags, replay};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Would catch a force that stays, a loop that goes on, or a session that hangs, when the device fails in contact: the device is stopped and
/// no more than one command is written after the failure.
#[test]
fn a_device_that_fails_ends_in_zero_force() {
    use DeviceFault::{Disconnected, Malformed, SafetyStop, Watchdog};
    let cases = [
        (Trouble::Fault(Disconnected), End::Device(Disconnected)),
        (Trouble::Fault(SafetyStop), End::Device(SafetyStop)),
        (Trouble::NotFinite, End::Device(Malformed)),
        (Trouble::WriteFault(Watchdog), End::Device(Watchdog)),
        (Trouble::Panic, End::HapticPanicked("the driver's bug".to_owned())),
    ];
    for pacing in [Pacing::Polled, Pacing::Exchange, Pacing::Callback] {
        for (trouble, expected) in &cases {
            let scene = scene();
            let (device, seen) = Troubled::new(&scene, pacing, *trouble, 300);
            let (finished, recorded, _) = run(&scene, device, options(&scene, 10.0));
            assert_eq!(&finished.end, expected, "{pacing:?}");
            assert!(*seen.force_before.lock().unwrap() > 0.1, "the test needs a force that could stay");
            assert_eq!(*seen.last.lock().unwrap(), Some(DeviceCommand::zero()), "{pacing:?} {trouble:?}");
            assert!(seen.stopped.load(Ordering::SeqCst));
            let after = seen.writes_after.load(Ordering::SeqCst);
            assert!(after <= 1, "{pacing:?} {trouble:?}: {after} writes after the trouble");
            // What was before it is all there.
            assert!(
                (298..=301).contains(&recorded.recording.rows.len()),
                "{}",
                recorded.recording.rows.len()
            );
        }
    }
}

/// Would catch a late device that is taken for a dead one at once, or never.
#[test]
fn a_late_device_is_waited_for_and_then_given_up() {
    let scene = scene();
    let (device, seen) = Troubled::new(&scene, Pacing::Polled, Trouble::LateForEver, 250);
    let late_limit = Duration::from_millis(200);
    let (finished, recorded, _) =
        run(&scene, device, RealTimeOptions { late_limit, ..options(&scene, 10.0) });
    assert_eq!(finished.end, End::Device(DeviceFault::Late));
    assert_eq!(*seen.last.lock().unwrap(), Some(DeviceCommand::zero()));
    let repeated =
        recorded.recording.rows.iter().filter(|r| r.flags.contains(Flags::SAMPLE_REPEATED)).count();
    assert_eq!(repeated as u64, finished.timing.repeated);
    // The limit is a time: a machine that stalls the thread makes several ticks in one period afterwards. Far from all 10 s, though.
    assert!((1..=1000).contains(&repeated), "{repeated}");
}

/// Would catch a force that jumps to where it was when the button on the device's front gives the motors back.
#[test]
fn a_device_that_is_switched_on_again_is_pushed_on_the_guard_s_ramp() {
    let mut file = scene().file.clone();
    file.guard.ramp_time = Some(0.05);
    let scene = Arc::new(Scene::from_file(file).unwrap());
    let ramp = scene.guard.unwrap().ramp_time;
    let (device, _) = Troubled::new(&scene, Pacing::Polled, Trouble::Off(60), 230);
    let (finished, recorded, ticks) = run(&scene, device, options(&scene, 0.65));
    assert_eq!(finished.end, End::Elapsed);
    let off: Vec<&TickRecord> = ticks.iter().filter(|t| t.result.flags.contains(Flags::DEVICE_OFF)).collect();
    assert_eq!(off.len(), 60);
    assert!(off.iter().any(|t| t.result.wanted.force.norm() > 0.1), "the test needs a force to jump to");
    // The last flagged tick is the first that is displayed; a late tick counts as two.
    let on = off[off.len() - 1];
    let share = |t: &TickRecord| t.result.command.force.norm() / t.result.wanted.force.norm().max(1e-9);
    assert!(share(on) <= 2.0 * scene.time_step / ramp + 1e-9, "{} of the force at once", share(on));
    let later = ticks.iter().filter(|t| t.tick > on.tick + 20);
    assert!(later.map(|t| t.result.command.force.norm()).fold(0.0, f64::max) > 0.1, "it never came back");
    let again = replay(&scene, &recorded.log, &mut |_| true).unwrap();
    assert!(csv(&again) == csv(&recorded.recording), "made again it is different");
}

/// Would catch a contact thread whose death nobody notices.
#[test]
fn a_contact_thread_that_dies_ends_in_zero_force() {
    let scene = scene();
    let (device, seen) = Troubled::new(&scene, Pacing::Polled, Trouble::None, u64::MAX);
    let mut options = options(&scene, 10.0);
    options.pass_hook = Some(Box::new(|pass| assert!(pass < 200, "a bug in the query")));
    let (finished, _, ticks) = run(&scene, device, options);
    assert!(
        matches!(&finished.end, End::ContactPanicked(text) if text.contains("a bug in the query")),
        "{:?}",
        finished.end
    );
    assert_eq!(*seen.last.lock().unwrap(), Some(DeviceCommand::zero()));
    assert!(seen.stopped.load(Ordering::SeqCst) && !ticks.is_empty());
}

/// Would catch a panic of the haptic thread that leaves the motors on.
#[test]
fn a_haptic_thread_that_dies_ends_in_zero_force() {
    let scene = scene();
    let (device, seen) = Troubled::new(&scene, Pacing::Polled, Trouble::None, u64::MAX);
    let mut options = options(&scene, 10.0);
    options.tick_hook = Some(Box::new(|tick| assert!(tick < 300, "a bug in the loop")));
    let (finished, _, _) = run(&scene, device, options);
    assert!(matches!(&finished.end, End::HapticPanicked(text) if text.contains("a bug in the loop")));
    assert_eq!(*seen.last.lock().unwrap(), Some(DeviceCommand::zero()));
    assert!(seen.stopped.load(Ordering::SeqCst));
}

/// Would catch a frozen haptic thread whose last force stays: the supervisor takes it away while the thread still hangs.
#[test]
fn a_haptic_thread_that_freezes_is_stopped_by_the_supervisor() {
    let scene = scene();
    let (device, seen) = Troubled::new(&scene, Pacing::Polled, Trouble::None, u64::MAX);
    let (frozen, thawed) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let mut options = options(&scene, 60.0);
    let (inside, until) = (Arc::clone(&frozen), Arc::clone(&thawed));
    options.tick_hook = Some(Box::new(move |tick| {
        if tick == 300 {
            inside.store(true, Ordering::SeqCst);
            // Until the test has seen what it came for.
            for _ in 0..20_000 {
                if !until.load(Ordering::SeqCst) {
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
            inside.store(false, Ordering::SeqCst);
        }
    }));
    let running = RealTime::start(Arc::clone(&scene), device, options).unwrap();
    while !seen.stopped.load(Ordering::SeqCst) {
        std::thread::sleep(Duration::from_millis(1));
        assert!(seen.reads.load(Ordering::SeqCst) <= 301, "it went on");
    }
    assert!(frozen.load(Ordering::SeqCst), "stopped only after it woke");
    thawed.store(true, Ordering::SeqCst);
    assert_eq!(*seen.last.lock().unwrap(), Some(DeviceCommand::zero()));
    let finished = running.stop();
    assert_eq!(finished.end, End::HapticFrozen);
    assert_eq!(*seen.last.lock().unwrap(), Some(DeviceCommand::zero()), "it wrote again after it woke");
}

/// Would catch a call of the device that hangs and after which the loop goes on as if nothing had been.
#[test]
fn a_device_call_that_hangs_ends_in_zero_force_when_it_returns() {
    let scene = scene();
    let (device, seen) = Troubled::new(&scene, Pacing::Polled, Trouble::Freeze(300), 300);
    let (finished, _, _) = run(&scene, device, options(&scene, 10.0));
    assert_eq!(finished.end, End::HapticFrozen);
    assert_eq!(*seen.last.lock().unwrap(), Some(DeviceCommand::zero()));
    assert!(seen.stopped.load(Ordering::SeqCst));
}

/// Would catch a phantom wall, a hidden age, or a body that is thrown, when the contact thread freezes for 100 ms in contact or
/// only comes by 50 times a second.
#[test]
fn a_contact_thread_that_freezes_or_crawls_is_seen_and_felt_little() {
    let slow: [(&str, f64, PassHook); 3] = [
        ("as it is", 0.0, Box::new(|_| {})),
        // Again and again, since on a slow machine a late pass may not be reached.
        (
            "frozen",
            0.1,
            Box::new(|pass| {
                if pass % 60 == 30 {
                    std::thread::sleep(Duration::from_millis(100));
                }
            }),
        ),
        ("50 Hz", 0.02, Box::new(|_| std::thread::sleep(Duration::from_millis(20)))),
    ];
    for (what, least_age, hook) in slow {
        let scene = scene();
        let (device, _) = Troubled::new(&scene, Pacing::Polled, Trouble::None, u64::MAX);
        let mut options = options(&scene, 0.65);
        options.pass_hook = Some(hook);
        let (finished, recorded, _) = run(&scene, device, options);
        let summary = recorded.recording.summary();
        assert_eq!(finished.end, End::Elapsed, "{what}");
        assert!(summary.stable && summary.greatest_force < 8.0, "{what}: {summary:?}");
        assert!(summary.greatest_contact_age >= least_age, "{what}: {} s", summary.greatest_contact_age);
        assert!(summary.in_contact > 0.2, "{what}: {}", summary.in_contact);
        let again = replay(&scene, &recorded.log, &mut |_| true).unwrap();
        assert!(csv(&again) == csv(&recorded.recording), "{what}: made again it is different");
    }
}
