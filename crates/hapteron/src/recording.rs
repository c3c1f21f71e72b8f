//! Recordings of runs: one row a tick, as `run.csv`, and what they come to.

mod rows;
mod summary;

pub use rows::Rows;
pub(crate) use rows::whole_lines;
pub use summary::{Summarizer, Summary};

use crate::scene::Scene;
use crate::session::{ContactSnapshot, Flags, Tick};
use hapteron_dynamics::RigidBody;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use std::io::{self, Write};
use std::path::Path;

/// A run is unstable when the coupling deviation reaches this, metres (`experiments.md`, Fig. 2).
pub const GREATEST_DEVIATION: f64 = 0.1;
/// A run is unstable when the coupling angle reaches this, radians.
pub const GREATEST_ANGLE: f64 = 1.5;

/// Columns of `run.csv`.
pub const COLUMNS: [&str; 45] = [
    "t",
    "handle_px",
    "handle_py",
    "handle_pz",
    "handle_qw",
    "handle_qx",
    "handle_qy",
    "handle_qz",
    "body_px",
    "body_py",
    "body_pz",
    "body_qw",
    "body_qx",
    "body_qy",
    "body_qz",
    "body_vx",
    "body_vy",
    "body_vz",
    "body_wx",
    "body_wy",
    "body_wz",
    "coupling_fx",
    "coupling_fy",
    "coupling_fz",
    "coupling_tx",
    "coupling_ty",
    "coupling_tz",
    "contact_fx",
    "contact_fy",
    "contact_fz",
    "contact_tx",
    "contact_ty",
    "contact_tz",
    "feedback_fx",
    "feedback_fy",
    "feedback_fz",
    "feedback_tx",
    "feedback_ty",
    "feedback_tz",
    "deviation",
    "penetration",
    "contacts",
    "clusters",
    "contact_age",
    "flags",
];

/// One tick. SI units, world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Seconds.
    pub time: f64,
    /// The handle in the world's scale.
    pub handle: Isometry3<f64>,
    /// The body's mesh frame.
    pub body: Isometry3<f64>,
    /// Linear velocity of the mesh frame's origin and angular velocity.
    pub body_velocity: [Vector3<f64>; 2],
    /// Force and torque of the coupling on the body at its centre of mass.
    pub coupling: [Vector3<f64>; 2],
    /// Force and torque of the contacts on the body at its centre of mass.
    pub contact: [Vector3<f64>; 2],
    /// What the device was sent.
    pub feedback: [Vector3<f64>; 2],
    /// Coupling deviation, metres.
    pub deviation: f64,
    /// Greatest local depth, metres; not positive where the surfaces do not cross, and never below minus the tolerance d.
    pub penetration: f64,
    /// Of the query.
    pub contacts: u32,
    /// Planes made of them.
    pub clusters: u32,
    /// Seconds since the state that the contacts were found at.
    pub contact_age: f64,
    /// Anything unusual.
    pub flags: Flags,
}

impl Row {
    /// A tick's row.
    #[must_use]
    pub fn new(scene: &Scene, time: f64, tick: &Tick, penetration: f64, contacts: &ContactSnapshot) -> Self {
        let counts = (contacts.contacts(), contacts.clusters());
        Self::of_body(scene, &scene.body, time, tick, penetration, counts)
    }

    /// A tick's row with a body whose mass is not the scene's, and the numbers of contacts and of planes.
    #[must_use]
    pub fn of_body(
        scene: &Scene,
        of: &RigidBody,
        time: f64,
        tick: &Tick,
        penetration: f64,
        counts: (u32, u32),
    ) -> Self {
        let state = &tick.step.state;
        let body = scene.world_from_mesh(state);
        let omega = state.angular_velocity(of);
        let arm = body.translation.vector - state.position;
        Self {
            time,
            handle: Isometry3::from_parts(tick.handle.position.into(), tick.handle.orientation),
            body,
            body_velocity: [state.linear_velocity(of) + omega.cross(&arm), omega],
            coupling: [tick.step.coupling.force, tick.step.coupling.torque],
            contact: [tick.step.contact.force, tick.step.contact.torque],
            feedback: [tick.command.force, tick.command.torque],
            deviation: tick.step.deviation,
            penetration,
            contacts: counts.0,
            clusters: counts.1,
            contact_age: tick.contact_age,
            flags: tick.flags,
        }
    }

    /// Writes its line of `run.csv`; the numbers read back to the same bits.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write_csv(&self, output: &mut impl Write) -> io::Result<()> {
        for (i, number) in self.numbers().iter().enumerate() {
            write!(output, "{}{number}", if i == 0 { "" } else { "," })?;
        }
        writeln!(output, ",{},{},{},{}", self.contacts, self.clusters, self.contact_age, self.flags.bits())
    }

    fn numbers(&self) -> [f64; 41] {
        let mut numbers = [0.0; 41];
        let mut at = 0;
        let mut put = |values: &[f64]| {
            numbers[at..at + values.len()].copy_from_slice(values);
            at += values.len();
        };
        put(&[self.time]);
        for pose in [&self.handle, &self.body] {
            let (p, q) = (pose.translation.vector, pose.rotation);
            put(&[p.x, p.y, p.z, q.w, q.i, q.j, q.k]);
        }
        for pair in [&self.body_velocity, &self.coupling, &self.contact, &self.feedback] {
            for v in pair {
                put(v.as_slice());
            }
        }
        put(&[self.deviation, self.penetration]);
        numbers
    }

    fn from_numbers(n: &[f64; 45]) -> Self {
        let vector = |i: usize| Vector3::new(n[i], n[i + 1], n[i + 2]);
        let pose = |i: usize| {
            let q = Quaternion::new(n[i + 3], n[i + 4], n[i + 5], n[i + 6]);
            Isometry3::from_parts(Translation3::from(vector(i)), UnitQuaternion::new_unchecked(q))
        };
        let pair = |i: usize| [vector(i), vector(i + 3)];
        Self {
            time: n[0],
            handle: pose(1),
            body: pose(8),
            body_velocity: pair(15),
            coupling: pair(21),
            contact: pair(27),
            feedback: pair(33),
            deviation: n[39],
            penetration: n[40],
            contacts: n[41] as u32,
            clusters: n[42] as u32,
            contact_age: n[43],
            flags: Flags::from_bits(n[44] as u32),
        }
    }
}

/// Writes the first line of `run.csv`.
///
/// # Errors
/// Those of the output.
pub fn write_header(output: &mut impl Write) -> io::Result<()> {
    writeln!(output, "{}", COLUMNS.join(","))
}

/// A run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// One a tick.
    pub rows: Vec<Row>,
    /// Greatest coupling angle, radians (not a column of `run.csv`).
    pub greatest_angle: f64,
    /// When the fault came that keeps the forces away at the end, seconds; none when there was none, or each was re-armed.
    pub fault_time: Option<f64>,
    /// Whether the run was ended before its motion was.
    pub cancelled: bool,
}

impl Recording {
    /// Without rows.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a tick.
    pub fn push(&mut self, row: Row, tick: &Tick) {
        self.greatest_angle = self.greatest_angle.max(tick.step.angle);
        self.add(row);
    }

    fn add(&mut self, row: Row) {
        self.fault_time = row.flags.no_force().then(|| self.fault_time.unwrap_or(row.time));
        self.rows.push(row);
    }

    /// What it comes to.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let mut summary = Summarizer::default();
        self.rows.iter().for_each(|row| summary.push(row));
        summary.summary(self.greatest_angle)
    }

    /// Writes `run.csv`; the numbers read back to the same bits.
    ///
    /// # Errors
    /// Those of the file.
    pub fn write_csv(&self, output: impl Write) -> io::Result<()> {
        let mut output = io::BufWriter::new(output);
        write_header(&mut output)?;
        for row in &self.rows {
            row.write_csv(&mut output)?;
        }
        output.flush()
    }

    /// Reads `run.csv`. The greatest angle is not a column; it is zero. A last line that was cut off, as by a crash, is left out.
    ///
    /// # Errors
    /// [`RecordingError`] with file, line and cure.
    pub fn read_csv(bytes: &[u8], name: &str) -> Result<Self, RecordingError> {
        let mut recording = Self::new();
        for row in Rows::new(whole_lines(bytes), name)? {
            recording.add(row?);
        }
        if recording.rows.is_empty() {
            let problem = "there are no rows".to_owned();
            return Err(RecordingError { file: name.to_owned(), line: None, problem });
        }
        Ok(recording)
    }

    /// Reads `run.csv` from a file.
    ///
    /// # Errors
    /// As [`Recording::read_csv`], or when the file cannot be read.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        let name = path.as_ref().display().to_string();
        let bytes = std::fs::read(&path).map_err(|e| RecordingError {
            file: name.clone(),
            line: None,
            problem: format!("cannot read the recording: {e}"),
        })?;
        Self::read_csv(&bytes, &name)
    }
}

/// What is wrong with a recording.
#[derive(Debug, thiserror::Error)]
#[error("{file}{}: {problem}", .line.map(|l| format!(", line {l}")).unwrap_or_default())]
pub struct RecordingError {
    /// The file.
    pub file: String,
    /// Line, counted from 1.
    pub line: Option<u64>,
    /// What is wrong and what to do.
    pub problem: String,
}
