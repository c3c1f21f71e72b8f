//! Records a session to files while it runs, in memory that does not grow. Not real time.
//!
//! Whoever drains a session ([`super::Running::drain`]) hands its ticks and passes to a [`Spool`], which passes them on to a thread of its own by a bounded
//! ring ([`hapteron_exchange`]) and never waits for it: a disk that is slow for longer than the ring lasts loses rows, which are counted, and one that is full
//! ends the recording and nothing else ([`Spool::trouble`]). So `run.csv` and `device.csv` hold whole lines up to some 50 ms ago whatever
//! happens to the process.
//!
//! How deep the surfaces crossed is found by the contact passes, for the ticks that they looked at. A tick's row waits until its pass is there, or one of
//! a later tick; a row that no pass looked at has the last known depth in it until [`Spooled::settle`], after the session, measures it and writes the
//! file again.

mod settle;
mod writer;

pub use settle::SpoolError;

use super::recorder::RowMaker;
use super::telemetry::{PassRecord, TickRecord};
use crate::recording::Row;
use crate::scene::Scene;
use crate::session::log::LogRow;
use hapteron_exchange::{Producer, ring};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use writer::{Outputs, Written};

/// Ticks and passes that may wait for the disk; more than ten seconds at 1 kHz.
const ROOM: usize = 16_384;
/// Between two looks of the thread at what waits.
const LOOK: Duration = Duration::from_millis(20);

/// A tick on its way to the disk.
#[derive(Clone, Copy, Debug)]
struct Held {
    tick: u64,
    row: Row,
    log: LogRow,
    /// Of the coupling, radians.
    angle: f64,
    /// Lateness and compute time, nanoseconds.
    timing: [u64; 2],
    /// Whether the row's depth is that of a pass.
    is_known: bool,
}

/// What goes to the thread.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "a place of the ring holds either")]
enum Entry {
    Tick(Held),
    Pass(PassRecord),
}

/// What the thread tells.
#[derive(Debug, Default)]
struct Shared {
    done: AtomicBool,
    trouble: OnceLock<String>,
}

/// The side that hands over. When it is gone, as when no session could begin, the thread writes what it has and ends.
struct Handing(Arc<Shared>);

impl Drop for Handing {
    fn drop(&mut self) {
        self.0.done.store(true, Ordering::Release);
    }
}

/// Records a session into a folder.
pub struct Spool {
    rows: RowMaker,
    scene: Arc<Scene>,
    folder: PathBuf,
    to: Producer<Entry>,
    lost: u64,
    handing: Handing,
    thread: JoinHandle<Written>,
}

/// A session's files, before the last look at its depths.
#[derive(Debug)]
pub struct Spooled {
    scene: Arc<Scene>,
    folder: PathBuf,
    written: Written,
    lost: u64,
    trouble: Option<String>,
}

impl Spool {
    /// Makes `run.csv` and `device.csv` in a folder that exists.
    ///
    /// # Errors
    /// [`SpoolError`], naming the file that cannot be made; no session should begin then.
    pub fn create(scene: Arc<Scene>, folder: &Path) -> Result<Self, SpoolError> {
        let outputs = Outputs::create(folder)?;
        Self::begin(scene, folder, outputs, ROOM)
    }

    fn begin(scene: Arc<Scene>, folder: &Path, outputs: Outputs, room: usize) -> Result<Self, SpoolError> {
        let first = PassRecord { of_tick: 0, ahead: 0.0, min_distance: 0.0, contacts: 0, duration_ns: 0 };
        let (to, from) = ring(Entry::Pass(first), room);
        let shared = Arc::new(Shared::default());
        let tell = Arc::clone(&shared);
        let mut writer = writer::Writer::new(&scene, outputs);
        let thread = thread::Builder::new().name("recording".into()).spawn(move || {
            let mut from = from;
            loop {
                // Looked at first: what was handed over before it is in the ring.
                let is_last = tell.done.load(Ordering::Acquire);
                while let Some(entry) = from.pop() {
                    writer.take(entry);
                }
                if is_last {
                    writer.release_all();
                }
                if let Some(text) = writer.flush() {
                    let _ = tell.trouble.set(text);
                }
                if is_last {
                    return writer.into_written();
                }
                thread::park_timeout(LOOK);
            }
        });
        let thread =
            thread.map_err(|e| SpoolError::new("cannot start the thread that records", folder, &e))?;
        Ok(Self {
            rows: RowMaker::new(Arc::clone(&scene)),
            scene,
            folder: folder.to_owned(),
            to,
            lost: 0,
            handing: Handing(shared),
            thread,
        })
    }

    /// Adds a tick. Never waits.
    pub fn tick(&mut self, record: &TickRecord) {
        let entry = self.entry(record);
        self.lost += u64::from(self.to.push(entry).is_err());
    }

    /// Adds a pass. Never waits.
    pub fn pass(&mut self, record: &PassRecord) {
        self.lost += u64::from(self.to.push(Entry::Pass(*record)).is_err());
    }

    fn entry(&mut self, record: &TickRecord) -> Entry {
        Entry::Tick(Held {
            tick: record.tick,
            row: self.rows.row(record),
            log: LogRow::of(record),
            angle: record.result.step.angle,
            timing: [record.lateness_ns, record.compute_ns],
            is_known: false,
        })
    }

    /// Why nothing is recorded any more, if that is so: in words, with the file and the time.
    #[must_use]
    pub fn trouble(&self) -> Option<&str> {
        self.handing.0.trouble.get().map(String::as_str)
    }

    /// Ends the recording with what had not been drained when the session ended. Waits for the disk.
    #[must_use]
    pub fn finish(mut self, records: &[TickRecord], passes: &[PassRecord]) -> Spooled {
        for record in records {
            let entry = self.entry(record);
            self.push_patiently(entry);
        }
        for pass in passes {
            self.push_patiently(Entry::Pass(*pass));
        }
        let shared = Arc::clone(&self.handing.0);
        drop(self.handing);
        self.thread.thread().unpark();
        // It has no way to panic; if it found one, what it had written is there, but nobody knows how much.
        let written = self.thread.join().unwrap_or_default();
        let trouble = shared.trouble.get().cloned();
        Spooled { scene: self.scene, folder: self.folder, written, lost: self.lost, trouble }
    }

    fn push_patiently(&mut self, mut entry: Entry) {
        while !self.thread.is_finished() {
            match self.to.push(entry) {
                Ok(()) => return,
                Err(back) => entry = back,
            }
            self.thread.thread().unpark();
            thread::sleep(Duration::from_millis(1));
        }
        self.lost += 1;
    }
}

impl Spooled {
    /// Rows in the files.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.written.rows
    }

    /// Greatest coupling angle, radians.
    #[must_use]
    pub fn greatest_angle(&self) -> f64 {
        self.written.greatest_angle
    }

    /// Ticks and passes that are not in the files, because the disk was too slow or full.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost + self.written.lost
    }

    /// Whether every tick and pass that was handed over is there.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.written.is_complete && self.lost() == 0
    }

    /// Why the recording ended before the session, if it did.
    #[must_use]
    pub fn trouble(&self) -> Option<&str> {
        self.trouble.as_deref()
    }
}

/// A file of a recording that is being written, and its name.
struct Output {
    out: Box<dyn Write + Send>,
    path: PathBuf,
    buffer: Vec<u8>,
}

impl Output {
    fn create(path: PathBuf) -> Result<Self, SpoolError> {
        match std::fs::File::create(&path) {
            Ok(file) => Ok(Self { out: Box::new(file), path, buffer: Vec::new() }),
            Err(error) => Err(SpoolError::new("cannot write", &path, &error)),
        }
    }

    /// Only whole lines are ever in the buffer.
    fn flush(&mut self) -> io::Result<()> {
        let done = self.out.write_all(&self.buffer);
        self.buffer.clear();
        done
    }
}

#[cfg(test)]
mod tests;
