//! The contact thread: newest state, query, planes, as fast as it can.

use super::clock;
use super::exchange::{ContactsEnd, Found, Seen};
use super::lookahead::Lookahead;
use super::shared::{Shared, message};
use super::telemetry::{PassRecord, add};
use crate::scene::Scene;
use crate::session::{ContactPass, View, handle_speed};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// Called before every pass with its number, on the contact thread: where tests make trouble.
pub type PassHook = Box<dyn FnMut(u64) + Send>;

/// Between two looks for a new state.
const POLL_NS: u64 = 20_000;
/// Without a state for so long, the haptic thread is behind; there is no hurry.
const LONG_POLL_NS: u64 = 200_000;
/// Those who look on get contacts this often.
const SHOW_NS: u64 = 10_000_000;

/// The contact loop with all it owns.
pub(super) struct ContactLoop {
    pub scene: Arc<Scene>,
    pub pass: ContactPass,
    pub ends: ContactsEnd,
    pub shared: Arc<Shared>,
    pub look: Lookahead,
    pub hook: Option<PassHook>,
}

impl ContactLoop {
    /// Runs until the session ends. Answers what a panic said.
    pub fn run(mut self) -> Option<String> {
        let shared = Arc::clone(&self.shared);
        let outcome = catch_unwind(AssertUnwindSafe(|| self.work()));
        if outcome.is_err() {
            shared.contact_died();
        }
        outcome.err().map(|panic| message(panic.as_ref()))
    }

    fn work(&mut self) {
        let period_ns = (self.scene.contact.period * 1e9) as u64;
        // A state that comes a little early is not to be passed over.
        let early = (self.scene.time_step * 0.5e9) as u64;
        let (mut started, mut shown, mut passes) = (clock::now_ns(), 0, 0u64);
        while !self.shared.is_ending() {
            let due = (started + period_ns).saturating_sub(early);
            if clock::now_ns() < due {
                clock::sleep_until(due);
            }
            let Some(seen) = self.wait_for_state() else { return };
            passes += 1;
            if let Some(hook) = &mut self.hook {
                hook(passes);
            }
            let now = clock::now_ns();
            let interval = now - started;
            started = now;
            let show = now - shown > SHOW_NS;
            if show {
                shown = now;
            }
            self.look_at(&seen, interval, show);
        }
    }

    /// The next state that no pass has looked at.
    fn wait_for_state(&mut self) -> Option<Seen> {
        let mut looks = 0;
        while !self.ends.states.update() {
            if self.shared.is_ending() {
                return None;
            }
            let expected = self.ends.states.value().next_ns;
            let now = clock::now_ns();
            let poll = if looks > 50 { LONG_POLL_NS } else { POLL_NS };
            clock::sleep_until(expected.max(now + poll).min(now + 2_000_000));
            looks += 1;
        }
        Some(*self.ends.states.value())
    }

    /// One pass. `interval_ns` is the time since the pass before it began; `show` tells whether others are to see what it finds.
    fn look_at(&mut self, seen: &Seen, interval_ns: u64, show: bool) {
        let begun = clock::now_ns();
        let ahead = self.look.seconds();
        let view = View {
            state: seen.state,
            body: seen.body,
            handle_speed: handle_speed(&self.scene, &seen.handle),
            time: seen.time,
            ahead,
            law: seen.law,
            model: seen.model,
        };
        let levels_watched = show && self.shared.levels_watched();
        self.pass.watch_levels(levels_watched);
        let ContactsEnd { contacts, passes, shown, levels, .. } = &mut self.ends;
        let found: &mut Found = contacts.slot();
        found.of_tick = seen.of_tick;
        let in_margin = self.pass.look(&self.scene, &view, &mut found.snapshot);
        if show {
            shown.slot().clone_from(&found.snapshot);
            shown.publish();
        }
        if levels_watched {
            self.pass.levels_in_use(levels.slot());
            levels.publish();
        }
        let duration_ns = clock::now_ns().saturating_sub(begun);
        let record = PassRecord {
            of_tick: seen.of_tick,
            ahead,
            min_distance: found.snapshot.min_distance(),
            contacts: found.snapshot.contacts(),
            duration_ns,
        };
        // The log must know of a pass before a tick can have used it.
        let told = passes.push(record).is_ok();
        contacts.publish();
        let telemetry = &self.shared.telemetry;
        telemetry.pass.record(duration_ns);
        add(&telemetry.passes, 1);
        if !told {
            add(&telemetry.lost_passes, 1);
        }
        self.look.learn(interval_ns as f64 * 1e-9, duration_ns as f64 * 1e-9, record.contacts, in_margin);
    }
}
