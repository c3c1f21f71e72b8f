//! Scaling between the device's workspace and the virtual world (section 7.4 of the paper).

use crate::{DeviceCommand, DeviceSample};

/// Positions in the world are those of the device times `position_scale`; orientations stay.
///
/// The force on the hand is the virtual one divided by the scale (0.4 gives the paper's 2.5). So the power at the device is the virtual
/// power divided by the scale squared, and since rotations are not scaled the torque must be divided by the square (6.25),
/// or energy would be made in exchanging translation for rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaling {
    position_scale: f64,
}

/// A scale that is not positive and finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalingError(pub f64);

impl std::fmt::Display for ScalingError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "position_scale is {}; it must be positive and finite", self.0)
    }
}

impl std::error::Error for ScalingError {}

impl Scaling {
    /// A scaling.
    ///
    /// # Errors
    /// A scale that is not positive and finite.
    pub fn new(position_scale: f64) -> Result<Self, ScalingError> {
        if position_scale > 0.0 && position_scale.is_finite() {
            Ok(Self { position_scale })
        } else {
            Err(ScalingError(position_scale))
        }
    }

    /// The device's sample in the virtual world.
    #[must_use]
    pub fn to_world(&self, sample: &DeviceSample) -> DeviceSample {
        DeviceSample {
            position: sample.position * self.position_scale,
            linear_velocity: sample.linear_velocity * self.position_scale,
            ..*sample
        }
    }

    /// The sample that a device would give for one in the virtual world.
    #[must_use]
    pub fn from_world(&self, sample: &DeviceSample) -> DeviceSample {
        DeviceSample {
            position: sample.position / self.position_scale,
            linear_velocity: sample.linear_velocity / self.position_scale,
            ..*sample
        }
    }

    /// What the device is told when the virtual world pushes the handle like this.
    #[must_use]
    pub fn to_device(&self, command: &DeviceCommand) -> DeviceCommand {
        let s = self.position_scale;
        DeviceCommand { force: command.force / s, torque: command.torque / (s * s) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn power_is_scaled_by_one_factor_for_force_and_torque() {
        let scaling = Scaling::new(0.4).unwrap();
        let sample = DeviceSample {
            time: 0.0,
            position: Vector3::x(),
            orientation: UnitQuaternion::identity(),
            linear_velocity: Vector3::new(1.0, 2.0, 3.0),
            angular_velocity: Vector3::new(-1.0, 0.5, 2.0),
            buttons: 0,
        };
        let command =
            DeviceCommand { force: Vector3::new(3.0, -1.0, 2.0), torque: Vector3::new(0.1, 0.3, 0.2) };
        let (world, device) = (scaling.to_world(&sample), scaling.to_device(&command));
        assert_eq!(device.force, command.force / 0.4);
        let force = device.force.dot(&sample.linear_velocity) / command.force.dot(&world.linear_velocity);
        let torque =
            device.torque.dot(&sample.angular_velocity) / command.torque.dot(&world.angular_velocity);
        assert!((force - 6.25).abs() < 1e-12 && (torque - 6.25).abs() < 1e-12);
    }

    #[test]
    fn a_scale_must_be_positive() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Scaling::new(bad).is_err());
        }
    }
}
