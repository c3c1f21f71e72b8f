//! The scene as it is written in TOML.
//!
//! Every key but the meshes may be left out here; [`super::Scene`] fills in what is missing, and writes this structure
//! again with nothing left out.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A scene file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// `[scene]`
    #[serde(default)]
    pub scene: General,
    /// `[body]`
    pub body: Body,
    /// `[[obstacle]]`
    #[serde(default)]
    pub obstacle: Vec<Obstacle>,
    /// `[coupling]`
    #[serde(default)]
    pub coupling: Coupling,
    /// `[contact]`
    #[serde(default)]
    pub contact: Contact,
    /// `[integrator]`
    #[serde(default)]
    pub integrator: Integrator,
    /// `[contact_thread]`
    #[serde(default)]
    pub contact_thread: ContactThread,
    /// `[device]`
    #[serde(default)]
    pub device: Device,
    /// `[hand]`
    #[serde(default)]
    pub hand: Hand,
    /// `[guard]`
    #[serde(default)]
    pub guard: Guard,
}

/// `[scene]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct General {
    /// Title in reports.
    pub name: Option<String>,
    /// World, m/s^2; default none.
    pub gravity: Option<[f64; 3]>,
    /// Of everything random: the simulated hand's tremor, the simulated device's jitter.
    pub seed: Option<u32>,
}

/// `[body]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// A file, or `builtin:NAME`.
    pub mesh: String,
    /// Metres per unit of the mesh; default 1.
    pub scale: Option<f64>,
    /// kg; default density times volume.
    pub mass: Option<f64>,
    /// kg/m^3; default 1000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// About the centre of mass in mesh axes, kg m^2; default that of a uniform solid.
    pub inertia: Option<[[f64; 3]; 3]>,
    /// The same for one kilogram, m^2; instead of `inertia`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_per_mass: Option<[[f64; 3]; 3]>,
    /// Mesh frame, metres; default that of a uniform solid.
    pub center_of_mass: Option<[f64; 3]>,
    /// Of the mesh frame in the world, metres; default where the coupling has no deviation.
    pub position: Option<[f64; 3]>,
    /// w, x, y, z, mesh to world; default where the coupling has no deviation.
    pub orientation: Option<[f64; 4]>,
    /// Of the mesh frame's origin, world, m/s; default at rest relative to the handle, or at rest where the pose is given.
    pub linear_velocity: Option<[f64; 3]>,
    /// World, rad/s; default as `linear_velocity`.
    pub angular_velocity: Option<[f64; 3]>,
}

/// `[[obstacle]]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// A file, or `builtin:NAME`.
    pub mesh: String,
    /// Metres per unit of the mesh; default 1.
    pub scale: Option<f64>,
    /// Of the mesh frame in the world, metres; default the origin.
    pub position: Option<[f64; 3]>,
    /// w, x, y, z, mesh to world; default none.
    pub orientation: Option<[f64; 4]>,
}

/// `[coupling]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Coupling {
    /// k_c, N/m; default 500.
    pub linear_stiffness: Option<f64>,
    /// b_c, N s/m; default 3.
    pub linear_damping: Option<f64>,
    /// k_theta, N m/rad; default 0.6.
    pub angular_stiffness: Option<f64>,
    /// b_theta, N m s/rad; default 0.006.
    pub angular_damping: Option<f64>,
    /// Where the body is held, mesh frame, metres; default where the handle is at the start, or the centre of mass when that is not known.
    pub grasp_position: Option<[f64; 3]>,
    /// Handle axes in mesh axes at the grasp, w, x, y, z; default as they are at the start.
    pub grasp_orientation: Option<[f64; 4]>,
    /// The coupling saturates smoothly at this force, N; default never.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_force: Option<f64>,
    /// The coupling saturates smoothly at this torque, N m; default never.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_torque: Option<f64>,
}

/// `[contact]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// k of each contact plane, N/m; default 5000.
    pub stiffness: Option<f64>,
    /// b of each contact plane, N s/m; default half critical, sqrt(k m).
    pub damping: Option<f64>,
    /// d: the force begins at this distance, metres; default 0.0005.
    pub tolerance: Option<f64>,
    /// 0: exact.
    pub error_threshold: Option<f64>,
    /// 0: every contact is a plane of its own.
    pub max_clusters: Option<usize>,
    /// Coefficient of friction; 0.
    pub friction: Option<f64>,
    /// How the haptic thread uses contacts between two queries; default planes.
    pub model: Option<ContactModel>,
    /// How far beyond d contacts are looked for; default auto.
    pub anticipation: Option<Anticipation>,
}

/// `contact.model`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactModel {
    /// Planes, evaluated anew at every tick, never pulling.
    Planes,
    /// The linearized contact model, Eq. 30.
    Linearized,
    /// The last force, held.
    Held,
}

/// `contact.anticipation`
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(untagged, expecting = "a length in metres, or \"auto\"")]
pub enum Anticipation {
    /// "auto": speed times (period + latency), within bounds.
    Auto(Auto),
    /// Metres.
    Metres(f64),
}

/// The word "auto".
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Auto {
    /// "auto"
    Auto,
}

/// `[integrator]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Integrator {
    /// Default backward-euler.
    pub method: Option<Method>,
    /// Seconds; default 0.001.
    pub time_step: Option<f64>,
}

/// `integrator.method`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Semi-implicit Backward Euler.
    BackwardEuler,
    /// Fully implicit Backward Euler by Newton's method.
    BackwardEulerNewton,
    /// Runge-Kutta IV.
    #[serde(rename = "runge-kutta-4")]
    RungeKutta4,
    /// Forward Euler.
    ForwardEuler,
    /// Static balance of coupling and contacts.
    QuasiStatic,
}

/// `[contact_thread]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ContactThread {
    /// From the start of one pass to the start of the next, seconds; default the time step.
    pub period: Option<f64>,
    /// From the start of a pass until its contacts can be used, seconds; default the time step. In real time it is what it is.
    pub latency: Option<f64>,
    /// Real time: number of the CPU that it is to stay on; default any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpu: Option<usize>,
    /// Real time: 1 to 79 for SCHED_FIFO, below the haptic thread's 80; default ordinary scheduling.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub priority: Option<i32>,
}

/// `[device]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// "simulated" (default), or the name of a driver.
    pub kind: Option<String>,
    /// Simulated: a name of the catalogue; default premium-1.5-6dof. In virtual time it stands in for a real device.
    pub model: Option<String>,
    /// Simulated: a force acts this many samples late; default 1.
    pub delay: Option<usize>,
    /// Simulated: the share of each new difference in the velocity estimate; default 0.3, 1 is the difference itself.
    pub velocity_filter: Option<f64>,
    /// Simulated: samples come up to this much too early or too late, seconds; default 0.
    pub jitter: Option<f64>,
    /// Simulated: apparent mass, kg; default the model's.
    pub mass: Option<f64>,
    /// Simulated: viscous friction, N s/m; default the model's.
    pub damping: Option<f64>,
    /// Simulated: Coulomb friction, N; default the model's.
    pub friction: Option<f64>,
    /// Simulated: of the encoders, metres; default the model's.
    pub resolution: Option<f64>,
    /// Metres in the world for one metre of the device; default 1. Trajectories are in the world's scale.
    pub position_scale: Option<f64>,
    /// Number of the button, from 0, each press of which lets go of the body or grasps it again; default 0.
    pub grasp_button: Option<u32>,
    /// Number of the button, from 0, while which is down the handle moves without the world; default 1.
    pub clutch_button: Option<u32>,
    /// Of a driver: what it needs to find its device; see `docs/devices.md`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub options: BTreeMap<String, toml::Value>,
}

/// `[hand]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// A file, or `builtin:NAME`.
    pub trajectory: Option<String>,
    /// How firmly a simulated hand holds the handle; instead of mass, damping and stiffness. Without any of them the handle follows the
    /// trajectory exactly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grip: Option<Grip>,
    /// Of the hand as far as it moves with the handle, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// N s/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping: Option<f64>,
    /// N/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Of a simulated hand, 8 to 12 Hz, metres; default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tremor: Option<f64>,
}

/// `hand.grip`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Grip {
    /// Nobody holds the handle.
    Released,
    /// With the fingertips.
    Light,
    /// As a pen.
    Medium,
    /// As a hammer.
    Firm,
}

/// `[guard]`: the limits of what the hand is pushed with, in the device's scale. Defaults come from the device.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Guard {
    /// Default true where a device or a simulated hand feels the force. Of a real device the limits of force and torque, the ramps and
    /// the fading stay even when it is false.
    pub enabled: Option<bool>,
    /// N; default the device's peak, which is also the most.
    pub max_force: Option<f64>,
    /// N m; default the device's peak, which is also the most.
    pub max_torque: Option<f64>,
    /// N/s; default the greatest force in 5 ms. The torque follows in proportion.
    pub max_slew: Option<f64>,
    /// W; default the greatest force at 1 m/s.
    pub max_power: Option<f64>,
    /// From no force to the whole, seconds; default 0.25.
    pub ramp_time: Option<f64>,
    /// Contacts older than this fade, seconds; default 0.1.
    pub stale_after: Option<f64>,
    /// A handle that is faster is a fault, m/s; default 2.
    pub max_speed: Option<f64>,
    /// Time-domain passivity control; default off.
    pub passivity: Option<bool>,
    /// Damping of the passivity control at the most, N s/m; default the device's, no more than 5, which is also the most.
    pub max_damping: Option<f64>,
}
