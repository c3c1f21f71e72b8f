//! A session again, from its log: the same ticks bit for bit, or what they would have been under other settings.

use super::log::Log;
use super::real_time::depth;
use super::{
    Command, ContactPass, ContactSnapshot, Flags, HapticState, Settings, View, apply, handle_speed, tick,
};
use crate::recording::{Recording, Row};
use crate::scene::{Scene, handle_at};
use hapteron_device::guard::{Guard, GuardError};
use hapteron_dynamics::Handle;
use std::collections::VecDeque;

/// Makes the ticks of a log again, with the contact passes in the places that they had.
///
/// With the scene of the log the recording has the same bits as the session's `run.csv`, if the log is complete. With another scene it tells what
/// the same hand at the same times would have met: the device's samples do not follow the force, the schedule stays. `progress` as in
/// [`super::run_virtual`].
///
/// # Errors
/// A guard that cannot be (a scene that was read has been checked already).
pub fn replay(
    scene: &Scene,
    log: &Log,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Recording, GuardError> {
    let mut session = Replay::new(scene, log)?;
    let mut recording = Recording::new();
    recording.rows.reserve(log.rows.len());
    let report_every = (log.rows.len() / 100).max(1);
    for i in 0..log.rows.len() {
        session.advance(i, &mut recording);
        if (i + 1) % report_every == 0 && !progress((i + 1) as f64 / log.rows.len() as f64) {
            recording.cancelled = true;
            break;
        }
    }
    Ok(recording)
}

struct Replay<'a> {
    scene: &'a Scene,
    log: &'a Log,
    settings: Settings,
    haptic: HapticState,
    pass: ContactPass,
    current: ContactSnapshot,
    /// Contacts of later passes, with the tick that each looked at.
    pending: VecDeque<(u64, ContactSnapshot)>,
    /// Snapshots to be used again.
    spare: Vec<ContactSnapshot>,
}

impl<'a> Replay<'a> {
    fn new(scene: &'a Scene, log: &'a Log) -> Result<Self, GuardError> {
        let mut session = Self {
            scene,
            log,
            settings: Settings::of(scene),
            haptic: HapticState {
                guard: scene.guard.map(Guard::new).transpose()?,
                ..HapticState::new(scene.start)
            },
            pass: ContactPass::new(scene),
            current: ContactSnapshot::empty(&scene.body, &scene.start),
            pending: VecDeque::new(),
            spare: Vec::new(),
        };
        let first = log.rows.first().map(|r| handle_at(&scene.scaling.to_world(&r.sample)));
        if let Some(handle) = first {
            session.look(0, 0.0, &handle, log.first_ahead);
            session.take(0);
        }
        Ok(session)
    }

    /// One tick, with the pass that looked at its state.
    fn advance(&mut self, index: usize, recording: &mut Recording) {
        let row = &self.log.rows[index];
        if let Some(command) = &row.command
            && *command != Command::Stop
        {
            apply(&mut self.settings, &mut self.haptic, command);
        }
        if row.flags.contains(Flags::DEVICE_OFF) {
            self.haptic.interrupted();
        }
        self.take(row.contacts_of);
        let mut result = tick(&self.settings, &self.haptic, &row.sample, &self.current, row.time);
        self.haptic = result.after;
        result.flags = result.flags.with(row.flags);
        let distance = match row.ahead {
            Some(ahead) => self.look(index as u64 + 1, row.time, &result.handle, ahead),
            None => self.pass.measure(self.scene, &self.haptic.state),
        };
        let counts = (self.current.contacts(), self.current.clusters());
        let depth = depth(self.scene, distance);
        let of = &self.settings.body;
        recording.push(Row::of_body(self.scene, of, row.time, &result, depth, counts), &result);
    }

    /// The pass that looks at the newest state. Answers the distance that it found.
    fn look(&mut self, of_tick: u64, time: f64, handle: &Handle, ahead: f64) -> f64 {
        let view = View {
            state: self.haptic.state,
            body: self.settings.body,
            handle_speed: handle_speed(self.scene, handle),
            time,
            ahead,
            law: self.haptic.grip.contact_law(&self.settings.contact_law),
            model: self.settings.contact_model,
        };
        let mut snapshot = self.spare.pop().unwrap_or_else(|| self.current.clone());
        self.pass.look(self.scene, &view, &mut snapshot);
        let distance = snapshot.min_distance();
        self.pending.push_back((of_tick, snapshot));
        distance
    }

    /// From now on the contacts of a tick's state.
    fn take(&mut self, of_tick: u64) {
        while self.pending.front().is_some_and(|(tick, _)| *tick <= of_tick) {
            if let Some((_, newer)) = self.pending.pop_front() {
                self.spare.push(std::mem::replace(&mut self.current, newer));
            }
        }
    }
}
