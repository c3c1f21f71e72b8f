//! The threads of a session, what they are granted, and the order in which they and the motors start.

use super::StartError;
use super::contact_thread::ContactLoop;
use super::haptic_thread::Loop;
use super::shared::{End, Shared, SharedDevice};
use super::system::{self, Grant, Grants};
use super::{clock, supervisor};
use hapteron_device::DeviceFault;
use std::io;
use std::sync::atomic::Ordering;
use std::sync::{Arc, mpsc};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

/// What is asked of the system.
pub(super) struct Wishes {
    pub priority: Option<i32>,
    pub cpu: Option<usize>,
    pub contact_priority: Option<i32>,
    pub contact_cpu: Option<usize>,
    pub lock_memory: bool,
    pub watchdog: Duration,
}

/// The threads, and what they were granted.
pub(super) struct Started {
    pub haptic: JoinHandle<End>,
    pub contact: JoinHandle<Option<String>>,
    pub supervisor: JoinHandle<bool>,
    pub grants: Grants,
    pub awake: system::WakeLatency,
    pub memory_locked: bool,
}

/// Asks for the calling thread.
fn ask(priority: Option<i32>, cpu: Option<usize>) -> (Grant, Grant) {
    system::wake_exactly();
    (priority.map_or(Grant::NotAsked, system::raise_priority), cpu.map_or(Grant::NotAsked, system::pin))
}

/// Starts the threads; when all memory is there to be locked and nothing is left to be prepared, the motors; and then the ticks. A device whose watchdog
/// waits for forces so has the first one a few milliseconds later.
pub(super) fn start(
    wishes: &Wishes,
    haptic_loop: Loop,
    contact_loop: ContactLoop,
    shared: &Arc<Shared>,
    device: &Arc<SharedDevice>,
) -> Result<Started, StartError> {
    let mut grants = Grants::default();
    let (awake, latency) = system::keep_awake();
    grants.latency = latency;
    let (tell, told) = mpsc::channel();
    let (priority, cpu) = (wishes.contact_priority, wishes.contact_cpu);
    let contact_tell = tell.clone();
    let contact = Builder::new().name("contacts".into()).spawn(move || {
        let _ = contact_tell.send((false, ask(priority, cpu)));
        contact_loop.run()
    })?;
    let (go, wait) = mpsc::channel();
    let (priority, cpu) = (wishes.priority, wishes.cpu);
    let haptic = haptic_thread(haptic_loop, device, wait, move || {
        let _ = tell.send((true, ask(priority, cpu)));
    });
    let haptic = match haptic {
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
    let watched = motors_on(device).and_then(|()| Ok(supervisor_thread(wishes, shared, device)?));
    match watched {
        Ok(supervisor) => {
            let _ = go.send(());
            Ok(Started { haptic, contact, supervisor, grants, awake, memory_locked })
        }
        Err(error) => {
            shared.stop();
            drop(go);
            // They end at once; the haptic one stops the device.
            let _ = (haptic.join(), contact.join());
            if memory_locked {
                system::unlock_memory();
            }
            Err(error)
        }
    }
}

/// The haptic thread, which waits for the word to go; without one it stops the device.
fn haptic_thread(
    mut haptic_loop: Loop,
    device: &Arc<SharedDevice>,
    go: mpsc::Receiver<()>,
    begin: impl FnOnce() + Send + 'static,
) -> io::Result<JoinHandle<End>> {
    let device = Arc::clone(device);
    Builder::new().name("haptic".into()).spawn(move || {
        begin();
        system::touch_stack();
        let shared = Arc::clone(&haptic_loop.shared);
        if go.recv().is_err() {
            device.stop();
            shared.haptic_ended();
            return End::Stopped;
        }
        haptic_loop.epoch_ns = clock::quiet_epoch(haptic_loop.period_ns);
        haptic_loop.last_fresh_ns = haptic_loop.epoch_ns;
        shared.pulse_ns.store(clock::now_ns(), Ordering::Release);
        haptic_loop.run(&device)
    })
}

/// Switches the motors on. Nobody else has the device yet.
fn motors_on(device: &SharedDevice) -> Result<(), StartError> {
    let Some(mut device) = device.claim() else {
        return Err(StartError::Device("device".to_owned(), DeviceFault::Late));
    };
    let outcome = device.set_force_enabled(true);
    outcome.map_err(|fault| StartError::Device(device.capabilities().name.clone(), fault))
}

fn supervisor_thread(
    wishes: &Wishes,
    shared: &Arc<Shared>,
    device: &Arc<SharedDevice>,
) -> io::Result<JoinHandle<bool>> {
    shared.pulse_ns.store(clock::now_ns(), Ordering::Release);
    let (watched, kept, watchdog) = (Arc::clone(shared), Arc::clone(device), wishes.watchdog);
    // Above the contact thread and below the haptic one.
    let priority = wishes.priority.map(|p| (p - 1).max(1));
    Builder::new().name("supervisor".into()).spawn(move || {
        let _ = ask(priority, None);
        supervisor::watch(&watched, &kept, watchdog)
    })
}
