//! Reading a scene beside the window, so that the window goes on.

use crate::live::Opened;
use crate::live::hand::capabilities;
use crate::view;
use hapteron::collision::mesh;
use hapteron::device::drivers;
use hapteron::scene::file::{Body, Hand, Obstacle};
use hapteron::scene::{Changes, Scene, SceneFile};
use hapteron::scenes;
use hapteron::trajectory::{PoseRow, Trajectory};
use nalgebra::{Isometry3, Vector3};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, TryRecvError};

/// What can be opened.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A scene file.
    File(PathBuf),
    /// A built-in scene.
    Builtin(String),
    /// Meshes that were put together here.
    Meshes(Box<SceneFile>),
}

impl Source {
    /// For people.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Builtin(name) => name.clone(),
            Self::Meshes(_) => "the meshes".to_owned(),
        }
    }
}

/// A scene that is being read.
pub struct Opening {
    /// What.
    pub source: Source,
    result: Receiver<Result<Opened, String>>,
}

impl Opening {
    /// Begins; `wake` is called when it is done.
    ///
    /// # Errors
    /// No thread is to be had.
    pub fn begin(source: Source, wake: impl FnOnce() + Send + 'static) -> Result<Self, String> {
        let (tell, result) = mpsc::channel();
        let asked = source.clone();
        let work = move || {
            let _ = tell.send(read(&asked));
            wake();
        };
        std::thread::Builder::new().name("opening".into()).spawn(work).map_err(|e| e.to_string())?;
        Ok(Self { source, result })
    }

    /// What came of it, when it is done.
    pub fn done(&self) -> Option<Result<Opened, String>> {
        match self.result.try_recv() {
            Ok(result) => Some(result),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err("reading it has failed".to_owned())),
        }
    }
}

/// Stands in for a motion until the body is known, and with it the place that the handle is put to. It begins at rest at the origin.
const STAND_IN: &str = "builtin:free-space";

/// Reads a scene and makes its shapes.
pub fn read(source: &Source) -> Result<Opened, String> {
    let scene = match source {
        Source::File(path) => load(path)?,
        Source::Builtin(name) => {
            let file = scenes::builtin(name).ok_or_else(|| {
                format!("no built-in scene is called \"{name}\"; there are {}", scenes::NAMES.join(", "))
            })?;
            Scene::from_file(file).map_err(|e| e.to_string())?
        }
        Source::Meshes(file) => without_motion(false, |overrides| {
            let mut file = SceneFile::clone(file);
            if let Some(motion) = overrides {
                file.hand = Hand { trajectory: Some(motion.to_owned()), ..Hand::default() };
            }
            Scene::from_file(file).map_err(|e| e.to_string())
        })?,
    };
    let mut scene = scene;
    let guard = scene.guard_for(&capabilities()).map_err(|e| e.to_string())?;
    scene.guard = guard.map(|g| *g.settings());
    let shapes = view::shapes(&scene);
    let device =
        scene.driver().map(|(kind, options)| drivers::open(kind, &options).map_err(|e| e.to_string()));
    Ok(Opened { scene: Arc::new(scene), shapes, device })
}

/// A scene file; one without a motion of the hand is held where the body is.
fn load(path: &Path) -> Result<Scene, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    let file = hapteron::scene::parse_file(&text, &path.display().to_string()).map_err(|e| e.to_string())?;
    let with = |motion: Option<&str>| {
        let overrides = motion.map(|m| format!("hand.trajectory={m}")).into_iter().collect();
        Scene::load(path, &Changes { overrides, ..Changes::default() }).map_err(|e| e.to_string())
    };
    if file.hand.trajectory.is_some() {
        with(None)
    } else {
        without_motion(file.coupling.grasp_position.is_some(), with)
    }
}

/// A scene whose handle stands still where the body is held: as the scene says, or at its centre of mass.
fn without_motion(
    grasp_given: bool,
    with: impl FnOnce(Option<&str>) -> Result<Scene, String>,
) -> Result<Scene, String> {
    let mut scene = with(Some(STAND_IN))?;
    if !grasp_given {
        let turn = scene.start.unit_quaternion().inverse();
        scene.coupling = scene.coupling.with_grasp(Vector3::zeros(), turn);
        scene.file.coupling.grasp_position = Some(scene.center_of_mass.into());
        scene.file.coupling.grasp_orientation = Some([turn.w, turn.i, turn.j, turn.k]);
    }
    let handle = scene.coupling.without_deviation(&scene.start, &scene.body);
    let pose = Isometry3::from_parts(handle.position.into(), handle.orientation);
    let row = |time| PoseRow { time, pose, velocity: None };
    scene.trajectory =
        Trajectory::from_rows(vec![row(0.0), row(1.0)], "standing still").map_err(|e| e.to_string())?;
    scene.file.hand.trajectory = None;
    Ok(scene)
}

/// Whether a file's name is that of a mesh.
#[must_use]
pub fn is_mesh(path: &Path) -> bool {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    extension.is_some_and(|e| ["obj", "stl", "ply", "off"].contains(&e.as_str()))
}

/// A mesh that was dropped on the window, before it is part of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Its file.
    pub path: PathBuf,
    /// Triangles.
    pub triangles: usize,
    /// Longest side of its box, in the file's unit.
    pub size: f64,
    /// Whether it has a volume.
    pub closed: bool,
}

impl Part {
    /// Reads a mesh.
    ///
    /// # Errors
    /// In words.
    pub fn read(path: &Path) -> Result<Self, String> {
        let mesh = mesh::load(path).map_err(|e| e.to_string())?;
        let [low, high] = mesh.bounds();
        Ok(Self {
            path: path.to_owned(),
            triangles: mesh.triangles().len(),
            size: (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max),
            closed: mesh::mass_properties(&mesh).is_ok(),
        })
    }
}

/// Meshes on their way to a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Assembly {
    /// As they were dropped.
    pub parts: Vec<Part>,
    /// Which one is held.
    pub body: usize,
    /// Metres for one unit of the files.
    pub scale: f64,
    /// Of the body, kg.
    pub mass: f64,
}

impl Assembly {
    /// Begins with a mesh. Files of more than ten units are taken for millimetres.
    #[must_use]
    pub fn new(part: Part) -> Self {
        let scale = if part.size > 10.0 { 1e-3 } else { 1.0 };
        Self { parts: vec![part], body: 0, scale, mass: 0.05 }
    }

    /// The scene of them.
    #[must_use]
    pub fn scene(&self) -> SceneFile {
        let name = |part: &Part| part.path.display().to_string();
        let mut file = SceneFile::default();
        let stem =
            |part: &Part| part.path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        for (index, part) in self.parts.iter().enumerate() {
            if index == self.body {
                file.scene.name = Some(stem(part));
                file.body = Body {
                    mesh: name(part),
                    scale: Some(self.scale),
                    mass: Some(self.mass),
                    // Where it is in the file: meshes of one assembly fit together.
                    position: Some([0.0; 3]),
                    orientation: Some([1.0, 0.0, 0.0, 0.0]),
                    ..Body::default()
                };
            } else {
                file.obstacle.push(Obstacle {
                    mesh: name(part),
                    scale: Some(self.scale),
                    ..Obstacle::default()
                });
            }
        }
        // A contact begins at a hundredth of the body's size, and no farther than half a millimetre.
        if let Some(body) = self.parts.get(self.body) {
            file.contact.tolerance = Some((0.01 * body.size * self.scale).min(5e-4));
        }
        file
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapteron::assets;

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("hapteron-opening-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    /// Would catch dropped meshes that do not become a scene that can be held: the handle must be where the body is.
    #[test]
    fn two_meshes_become_a_scene() {
        let folder = folder("meshes");
        let mut parts = Vec::new();
        for name in ["spoon", "cup"] {
            let path = folder.join(format!("{name}.obj"));
            let mesh = assets::builtin(name).unwrap().scaled(1000.0).unwrap();
            assets::write_obj(&mesh, name, std::fs::File::create(&path).unwrap()).unwrap();
            assert!(is_mesh(&path));
            parts.push(Part::read(&path).unwrap());
        }
        let mut assembly = Assembly::new(parts[0].clone());
        assembly.parts.push(parts[1].clone());
        assert_eq!(assembly.scale, 1e-3);
        let opened = read(&Source::Meshes(Box::new(assembly.scene()))).unwrap();
        let scene = &opened.scene;
        assert_eq!((scene.obstacles.len(), scene.body.mass()), (1, 0.05));
        let handle = scene.trajectory.sample(0.0, 1e-3).position;
        assert!((handle - scene.start.position).norm() < 1e-12);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    /// Would catch a scene file that can be run with a device but not be opened here, and errors that do not say what is wrong.
    #[test]
    fn a_scene_without_a_motion_is_held_where_the_body_is() {
        let folder = folder("still");
        let path = folder.join("scene.toml");
        std::fs::write(
            &path,
            "[body]\nmesh = \"builtin:spoon\"\nposition = [0.1, 0.0, 0.2]\norientation = [0.0, 1.0, 0.0, 0.0]\n",
        )
        .unwrap();
        let opened = read(&Source::File(path.clone())).unwrap();
        let handle = opened.scene.trajectory.sample(0.0, 1e-3);
        assert!((handle.position - opened.scene.start.position).norm() < 1e-12);
        let at_rest = opened.scene.coupling.without_deviation(&opened.scene.start, &opened.scene.body);
        assert!((at_rest.position - handle.position).norm() < 1e-12);
        assert!(at_rest.orientation.angle_to(&handle.orientation) < 1e-9);
        std::fs::write(&path, "[body]\nmesh = \"builtin:fork\"\n").unwrap();
        assert!(read(&Source::File(path)).is_err_and(|e| e.contains("fork")));
        assert!(read(&Source::Builtin("teeth".to_owned())).is_err_and(|e| e.contains("spoon_in_cup")));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
