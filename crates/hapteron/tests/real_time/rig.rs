//! A scene, a device that makes trouble, and a session to its end.

use hapteron::device::{
    Applied, Capabilities, Control, Device, DeviceCommand, DeviceFault, DeviceSample, Pacing,
};
use hapteron::scene::Scene;
use hapteron::scene::file::Method;
use hapteron::scenes::spoon_in_cup;
use hapteron::session::real_time::{
    Finished, RealTime, RealTimeOptions, Recorded, Recorder, Running, SceneDevice, TickRecord, Told,
};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// The spoon in the cup with a hand that feels the force; in contact from about 0.2 s on.
pub fn scene() -> Arc<Scene> {
    let mut file = spoon_in_cup(0.01, 2e3, Method::BackwardEuler);
    file.hand.mass = Some(0.3);
    file.hand.damping = Some(6.0);
    file.hand.stiffness = Some(400.0);
    file.contact_thread.latency = Some(1e-3);
    Arc::new(Scene::from_file(file).unwrap())
}

/// What a device can be made to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trouble {
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
pub struct Seen {
    pub reads: AtomicU64,
    pub stopped: AtomicBool,
    /// The last command, and how many were written after the trouble.
    pub last: Mutex<Option<DeviceCommand>>,
    pub writes_after: AtomicU64,
    pub force_before: Mutex<f64>,
}

/// The scene's device, with trouble at a read.
pub struct Troubled {
    inner: SceneDevice,
    pub capabilities: Capabilities,
    trouble: Trouble,
    at: u64,
    seen: Arc<Seen>,
}

impl Troubled {
    pub fn new(scene: &Arc<Scene>, pacing: Pacing, trouble: Trouble, at: u64) -> (Box<Self>, Arc<Seen>) {
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

pub fn options(scene: &Scene, seconds: f64) -> RealTimeOptions {
    RealTimeOptions { duration: Some(seconds), attach: false, ..RealTimeOptions::of(scene) }
}

/// Waits for a session to end by itself, and records it.
pub fn to_end(mut running: Running) -> (Finished, Recorded, Vec<TickRecord>) {
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

pub fn run(
    scene: &Arc<Scene>,
    device: Box<dyn Device>,
    options: RealTimeOptions,
) -> (Finished, Recorded, Vec<TickRecord>) {
    to_end(RealTime::start(Arc::clone(scene), device, options).unwrap())
}
