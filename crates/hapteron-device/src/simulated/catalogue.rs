//! Models of devices that people have.
//!
//! Limits are those that CHAI3D 3.3 and the vendors' samples use. Figures that come from data sheets recalled from memory, or that no source
//! gives and had to be assumed, are named in [`DeviceModel::unverified`]: check them against your device.

use crate::{Capabilities, Pacing};
use nalgebra::Vector3;

/// A device model. SI units; forces and torques at the handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceModel {
    /// Name in scenes.
    pub id: &'static str,
    /// As people know it.
    pub name: &'static str,
    /// Greatest force for a short time, N.
    pub peak_force: f64,
    /// For ever, N.
    pub continuous_force: f64,
    /// Greatest torque for a short time, N m; 0: it turns no hand.
    pub peak_torque: f64,
    /// For ever, N m.
    pub continuous_torque: f64,
    /// Greatest stiffness that it displays well, N/m.
    pub max_stiffness: f64,
    /// In rotation, N m/rad.
    pub max_angular_stiffness: f64,
    /// Greatest damping, N s/m.
    pub max_damping: f64,
    /// Of the workspace, metres.
    pub workspace_radius: f64,
    /// Ticks a second that it is made for, Hz.
    pub rate: f64,
    /// Apparent mass at the handle, kg.
    pub mass: f64,
    /// Viscous friction, N s/m.
    pub damping: f64,
    /// Coulomb friction, N.
    pub friction: f64,
    /// Apparent inertia, kg m^2.
    pub inertia: f64,
    /// Viscous, N m s/rad.
    pub angular_damping: f64,
    /// Coulomb, N m.
    pub angular_friction: f64,
    /// Of the encoders, metres; 0: exact.
    pub resolution: f64,
    /// Of the encoders, radians; 0: exact.
    pub angular_resolution: f64,
    /// Whether it senses orientation.
    pub senses_rotation: bool,
    /// Names of the figures that nobody has checked.
    pub unverified: &'static [&'static str],
}

/// The model of scenes that name none.
pub const DEFAULT_MODEL: &str = "premium-1.5-6dof";

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// What most rows share: dynamics that no source gives.
const TYPICAL: DeviceModel = DeviceModel {
    id: "",
    name: "",
    peak_force: 0.0,
    continuous_force: 0.0,
    peak_torque: 0.0,
    continuous_torque: 0.0,
    max_stiffness: 0.0,
    max_angular_stiffness: 0.0,
    max_damping: 0.0,
    workspace_radius: 0.0,
    rate: 1000.0,
    mass: 0.1,
    damping: 0.05,
    friction: 0.05,
    inertia: 1e-4,
    angular_damping: 1e-4,
    angular_friction: 1e-3,
    resolution: 1e-5,
    angular_resolution: 0.09 * DEGREE,
    senses_rotation: true,
    unverified: &[],
};

const DYNAMICS: &[&str] = &[
    "mass",
    "damping",
    "friction",
    "inertia",
    "angular_damping",
    "angular_friction",
    "resolution",
    "angular_resolution",
];
const DYNAMICS_AND_CONTINUOUS: &[&str] = &[
    "continuous_force",
    "mass",
    "damping",
    "friction",
    "inertia",
    "angular_damping",
    "angular_friction",
    "resolution",
    "angular_resolution",
];
const ALL_BUT_FORCE_LIMIT: &[&str] = &[
    "continuous_force",
    "peak_torque",
    "continuous_torque",
    "mass",
    "damping",
    "friction",
    "inertia",
    "angular_damping",
    "angular_friction",
    "resolution",
    "angular_resolution",
];
const EVERYTHING: &[&str] = &[
    "peak_force",
    "continuous_force",
    "peak_torque",
    "continuous_torque",
    "max_stiffness",
    "max_angular_stiffness",
    "max_damping",
    "workspace_radius",
    "rate",
    "mass",
    "damping",
    "friction",
    "inertia",
    "angular_damping",
    "angular_friction",
    "resolution",
    "angular_resolution",
];

/// All models.
pub const CATALOGUE: [DeviceModel; 13] = [
    DeviceModel {
        id: DEFAULT_MODEL,
        name: "Phantom Premium 1.5 6DOF",
        peak_force: 8.5,
        continuous_force: 1.4,
        peak_torque: 0.5,
        continuous_torque: 0.188,
        max_stiffness: 800.0,
        max_angular_stiffness: 0.3,
        max_damping: 5.0,
        workspace_radius: 0.12,
        mass: 0.136,
        friction: 0.04,
        resolution: 3e-5,
        angular_resolution: 0.0023 * DEGREE,
        unverified: ALL_BUT_FORCE_LIMIT,
        ..TYPICAL
    },
    DeviceModel {
        id: "premium-3.0-6dof",
        name: "Phantom Premium 3.0 6DOF",
        peak_force: 22.0,
        continuous_force: 3.0,
        peak_torque: 0.515,
        continuous_torque: 0.188,
        max_stiffness: 1000.0,
        max_angular_stiffness: 0.3,
        max_damping: 5.0,
        workspace_radius: 0.25,
        mass: 0.159,
        friction: 0.2,
        resolution: 2e-5,
        angular_resolution: 0.0023 * DEGREE,
        unverified: ALL_BUT_FORCE_LIMIT,
        ..TYPICAL
    },
    DeviceModel {
        id: "touch",
        name: "Touch",
        peak_force: 3.3,
        continuous_force: 0.88,
        max_stiffness: 400.0,
        max_damping: 4.0,
        workspace_radius: 0.075,
        mass: 0.045,
        friction: 0.26,
        resolution: 5.5e-5,
        unverified: DYNAMICS,
        ..TYPICAL
    },
    DeviceModel {
        id: "touch-x",
        name: "Touch X (Desktop)",
        peak_force: 7.9,
        continuous_force: 1.75,
        max_stiffness: 1000.0,
        max_damping: 5.0,
        workspace_radius: 0.1,
        mass: 0.045,
        friction: 0.06,
        resolution: 2.3e-5,
        unverified: DYNAMICS_AND_CONTINUOUS,
        ..TYPICAL
    },
    DeviceModel {
        id: "omni",
        name: "Phantom Omni",
        peak_force: 3.3,
        continuous_force: 0.88,
        max_stiffness: 700.0,
        max_damping: 5.0,
        workspace_radius: 0.1,
        mass: 0.045,
        friction: 0.26,
        resolution: 5.5e-5,
        unverified: DYNAMICS_AND_CONTINUOUS,
        ..TYPICAL
    },
    DeviceModel { id: "omega.3", name: "omega.3", senses_rotation: false, ..OMEGA },
    OMEGA,
    DeviceModel {
        id: "sigma.7",
        name: "sigma.7",
        peak_force: 12.0,
        continuous_force: 12.0,
        peak_torque: 0.2,
        continuous_torque: 0.2,
        max_stiffness: 4000.0,
        max_angular_stiffness: 1.0,
        max_damping: 30.0,
        workspace_radius: 0.075,
        rate: 4000.0,
        mass: 0.3,
        resolution: 1.5e-6,
        angular_resolution: 0.013 * DEGREE,
        unverified: DYNAMICS_AND_CONTINUOUS,
        ..TYPICAL
    },
    DeviceModel {
        id: "lambda.7",
        name: "lambda.7",
        peak_force: 12.0,
        continuous_force: 12.0,
        peak_torque: 0.2,
        continuous_torque: 0.2,
        max_stiffness: 8000.0,
        max_angular_stiffness: 1.0,
        max_damping: 30.0,
        workspace_radius: 0.1125,
        rate: 4000.0,
        mass: 0.3,
        resolution: 1.5e-6,
        angular_resolution: 0.013 * DEGREE,
        unverified: DYNAMICS_AND_CONTINUOUS,
        ..TYPICAL
    },
    DeviceModel {
        id: "delta.3",
        name: "delta.3",
        peak_force: 20.0,
        continuous_force: 20.0,
        max_stiffness: 5000.0,
        max_damping: 30.0,
        workspace_radius: 0.15,
        rate: 4000.0,
        mass: 0.25,
        resolution: 3e-5,
        senses_rotation: false,
        unverified: DYNAMICS_AND_CONTINUOUS,
        ..TYPICAL
    },
    DeviceModel {
        id: "falcon",
        name: "Falcon",
        peak_force: 8.0,
        continuous_force: 8.0,
        max_stiffness: 3000.0,
        max_damping: 20.0,
        workspace_radius: 0.04,
        resolution: 6e-5,
        senses_rotation: false,
        unverified: DYNAMICS_AND_CONTINUOUS,
        ..TYPICAL
    },
    DeviceModel {
        id: "inverse3",
        name: "Inverse3",
        peak_force: 10.0,
        continuous_force: 3.0,
        max_stiffness: 1000.0,
        max_damping: 5.0,
        workspace_radius: 0.075,
        senses_rotation: false,
        unverified: EVERYTHING,
        ..TYPICAL
    },
    DeviceModel {
        id: "virtuose-6d",
        name: "Virtuose 6D",
        peak_force: 35.0,
        continuous_force: 10.0,
        peak_torque: 3.1,
        continuous_torque: 1.0,
        max_stiffness: 2000.0,
        max_angular_stiffness: 30.0,
        max_damping: 30.0,
        workspace_radius: 0.3,
        mass: 0.7,
        friction: 0.5,
        inertia: 1e-3,
        resolution: 6e-6,
        unverified: EVERYTHING,
        ..TYPICAL
    },
];

const OMEGA: DeviceModel = DeviceModel {
    id: "omega.6",
    name: "omega.6",
    peak_force: 12.0,
    continuous_force: 12.0,
    max_stiffness: 5000.0,
    max_damping: 30.0,
    workspace_radius: 0.075,
    rate: 4000.0,
    mass: 0.22,
    unverified: DYNAMICS_AND_CONTINUOUS,
    ..TYPICAL
};

/// A model by its name.
#[must_use]
pub fn model(id: &str) -> Option<DeviceModel> {
    CATALOGUE.into_iter().find(|m| m.id == id)
}

impl DeviceModel {
    /// What a simulated device of this model can do.
    #[must_use]
    pub fn capabilities(&self) -> Capabilities {
        let corner = Vector3::repeat(self.workspace_radius);
        Capabilities {
            name: format!("{} (simulated)", self.name),
            senses_rotation: self.senses_rotation,
            drives_force: self.peak_force > 0.0,
            drives_torque: self.peak_torque > 0.0,
            peak_force: self.peak_force,
            continuous_force: self.continuous_force,
            peak_torque: self.peak_torque,
            continuous_torque: self.continuous_torque,
            max_stiffness: self.max_stiffness,
            max_angular_stiffness: self.max_angular_stiffness,
            max_damping: self.max_damping,
            workspace: [-corner, corner],
            rate: self.rate,
            buttons: 1,
            force_persists: true,
            hardware_watchdog: false,
            pacing: Pacing::Polled,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a row without a value, with limits the wrong way round, or one whose assumed dynamics pass as facts.
    #[test]
    fn every_row_is_complete_and_plausible() {
        for (i, m) in CATALOGUE.iter().enumerate() {
            assert!(!m.id.is_empty() && !m.name.is_empty());
            assert!(CATALOGUE[..i].iter().all(|other| other.id != m.id), "{} twice", m.id);
            assert!(m.peak_force >= m.continuous_force && m.continuous_force > 0.0, "{}", m.id);
            assert!(m.peak_torque >= m.continuous_torque && m.continuous_torque >= 0.0, "{}", m.id);
            assert_eq!(m.max_angular_stiffness > 0.0, m.peak_torque > 0.0, "{}", m.id);
            assert!(m.mass > 0.0 && m.inertia > 0.0 && m.max_stiffness > 0.0 && m.workspace_radius > 0.0);
            assert!(m.unverified.contains(&"mass") && m.unverified.contains(&"friction"), "{}", m.id);
            assert!(m.unverified.iter().all(|f| EVERYTHING.contains(f)));
            assert_eq!(model(m.id), Some(*m));
        }
        assert!(model(DEFAULT_MODEL).is_some());
    }
}
