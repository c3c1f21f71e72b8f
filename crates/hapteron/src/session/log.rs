//! The log of a session: all that the threads' timing and the device decided, so that the same ticks can be made again bit for bit.
//!
//! A tick is a pure function of its state, settings, device sample, contacts and time; contacts are a function of the state that a pass looked at
//! and of how far ahead it looked, in the order of the passes. So one row a tick is enough: the sample, the time, the tick whose state the
//! contacts came from, whether a pass looked at this tick's state and how far ahead, and the command that was applied. `device.csv`
//! beside `run.csv` holds it.

use super::Flags;
use super::command::{self, Command};
use super::real_time::{PassRecord, TickRecord};
use crate::scene::Scene;
use hapteron_device::DeviceSample;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::io::{self, Write};
use std::path::Path;

/// Columns of `device.csv`. Positions are in the device's scale.
pub const COLUMNS: [&str; 20] = [
    "t",
    "px",
    "py",
    "pz",
    "qw",
    "qx",
    "qy",
    "qz",
    "vx",
    "vy",
    "vz",
    "wx",
    "wy",
    "wz",
    "sampled",
    "buttons",
    "flags",
    "contacts_of",
    "ahead",
    "command",
];

/// One tick, beside what follows from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRow {
    /// `now` of the tick.
    pub time: f64,
    /// What the device gave.
    pub sample: DeviceSample,
    /// Bits that are not the tick's own.
    pub flags: Flags,
    /// The tick whose state the contacts were found at; ticks count from 1, 0 is the start.
    pub contacts_of: u64,
    /// How far ahead the pass looked that looked at this tick's state, seconds; none: no pass did.
    pub ahead: Option<f64>,
    /// Applied before the tick.
    pub command: Option<Command>,
}

impl LogRow {
    /// Of a tick; whether a pass looked at its state is not known yet.
    pub(super) fn of(record: &TickRecord) -> Self {
        Self {
            time: record.time,
            sample: record.sample,
            flags: record.result.flags.only(OF_THE_LOOP),
            contacts_of: record.contacts_of,
            ahead: None,
            command: record.command,
        }
    }

    /// Writes its line of `device.csv`; the numbers read back to the same bits.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write_csv(&self, out: &mut impl Write) -> io::Result<()> {
        let s = &self.sample;
        let q = &s.orientation;
        let (p, v, w) = (s.position, s.linear_velocity, s.angular_velocity);
        write!(out, "{},{},{},{},{},{},{},{}", self.time, p.x, p.y, p.z, q.w, q.i, q.j, q.k)?;
        write!(out, ",{},{},{},{},{},{},{},{}", v.x, v.y, v.z, w.x, w.y, w.z, s.time, s.buttons)?;
        write!(out, ",{},{},", self.flags.bits(), self.contacts_of)?;
        if let Some(ahead) = self.ahead {
            write!(out, "{ahead}")?;
        }
        writeln!(out, ",{}", self.command.as_ref().map_or_else(String::new, command::to_text))
    }
}

/// Writes what stands in `device.csv` above the ticks: the columns, and how far ahead the pass at the start looked.
///
/// # Errors
/// Those of the output.
pub fn write_head(out: &mut impl Write, first_ahead: f64) -> io::Result<()> {
    writeln!(out, "{}", COLUMNS.join(","))?;
    // The pass at the start stands in a row of its own, without a tick.
    writeln!(out, "0{},{first_ahead},", ",".repeat(17))
}

/// All ticks of a session.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// How far ahead the pass at the start looked, seconds.
    pub first_ahead: f64,
    /// One a tick.
    pub rows: Vec<LogRow>,
    /// Records are missing: what is made again will differ.
    pub is_complete: bool,
}

/// Bits of a record that come from the loop and not from the tick.
const OF_THE_LOOP: Flags = Flags::SAMPLE_REPEATED.with(Flags::DEADLINE_MISSED).with(Flags::DEVICE_OFF);

impl Log {
    /// A log without ticks.
    #[must_use]
    pub fn new() -> Self {
        Self { is_complete: true, ..Self::default() }
    }

    /// Adds a tick.
    pub fn push(&mut self, record: &TickRecord) {
        self.is_complete &= record.tick == self.rows.len() as u64 + 1;
        self.rows.push(LogRow::of(record));
    }

    /// Adds a pass; the tick whose state it looked at must be there. Answers whether it was.
    pub fn push_pass(&mut self, pass: &PassRecord) -> bool {
        if pass.of_tick == 0 {
            self.first_ahead = pass.ahead;
            return true;
        }
        let row = usize::try_from(pass.of_tick - 1).ok().and_then(|i| self.rows.get_mut(i));
        row.map(|row| row.ahead = Some(pass.ahead)).is_some()
    }

    /// Writes `device.csv`; the numbers read back to the same bits.
    ///
    /// # Errors
    /// Those of the file.
    pub fn write_csv(&self, output: impl Write) -> io::Result<()> {
        let mut out = io::BufWriter::new(output);
        write_head(&mut out, self.first_ahead)?;
        for row in &self.rows {
            row.write_csv(&mut out)?;
        }
        out.flush()
    }

    /// Whether a file's beginning is that of a log rather than of a trajectory.
    #[must_use]
    pub fn is_log(bytes: &[u8]) -> bool {
        bytes.starts_with(COLUMNS.join(",").as_bytes())
    }

    /// Reads `device.csv` of a session with this scene. A last line that was cut off, as by a crash, is left out.
    ///
    /// # Errors
    /// [`LogError`] with file, line and cure.
    pub fn read_csv(bytes: &[u8], name: &str, scene: &Scene) -> Result<Self, LogError> {
        let fail = |line: Option<u64>, problem: String| LogError { file: name.to_owned(), line, problem };
        let mut reader = csv::Reader::from_reader(crate::recording::whole_lines(bytes));
        let header = reader.headers().map_err(|e| fail(None, e.to_string()))?;
        if header.iter().ne(COLUMNS) {
            return Err(fail(Some(1), "this is not a device.csv of hapteron".to_owned()));
        }
        let mut log = Self::new();
        for (index, record) in reader.records().enumerate() {
            let record = record.map_err(|e| fail(e.position().map(csv::Position::line), e.to_string()))?;
            let line = record.position().map(csv::Position::line);
            if index == 0 {
                log.first_ahead = number(&record, 18).map_err(|e| fail(line, e))?;
                continue;
            }
            let row = read_row(&record, scene).map_err(|e| fail(line, e))?;
            if row.contacts_of > log.rows.len() as u64 {
                return Err(fail(line, "contacts_of names a tick that has not been".to_owned()));
            }
            log.rows.push(row);
        }
        if log.rows.is_empty() {
            return Err(fail(None, "there are no ticks".to_owned()));
        }
        Ok(log)
    }

    /// Reads `device.csv` from a file.
    ///
    /// # Errors
    /// As [`Log::read_csv`], or when the file cannot be read.
    pub fn load(path: impl AsRef<Path>, scene: &Scene) -> Result<Self, LogError> {
        let name = path.as_ref().display().to_string();
        let bytes = std::fs::read(&path).map_err(|e| LogError {
            file: name.clone(),
            line: None,
            problem: format!("cannot read the log: {e}"),
        })?;
        Self::read_csv(&bytes, &name, scene)
    }
}

/// Of a column.
fn number(record: &csv::StringRecord, column: usize) -> Result<f64, String> {
    let word = record.get(column).unwrap_or_default();
    word.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
        let shown: String = word.chars().take(40).collect();
        format!("'{shown}' in column '{}' is not a finite number", COLUMNS[column])
    })
}

fn whole<T: std::str::FromStr>(record: &csv::StringRecord, column: usize) -> Result<T, String> {
    let word = record.get(column).unwrap_or_default();
    word.parse().map_err(|_| {
        let shown: String = word.chars().take(40).collect();
        format!("'{shown}' in column '{}' is not a number of its kind", COLUMNS[column])
    })
}

fn read_row(record: &csv::StringRecord, scene: &Scene) -> Result<LogRow, String> {
    let vector = |i: usize| -> Result<Vector3<f64>, String> {
        Ok(Vector3::new(number(record, i)?, number(record, i + 1)?, number(record, i + 2)?))
    };
    let q = Quaternion::new(number(record, 4)?, number(record, 5)?, number(record, 6)?, number(record, 7)?);
    if !((q.norm() - 1.0).abs() <= 1e-2) {
        return Err(format!("quaternion of length {}; it must be a unit quaternion", q.norm()));
    }
    let ahead = record.get(18).is_some_and(|word| !word.is_empty());
    let command = match record.get(19).unwrap_or_default() {
        "" => None,
        text => Some(command::from_text(text, scene)?),
    };
    Ok(LogRow {
        time: number(record, 0)?,
        sample: DeviceSample {
            time: number(record, 14)?,
            position: vector(1)?,
            // As it is: normalising would change its last bits.
            orientation: UnitQuaternion::new_unchecked(q),
            linear_velocity: vector(8)?,
            angular_velocity: vector(11)?,
            buttons: whole(record, 15)?,
        },
        flags: Flags::from_bits(whole(record, 16)?),
        contacts_of: whole(record, 17)?,
        ahead: if ahead { Some(number(record, 18)?) } else { None },
        command,
    })
}

/// What is wrong with a log.
#[derive(Debug, thiserror::Error)]
#[error("{file}{}: {problem}", .line.map(|l| format!(", line {l}")).unwrap_or_default())]
pub struct LogError {
    /// The file.
    pub file: String,
    /// Line, counted from 1.
    pub line: Option<u64>,
    /// What is wrong and what to do.
    pub problem: String,
}
