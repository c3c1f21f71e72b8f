//! The threads: what they do when all is well, and when one of them, or the device, is not.
//!
//! Nothing here asserts a time that a busy machine could miss: what is asserted holds however late the threads run.
#![allow(clippy::unwrap_used)]

mod common;

use common::csv;
use hapteron::device::{
    Applied, Capabilities, Control, Device, DeviceCommand, DeviceFault, DeviceSample, Pacing,
};
use hapteron::scene::file::Method;
use hapteron::scene::{ContactModel, Scene};
use hapteron::scenes::spoon_in_cup;
use hapteron::session::real_time::{
    End, Finished, PassHook, RealTime, RealTimeOptions, Recorded, Recorder, Running, SceneDevice, StartError,
    TickRecord, Told,
};
use hapteron::session::{Command, Flags, Gains, log::Log, replay};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// The spoon in the cup with a hand that feels the force; in contact from about 0.2 s on.
fn scene() -> Arc<Scene> {
    let mut file = spoon_in_cup(0.01, 2e3, Method::BackwardEuler);
    file.hand.mass = Some(0.3);
    file.hand.damping = Some(6.0);
    file.hand.stiffness = Some(400.0);
    file.contact_thread.latency = Some(1e-3);
    Arc::new(Scene::from_file(file).unwrap())
}

/// What a device can be made to do.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Trouble {
    None,
    Fault(DeviceFault),
    NotFinite,
    LateForEver,
    Panic,
    Freeze(u64),
    WriteFault(DeviceFault),
    /// Motors off for so many ticks, as by a button on the device's front.
    Off(u64),
}

/// What became of it, seen from outside.
#[derive(Default)]
struct Seen {
    reads: AtomicU64,
    stopped: AtomicBool,
    /// The last command, and how many were written after the trouble.
    last: Mutex<Option<DeviceCommand>>,
    writes_after: AtomicU64,
    force_before: Mutex<f64>,
}

/// The scene's device, with trouble at a read.
struct Troubled {
    inner: SceneDevice,
    capabilities: Capabilities,
    trouble: Trouble,
    at: u64,
    seen: Arc<Seen>,
}

impl Troubled {
    fn new(scene: &Arc<Scene>, pacing: Pacing, trouble: Trouble, at: u64) -> (Box<Self>, Arc<Seen>) {
        let inner = SceneDevice::new(Arc::clone(scene), false).unwrap();
        let capabilities = Capabilities { pacing, ..inner.capabilities().clone() };
        let seen = Arc::new(Seen::default());
        (Box::new(Self { inner, capabilities, trouble, at, seen: Arc::clone(&seen) }), seen)
    }
}

impl Device for Troubled {
    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn home(&mut self) -> Result<(), DeviceFault> {
        self.inner.home()
    }

    fn set_force_enabled(&mut self, enabled: bool) -> Result<(), DeviceFault> {
        self.inner.set_force_enabled(enabled)
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        let n = self.seen.reads.fetch_add(1, Ordering::SeqCst);
        if self.capabilities.pacing == Pacing::Exchange {
            std::thread::sleep(Duration::from_micros(900));
        }
        if n < self.at {
            return self.inner.read();
        }
        match self.trouble {
            Trouble::None | Trouble::WriteFault(_) | Trouble::Off(_) => self.inner.read(),
            Trouble::Fault(fault) => Err(fault),
            Trouble::LateForEver => Err(DeviceFault::Late),
            Trouble::NotFinite => {
                let sample = self.inner.read()?;
                Ok(DeviceSample { position: sample.position * f64::NAN, ..sample })
            }
            Trouble::Panic => panic!("the driver's bug"),
            Trouble::Freeze(ms) => {
                if n == self.at {
                    std::thread::sleep(Duration::from_millis(ms));
                }
                self.inner.read()
            }
        }
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        let reads = self.seen.reads.load(Ordering::SeqCst);
        if reads > self.at {
            self.seen.writes_after.fetch_add(1, Ordering::SeqCst);
            if let Trouble::WriteFault(fault) = self.trouble {
                return Err(fault);
            }
            if let Trouble::Off(ticks) = self.trouble
                && reads <= self.at + ticks
            {
                let _ = self.inner.write(&DeviceCommand::zero());
                return Ok(Applied::Disabled);
            }
        } else {
            *self.seen.force_before.lock().unwrap() = command.force.norm();
        }
        *self.seen.last.lock().unwrap() = Some(*command);
        self.inner.write(command)
    }

    fn serve(&mut self, control: Control<'_>) -> Result<(), DeviceFault> {
        loop {
            std::thread::sleep(Duration::from_micros(900));
            let sample = self.read()?;
            match control(&sample) {
                Some(command) => self.write(&command)?,
                None => return Ok(()),
            };
        }
    }

    fn stop(&mut self) {
        self.seen.stopped.store(true, Ordering::SeqCst);
        *self.seen.last.lock().unwrap() = Some(DeviceCommand::zero());
        self.inner.stop();
    }
}

fn options(scene: &Scene, seconds: f64) -> RealTimeOptions {
    RealTimeOptions { duration: Some(seconds), attach: false, ..RealTimeOptions::of(scene) }
}

/// Waits for a session to end by itself, and records it.
fn to_end(mut running: Running) -> (Finished, Recorded, Vec<TickRecord>) {
    let mut recorder = Recorder::new(Arc::clone(running.scene()));
    let mut all = Vec::new();
    for _ in 0..3000 {
        std::thread::sleep(Duration::from_millis(5));
        running.drain(&mut |told| match told {
            Told::Tick(tick) => {
                recorder.tick(tick);
                all.push(*tick);
            }
            Told::Pass(pass) => recorder.pass(pass),
        });
        if running.is_over() {
            break;
        }
    }
    let finished = running.stop();
    finished.records.iter().for_each(|r| {
        recorder.tick(r);
        all.push(*r);
    });
    finished.passes.iter().for_each(|p| recorder.pass(p));
    (finished, recorder.finish(&mut |_| true), all)
}

fn run(
    scene: &Arc<Scene>,
    device: Box<dyn Device>,
    options: RealTimeOptions,
) -> (Finished, Recorded, Vec<TickRecord>) {
    to_end(RealTime::start(Arc::clone(scene), device, options).unwrap())
}

/// Would catch an order of threads, a command or a missed tick that the log does not tell, and a pacing that does not call the same tick:
/// sessions of every pacing, with commands, come again bit for bit.
#[test]
fn sessions_of_every_pacing_come_again_bit_for_bit() {
    for pacing in [Pacing::Polled, Pacing::Exchange, Pacing::Callback] {
        let scene = scene();
        let (device, seen) = Troubled::new(&scene, pacing, Trouble::None, u64::MAX);
        let mut running = RealTime::start(Arc::clone(&scene), device, options(&scene, 0.6)).unwrap();
        let gains = Gains {
            linear_stiffness: 400.0,
            linear_damping: 3.0,
            angular_stiffness: 0.4,
            angular_damping: 0.01,
            max_force: Some(3.0),
            max_torque: None,
        };
        for command in [
            Command::coupling(&gains).unwrap(),
            Command::mass(&scene, 0.02).unwrap(),
            Command::gravity([0.0, 0.1, -0.3]).unwrap(),
            Command::contact(1500.0, 1.0).unwrap(),
            Command::SetContactModel(ContactModel::Linearized),
            Command::SetMethod(hapteron::dynamics::Method::BackwardEulerNewton),
            Command::Clutch(true),
            Command::Clutch(false),
            Command::Pause(true),
            Command::Pause(false),
            Command::Attach,
            Command::Grasp(false),
            Command::Grasp(true),
            Command::SetContactModel(ContactModel::Planes),
        ] {
            running.send(command).unwrap();
        }
        let (finished, recorded, ticks) = to_end(running);
        assert_eq!(finished.end, End::Elapsed, "{pacing:?}");
        assert!(seen.stopped.load(Ordering::SeqCst));
        assert_eq!(finished.timing.ticks, ticks.len() as u64);
        assert!(ticks.windows(2).all(|w| w[1].tick == w[0].tick + 1 && w[1].time > w[0].time));
        assert!(recorded.log.is_complete && finished.timing.lost == 0);
        assert!(recorded.recording.rows.iter().any(|r| r.contact[0].norm() > 0.1), "{pacing:?}: no contact");
        let mut bytes = Vec::new();
        recorded.log.write_csv(&mut bytes).unwrap();
        let log = Log::read_csv(&bytes, "device.csv", &scene).unwrap();
        assert_eq!(log, recorded.log, "the log reads back differently");
        let again = replay(&scene, &log, &mut |_| true).unwrap();
        assert!(csv(&again) == csv(&recorded.recording), "{pacing:?}: made again it is different");
    }
}

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
        (
            "frozen",
            0.1,
            Box::new(|pass| {
                if pass == 250 {
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

/// Would catch a session that starts at a rate nobody asked for, or leaves the motors on when it cannot start.
#[test]
fn a_session_that_cannot_start_says_why_and_stops_the_device() {
    let scene = scene();
    let (device, seen) = Troubled::new(&scene, Pacing::Polled, Trouble::Fault(DeviceFault::NotHomed), 0);
    let refused = RealTime::start(Arc::clone(&scene), device, RealTimeOptions::of(&scene)).err().unwrap();
    assert!(matches!(&refused, StartError::Device(_, DeviceFault::NotHomed)));
    assert!(refused.to_string().contains("reset position"), "{refused}");
    assert!(seen.stopped.load(Ordering::SeqCst));
    let mut file = spoon_in_cup(0.01, 2e3, Method::BackwardEuler);
    file.integrator.time_step = Some(0.01);
    let slow = Arc::new(Scene::from_file(file).unwrap());
    let device = Box::new(SceneDevice::new(Arc::clone(&slow), false).unwrap());
    let refused = RealTime::start(slow, device, RealTimeOptions::of(&scene)).err().unwrap();
    assert!(refused.to_string().contains("500 to 8000"), "{refused}");
}

/// Would catch threads that outlive their session, or a device that is left on by someone who forgets to stop.
#[test]
fn a_session_that_is_dropped_stops_the_device() {
    let scene = scene();
    let (device, seen) = Troubled::new(&scene, Pacing::Polled, Trouble::None, u64::MAX);
    let mut running = RealTime::start(Arc::clone(&scene), device, RealTimeOptions::of(&scene)).unwrap();
    while running.latest().tick < 50 {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(running.contacts().clusters() as usize == running.contacts().planes().len());
    drop(running);
    assert!(seen.stopped.load(Ordering::SeqCst));
    let reads = seen.reads.load(Ordering::SeqCst);
    std::thread::sleep(Duration::from_millis(20));
    assert_eq!(seen.reads.load(Ordering::SeqCst), reads);
}

/// Would catch the stop command that only stops the simulation, and commands that vanish.
#[test]
fn the_stop_command_ends_the_session_and_others_are_all_applied() {
    let scene = scene();
    let (device, seen) = Troubled::new(&scene, Pacing::Polled, Trouble::None, u64::MAX);
    let mut running = RealTime::start(Arc::clone(&scene), device, RealTimeOptions::of(&scene)).unwrap();
    let mut sent = vec![];
    for i in 0..40 {
        let command = Command::contact(1000.0 + f64::from(i), 1.0).unwrap();
        running.send(command).unwrap();
        sent.push(command);
    }
    running.send(Command::Stop).unwrap();
    let (finished, recorded, _) = to_end(running);
    assert_eq!(finished.end, End::Stopped);
    assert!(seen.stopped.load(Ordering::SeqCst));
    let applied: Vec<Command> = recorded.log.rows.iter().filter_map(|r| r.command).collect();
    // The workspace is attached first of all.
    assert_eq!(applied[0], Command::Attach);
    assert_eq!(applied[1..41], sent);
}
