//! Scenes: what is held, what it touches, how, and by which hand.
//!
//! A scene is read from TOML ([`file::SceneFile`], every key of which is optional but the meshes), checked, and resolved: the
//! meshes are loaded, what is missing is filled in, and [`Scene::to_toml`] gives back a file with every value written out, from which
//! the same scene comes bit for bit. Set-up only; nothing here runs in the haptic tick.

mod closed_loop;
mod error;
pub mod file;
mod read;
mod resolve;

pub use error::SceneError;
pub use file::{ContactModel, SceneFile};

use crate::session::grasp::Buttons;
use crate::trajectory::Trajectory;
use error::Source;
use hapteron_collision::Surface;
use hapteron_collision::clod::{Detail, Hierarchy, Lod, Progress};
use hapteron_collision::mesh::TriMesh;
use hapteron_device::drivers::{self, DriverOptions};
use hapteron_device::guard::{Guard, GuardSettings};
use hapteron_device::simulated::SimulatedSettings;
use hapteron_device::{Capabilities, DeviceSample, HandParameters, Scaling};
use hapteron_dynamics::{Coupling, Handle, Method, RigidBody, State};
use nalgebra::{Isometry3, Vector3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A mesh with the structure that queries need.
#[derive(Clone, Debug)]
pub struct Model {
    /// Scaled to metres.
    pub mesh: TriMesh,
    /// Of the mesh, for queries.
    pub surface: Surface,
    /// Its contact levels of detail, where the scene has an error threshold.
    pub hierarchy: Option<Arc<Hierarchy>>,
}

impl Model {
    /// Surface and levels, where there are levels.
    #[must_use]
    pub fn lod(&self) -> Option<Lod<'_>> {
        self.hierarchy.as_deref().map(|hierarchy| Lod { surface: &self.surface, hierarchy })
    }
}

/// A fixed object.
#[derive(Clone, Debug)]
pub struct PlacedObstacle {
    /// Its shape.
    pub model: Model,
    /// Where it is.
    pub world_from_mesh: Isometry3<f64>,
}

/// How contacts become forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSettings {
    /// k of each plane, N/m.
    pub stiffness: f64,
    /// b of each plane, N s/m.
    pub damping: f64,
    /// d, metres.
    pub tolerance: f64,
    /// How coarse contacts may be.
    pub detail: Detail,
    /// Most clusters; 0: every contact is a plane of its own.
    pub max_clusters: usize,
    /// Contacts farther than this from a cluster found one of their own, metres.
    pub cluster_radius: f64,
    /// How the haptic thread uses them.
    pub model: ContactModel,
    /// Metres beyond d; none: from the speed, see [`crate::session`].
    pub anticipation: Option<f64>,
    /// From the start of one contact pass to the next, seconds.
    pub period: f64,
    /// From the start of a pass until its contacts can be used, seconds.
    pub latency: f64,
}

/// A scene that is complete and valid.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Every value, as [`Scene::to_toml`] writes it.
    pub file: SceneFile,
    /// The grasped object.
    pub body: RigidBody,
    /// Its shape.
    pub model: Model,
    /// Of the body, mesh frame, metres.
    pub center_of_mass: Vector3<f64>,
    /// What it touches.
    pub obstacles: Vec<PlacedObstacle>,
    /// Between handle and body.
    pub coupling: Coupling,
    /// Contact.
    pub contact: ContactSettings,
    /// World, m/s^2.
    pub gravity: Vector3<f64>,
    /// Integration method.
    pub method: Method,
    /// Of the haptic thread, seconds.
    pub time_step: f64,
    /// Between device and world.
    pub scaling: Scaling,
    /// Those of the device that grasp and clutch.
    pub buttons: Buttons,
    /// The motion of the handle (or of the hand's goal), in the world's scale.
    pub trajectory: Trajectory,
    /// A simulated hand; without, the handle follows the trajectory exactly.
    pub hand: Option<HandParameters>,
    /// The device that is simulated where there is a hand.
    pub simulated: SimulatedSettings,
    /// Its guard; none: switched off, or nobody feels the force.
    pub guard: Option<GuardSettings>,
    /// The body at the start.
    pub start: State,
}

/// What is changed in a scene as it is read.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// `table.key=value`, in this order.
    pub overrides: Vec<String>,
    /// A trajectory that the handle follows exactly instead of the scene's hand.
    pub replay: Option<PathBuf>,
}

impl Scene {
    /// Reads a scene and all it names.
    ///
    /// # Errors
    /// Whatever is wrong, with file, line, key and cure.
    pub fn load(path: impl AsRef<Path>, changes: &Changes) -> Result<Self, SceneError> {
        Self::load_with(path, changes, &mut |_| true)
    }

    /// As [`Scene::load`]; where contact levels have to be built, which takes up to minutes, `progress` is told the share of each model's that is done
    /// (0 to 1), and stops it all by answering `false`.
    ///
    /// # Errors
    /// As [`Scene::load`], and when it was stopped.
    pub fn load_with(
        path: impl AsRef<Path>,
        changes: &Changes,
        progress: &mut Progress<'_>,
    ) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|e| SceneError {
            file: name.clone(),
            line: None,
            key: None,
            problem: format!("cannot read the scene: {e}"),
        })?;
        let folder = path.parent().unwrap_or_else(|| Path::new("."));
        Self::parse_with(&text, &name, folder, changes, progress)
    }

    /// Reads a scene from text; `name` stands for the file in errors, and paths are relative to `folder`.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn parse(text: &str, name: &str, folder: &Path, changes: &Changes) -> Result<Self, SceneError> {
        Self::parse_with(text, name, folder, changes, &mut |_| true)
    }

    fn parse_with(
        text: &str,
        name: &str,
        folder: &Path,
        changes: &Changes,
        progress: &mut Progress<'_>,
    ) -> Result<Self, SceneError> {
        let source = Source { name: name.to_owned(), text: text.to_owned() };
        let mut file = read::read(&source, &changes.overrides)?;
        if let Some(replay) = &changes.replay {
            let path = std::path::absolute(replay).unwrap_or_else(|_| replay.clone());
            file.hand = file::Hand { trajectory: Some(path.display().to_string()), ..Default::default() };
        }
        resolve::resolve(&source, file, folder, progress)
    }

    /// Completes a scene that is not read from a file; paths are relative to the current folder.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn from_file(file: SceneFile) -> Result<Self, SceneError> {
        let name = file.scene.name.clone().unwrap_or_else(|| "scene".to_owned());
        resolve::resolve(&Source { name, text: String::new() }, file, Path::new("."), &mut |_| true)
    }

    /// The scene with every value written out.
    ///
    /// # Errors
    /// As [`SceneFile::to_toml`].
    pub fn to_toml(&self) -> Result<String, SceneError> {
        self.file.to_toml()
    }

    /// The scene's title.
    #[must_use]
    pub fn name(&self) -> &str {
        self.file.scene.name.as_deref().unwrap_or("scene")
    }

    /// Seconds.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.trajectory.duration()
    }

    /// A guard for a device, with the scene's limits where it has them, and never more than the device's. None: switched off, and the
    /// device is simulated; of a real one the limits stay ([`GuardSettings::limits_only`]).
    ///
    /// # Errors
    /// A limit out of its range.
    pub fn guard_for(&self, device: &Capabilities) -> Result<Option<Guard>, SceneError> {
        self.guard_of(device, self.driver().is_some())
    }

    fn guard_of(&self, device: &Capabilities, real: bool) -> Result<Option<Guard>, SceneError> {
        let fault = |e: hapteron_device::guard::GuardError| SceneError {
            file: self.name().to_owned(),
            line: None,
            key: Some(format!("guard.{}", e.0)),
            problem: e.to_string(),
        };
        let (keys, delay) = (&self.file.guard, self.simulated.delay);
        let settings = closed_loop::guard_settings(keys, device, true, delay, self.time_step);
        Guard::new(settings).map_err(fault)?;
        let settings = closed_loop::as_wanted(settings, keys.enabled != Some(false), real);
        settings.map(Guard::new).transpose().map_err(fault)
    }

    /// Takes the limits of a device that is open into the scene, for its guard and for [`Scene::to_toml`]. A scene that names no real device says nothing of a
    /// real one's guard, which is on then, although nobody may have felt anything so far.
    ///
    /// # Errors
    /// As [`Scene::guard_for`].
    pub fn adopt(&mut self, device: &Capabilities) -> Result<(), SceneError> {
        if self.driver().is_none() {
            self.file.guard.enabled = Some(true);
        }
        self.guard = self.guard_of(device, true)?.map(|guard| *guard.settings());
        if let Some(settings) = &self.guard {
            closed_loop::write_out(&mut self.file.guard, settings);
        }
        Ok(())
    }

    /// The driver and its options; none where the device is simulated. A library that calls the loop is asked to do so once a time step.
    #[must_use]
    pub fn driver(&self) -> Option<(&str, DriverOptions)> {
        let kind = self.file.device.kind.as_deref().filter(|kind| *kind != closed_loop::SIMULATED)?;
        let mut options = DriverOptions::new();
        if kind == drivers::CALLED_BY_THE_LIBRARY {
            options.set("rate", (1.0 / self.time_step).round());
        }
        for (key, value) in &self.file.device.options {
            // A text without its quotes.
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            options.set(key.clone(), text);
        }
        Some((kind, options))
    }

    /// The pose of the body's mesh frame at a state.
    #[must_use]
    pub fn world_from_mesh(&self, state: &State) -> Isometry3<f64> {
        let rotation = state.unit_quaternion();
        Isometry3::from_parts((state.position - rotation * self.center_of_mass).into(), rotation)
    }
}

impl SceneFile {
    /// As it is read.
    ///
    /// # Errors
    /// None in practice: a value that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, SceneError> {
        let file = self.scene.name.clone().unwrap_or_default();
        toml::to_string(self).map_err(|e| SceneError { file, line: None, key: None, problem: e.to_string() })
    }
}

/// Reads a scene's text without loading what it names: syntax, keys and types only.
///
/// # Errors
/// A [`SceneError`] with the line.
pub fn parse_file(text: &str, name: &str) -> Result<SceneFile, SceneError> {
    read::read(&Source { name: name.to_owned(), text: text.to_owned() }, &[])
}

/// The handle of the dynamics at a device sample in the world's scale.
#[must_use]
pub fn handle_at(sample: &DeviceSample) -> Handle {
    Handle {
        position: sample.position,
        orientation: sample.orientation,
        linear_velocity: sample.linear_velocity,
        angular_velocity: sample.angular_velocity,
    }
}

#[cfg(test)]
mod tests;
