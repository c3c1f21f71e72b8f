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
mod threads;

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
pub use telemetry::{LatenessRatio, ON_TIME_NS, PassRecord, TickRecord, Timing, Undelivered};

use super::contact_pass::sample_speed;
use super::{Command, ContactLaw, ContactPass, ContactSnapshot, Flags, HapticState, Settings, View, tick};
use crate::scene::{Scene, handle_at};
use contact_thread::ContactLoop;
use exchange::{Found, Seen, exchange};
use hapteron_device::guard::{Guard, GuardError};
use hapteron_device::{Capabilities, Device, DeviceFault, DeviceSample, Pacing};
use haptic_thread::Loop;
use lookahead::Lookahead;
use shared::{Shared, SharedDevice};
use std::sync::Arc;
use std::time::Duration;
use threads::{Started, Wishes};

/// SCHED_FIFO priority that the haptic thread asks for: above the interrupts' threads (50), below the kernel's own watch (99).
pub const HAPTIC_PRIORITY: i32 = 80;
/// Ticks a second that the haptic thread can be asked for.
pub const RATES: std::ops::RangeInclusive<f64> = 500.0..=8000.0;
/// Time steps are compared with the rates to this share.
const ROUNDING: f64 = 1e-6;
/// A device that calls the loop does so at the scene's rate to this share.
const PACE: f64 = 0.02;

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
    /// A device that calls the loop at another rate than the scene's.
    #[error(
        "{device} calls the loop {rate:.0} times a second, and integrator.time_step is {time_step} s: the body's time would not be the hand's. \
         Cure: integrator.time_step = {wanted}"
    )]
    Pace {
        /// Its name.
        device: String,
        /// Its calls a second.
        rate: f64,
        /// The scene's, seconds.
        time_step: f64,
        /// What it should be, seconds.
        wanted: f64,
    },
    /// The scene's guard lets through more than the device is made for, or there is none.
    #[error(
        "{0}: the scene's guard is not for this device; Scene::adopt makes it so, with the device's capabilities"
    )]
    Unguarded(String),
    /// The system has no more threads.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// Starts sessions.
pub struct RealTime;

impl RealTime {
    /// Homes the device, starts the threads and, last, switches its motors on.
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
        let capabilities = device.capabilities();
        let name = capabilities.name.clone();
        if capabilities.pacing == Pacing::Callback && (capabilities.rate / rate - 1.0).abs() > PACE {
            let (rate, time_step) = (capabilities.rate, scene.time_step);
            device.stop();
            return Err(StartError::Pace { device: name, rate, time_step, wanted: 1.0 / rate });
        }
        if !device.is_simulated() && !is_guarded(&scene, device.capabilities()) {
            device.stop();
            return Err(StartError::Unguarded(name));
        }
        let guard = match scene.guard.map(Guard::new).transpose() {
            Ok(guard) => guard,
            Err(error) => {
                device.stop();
                return Err(StartError::Guard(error));
            }
        };
        match device.home().and_then(|()| first_sample(device.as_mut())) {
            Ok(sample) => launch(scene, device, guard, sample, options),
            Err(fault) => {
                device.stop();
                Err(StartError::Device(name, fault))
            }
        }
    }
}

/// Where the handle is, motors off. A device that calls the loop tells it in a round of its own.
fn first_sample(device: &mut dyn Device) -> Result<DeviceSample, DeviceFault> {
    let mut first = None;
    match device.capabilities().pacing {
        Pacing::Polled | Pacing::Exchange => first = Some(device.read()?),
        Pacing::Callback => device.serve(&mut |sample| {
            first = Some(*sample);
            None
        })?,
    }
    first.ok_or(DeviceFault::Late)
}

/// Whether nothing beyond a device's greatest force and torque can get through the scene's guard.
fn is_guarded(scene: &Scene, device: &Capabilities) -> bool {
    let within = |limit: f64, drives: bool, peak: f64| !drives || limit <= peak;
    let drives = device.drives_force || device.drives_torque;
    scene.guard.map_or(!drives, |guard| {
        within(guard.max_force, device.drives_force, device.peak_force)
            && within(guard.max_torque, device.drives_torque, device.peak_torque)
    })
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
    threads::start(&wishes, haptic_loop, contact_loop, &shared, &device)
        .map(|started| Running::new(scene, shared, device, outer, started))
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
