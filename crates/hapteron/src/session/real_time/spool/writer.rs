//! What the thread that records does with ticks and passes.

use super::{Entry, Held, Output, SpoolError};
use crate::recording::write_header;
use crate::scene::Scene;
use crate::session::log::write_head;
use crate::session::real_time::telemetry::PassRecord;
use std::collections::VecDeque;
use std::io::Read;
use std::path::Path;

/// Ticks that may wait for their pass. A contact thread that is frozen for longer has long cost the session its force (`guard.stale_after`); its pass is not in the
/// log then, which counts as a loss.
pub(super) const WINDOW: usize = 16_384;
/// Bytes that are written at once.
const BLOCK: usize = 1 << 16;

/// The three files: rows, log, and what is needed of each row at the end.
pub(super) struct Outputs {
    pub rows: Output,
    pub log: Output,
    pub marks: Output,
}

impl Outputs {
    pub fn create(folder: &Path) -> Result<Self, SpoolError> {
        let mut outputs = Self {
            rows: Output::create(folder.join("run.csv"))?,
            log: Output::create(folder.join("device.csv"))?,
            marks: Output::create(folder.join(Mark::FILE))?,
        };
        // Into memory: that does not fail.
        let _ = write_header(&mut outputs.rows.buffer);
        Ok(outputs)
    }
}

/// What is kept of a row beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mark {
    /// Lateness and compute time, nanoseconds.
    pub timing: [u64; 2],
    pub is_known: bool,
}

impl Mark {
    /// Removed at the end.
    pub const FILE: &str = "run.part";

    fn write(self, out: &mut Vec<u8>) {
        self.timing.iter().for_each(|ns| out.extend_from_slice(&ns.to_le_bytes()));
        out.push(u8::from(self.is_known));
    }

    pub fn read(input: &mut impl Read) -> std::io::Result<Self> {
        let (mut words, mut known) = ([[0; 8]; 2], [0]);
        for word in &mut words {
            input.read_exact(word)?;
        }
        input.read_exact(&mut known)?;
        Ok(Self { timing: words.map(u64::from_le_bytes), is_known: known != [0] })
    }
}

/// What there is of a recording.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Written {
    /// In the files.
    pub rows: u64,
    /// Ticks that are not, and passes that came too late for theirs.
    pub lost: u64,
    /// Every tick from the first to the last is there.
    pub is_complete: bool,
    pub greatest_angle: f64,
}

/// Puts ticks and passes together and writes them.
pub(super) struct Writer {
    outputs: Outputs,
    /// Ticks whose pass is not known yet, in their order.
    window: VecDeque<Held>,
    /// Passes whose tick has not come yet.
    passes: VecDeque<PassRecord>,
    newest: u64,
    first_ahead: f64,
    tolerance: f64,
    /// The last that is known.
    depth: f64,
    /// Let go of, whether written or not.
    released: u64,
    /// In the buffers.
    buffered: u64,
    written: Written,
    failed: Option<String>,
}

impl Writer {
    pub fn new(scene: &Scene, outputs: Outputs) -> Self {
        let tolerance = scene.contact.tolerance;
        Self {
            outputs,
            window: VecDeque::new(),
            passes: VecDeque::new(),
            newest: 0,
            first_ahead: 0.0,
            tolerance,
            depth: -tolerance,
            released: 0,
            buffered: 0,
            written: Written { is_complete: true, ..Written::default() },
            failed: None,
        }
    }

    /// Takes what comes next.
    pub fn take(&mut self, entry: Entry) {
        match entry {
            Entry::Tick(held) => {
                self.newest = held.tick;
                self.window.push_back(held);
                if self.window.len() > WINDOW {
                    self.release();
                }
            }
            Entry::Pass(pass) if pass.of_tick == 0 => self.first_ahead = pass.ahead,
            Entry::Pass(pass) => {
                self.passes.push_back(pass);
                if self.passes.len() > WINDOW {
                    self.passes.pop_front();
                    self.written.lost += 1;
                }
            }
        }
        self.match_up();
    }

    /// Gives ticks what the passes found that looked at their states, and lets them go.
    fn match_up(&mut self) {
        while let Some(pass) = self.passes.front().copied().filter(|p| p.of_tick <= self.newest) {
            self.passes.pop_front();
            // Passes come in the order of the ticks: none will look at an earlier one.
            while self.window.front().is_some_and(|held| held.tick < pass.of_tick) {
                self.release();
            }
            match self.window.front_mut().filter(|held| held.tick == pass.of_tick) {
                Some(held) => {
                    held.log.ahead = Some(pass.ahead);
                    held.row.penetration = (-pass.min_distance).max(-self.tolerance);
                    held.is_known = true;
                    self.release();
                }
                None => self.written.lost += 1,
            }
        }
    }

    /// The oldest of those that wait goes to the files.
    fn release(&mut self) {
        let Some(mut held) = self.window.pop_front() else { return };
        self.released += 1;
        self.written.is_complete &= held.tick == self.released;
        self.written.greatest_angle = self.written.greatest_angle.max(held.angle);
        if self.failed.is_some() {
            self.written.lost += 1;
            return;
        }
        if held.is_known {
            self.depth = held.row.penetration;
        } else {
            held.row.penetration = self.depth;
        }
        let Outputs { rows, log, marks } = &mut self.outputs;
        // Into memory: that does not fail.
        if self.released == 1 {
            let _ = write_head(&mut log.buffer, self.first_ahead);
        }
        let _ = held.row.write_csv(&mut rows.buffer);
        let _ = held.log.write_csv(&mut log.buffer);
        Mark { timing: held.timing, is_known: held.is_known }.write(&mut marks.buffer);
        self.buffered += 1;
        if rows.buffer.len() > BLOCK {
            self.write_out(held.row.time);
        }
    }

    /// At the end: no more passes will come.
    pub fn release_all(&mut self) {
        while !self.window.is_empty() {
            self.release();
        }
    }

    /// Hands all whole lines to the system. Answers what is wrong, once it is.
    pub fn flush(&mut self) -> Option<String> {
        let time = self.window.front().map_or(f64::NAN, |held| held.row.time);
        self.write_out(time);
        self.failed.clone()
    }

    fn write_out(&mut self, time: f64) {
        if self.failed.is_some() {
            return;
        }
        let Outputs { rows, log, marks } = &mut self.outputs;
        // The rows last: what counts is that they are there, and what belongs to them.
        for output in [log, marks, rows] {
            if let Err(error) = output.flush() {
                let since = if time.is_finite() { format!(" from {time:.3} s on") } else { String::new() };
                let path = output.path.display();
                self.failed = Some(format!("cannot write {path}: {error}; nothing is recorded{since}"));
                self.written.lost += self.buffered;
                return;
            }
        }
        self.written.rows += self.buffered;
        self.buffered = 0;
    }

    pub fn into_written(self) -> Written {
        self.written
    }
}
