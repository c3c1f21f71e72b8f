//! What is recorded, how it is saved, and how it is made again.

use super::history::History;
use super::values::Values;
use hapteron::dynamics::State;
use hapteron::recording::{Recording, Row};
use hapteron::scene::Scene;
use hapteron::session::real_time::TickRecord;
use hapteron::trajectory::{PoseRow, Trajectory};
use nalgebra::Isometry3;
use std::path::{Path, PathBuf};

/// Longest recording: ten minutes at 1 kHz, some 300 megabytes.
const LONGEST: usize = 600_000;

/// A recording that is being made.
pub struct Recorder {
    rows: History,
    hand: Vec<PoseRow>,
    start: Option<State>,
    /// As they were when it began.
    values: Values,
}

impl Recorder {
    /// Begins with the next tick.
    #[must_use]
    pub fn new(values: Values) -> Self {
        Self { rows: History::keeping(LONGEST), hand: Vec::new(), start: None, values }
    }

    /// Adds a tick.
    pub fn push(&mut self, record: &TickRecord, row: Row) {
        if self.rows.is_full() {
            return;
        }
        self.start.get_or_insert(record.result.after.state);
        let handle = &record.result.handle;
        self.hand.push(PoseRow {
            time: record.time,
            pose: Isometry3::from_parts(handle.position.into(), handle.orientation),
            velocity: Some([handle.linear_velocity, handle.angular_velocity]),
        });
        self.rows.push(record.tick, row);
    }

    /// See [`History::correct`].
    pub fn correct(&mut self, tick: u64, penetration: f64) {
        self.rows.correct(tick, penetration);
    }

    /// Seconds so far.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.rows.span().map_or(0.0, |[from, to]| to - from)
    }

    /// Ends it; nothing when it has fewer than two ticks.
    #[must_use]
    pub fn finish(self) -> Option<Recorded> {
        let start = self.start?;
        let first = self.hand.first()?.time;
        let hand: Vec<PoseRow> =
            self.hand.into_iter().map(|row| PoseRow { time: row.time - first, ..row }).collect();
        let motion = Trajectory::from_rows(hand, "the recording").ok()?;
        let mut recording = Recording::new();
        recording.rows = self.rows.rows().copied().collect();
        Some(Recorded { recording, motion, start, values: self.values })
    }
}

/// A recording.
pub struct Recorded {
    recording: Recording,
    motion: Trajectory,
    start: State,
    values: Values,
}

impl Recorded {
    /// Seconds.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.motion.duration()
    }

    /// The scene that makes it again: the same start and the same hand, with the values given now.
    ///
    /// # Errors
    /// Numbers that no coupling or body has.
    pub fn scene(&self, scene: &Scene, values: &Values) -> Result<Scene, hapteron::session::CommandError> {
        let mut again = values.applied_to(scene)?;
        let ratio = values.mass / self.values.mass;
        again.start = self.start;
        again.start.linear_momentum *= ratio;
        again.start.angular_momentum *= ratio;
        again.trajectory = self.motion.clone();
        again.hand = None;
        Ok(again)
    }

    /// Writes `run.csv`, `hand.csv` and a `scene.toml` that makes it again in virtual time into a new folder. Answers the folder.
    ///
    /// # Errors
    /// Those of the files, in words.
    pub fn save(&self, scene: &Scene) -> Result<PathBuf, String> {
        let folder = free_folder(scene.name());
        let text = |path: &Path, e: std::io::Error| format!("cannot write {}: {e}", path.display());
        std::fs::create_dir_all(&folder).map_err(|e| text(&folder, e))?;
        let path = folder.join("run.csv");
        let file = std::fs::File::create(&path).map_err(|e| text(&path, e))?;
        self.recording.write_csv(file).map_err(|e| text(&path, e))?;
        let path = folder.join("hand.csv");
        std::fs::write(&path, self.hand_csv()).map_err(|e| text(&path, e))?;
        let path = folder.join("scene.toml");
        std::fs::write(&path, self.scene_toml(scene, &folder)?).map_err(|e| text(&path, e))?;
        Ok(folder)
    }

    /// The hand's motion with its velocities, as scenes take it.
    fn hand_csv(&self) -> String {
        let mut text = "t,px,py,pz,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n".to_owned();
        for row in self.motion.rows() {
            let (p, q) = (row.pose.translation.vector, row.pose.rotation);
            let [v, w] = row.velocity.unwrap_or_default();
            let numbers = [row.time, p.x, p.y, p.z, q.w, q.i, q.j, q.k, v.x, v.y, v.z, w.x, w.y, w.z];
            let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
            text += &words.join(",");
            text.push('\n');
        }
        text
    }

    fn scene_toml(&self, scene: &Scene, folder: &Path) -> Result<String, String> {
        let mut again = self.scene(scene, &self.values).map_err(|e| e.to_string())?;
        let pose = again.world_from_mesh(&again.start);
        let body = &mut again.file.body;
        body.position = Some(pose.translation.vector.into());
        let q = pose.rotation;
        body.orientation = Some([q.w, q.i, q.j, q.k]);
        let omega = self.start.angular_velocity(&again.body);
        let arm = pose.translation.vector - self.start.position;
        body.linear_velocity = Some((self.start.linear_velocity(&again.body) + omega.cross(&arm)).into());
        body.angular_velocity = Some(omega.into());
        let hand = folder.join("hand.csv");
        let hand = std::path::absolute(&hand).unwrap_or(hand);
        again.file.hand = hapteron::scene::file::Hand {
            trajectory: Some(hand.display().to_string()),
            ..Default::default()
        };
        again.to_toml().map_err(|e| e.to_string())
    }
}

/// Whether a scene's motion does not move.
#[must_use]
pub fn is_still(scene: &Scene) -> bool {
    scene.trajectory.rows().windows(2).all(|w| w[0].pose == w[1].pose)
}

/// `runs/live-NAME`, or numbered when it exists.
fn free_folder(name: &str) -> PathBuf {
    let plain: String = name.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
    let first = Path::new("runs").join(format!("live-{plain}"));
    let numbered = (2..).map(|n| Path::new("runs").join(format!("live-{plain}-{n}")));
    std::iter::once(first.clone()).chain(numbered).find(|p| !p.exists()).unwrap_or(first)
}

/// Writes rows as `run.csv` into a new file in `runs`. Answers the file.
///
/// # Errors
/// Those of the file, in words.
pub fn save_rows<'a>(rows: impl Iterator<Item = &'a Row>, name: &str) -> Result<PathBuf, String> {
    let folder = free_folder(name);
    let path = folder.join("run.csv");
    let text = |e: std::io::Error| format!("cannot write {}: {e}", path.display());
    std::fs::create_dir_all(&folder).map_err(text)?;
    let mut recording = Recording::new();
    recording.rows = rows.copied().collect();
    recording.write_csv(std::fs::File::create(&path).map_err(text)?).map_err(text)?;
    Ok(path)
}
