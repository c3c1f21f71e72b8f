//! A session with the window's hand, and what the window keeps of it.

use super::hand::{HandControl, Hold, Source, WindowHand, Wish};
use super::history::History;
use super::kept::Kept;
use super::recorder::Recorder;
use super::values::Values;
use crate::view::Spot;
use hapteron::device::drivers::{self, OpenError};
use hapteron::device::{Device, Scaling};
use hapteron::dynamics::{ContactPlane, RigidBody};
use hapteron::recording::Row;
use hapteron::scene::{Scene, SceneError};
use hapteron::session::real_time::{
    End, Grants, PassRecord, RealTime, RealTimeOptions, Running, StartError, TickRecord, Timing, Told,
};
use hapteron::session::{Command, CommandError, Flags, LevelsInUse};
use hapteron::trajectory::{PoseRow, Trajectory, TrajectoryError};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use std::sync::Arc;

/// Ticks that may wait for the window: eight seconds without a picture.
const ROOM: usize = 8192;

/// Why a session could not be had.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The threads or the device.
    #[error("{0}")]
    Start(#[from] StartError),
    /// The motion of the hand.
    #[error("{0}")]
    Motion(#[from] TrajectoryError),
    /// The device cannot be opened.
    #[error("{0}")]
    Driver(#[from] OpenError),
    /// The guard.
    #[error("{0}")]
    Guard(#[from] SceneError),
}

/// How the device's workspace lies in the world, as the session has put it.
#[derive(Clone, Copy, Debug)]
struct Index {
    offset: Vector3<f64>,
    turn: UnitQuaternion<f64>,
}

/// A scene that runs, or has run.
pub struct Session {
    scene: Arc<Scene>,
    running: Option<Running>,
    ended: Option<End>,
    timing: Timing,
    grants: Grants,
    control: HandControl,
    wish: Wish,
    index: Index,
    /// Length of the motion that the hand can make, seconds.
    motion: f64,
    /// The device's name, when it is not the window's hand.
    driver: Option<String>,
    latest: Option<TickRecord>,
    /// As its mass has been set.
    body: RigidBody,
    spots: Vec<Spot>,
    /// Contact levels in use, while somebody looks at them.
    levels: Option<LevelsInUse>,
    /// How ticks kept their time, while somebody counts.
    kept: Option<Vec<Kept>>,
    /// The session has put the workspace elsewhere.
    moved: bool,
    /// Pose of the coupling frame in the body's mesh frame, as it was grasped last.
    grasp: Isometry3<f64>,
    held: bool,
}

impl Session {
    /// Starts a scene; the hand can make the scene's motion. With `play` it does so at once, and is followed exactly.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn start(scene: Arc<Scene>, hold: Hold, play: bool) -> Result<Self, SessionError> {
        let wish = first_wish(&scene, hold, play);
        let motion = in_device_scale(&scene.trajectory, scale_of(&scene))?;
        let (control, device) = WindowHand::new(wish, Some(motion));
        Self::launch(scene, Box::new(device), control, wish, None)
    }

    /// Starts a scene with a real device, or one without motors that a driver has opened.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn start_device(scene: Arc<Scene>, device: Box<dyn Device>) -> Result<Self, SessionError> {
        let mut scene = Scene::clone(&scene);
        scene.adopt(device.capabilities())?;
        let name = device.capabilities().name.clone();
        let wish = first_wish(&scene, Hold::Exact, false);
        // No one listens to the control of a hand that is not the device.
        let (control, _) = WindowHand::new(wish, None);
        Self::launch(Arc::new(scene), device, control, wish, Some(name))
    }

    fn launch(
        scene: Arc<Scene>,
        device: Box<dyn Device>,
        control: HandControl,
        wish: Wish,
        driver: Option<String>,
    ) -> Result<Self, SessionError> {
        let mut options = RealTimeOptions::of(&scene);
        options.room = ROOM;
        // The window's hand begins where the scene says that the handle is; another device is put there.
        options.attach = driver.is_some();
        let running = RealTime::start(Arc::clone(&scene), device, options)?;
        let grants = running.grants().clone();
        let motion = scene.trajectory.duration();
        let (body, grasp) = (scene.body, crate::view::grasp(&scene));
        let index = Index { offset: Vector3::zeros(), turn: UnitQuaternion::identity() };
        Ok(Self {
            scene,
            running: Some(running),
            ended: None,
            timing: Timing::default(),
            grants,
            control,
            wish,
            index,
            motion,
            driver,
            latest: None,
            body,
            spots: Vec::new(),
            levels: None,
            kept: None,
            moved: false,
            grasp,
            held: true,
        })
    }

    /// The device's name, when it is not the window's hand.
    #[must_use]
    pub fn driver(&self) -> Option<&str> {
        self.driver.as_deref()
    }

    /// Takes what has happened since the last picture.
    pub fn poll(&mut self, history: &mut History, recorder: Option<&mut Recorder>) {
        let Some(running) = &mut self.running else { return };
        let (scene, body) = (&self.scene, &mut self.body);
        let (held, grasp) = (&mut self.held, &mut self.grasp);
        let mut newest = None;
        let mut found: Vec<PassRecord> = Vec::new();
        let mut recorder = recorder;
        let kept = &mut self.kept;
        running.drain(&mut |told| match told {
            Told::Tick(record) => {
                if let Some(Command::SetMass(changed)) = &record.command {
                    *body = *changed;
                }
                // The penetration is filled in when a pass has looked at it.
                let depth = -scene.contact.tolerance;
                let row = Row::of_body(scene, body, record.time, &record.result, depth, record.counts);
                history.push(record.tick, row);
                let holds = !record.result.flags.contains(Flags::RELEASED);
                if holds && !*held {
                    *grasp = row.body.inverse() * row.handle;
                }
                *held = holds;
                if let Some(recorder) = &mut recorder {
                    recorder.push(record, row);
                }
                if let Some(kept) = kept {
                    kept.push(Kept::of(record));
                }
                newest = Some(*record);
            }
            Told::Pass(pass) => found.push(*pass),
        });
        for pass in &found {
            let penetration = (-pass.min_distance).max(-scene.contact.tolerance);
            history.correct(pass.of_tick, penetration);
            if let Some(recorder) = &mut recorder {
                recorder.correct(pass.of_tick, penetration);
            }
        }
        if let Some(record) = newest {
            self.latest = Some(record);
            let index = index_of(&record, &scene.scaling);
            let moved = (index.offset - self.index.offset).norm() > 1e-7;
            self.moved |= moved || index.turn.angle_to(&self.index.turn) > 1e-6;
            self.index = index;
        }
        let latest = *running.latest();
        let state = latest.result.after.state;
        self.spots.clear();
        self.spots.extend(running.contacts().planes().iter().map(|p| spot(p, &state)));
        if let Some(levels) = &mut self.levels {
            levels.clone_from(running.levels());
        }
        self.timing = running.timing();
        if running.is_over() {
            self.stop();
        }
    }

    /// Zero force, and the end.
    pub fn stop(&mut self) {
        if let Some(running) = self.running.take() {
            let finished = running.stop();
            self.ended = Some(finished.end);
            self.timing = finished.timing;
        }
    }

    /// Why it ended, when it has.
    #[must_use]
    pub fn ended(&self) -> Option<&End> {
        self.ended.as_ref()
    }

    /// Tells the session something.
    ///
    /// # Errors
    /// [`CommandError`].
    pub fn send(&mut self, command: Command) -> Result<(), CommandError> {
        match &mut self.running {
            Some(running) => running.send(command),
            None => Err(CommandError::Ended),
        }
    }

    /// Tells the session which values have changed.
    ///
    /// # Errors
    /// [`CommandError`] of the first that it cannot have.
    pub fn change(&mut self, values: &Values, before: &Values) -> Result<(), CommandError> {
        for command in values.commands(before, &Arc::clone(&self.scene)) {
            self.send(command?)?;
        }
        Ok(())
    }

    /// Where the handle should go (world), what moves it, and how it is held.
    pub fn steer(&mut self, goal: &Isometry3<f64>, source: Source, hold: Hold, repeat: bool) {
        let place = (goal.translation.vector - self.index.offset) / scale_of(&self.scene);
        let pose = Isometry3::from_parts(place.into(), goal.rotation * self.index.turn.inverse());
        let wish = Wish { pose, source, hold, repeat, ..self.wish };
        if wish != self.wish {
            self.wish = wish;
            self.control.tell(wish);
        }
    }

    /// Begins the motion anew.
    pub fn restart_motion(&mut self) {
        self.wish.start = self.wish.start.wrapping_add(1);
        self.control.tell(self.wish);
    }

    /// Length of the hand's motion, seconds.
    #[must_use]
    pub fn motion(&self) -> f64 {
        self.motion
    }

    /// The newest tick.
    #[must_use]
    pub fn latest(&self) -> Option<&TickRecord> {
        self.latest.as_ref()
    }

    /// Contacts as they were found last.
    #[must_use]
    pub fn spots(&self) -> &[Spot] {
        &self.spots
    }

    /// Whether the contact levels in use are wanted.
    pub fn watch_levels(&mut self, on: bool) {
        if on != self.levels.is_some()
            && let Some(running) = &mut self.running
        {
            running.watch_levels(on);
            self.levels = on.then(LevelsInUse::default);
        }
    }

    /// The contact levels in use, when they are wanted.
    #[must_use]
    pub fn levels(&self) -> Option<&LevelsInUse> {
        self.levels.as_ref()
    }

    /// How the ticks since the last call have kept their time; from the first call on.
    pub fn take_kept(&mut self) -> Vec<Kept> {
        self.kept.replace(Vec::new()).unwrap_or_default()
    }

    /// Whether the hand holds the body.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.held
    }

    /// Pose of the coupling frame in the body's mesh frame.
    #[must_use]
    pub fn grasp(&self) -> Isometry3<f64> {
        self.grasp
    }

    /// Whether the session has put the workspace elsewhere since this was asked last: where the pointer wanted the handle is past.
    pub fn take_moved(&mut self) -> bool {
        std::mem::take(&mut self.moved)
    }

    /// Histograms and counts.
    #[must_use]
    pub fn timing(&self) -> &Timing {
        &self.timing
    }

    /// What the system granted.
    #[must_use]
    pub fn grants(&self) -> &Grants {
        &self.grants
    }
}

/// Opens a device, as the scene says where it names that kind. Set-up: may take seconds.
///
/// # Errors
/// [`SessionError::Driver`].
pub(super) fn open_device(scene: &Scene, kind: &str) -> Result<Box<dyn Device>, SessionError> {
    let own = scene.driver().filter(|(asked, _)| *asked == kind).map(|(_, options)| options);
    Ok(drivers::open(kind, &own.unwrap_or_default())?)
}

/// The hand where the scene has it at the start.
fn first_wish(scene: &Scene, hold: Hold, play: bool) -> Wish {
    let first = scene.scaling.from_world(&scene.trajectory.sample(0.0, scene.time_step));
    Wish {
        pose: Isometry3::from_parts(first.position.into(), first.orientation),
        source: if play { Source::Motion } else { Source::Pointer },
        hold,
        start: 0,
        repeat: false,
    }
}

/// The handle's way from the device into the world, as a tick has taken it.
fn index_of(record: &TickRecord, scaling: &Scaling) -> Index {
    let scaled = scaling.to_world(&record.sample);
    let handle = &record.result.handle;
    Index {
        offset: handle.position - scaled.position,
        turn: scaled.orientation.inverse() * handle.orientation,
    }
}

/// A plane as it is shown at a state.
pub(super) fn spot(plane: &ContactPlane, state: &hapteron::dynamics::State) -> Spot {
    let point = state.position + state.unit_quaternion() * plane.point_b;
    Spot {
        point: Point3::from(point),
        normal: plane.normal_w,
        depth: plane.normal_w.dot(&point) - plane.offset,
    }
}

/// Metres in the world for one metre of the device.
pub(super) fn scale_of(scene: &Scene) -> f64 {
    scene.file.device.position_scale.unwrap_or(1.0)
}

/// A motion as a device would make it.
fn in_device_scale(motion: &Trajectory, factor: f64) -> Result<Trajectory, TrajectoryError> {
    let row = |r: &PoseRow| PoseRow {
        pose: Isometry3::from_parts((r.pose.translation.vector / factor).into(), r.pose.rotation),
        velocity: r.velocity.map(|[v, w]| [v / factor, w]),
        ..*r
    };
    Trajectory::from_rows(motion.rows().iter().map(row).collect(), "the motion of the hand")
}
