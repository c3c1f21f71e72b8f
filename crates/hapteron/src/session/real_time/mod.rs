//! Real time: the paper's multirate pipeline on threads (section 3.1).
//!
//! Three threads. The *haptic thread* runs [`super::tick`] on absolute deadlines, between reading and writing the device. The *contact thread*
//! looks at the newest state, as fast as it can, and hands over planes. The *supervisor* sleeps, and stops the device if the haptic thread
//! does not go on. They share only newest values, bounded rings and counts: none can hold another up. Whatever ends a session - a command, a
//! device that is gone, a panic of either thread, a freeze - the device is told zero force and stopped.
//!
//! Priority, locked memory and the like are asked for and reported ([`Grants`]), never required.

mod bare;
pub mod clock;
mod contact_thread;
mod exchange;
mod haptic_thread;
pub mod histogram;
mod lookahead;
mod recorder;
mod running;
mod scene_device;
mod shared;
mod spool;
mod supervisor;
pub mod system;
mod telemetry;

pub use bare::{Bare, bare_loop};
pub use contact_thread::PassHook;
pub use haptic_thread::TickHook;
pub use histogram::Distribution;
pub(in crate::session) use recorder::depth;
pub use recorder::{Recorded, Recorder};
pub use running::{Finished, Running, Told};
pub use scene_device::SceneDevice;
pub use shared::End;
pub use spool::{Spool, SpoolError, Spooled};
pub use system::{Grant, Grants};
pub use telemetry::{LatenessRatio, PassRecord, TickRecord, Timing, Undelivered};

use super::contact_pass::sample_speed;
use super::{Command, ContactLaw, ContactPass, ContactSnapshot, Flags, HapticState, Settings, View, tick};
use crate::scene::{Scene, handle_at};
use contact_thread::ContactLoop;
use exchange::{Found, Seen, exchange};
use hapteron_device::guard::{Guard, GuardError};
use hapteron_device::{Device, DeviceFault, DeviceSample};
use haptic_thread::Loop;
use lookahead::Lookahead;
use shared::{Shared, SharedDevice};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

/// SCHED_FIFO priority that the haptic thread asks for: above the interrupts' threads (50), below the kernel's own watch (99).
pub const HAPTIC_PRIORITY: i32 = 80;
/// Ticks a second that the haptic thread can be asked for.
pub const RATES: std::ops::RangeInclusive<f64> = 500.0..=8000.0;
/// Time steps are compared with the rates to this share.
const ROUNDING: f64 = 1e-6;

/// How a session is run. The defaults ask for all that the system may grant.
pub struct RealTimeOptions {
    /// SCHED_FIFO priority of the haptic thread, 1 to 99; none: ordinary scheduling.
    pub priority: Option<i32>,
    /// CPU of the haptic thread.
    pub cpu: Option<usize>,
    /// SCHED_FIFO priority of the contact thread; none: ordinary scheduling, which is always below the haptic thread's. Default: the scene's.
    pub contact_priority: Option<i32>,
    /// CPU of the contact thread. Default: the scene's.
    pub contact_cpu: Option<usize>,
    /// Lock the pages that the process has at the start.
    pub lock_memory: bool,
    /// Spinning begins at least so long before a deadline; longer where the system wakes late ([`clock::Margin`]).
    pub spin: Duration,
    /// End after so many seconds.
    pub duration: Option<f64>,
    /// A haptic thread that does not tick for so long is taken for dead.
    pub watchdog: Duration,
    /// A device may fail to give a sample for so long; meanwhile its last one is used again.
    pub late_limit: Duration,
    /// Put the device's workspace so that the coupling has no deviation at the start. Simulated devices start on the scene's motion, which has
    /// none to begin with.
    pub attach: bool,
    /// Measure a loop that does nothing between the ticks, for comparison.
    pub bare: bool,
    /// Records that may wait to be drained.
    pub room: usize,
    /// For tests: called before every tick on the haptic thread.
    #[doc(hidden)]
    pub tick_hook: Option<TickHook>,
    /// For tests: called before every pass on the contact thread.
    #[doc(hidden)]
    pub pass_hook: Option<PassHook>,
}

impl RealTimeOptions {
    /// The defaults for a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self {
            priority: Some(HAPTIC_PRIORITY),
            cpu: None,
            contact_priority: scene.file.contact_thread.priority,
            contact_cpu: scene.file.contact_thread.cpu,
            lock_memory: true,
            spin: clock::SPIN,
            duration: None,
            watchdog: Duration::from_millis(50),
            late_limit: Duration::from_millis(10),
            attach: true,
            bare: false,
            room: 16_384,
            tick_hook: None,
            pass_hook: None,
        }
    }
}

/// Why a session could not start. The device is stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// A rate that no haptic thread is asked for.
    #[error(
        "integrator.time_step is {0} s, {1:.0} ticks a second; in real time there can be 500 to 8000 (0.002 to 0.000125 s)"
    )]
    Rate(f64, f64),
    /// A limit of the guard.
    #[error("guard: {0}")]
    Guard(GuardError),
    /// The device.
    #[error("{0}: {1}")]
    Device(String, DeviceFault),
    /// The system has no more threads.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// Starts sessions.
pub struct RealTime;

impl RealTime {
    /// Homes the device, switches its motors on and starts the threads.
    ///
    /// # Errors
    /// [`StartError`]; the device is stopped then.
    pub fn start(
        scene: Arc<Scene>,
        mut device: Box<dyn Device>,
        options: RealTimeOptions,
    ) -> Result<Running, StartError> {
        let rate = 1.0 / scene.time_step;
        if !(*RATES.start() * (1.0 - ROUNDING)..=*RATES.end() * (1.0 + ROUNDING)).contains(&rate) {
            return Err(StartError::Rate(scene.time_step, rate));
        }
        let name = device.capabilities().name.clone();
        let guard = match scene.guard.map(Guard::new).transpose() {
            Ok(guard) => guard,
            Err(error) => {
                device.stop();
                return Err(StartError::Guard(error));
            }
        };
        match prepare(device.as_mut()) {
            Ok(sample) => launch(scene, device, guard, sample, options),
            Err(fault) => {
                device.stop();
                Err(StartError::Device(name, fault))
            }
        }
    }
}

fn prepare(device: &mut dyn Device) -> Result<DeviceSample, DeviceFault> {
    device.home()?;
    let sample = device.read()?;
    device.set_force_enabled(true)?;
    Ok(sample)
}

fn launch(
    scene: Arc<Scene>,
    device: Box<dyn Device>,
    guard: Option<Guard>,
    sample: DeviceSample,
    options: RealTimeOptions,
) -> Result<Running, StartError> {
    let settings = Settings::of(&scene);
    let haptic = HapticState { guard, ..HapticState::new(scene.start) };
    let (pass, found, first_pass) = first_contacts(&scene, &sample);
    let seen = Seen {
        of_tick: 0,
        time: 0.0,
        state: scene.start,
        handle: handle_at(&scene.scaling.to_world(&sample)),
        body: scene.body,
        law: settings.contact_law,
        model: settings.contact_model,
        next_ns: clock::now_ns(),
    };
    let first = first_record(&settings, &haptic, &sample, &found);
    let (haptic_end, mut contacts_end, mut outer) =
        exchange(&found, &seen, &first, &first_pass, options.room.max(64));
    // The start has been looked at.
    contacts_end.states.update();
    let _ = contacts_end.passes.push(first_pass);
    if options.attach {
        let _ = outer.commands.push(Command::Attach);
    }
    let shared = Arc::new(Shared::default());
    let capabilities = device.capabilities().clone();
    let device = Arc::new(SharedDevice::new(device));
    let contact_loop = ContactLoop {
        look: Lookahead::new(scene.contact.period + scene.contact.latency),
        scene: Arc::clone(&scene),
        pass,
        ends: contacts_end,
        shared: Arc::clone(&shared),
        hook: options.pass_hook,
    };
    let haptic_loop = Loop {
        period_ns: (settings.time_step * 1e9).round() as u64,
        settings,
        haptic,
        ends: haptic_end,
        shared: Arc::clone(&shared),
        epoch_ns: 0,
        spin: options.spin,
        duration: options.duration,
        late_limit_ns: options.late_limit.as_nanos() as u64,
        capabilities,
        bare: options.bare,
        hook: options.tick_hook,
        ticks: 0,
        device_off: false,
        last: sample,
        last_fresh_ns: 0,
        last_time: 0.0,
        last_start_ns: 0,
    };
    let wishes = Wishes {
        priority: options.priority,
        cpu: options.cpu,
        contact_priority: options.contact_priority,
        contact_cpu: options.contact_cpu,
        lock_memory: options.lock_memory,
        watchdog: options.watchdog,
    };
    threads(&wishes, haptic_loop, contact_loop, &shared, &device)
        .map(|started| Running::new(scene, shared, device, outer, started))
}

/// What is asked of the system.
struct Wishes {
    priority: Option<i32>,
    cpu: Option<usize>,
    contact_priority: Option<i32>,
    contact_cpu: Option<usize>,
    lock_memory: bool,
    watchdog: Duration,
}

/// The threads, and what they were granted.
struct Started {
    haptic: thread::JoinHandle<End>,
    contact: thread::JoinHandle<Option<String>>,
    supervisor: thread::JoinHandle<bool>,
    grants: Grants,
    awake: system::WakeLatency,
    memory_locked: bool,
}

/// Starts the threads; the haptic one last, when all memory is there to be locked.
fn threads(
    wishes: &Wishes,
    mut haptic_loop: Loop,
    contact_loop: ContactLoop,
    shared: &Arc<Shared>,
    device: &Arc<SharedDevice>,
) -> Result<Started, StartError> {
    let mut grants = Grants::default();
    let (awake, latency) = system::keep_awake();
    grants.latency = latency;
    let (tell, told) = mpsc::channel();
    let (go, wait) = mpsc::channel::<()>();
    let ask = |priority: Option<i32>, cpu: Option<usize>| {
        system::wake_exactly();
        (priority.map_or(Grant::NotAsked, system::raise_priority), cpu.map_or(Grant::NotAsked, system::pin))
    };
    let asked = (wishes.contact_priority, wishes.contact_cpu);
    let contact_tell = tell.clone();
    let contact = thread::Builder::new().name("contacts".into()).spawn(move || {
        let _ = contact_tell.send((false, ask(asked.0, asked.1)));
        contact_loop.run()
    })?;
    let asked = (wishes.priority, wishes.cpu);
    let (haptic_shared, haptic_device) = (Arc::clone(shared), Arc::clone(device));
    let spawned = thread::Builder::new().name("haptic".into()).spawn(move || {
        let _ = tell.send((true, ask(asked.0, asked.1)));
        system::touch_stack();
        let _ = wait.recv();
        haptic_loop.epoch_ns = clock::quiet_epoch(haptic_loop.period_ns);
        haptic_loop.last_fresh_ns = haptic_loop.epoch_ns;
        haptic_shared.pulse_ns.store(clock::now_ns(), std::sync::atomic::Ordering::Release);
        haptic_loop.run(&haptic_device)
    });
    let haptic = match spawned {
        Ok(haptic) => haptic,
        Err(error) => {
            shared.stop();
            return Err(error.into());
        }
    };
    for (is_haptic, (priority, cpu)) in told.iter().take(2) {
        if is_haptic {
            (grants.priority, grants.cpu) = (priority, cpu);
        } else {
            (grants.contact_priority, grants.contact_cpu) = (priority, cpu);
        }
    }
    if wishes.lock_memory {
        grants.memory = system::lock_memory();
    }
    let memory_locked = grants.memory.is_given();
    shared.pulse_ns.store(clock::now_ns(), std::sync::atomic::Ordering::Release);
    let (watched, kept, watchdog) = (Arc::clone(shared), Arc::clone(device), wishes.watchdog);
    // Above the contact thread and below the haptic one.
    let priority = wishes.priority.map(|p| (p - 1).max(1));
    let supervisor = thread::Builder::new().name("supervisor".into()).spawn(move || {
        let _ = ask(priority, None);
        supervisor::watch(&watched, &kept, watchdog)
    });
    let supervisor = match supervisor {
        Ok(supervisor) => supervisor,
        Err(error) => {
            // Without its supervisor it does not start.
            shared.stop();
            drop(go);
            return Err(error.into());
        }
    };
    let _ = go.send(());
    Ok(Started { haptic, contact, supervisor, grants, awake, memory_locked })
}

/// The pass at the start, whose contacts the first tick uses: no one grips an object before its contacts are known.
fn first_contacts(scene: &Scene, sample: &DeviceSample) -> (ContactPass, Found, PassRecord) {
    let contact = &scene.contact;
    let mut pass = ContactPass::new(scene);
    let mut snapshot = ContactSnapshot::empty(&scene.body, &scene.start);
    let view = View {
        state: scene.start,
        body: scene.body,
        handle_speed: sample_speed(scene, sample),
        time: 0.0,
        ahead: contact.period + contact.latency,
        law: ContactLaw { stiffness: contact.stiffness, damping: contact.damping },
        model: contact.model,
    };
    let begun = clock::now_ns();
    pass.look(scene, &view, &mut snapshot);
    let record = PassRecord {
        of_tick: 0,
        ahead: view.ahead,
        min_distance: snapshot.min_distance(),
        contacts: snapshot.contacts(),
        duration_ns: clock::now_ns().saturating_sub(begun),
    };
    (pass, Found { of_tick: 0, snapshot }, record)
}

/// What [`Running::latest`] shows before the first tick: the start, without any force.
fn first_record(
    settings: &Settings,
    haptic: &HapticState,
    sample: &DeviceSample,
    found: &Found,
) -> TickRecord {
    let mut result = tick(settings, haptic, sample, &found.snapshot, 0.0);
    result.after = *haptic;
    result.command = hapteron_device::DeviceCommand::zero();
    result.flags = Flags::default();
    TickRecord {
        tick: 0,
        time: 0.0,
        sample: *sample,
        command: None,
        result,
        contacts_of: 0,
        counts: (found.snapshot.contacts(), found.snapshot.clusters()),
        lateness_ns: 0,
        compute_ns: 0,
        missed: 0,
    }
}

#[cfg(test)]
mod tests;
