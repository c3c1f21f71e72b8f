//! What the device types can do. Forces, torques, stiffness and workspace are those that CHAI3D drives them with.

use crate::{Capabilities, Pacing};
use nalgebra::Vector3;

/// One row: type codes, name, N, N m, N/m, N m/rad, N s/m, radius in m.
struct Model {
    types: &'static [i32],
    name: &'static str,
    force: f64,
    torque: f64,
    stiffness: f64,
    angular_stiffness: f64,
    damping: f64,
    radius: f64,
}

const fn row(
    types: &'static [i32],
    name: &'static str,
    [force, torque, stiffness, angular_stiffness, damping, radius]: [f64; 6],
) -> Model {
    Model { types, name, force, torque, stiffness, angular_stiffness, damping, radius }
}

const MODELS: [Model; 10] = [
    row(&[63], "delta.3", [20.0, 0.0, 5000.0, 0.0, 30.0, 0.15]),
    row(&[33], "omega.3", [12.0, 0.0, 5000.0, 0.0, 30.0, 0.075]),
    row(&[34, 36], "omega.6", [12.0, 0.0, 5000.0, 0.0, 30.0, 0.075]),
    row(&[35, 37], "omega.7", [12.0, 0.0, 5000.0, 0.0, 30.0, 0.075]),
    row(&[206], "sigma.3", [12.0, 0.0, 4000.0, 0.0, 30.0, 0.075]),
    row(&[104, 105], "sigma.7", [12.0, 0.2, 4000.0, 1.0, 30.0, 0.075]),
    row(&[203], "lambda.3", [12.0, 0.0, 8000.0, 0.0, 30.0, 0.1125]),
    row(&[131, 132], "lambda.6", [12.0, 0.0, 8000.0, 0.0, 30.0, 0.1125]),
    row(&[108, 109], "lambda.7", [12.0, 0.2, 8000.0, 1.0, 30.0, 0.1125]),
    row(&[60], "Falcon", [8.0, 0.0, 3000.0, 0.0, 20.0, 0.04]),
];

/// What the library tells about one device.
pub(super) struct Described {
    pub system_type: i32,
    pub name: Option<String>,
    pub left_handed: bool,
    pub senses_rotation: bool,
    pub active_wrist: bool,
    pub limits: [Option<f64>; 2],
    pub watchdog: bool,
}

/// The capabilities of a device; of a type that is not in the table, only the library's own limits are known.
pub(super) fn capabilities(described: Described) -> Capabilities {
    let model = MODELS.iter().find(|m| m.types.contains(&described.system_type));
    let name = model.map(|m| m.name.to_owned()).or(described.name);
    let name = name.unwrap_or_else(|| format!("type {}", described.system_type));
    let hand = if described.left_handed { ", left-handed" } else { "" };
    let drives_torque = described.active_wrist && model.is_none_or(|m| m.torque > 0.0);
    let limit = |own: Option<f64>, known: Option<f64>| {
        known.unwrap_or(f64::INFINITY).min(own.unwrap_or(f64::INFINITY))
    };
    let force = limit(described.limits[0], model.map(|m| m.force));
    let torque = if drives_torque { limit(described.limits[1], model.map(|m| m.torque)) } else { 0.0 };
    let known = |get: fn(&Model) -> f64| model.map_or(f64::INFINITY, get);
    let corner = Vector3::repeat(model.map_or(0.0, |m| m.radius));
    Capabilities {
        name: format!("Force Dimension {name}{hand}"),
        senses_rotation: described.senses_rotation,
        drives_force: true,
        drives_torque,
        peak_force: force,
        continuous_force: force,
        peak_torque: torque,
        continuous_torque: torque,
        max_stiffness: known(|m| m.stiffness),
        max_angular_stiffness: if drives_torque { known(|m| m.angular_stiffness) } else { 0.0 },
        max_damping: known(|m| m.damping),
        workspace: [-corner, corner],
        rate: 1000.0,
        buttons: 32,
        force_persists: true,
        hardware_watchdog: described.watchdog,
        pacing: Pacing::Polled,
    }
}
