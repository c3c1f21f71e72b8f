//! Sessions when all is well: from the start to the end, and made again.

use crate::common::csv;
use crate::rig::{Trouble, Troubled, options, scene, to_end};
#[cfg(target_os = "linux")]
use hapteron::device::{Applied, Capabilities, Device, DeviceCommand, DeviceSample};
use hapteron::device::{DeviceFault, Pacing};
use hapteron::scene::file::Method;
use hapteron::scene::{ContactModel, Scene};
use hapteron::scenes::spoon_in_cup;
use hapteron::session::real_time::{End, RealTime, RealTimeOptions, SceneDevice, StartError};
use hapteron::session::{Command, Gains, log::Log, replay};
#[cfg(target_os = "linux")]
use std::ffi::OsString;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::Duration;

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

/// Would catch motors that are on while threads and contacts are still prepared: a device's own watchdog, which waits 20 ms for a force, would take them away before
/// the first tick.
#[cfg(target_os = "linux")]
#[test]
fn the_motors_are_switched_on_last() {
    let scene = scene();
    let threads = Arc::new(Mutex::new((Vec::new(), None)));
    let device = Box::new(Watched {
        inner: SceneDevice::new(Arc::clone(&scene), false).unwrap(),
        threads: Arc::clone(&threads),
    });
    let running = RealTime::start(Arc::clone(&scene), device, options(&scene, 0.05)).unwrap();
    assert_eq!(to_end(running).0.end, End::Elapsed);
    let (there, haptic) = threads.lock().unwrap().clone();
    assert!(there.contains(&haptic.unwrap()), "the haptic thread came after the motors");
}

/// Sees which threads there are when the motors are switched on, and which one writes first.
#[cfg(target_os = "linux")]
struct Watched {
    inner: SceneDevice,
    threads: Arc<Mutex<(Vec<OsString>, Option<OsString>)>>,
}

#[cfg(target_os = "linux")]
impl Device for Watched {
    fn capabilities(&self) -> &Capabilities {
        self.inner.capabilities()
    }

    fn home(&mut self) -> Result<(), DeviceFault> {
        self.inner.home()
    }

    fn set_force_enabled(&mut self, enabled: bool) -> Result<(), DeviceFault> {
        let tasks = std::fs::read_dir("/proc/self/task").unwrap();
        self.threads.lock().unwrap().0 = tasks.map(|t| t.unwrap().file_name()).collect();
        self.inner.set_force_enabled(enabled)
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        self.inner.read()
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        let this = std::fs::read_link("/proc/thread-self").unwrap();
        self.threads.lock().unwrap().1.get_or_insert(this.file_name().unwrap().to_owned());
        self.inner.write(command)
    }

    fn stop(&mut self) {
        self.inner.stop();
    }
}

/// Would catch a device that someone's code drives with more than it is made for, or without any guard.
#[test]
fn a_device_that_the_guard_is_not_for_is_not_driven() {
    let strong = scene();
    let mut file = strong.file.clone();
    file.guard.enabled = Some(false);
    let unguarded = Arc::new(Scene::from_file(file).unwrap());
    assert!(unguarded.guard.is_none());
    for (scene, peak) in [(&strong, 3.0), (&unguarded, f64::INFINITY)] {
        let (mut device, seen) = Troubled::new(scene, Pacing::Polled, Trouble::None, u64::MAX);
        device.capabilities.peak_force = peak;
        let refused = RealTime::start(Arc::clone(scene), device, options(scene, 0.1)).err().unwrap();
        assert!(matches!(&refused, StartError::Unguarded(_)), "{refused}");
        assert!(refused.to_string().contains("Scene::adopt"));
        assert!(seen.stopped.load(Ordering::SeqCst));
    }
    // Taken over by the scene it is driven, and no harder than it is made for.
    let mut adopted = Scene::clone(&strong);
    let (mut device, _) = Troubled::new(&strong, Pacing::Polled, Trouble::None, u64::MAX);
    device.capabilities.peak_force = 3.0;
    adopted.adopt(&device.capabilities).unwrap();
    let scene = Arc::new(adopted);
    assert_eq!(scene.guard.unwrap().max_force, 3.0);
    let running = RealTime::start(Arc::clone(&scene), device, options(&scene, 0.1)).unwrap();
    assert_eq!(to_end(running).0.end, End::Elapsed);
}

/// Would catch a device that calls the loop at another rate, so that the body's time is not the hand's.
#[test]
fn a_device_that_calls_at_another_rate_is_told() {
    let scene = scene();
    let (mut device, seen) = Troubled::new(&scene, Pacing::Callback, Trouble::None, u64::MAX);
    device.capabilities.rate = 500.0;
    let refused = RealTime::start(Arc::clone(&scene), device, options(&scene, 0.1)).err().unwrap();
    assert!(refused.to_string().contains("integrator.time_step = 0.002"), "{refused}");
    assert!(seen.stopped.load(Ordering::SeqCst));
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
