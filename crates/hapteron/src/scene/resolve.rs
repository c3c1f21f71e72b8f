//! Fills in what a scene leaves out and checks what it says.

use super::closed_loop;
use super::error::{SceneError, Source};
use super::file::{self, Anticipation, Auto, SceneFile};
use super::{ContactModel, ContactSettings, Model, PlacedObstacle, Scene};
use crate::session::grasp::Buttons;
use crate::session::real_time::HAPTIC_PRIORITY;
use crate::trajectory::{PoseRow, Trajectory};
use crate::{assets, motion};
use hapteron_collision::Surface;
use hapteron_collision::clod::{BuildError, Detail, Progress, cache};
use hapteron_collision::mesh::{self, TriMesh};
use hapteron_device::{DeviceSample, Scaling};
use hapteron_dynamics::{Coupling, Method, RigidBody, Spring, State};
use nalgebra::{Isometry3, Matrix3, Quaternion, UnitQuaternion, Vector3};
use std::path::Path;
use std::sync::Arc;

const BUILTIN: &str = "builtin:";
/// Density of a body that is given neither mass nor density: water's, kg/m^3.
const DENSITY: f64 = 1000.0;
/// Radius of a contact cluster as a share of the body's.
const CLUSTER_RADIUS: f64 = 0.15;
/// Shortest step and period, seconds: below it a scene of a second takes hours, and its record more memory than there is.
const SHORTEST: f64 = 1e-6;
/// A quaternion this close to unit length is used bit for bit.
const EXACT_UNIT: f64 = 1e-14;

pub(super) type Resolved<T> = Result<T, SceneError>;

pub(super) fn resolve(
    source: &Source,
    mut file: SceneFile,
    folder: &Path,
    progress: &mut Progress<'_>,
) -> Resolved<Scene> {
    let resolver = Resolver { source, folder };
    let time_step = resolver.interval("integrator.time_step", &mut file.integrator.time_step, 1e-3)?;
    let method = *file.integrator.method.get_or_insert(file::Method::BackwardEuler);
    file.scene.name.get_or_insert_with(|| "scene".to_owned());
    file.scene.seed.get_or_insert(0);
    let gravity = resolver.vector("scene.gravity", *file.scene.gravity.get_or_insert([0.0; 3]))?;

    let mut model = resolver.model("body.mesh", &mut file.body.mesh, "body.scale", &mut file.body.scale)?;
    let (body, center_of_mass) = resolver.mass(&mut file.body, &model.mesh)?;
    let mut obstacles = resolver.obstacles(&mut file.obstacle)?;
    let scaling = file.device.position_scale.get_or_insert(1.0);
    let scaling = Scaling::new(*scaling).map_err(|e| source.fault("device.position_scale", e.to_string()))?;
    let buttons = resolver.buttons(&mut file.device)?;
    let trajectory = resolver.trajectory(&mut file, center_of_mass, time_step)?;
    let closed = resolver.closed_loop(&mut file, time_step)?;

    let handle = closed.sensed(trajectory.sample(0.0, time_step));
    let coupling = resolver.coupling(&mut file, &handle, center_of_mass)?;
    let start = resolver.start(&mut file, &handle, &body, center_of_mass)?;
    let contact = resolver.contact(&mut file, &body, &model, time_step)?;
    if !contact.detail.is_exact() {
        let models = std::iter::once(&mut model).chain(obstacles.iter_mut().map(|o| &mut o.model));
        for model in models {
            add_levels(model, progress)
                .map_err(|error| source.fault("contact.error_threshold", error.to_string()))?;
        }
    }
    Ok(Scene {
        file,
        body,
        model,
        center_of_mass,
        obstacles,
        coupling,
        contact,
        gravity,
        method: match method {
            file::Method::BackwardEuler => Method::BackwardEuler,
            file::Method::BackwardEulerNewton => Method::BackwardEulerNewton,
            file::Method::RungeKutta4 => Method::RungeKutta4,
            file::Method::ForwardEuler => Method::ForwardEuler,
            file::Method::QuasiStatic => Method::QuasiStatic,
        },
        time_step,
        scaling,
        buttons,
        trajectory,
        hand: closed.hand,
        simulated: closed.simulated,
        guard: closed.guard,
        start,
    })
}

/// Levels of detail from the user's cache, or else built and put there.
fn add_levels(model: &mut Model, progress: &mut Progress<'_>) -> Result<(), BuildError> {
    let folder = cache::default_folder();
    let (hierarchy, _) = cache::load_or_build(&model.surface, folder.as_deref(), progress)?;
    model.hierarchy = Some(Arc::new(hierarchy));
    Ok(())
}

pub(super) struct Resolver<'a> {
    pub(super) source: &'a Source,
    folder: &'a Path,
}

impl Resolver<'_> {
    pub(super) fn positive(&self, key: &str, value: &mut Option<f64>, default: f64) -> Resolved<f64> {
        let v = *value.get_or_insert(default);
        if v > 0.0 && v.is_finite() {
            return Ok(v);
        }
        Err(self.source.fault(key, format!("is {v}; it must be positive and finite")))
    }

    fn interval(&self, key: &str, value: &mut Option<f64>, default: f64) -> Resolved<f64> {
        let v = self.positive(key, value, default)?;
        if v >= SHORTEST {
            return Ok(v);
        }
        Err(self.source.fault(key, format!("is {v}; it must be at least {SHORTEST} seconds")))
    }

    pub(super) fn not_negative(&self, key: &str, value: &mut Option<f64>, default: f64) -> Resolved<f64> {
        let v = *value.get_or_insert(default);
        if v >= 0.0 && v.is_finite() {
            return Ok(v);
        }
        Err(self.source.fault(key, format!("is {v}; it must be finite and not negative")))
    }

    fn vector(&self, key: &str, v: [f64; 3]) -> Resolved<Vector3<f64>> {
        if v.iter().all(|c| c.is_finite()) {
            return Ok(Vector3::from(v));
        }
        Err(self.source.fault(key, format!("is {v:?}; every component must be finite")))
    }

    fn rotation(&self, key: &str, v: &mut [f64; 4]) -> Resolved<UnitQuaternion<f64>> {
        let [w, x, y, z] = *v;
        let square = w * w + x * x + y * y + z * z;
        let length = libm::sqrt(square);
        if !((length - 1.0).abs() <= 1e-2) {
            let text = format!("is {v:?}, of length {length}; it must be a unit quaternion w, x, y, z");
            return Err(self.source.fault(key, text));
        }
        // Dividing one that is unit already would change its last bits, and a written scene must come back as it was.
        if (square - 1.0).abs() > EXACT_UNIT {
            *v = v.map(|c| c / length);
        }
        let [w, x, y, z] = *v;
        Ok(UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)))
    }

    fn model(
        &self,
        key: &str,
        name: &mut String,
        scale_key: &str,
        scale: &mut Option<f64>,
    ) -> Resolved<Model> {
        let factor = self.positive(scale_key, scale, 1.0)?;
        let raw: TriMesh = if let Some(builtin) = name.strip_prefix(BUILTIN) {
            assets::builtin(builtin).map_err(|e| self.source.fault(key, e.to_string()))?
        } else {
            let path = self.path(name);
            let mesh = mesh::load(&path).map_err(|e| self.source.fault(key, e.to_string()))?;
            *name = path;
            mesh
        };
        let mesh = if factor == 1.0 {
            raw
        } else {
            raw.scaled(factor).map_err(|e| self.source.fault(scale_key, e.to_string()))?
        };
        let surface = Surface::build(&mesh);
        Ok(Model { mesh, surface, hierarchy: None })
    }

    /// Relative to the scene's folder, and absolute, so that a written scene finds its files from anywhere.
    fn path(&self, name: &str) -> String {
        let joined = self.folder.join(name);
        std::fs::canonicalize(&joined).unwrap_or(joined).display().to_string()
    }

    fn obstacles(&self, obstacles: &mut [file::Obstacle]) -> Resolved<Vec<PlacedObstacle>> {
        let mut placed = Vec::with_capacity(obstacles.len());
        for (index, obstacle) in obstacles.iter_mut().enumerate() {
            let key = |field: &str| format!("obstacle.{index}.{field}");
            let model = self.model(&key("mesh"), &mut obstacle.mesh, &key("scale"), &mut obstacle.scale)?;
            let position = self.vector(&key("position"), *obstacle.position.get_or_insert([0.0; 3]))?;
            let orientation = obstacle.orientation.get_or_insert([1.0, 0.0, 0.0, 0.0]);
            let rotation = self.rotation(&key("orientation"), orientation)?;
            placed.push(PlacedObstacle {
                model,
                world_from_mesh: Isometry3::from_parts(position.into(), rotation),
            });
        }
        Ok(placed)
    }

    fn mass(&self, body: &mut file::Body, mesh: &TriMesh) -> Resolved<(RigidBody, Vector3<f64>)> {
        let both =
            |a: &str, b: &str| self.source.fault(a, format!("stands beside `{b}`; give one of the two"));
        if body.mass.is_some() && body.density.is_some() {
            return Err(both("body.density", "body.mass"));
        }
        if body.inertia.is_some() && body.inertia_per_mass.is_some() {
            return Err(both("body.inertia_per_mass", "body.inertia"));
        }
        let inertia_given = body.inertia.is_some() || body.inertia_per_mass.is_some();
        let from_mesh = if body.mass.is_some() && inertia_given && body.center_of_mass.is_some() {
            None
        } else {
            let found = mesh::mass_properties(mesh).map_err(|e| {
                let text = format!(
                    "mass properties are not to be had from this mesh: {e}. Give `mass`, `inertia` and `center_of_mass`, or close the mesh"
                );
                self.source.fault("body.mesh", text)
            })?;
            Some(found)
        };
        let density = body.density.take();
        if let Some(v) = density.filter(|v| !(*v > 0.0 && v.is_finite())) {
            return Err(self.source.fault("body.density", format!("is {v}; it must be positive and finite")));
        }
        let volume = from_mesh.map_or(0.0, |m| m.volume);
        let mass = self.positive("body.mass", &mut body.mass, density.unwrap_or(DENSITY) * volume)?;
        let per_mass = body.inertia_per_mass.take().map(matrix);
        let inertia = match (body.inertia, per_mass, from_mesh) {
            (Some(rows), _, _) => matrix(rows),
            (None, Some(per_mass), _) => per_mass * mass,
            (None, None, Some(found)) => found.inertia_per_mass * mass,
            (None, None, None) => Matrix3::zeros(),
        };
        body.inertia = Some(std::array::from_fn(|r| std::array::from_fn(|c| inertia[(r, c)])));
        let center = from_mesh.map_or([0.0; 3], |m| m.center_of_mass.into());
        let center = self.vector("body.center_of_mass", *body.center_of_mass.get_or_insert(center))?;
        let rigid =
            RigidBody::new(mass, inertia).map_err(|e| self.source.fault("body.inertia", e.to_string()))?;
        Ok((rigid, center))
    }

    fn buttons(&self, device: &mut file::Device) -> Resolved<Buttons> {
        let bit = |key: &str, number: &mut Option<u32>, default: u32| {
            let n = *number.get_or_insert(default);
            1u32.checked_shl(n).ok_or_else(|| {
                self.source.fault(
                    key,
                    format!(
                        "is {n}; buttons are counted from 0 to 31. One that the device lacks is never pressed"
                    ),
                )
            })
        };
        let grasp = bit("device.grasp_button", &mut device.grasp_button, 0)?;
        let clutch = bit("device.clutch_button", &mut device.clutch_button, 1)?;
        if grasp == clutch {
            return Err(self
                .source
                .fault("device.clutch_button", "is the same as grasp_button; give it another"));
        }
        Ok(Buttons { grasp, clutch })
    }

    fn trajectory(&self, file: &mut SceneFile, center: Vector3<f64>, dt: f64) -> Resolved<Trajectory> {
        let driven = file.device.kind.as_ref().is_some_and(|kind| kind != closed_loop::SIMULATED);
        let Some(name) = &mut file.hand.trajectory else {
            if driven {
                return self.waiting_handle(file, center);
            }
            let text = "is missing: without a real device the handle needs a motion. Give a CSV file (t,px,py,pz,qw,qx,qy,qz), `builtin:NAME`, or --replay FILE";
            return Err(self.source.fault("hand.trajectory", text));
        };
        let fault =
            |e: crate::trajectory::TrajectoryError| self.source.fault("hand.trajectory", e.to_string());
        if let Some(builtin) = name.strip_prefix(BUILTIN) {
            motion::builtin(builtin, dt).map_err(fault)
        } else {
            let path = self.path(name);
            *name = path.clone();
            Trajectory::load(path).map_err(fault)
        }
    }

    /// Where a real device's handle is taken to be until it tells: at the centre of mass of the body, or at the origin.
    fn waiting_handle(&self, file: &mut SceneFile, center: Vector3<f64>) -> Resolved<Trajectory> {
        let pose = match (file.body.position, &mut file.body.orientation) {
            (Some(p), Some(q)) => {
                let rotation = self.rotation("body.orientation", q)?;
                Isometry3::from_parts((self.vector("body.position", p)? + rotation * center).into(), rotation)
            }
            _ => Isometry3::identity(),
        };
        let still = |time| PoseRow { time, pose, velocity: Some([Vector3::zeros(); 2]) };
        Trajectory::from_rows(vec![still(0.0), still(1.0)], "waiting handle")
            .map_err(|e| self.source.fault("hand.trajectory", e.to_string()))
    }

    /// The grasp is given, or recorded from where handle and body are at the start (section 5.1 of the paper).
    fn coupling(
        &self,
        file: &mut SceneFile,
        handle: &DeviceSample,
        center: Vector3<f64>,
    ) -> Resolved<Coupling> {
        let c = &mut file.coupling;
        let given = match (file.body.position, &mut file.body.orientation) {
            (Some(p), Some(q)) => {
                let rotation = self.rotation("body.orientation", q)?;
                Some(Isometry3::from_parts(self.vector("body.position", p)?.into(), rotation))
            }
            _ => None,
        };
        let default_position = given.map_or(center, |pose| {
            pose.inverse_transform_point(&nalgebra::Point3::from(handle.position)).coords
        });
        let default_orientation =
            given.map_or(UnitQuaternion::identity(), |p| p.rotation.inverse() * handle.orientation);
        let position =
            self.vector("coupling.grasp_position", *c.grasp_position.get_or_insert(default_position.into()))?;
        let q = default_orientation;
        let orientation = self.rotation(
            "coupling.grasp_orientation",
            c.grasp_orientation.get_or_insert([q.w, q.i, q.j, q.k]),
        )?;
        let spring = |stiffness: f64, limit: Option<f64>| Spring { stiffness, limit };
        Coupling::new(
            spring(
                self.not_negative("coupling.linear_stiffness", &mut c.linear_stiffness, 500.0)?,
                c.max_force,
            ),
            self.not_negative("coupling.linear_damping", &mut c.linear_damping, 3.0)?,
            spring(
                self.not_negative("coupling.angular_stiffness", &mut c.angular_stiffness, 0.6)?,
                c.max_torque,
            ),
            self.not_negative("coupling.angular_damping", &mut c.angular_damping, 0.006)?,
            position - center,
            orientation,
        )
        .map_err(|e| self.source.fault("coupling.max_force", e.to_string()))
    }

    /// The body at the start: where it is said to be, or where the coupling has no deviation.
    fn start(
        &self,
        file: &mut SceneFile,
        handle: &DeviceSample,
        body: &RigidBody,
        center: Vector3<f64>,
    ) -> Resolved<State> {
        let posed = file.body.position.is_some() && file.body.orientation.is_some();
        let grasp = Vector3::from(file.coupling.grasp_position.unwrap_or_default());
        let mut held = file.coupling.grasp_orientation.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let held = self.rotation("coupling.grasp_orientation", &mut held)?;
        let q = handle.orientation * held.inverse();
        let orientation = file.body.orientation.get_or_insert([q.w, q.i, q.j, q.k]);
        let rotation = self.rotation("body.orientation", orientation)?;
        let default = handle.position - rotation * grasp;
        let position = self.vector("body.position", *file.body.position.get_or_insert(default.into()))?;
        let (v, omega) = if posed {
            (Vector3::zeros(), Vector3::zeros())
        } else {
            let arm = rotation * grasp;
            (handle.linear_velocity - handle.angular_velocity.cross(&arm), handle.angular_velocity)
        };
        let v = self.vector("body.linear_velocity", *file.body.linear_velocity.get_or_insert(v.into()))?;
        let omega =
            self.vector("body.angular_velocity", *file.body.angular_velocity.get_or_insert(omega.into()))?;
        let arm = rotation * center;
        Ok(State::moving(body, position + arm, &rotation, &(v + omega.cross(&arm)), &omega))
    }

    fn contact(
        &self,
        file: &mut SceneFile,
        body: &RigidBody,
        model: &Model,
        time_step: f64,
    ) -> Resolved<ContactSettings> {
        let c = &mut file.contact;
        let (_, radius) = model.mesh.bounding_sphere();
        if self.not_negative("contact.friction", &mut c.friction, 0.0)? > 0.0 {
            let text = "is not available yet; contacts are without friction. Set it to 0";
            return Err(self.source.fault("contact.friction", text));
        }
        let threshold = self.not_negative("contact.error_threshold", &mut c.error_threshold, 0.0)?;
        if threshold >= 1.0 {
            let text =
                format!("is {threshold}; it is a share of the body's radius, such as 0.025, and 0 is exact");
            return Err(self.source.fault("contact.error_threshold", text));
        }
        let stiffness = self.positive("contact.stiffness", &mut c.stiffness, 5000.0)?;
        // Half of critical, 0.5 * 2 sqrt(k m): more only raises the impact force (experiments on Fig. 4).
        let half_critical = libm::sqrt(stiffness * body.mass());
        let damping = self.not_negative("contact.damping", &mut c.damping, half_critical)?;
        let tolerance = self.not_negative("contact.tolerance", &mut c.tolerance, 0.0005)?;
        let anticipation = match *c.anticipation.get_or_insert(Anticipation::Auto(Auto::Auto)) {
            Anticipation::Auto(_) => None,
            Anticipation::Metres(metres) => {
                Some(self.not_negative("contact.anticipation", &mut Some(metres), 0.0)?)
            }
        };
        let thread = &mut file.contact_thread;
        if let Some(priority) = thread.priority.filter(|p| !(1..HAPTIC_PRIORITY).contains(p)) {
            let text = format!(
                "is {priority}; it must be 1 to {}, below the haptic thread's. Leave it out for ordinary scheduling",
                HAPTIC_PRIORITY - 1
            );
            return Err(self.source.fault("contact_thread.priority", text));
        }
        Ok(ContactSettings {
            stiffness,
            damping,
            tolerance,
            detail: Detail { force_from: Some(tolerance), ..Detail::threshold(threshold * radius) },
            max_clusters: *c.max_clusters.get_or_insert(0),
            cluster_radius: CLUSTER_RADIUS * model.surface.radius(),
            model: *c.model.get_or_insert(ContactModel::Planes),
            anticipation,
            period: self.interval("contact_thread.period", &mut thread.period, time_step)?,
            latency: self.not_negative("contact_thread.latency", &mut thread.latency, time_step)?,
        })
    }
}

fn matrix(rows: [[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| rows[r][c])
}
