//! A session that runs, as seen from outside its threads.

use super::exchange::OuterEnd;
use super::shared::{End, Shared, SharedDevice};
use super::system::{self, Grants};
use super::telemetry::{PassRecord, TickRecord, Timing};
use super::{Started, clock};
use crate::scene::Scene;
use crate::session::{Command, CommandError, ContactSnapshot, LevelsInUse};
use hapteron_device::Device;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

/// How long the threads get to end before they are left to themselves.
const PATIENCE: Duration = Duration::from_secs(2);

/// Haptic, contact, supervisor.
type Threads = (JoinHandle<End>, JoinHandle<Option<String>>, JoinHandle<bool>);

/// A running session. Not for the haptic thread. Dropping it stops the session, the device first.
pub struct Running {
    scene: Arc<Scene>,
    shared: Arc<Shared>,
    device: Option<Arc<SharedDevice>>,
    outer: OuterEnd,
    threads: Option<Threads>,
    grants: Grants,
    /// Open as long as the session lives.
    _awake: system::WakeLatency,
    memory_locked: bool,
}

/// What a session tells of itself.
#[derive(Clone, Copy, Debug)]
pub enum Told<'a> {
    /// A tick.
    Tick(&'a TickRecord),
    /// A contact pass.
    Pass(&'a PassRecord),
}

/// What is left of a session.
pub struct Finished {
    /// Why it ended.
    pub end: End,
    /// What the system had granted.
    pub grants: Grants,
    /// Of the whole session.
    pub timing: Timing,
    /// Ticks that had not been drained.
    pub records: Vec<TickRecord>,
    /// Passes that had not been drained.
    pub passes: Vec<PassRecord>,
    /// The device, stopped; none when a thread hangs in it.
    pub device: Option<Box<dyn Device>>,
}

impl Running {
    pub(super) fn new(
        scene: Arc<Scene>,
        shared: Arc<Shared>,
        device: Arc<SharedDevice>,
        outer: OuterEnd,
        started: Started,
    ) -> Self {
        let Started { haptic, contact, supervisor, grants, awake, memory_locked } = started;
        Self {
            scene,
            shared,
            device: Some(device),
            outer,
            threads: Some((haptic, contact, supervisor)),
            grants,
            _awake: awake,
            memory_locked,
        }
    }

    /// What is being run.
    #[must_use]
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The newest tick.
    pub fn latest(&mut self) -> &TickRecord {
        self.outer.latest.read()
    }

    /// Contacts as they were found a few hundredths of a second ago at most.
    pub fn contacts(&mut self) -> &ContactSnapshot {
        self.outer.shown.read()
    }

    /// Whether [`Running::levels`] are wanted. Until they are, they cost the contact thread nothing.
    pub fn watch_levels(&mut self, on: bool) {
        self.shared.watch_levels(on);
    }

    /// The contact levels in use a few hundredths of a second ago at most, when they are wanted.
    pub fn levels(&mut self) -> &LevelsInUse {
        self.outer.levels.read()
    }

    /// Takes the ticks and passes since the last call, in their order. To be called often enough that no more than
    /// [`super::RealTimeOptions::room`] wait; [`Timing::lost`] counts those that found no room.
    pub fn drain(&mut self, told: &mut dyn FnMut(Told<'_>)) {
        // Only what is there now: a fast loop must not keep its watcher for ever.
        for _ in 0..self.outer.records.waiting() {
            if let Some(record) = self.outer.records.pop() {
                told(Told::Tick(&record));
            }
        }
        for _ in 0..self.outer.passes.waiting() {
            if let Some(record) = self.outer.passes.pop() {
                told(Told::Pass(&record));
            }
        }
    }

    /// Sends a command; each is applied before a tick of its own, in order.
    ///
    /// # Errors
    /// [`CommandError::Full`] when too many wait, [`CommandError::Ended`] after the end.
    pub fn send(&mut self, command: Command) -> Result<(), CommandError> {
        if self.is_over() {
            return Err(CommandError::Ended);
        }
        self.outer.commands.push(command).map_err(|_| CommandError::Full)
    }

    /// Histograms and counts until now.
    #[must_use]
    pub fn timing(&self) -> Timing {
        self.shared.telemetry.timing()
    }

    /// What the system granted.
    #[must_use]
    pub fn grants(&self) -> &Grants {
        &self.grants
    }

    /// Whether it has ended by itself; [`Running::stop`] tells why.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.shared.is_ending()
    }

    /// Ends the session, the device first, and gives what is left of it.
    #[must_use]
    pub fn stop(mut self) -> Finished {
        let end = self.end();
        let mut finished = Finished {
            end,
            grants: self.grants.clone(),
            timing: self.timing(),
            records: Vec::new(),
            passes: Vec::new(),
            device: None,
        };
        let (records, passes) = (&mut finished.records, &mut finished.passes);
        self.drain(&mut |told| match told {
            Told::Tick(tick) => records.push(*tick),
            Told::Pass(pass) => passes.push(*pass),
        });
        finished.device = self.device.take().and_then(Arc::into_inner).map(SharedDevice::into_inner);
        finished
    }

    /// Stops and joins the threads.
    fn end(&mut self) -> End {
        let Some((haptic, contact, supervisor)) = self.threads.take() else { return End::Stopped };
        self.shared.stop();
        let deadline = clock::now_ns() + PATIENCE.as_nanos() as u64;
        let wait = |finished: &dyn Fn() -> bool| {
            while !finished() && clock::now_ns() < deadline {
                std::thread::sleep(Duration::from_millis(1));
            }
            finished()
        };
        let mut end = if wait(&|| haptic.is_finished()) {
            haptic.join().unwrap_or_else(|_| End::HapticPanicked("panic".to_owned()))
        } else {
            End::HapticFrozen
        };
        if wait(&|| supervisor.is_finished()) && supervisor.join().unwrap_or(false) {
            end = End::HapticFrozen;
        }
        if wait(&|| contact.is_finished())
            && let Ok(Some(text)) = contact.join()
            && matches!(end, End::ContactPanicked(_))
        {
            end = End::ContactPanicked(text);
        }
        if self.memory_locked {
            system::unlock_memory();
        }
        end
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end();
    }
}
