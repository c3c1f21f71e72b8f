//! Motions of the handle, read from CSV (`t,px,py,pz,qw,qx,qy,qz` and optionally `vx,vy,vz,wx,wy,wz`), or from a `run.csv`.

use hapteron_device::DeviceSample;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use std::path::Path;

/// Times closer than this are the same, seconds.
const SAME_TIME: f64 = 1e-9;
/// A quaternion may be off unit length by this much before it is refused.
const UNIT_TOLERANCE: f64 = 1e-2;
const POSE: [&str; 8] = ["t", "px", "py", "pz", "qw", "qx", "qy", "qz"];
const VELOCITY: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];

/// What is wrong with a table of poses: file, line, cure.
#[derive(Debug, thiserror::Error)]
#[error("{file}{}: {problem}", .line.map(|l| format!(", line {l}")).unwrap_or_default())]
pub struct TrajectoryError {
    /// The file.
    pub file: String,
    /// Line, counted from 1.
    pub line: Option<u64>,
    /// What is wrong and what to do.
    pub problem: String,
}

/// A pose with the time it was taken and, where the table has them, the velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseRow {
    /// Seconds.
    pub time: f64,
    /// Of the handle, or of a mesh frame, in the world.
    pub pose: Isometry3<f64>,
    /// Linear (m/s) and angular (rad/s, world axes).
    pub velocity: Option<[Vector3<f64>; 2]>,
}

/// Reads a table of poses; the header is required, unknown columns are ignored.
///
/// # Errors
/// A table that cannot be read, lacks a column, or holds a number that is none or not finite, or a quaternion far from unit length.
pub fn read_poses(bytes: &[u8], name: &str) -> Result<Vec<PoseRow>, TrajectoryError> {
    Ok(read_with_lines(bytes, name)?.0)
}

/// The rows, and the line of each.
type RowsWithLines = (Vec<PoseRow>, Vec<Option<u64>>);

fn read_with_lines(bytes: &[u8], name: &str) -> Result<RowsWithLines, TrajectoryError> {
    let fail = |line: Option<u64>, problem: String| TrajectoryError { file: name.to_owned(), line, problem };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
    let header = reader.headers().map_err(|e| fail(None, e.to_string()))?.clone();
    // A run.csv can be replayed: the handle's columns there have a prefix.
    let find = |wanted: &str| header.iter().position(|h| h == wanted);
    let recorded = find("px").is_none() && find("handle_px").is_some();
    let column = |wanted: &str| {
        if recorded && wanted != "t" { find(&format!("handle_{wanted}")) } else { find(wanted) }
    };
    let mut columns = Vec::with_capacity(14);
    for wanted in POSE {
        let Some(index) = column(wanted) else {
            return Err(fail(
                Some(1),
                format!("column '{wanted}' is missing; the header must be '{}'", POSE.join(",")),
            ));
        };
        columns.push(index);
    }
    let velocities: Vec<usize> = VELOCITY.iter().filter_map(|c| column(c)).collect();
    if velocities.len() == VELOCITY.len() {
        columns.extend(velocities);
    }
    let (mut rows, mut lines) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(|e| fail(e.position().map(csv::Position::line), e.to_string()))?;
        let line = record.position().map(csv::Position::line);
        let mut v = [0.0; 14];
        for (value, &index) in v.iter_mut().zip(&columns) {
            let word = record.get(index).unwrap_or_default();
            *value = word.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
                let shown: String = word.chars().take(40).collect();
                fail(
                    line,
                    format!(
                        "'{shown}' in column '{}' is not a finite number",
                        header.get(index).unwrap_or_default()
                    ),
                )
            })?;
        }
        let q = Quaternion::new(v[4], v[5], v[6], v[7]);
        if !((q.norm() - 1.0).abs() <= UNIT_TOLERANCE) {
            return Err(fail(
                line,
                format!("quaternion of length {}; it must be a unit quaternion qw,qx,qy,qz", q.norm()),
            ));
        }
        let pose =
            Isometry3::from_parts(Translation3::new(v[1], v[2], v[3]), UnitQuaternion::new_normalize(q));
        let velocity = (columns.len() == 14)
            .then(|| [Vector3::new(v[8], v[9], v[10]), Vector3::new(v[11], v[12], v[13])]);
        rows.push(PoseRow { time: v[0], pose, velocity });
        lines.push(line);
    }
    Ok((rows, lines))
}

/// A motion of the handle over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    rows: Vec<PoseRow>,
}

impl Trajectory {
    /// Reads a motion.
    ///
    /// # Errors
    /// As [`read_poses`], and when there are fewer than two rows or the times do not rise from row to row.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self, TrajectoryError> {
        let (rows, lines) = read_with_lines(bytes, name)?;
        Self::checked(rows, name, |row| lines[row])
    }

    /// Reads a motion from a file.
    ///
    /// # Errors
    /// As [`Trajectory::parse`], or when the file cannot be read.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, TrajectoryError> {
        let name = path.as_ref().display().to_string();
        let bytes = std::fs::read(&path).map_err(|e| TrajectoryError {
            file: name.clone(),
            line: None,
            problem: format!("cannot read the trajectory: {e}"),
        })?;
        Self::parse(&bytes, &name)
    }

    /// A motion from rows; `name` stands for the file in errors.
    ///
    /// # Errors
    /// Fewer than two rows, or times that do not rise.
    pub fn from_rows(rows: Vec<PoseRow>, name: &str) -> Result<Self, TrajectoryError> {
        // One line for the header, and lines count from 1.
        Self::checked(rows, name, |row| Some(row as u64 + 2))
    }

    fn checked(
        rows: Vec<PoseRow>,
        name: &str,
        line: impl Fn(usize) -> Option<u64>,
    ) -> Result<Self, TrajectoryError> {
        let fail = |line, problem: String| TrajectoryError { file: name.to_owned(), line, problem };
        if rows.len() < 2 {
            let text = format!("{} rows; a trajectory needs at least two", rows.len());
            return Err(fail(None, text));
        }
        for (index, pair) in rows.windows(2).enumerate() {
            if pair[1].time <= pair[0].time + SAME_TIME {
                let text = format!(
                    "time {} does not come after {}; sort the rows and drop repeated times",
                    pair[1].time, pair[0].time
                );
                return Err(fail(line(index + 1), text));
            }
        }
        Ok(Self { rows })
    }

    /// The rows.
    #[must_use]
    pub fn rows(&self) -> &[PoseRow] {
        &self.rows
    }

    /// Time of the first row, seconds.
    #[must_use]
    pub fn start(&self) -> f64 {
        self.rows[0].time
    }

    /// From the first to the last row, seconds.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.rows[self.rows.len() - 1].time - self.rows[0].time
    }

    /// The handle at a time since the first row: a row that falls on it as it is, else between its neighbours; before the first
    /// and after the last row it stands there. Without velocity columns the velocity is the backward difference over `dt`.
    #[must_use]
    pub fn sample(&self, time: f64, dt: f64) -> DeviceSample {
        let (pose, velocity) = self.at(time);
        let [linear_velocity, angular_velocity] = velocity.unwrap_or_else(|| {
            let (before, _) = self.at(time - dt);
            let turn = pose.rotation * before.rotation.inverse();
            [(pose.translation.vector - before.translation.vector) / dt, turn.scaled_axis() / dt]
        });
        DeviceSample {
            time,
            position: pose.translation.vector,
            orientation: pose.rotation,
            linear_velocity,
            angular_velocity,
            buttons: 0,
        }
    }

    fn at(&self, time: f64) -> (Isometry3<f64>, Option<[Vector3<f64>; 2]>) {
        let wanted = time + self.start();
        let after = self.rows.partition_point(|r| r.time < wanted - SAME_TIME);
        let still = |row: &PoseRow| (row.pose, row.velocity.map(|_| [Vector3::zeros(); 2]));
        let Some(b) = self.rows.get(after) else {
            return still(&self.rows[self.rows.len() - 1]);
        };
        if (b.time - wanted).abs() <= SAME_TIME {
            return (b.pose, b.velocity);
        }
        let Some(a) = after.checked_sub(1).map(|i| &self.rows[i]) else {
            return still(b);
        };
        let f = (wanted - a.time) / (b.time - a.time);
        let turn = (b.pose.rotation * a.pose.rotation.inverse()).scaled_axis();
        let rotation = UnitQuaternion::from_scaled_axis(turn * f) * a.pose.rotation;
        let position = a.pose.translation.vector.lerp(&b.pose.translation.vector, f);
        let velocity = match (a.velocity, b.velocity) {
            (Some(u), Some(v)) => Some([u[0].lerp(&v[0], f), u[1].lerp(&v[1], f)]),
            _ => None,
        };
        (Isometry3::from_parts(position.into(), rotation), velocity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "t,px,py,pz,qw,qx,qy,qz\n";

    fn error(text: &str) -> String {
        Trajectory::parse(text.as_bytes(), "x.csv").unwrap_err().to_string()
    }

    #[test]
    fn rows_on_a_tick_are_used_as_they_are_and_others_lie_between() {
        let text =
            format!("{HEADER}0,0,0,0,1,0,0,0\n0.002,0.001,0,0,0.7071067811865476,0,0,0.7071067811865476\n");
        let t = Trajectory::parse(text.as_bytes(), "x").unwrap();
        assert_eq!(t.sample(0.002, 1e-3).position.x, 0.001);
        let middle = t.sample(0.001, 1e-3);
        assert!((middle.position.x - 0.0005).abs() < 1e-15);
        assert!((middle.orientation.angle() - std::f64::consts::FRAC_PI_4).abs() < 1e-12);
        assert!((middle.linear_velocity.x - 0.5).abs() < 1e-12);
        assert!((middle.angular_velocity.z - std::f64::consts::FRAC_PI_4 / 1e-3).abs() < 1e-6);
        assert_eq!(t.sample(1.0, 1e-3).linear_velocity, Vector3::zeros());
    }

    #[test]
    fn opposite_quaternions_do_not_make_the_handle_spin() {
        let text = format!("{HEADER}0,0,0,0,1,0,0,0\n0.1,0,0,0,-1,0,0,0\n");
        let t = Trajectory::parse(text.as_bytes(), "x").unwrap();
        assert!(t.sample(0.05, 1e-3).angular_velocity.norm() < 1e-9);
    }

    #[test]
    fn faults_name_the_line_and_the_cure() {
        let row = "0,0,0,0,1,0,0,0\n";
        assert!(error(&format!("{HEADER}{row}")).contains("at least two"));
        assert!(error(&format!("{HEADER}{row}0.1,0,0,0,1,0,0,0\n0.05,0,0,0,1,0,0,0\n")).contains("line 4"));
        let commented = format!("{HEADER}# a\n\n{row}# b\n0.1,0,0,0,1,0,0,0\n0.05,0,0,0,1,0,0,0\n");
        assert!(error(&commented).contains("line 7"));
        assert!(error(&format!("{HEADER}{row}0.1,0,NaN,0,1,0,0,0\n")).contains("column 'py'"));
        assert!(error(&format!("{HEADER}{row}0.1,0,0,0,3,0,0,0\n")).contains("unit quaternion"));
        assert!(error("t,px,py\n0,0,0\n").contains("'pz' is missing"));
        assert!(error("").contains("'t' is missing"));
    }
}
