//! Makes a recording and a log of what a running session tells, in memory: for short sessions, and tests ([`super::Spool`] is for any). Not real
//! time.

use super::telemetry::{PassRecord, TickRecord};
use crate::recording::{Recording, Row};
use crate::scene::Scene;
use crate::session::log::Log;
use crate::session::{Command, ContactPass};
use hapteron_dynamics::RigidBody;
use std::sync::Arc;

/// Collects ticks and passes, in their order.
pub struct Recorder {
    scene: Arc<Scene>,
    rows: RowMaker,
    recording: Recording,
    log: Log,
    /// Passes whose tick has not been drained yet.
    waiting: Vec<PassRecord>,
    /// Lateness and compute time of every tick, nanoseconds.
    timing: Vec<(u64, u64)>,
}

/// What a session comes to.
pub struct Recorded {
    /// For `run.csv`.
    pub recording: Recording,
    /// For `device.csv`.
    pub log: Log,
    /// Lateness and compute time of every tick, nanoseconds.
    pub timing: Vec<(u64, u64)>,
}

impl Recorder {
    /// Of a session with a scene.
    #[must_use]
    pub fn new(scene: Arc<Scene>) -> Self {
        Self {
            rows: RowMaker::new(Arc::clone(&scene)),
            scene,
            recording: Recording::new(),
            log: Log::new(),
            waiting: Vec::new(),
            timing: Vec::new(),
        }
    }

    /// Adds a tick.
    pub fn tick(&mut self, record: &TickRecord) {
        self.recording.push(self.rows.row(record), &record.result);
        self.log.push(record);
        self.timing.push((record.lateness_ns, record.compute_ns));
    }

    /// Adds a pass.
    pub fn pass(&mut self, record: &PassRecord) {
        self.waiting.push(*record);
        if self.waiting.len() >= 64 {
            self.settle();
        }
    }

    /// Gives ticks what the passes found that looked at their states.
    fn settle(&mut self) {
        let mut waiting = std::mem::take(&mut self.waiting);
        waiting.retain(|pass| {
            let known = self.log.push_pass(pass);
            if known && pass.of_tick > 0 {
                let row = self.recording.rows.get_mut(pass.of_tick as usize - 1);
                if let Some(row) = row {
                    row.penetration = depth(&self.scene, pass.min_distance);
                }
            }
            !known
        });
        self.waiting = waiting;
    }

    /// Measures the depth of the ticks that no pass looked at. `progress` is told the share that is done; when it answers `false` the rest
    /// stays at the last known depth.
    #[must_use]
    pub fn finish(mut self, progress: &mut dyn FnMut(f64) -> bool) -> Recorded {
        self.settle();
        let mut measure = ContactPass::new(&self.scene);
        let count = self.recording.rows.len();
        let (mut last, mut go_on) = (-self.scene.contact.tolerance, true);
        for (i, row) in self.recording.rows.iter_mut().enumerate() {
            if row.penetration.is_nan() {
                row.penetration =
                    if go_on { depth(&self.scene, measure.measure_at(&self.scene, &row.body)) } else { last };
            }
            last = row.penetration;
            if i % 1000 == 0 {
                go_on = go_on && progress(i as f64 / count as f64);
            }
        }
        Recorded { recording: self.recording, log: self.log, timing: self.timing }
    }
}

/// Makes rows of ticks. How deep they are, is known when their pass is, or measured at the end.
pub(super) struct RowMaker {
    scene: Arc<Scene>,
    /// Commands may change its mass.
    body: RigidBody,
}

impl RowMaker {
    pub fn new(scene: Arc<Scene>) -> Self {
        Self { body: scene.body, scene }
    }

    pub fn row(&mut self, record: &TickRecord) -> Row {
        if let Some(Command::SetMass(body)) = &record.command {
            self.body = *body;
        }
        Row::of_body(&self.scene, &self.body, record.time, &record.result, f64::NAN, record.counts)
    }
}

/// As it stands in a row.
pub(in crate::session) fn depth(scene: &Scene, distance: f64) -> f64 {
    (-distance).max(-scene.contact.tolerance)
}
