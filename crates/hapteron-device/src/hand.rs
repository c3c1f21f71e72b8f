//! A hand that holds the handle: pulled along a motion by a spring and damper, and pushed by the device.

use crate::{DeviceCommand, DeviceSample};
use nalgebra::{UnitQuaternion, Vector3};

/// The hand's impedance, for translation and (with the mass at `RADIUS`) for rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandParameters {
    /// Mass of hand and handle together, kg.
    pub mass: f64,
    /// N s/m.
    pub damping: f64,
    /// N/m.
    pub stiffness: f64,
}

/// Radius of gyration by which translation's mass, damping and stiffness become those of rotation, metres. With a light
/// pinch (0.05 kg, 4 N s/m, 100 N/m) it gives moments as measured at a pinch: 2e-5 kg m^2, 1.6e-3 N m s, 0.04 N m.
const RADIUS: f64 = 0.02;

/// Why a hand cannot be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandError(pub &'static str, pub f64);

impl std::fmt::Display for HandError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "hand.{} is {}; it must be finite, mass and stiffness positive, damping not negative",
            self.0, self.1
        )
    }
}

impl std::error::Error for HandError {}

/// A simulated hand with its state.
#[derive(Clone, Copy, Debug)]
pub struct Hand {
    parameters: HandParameters,
    sample: DeviceSample,
}

impl Hand {
    /// A hand that starts on its goal.
    ///
    /// # Errors
    /// Mass and stiffness must be positive, damping not negative, all finite.
    pub fn new(parameters: HandParameters, goal: &DeviceSample) -> Result<Self, HandError> {
        let HandParameters { mass, damping, stiffness } = parameters;
        for (name, value, valid) in [
            ("mass", mass, mass > 0.0),
            ("damping", damping, damping >= 0.0),
            ("stiffness", stiffness, stiffness > 0.0),
        ] {
            if !(valid && value.is_finite()) {
                return Err(HandError(name, value));
            }
        }
        Ok(Self { parameters, sample: *goal })
    }

    /// Where the hand is.
    #[must_use]
    pub fn sample(&self) -> DeviceSample {
        self.sample
    }

    /// Moves on by `dt` towards a goal while the device pushes with a held force.
    ///
    /// Implicit Euler on each axis, stable for any impedance. The turn towards the goal is treated as small within one step. Real time: constant work.
    pub fn advance(&mut self, goal: &DeviceSample, command: &DeviceCommand, dt: f64) -> DeviceSample {
        let HandParameters { mass, damping, stiffness } = self.parameters;
        let whole = mass + dt * damping + dt * dt * stiffness;
        let pull = (goal.position - self.sample.position) * stiffness
            + goal.linear_velocity * damping
            + command.force;
        let v = (self.sample.linear_velocity * mass + pull * dt) / whole;
        let r2 = RADIUS * RADIUS;
        let turn = (goal.orientation * self.sample.orientation.inverse()).scaled_axis();
        let twist = turn * (stiffness * r2) + goal.angular_velocity * (damping * r2) + command.torque;
        let omega = (self.sample.angular_velocity * (mass * r2) + twist * dt) / (whole * r2);
        let finite = |v: &Vector3<f64>| v.iter().all(|c| c.is_finite());
        if finite(&v) && finite(&omega) {
            self.sample.position += v * dt;
            self.sample.orientation = UnitQuaternion::from_scaled_axis(omega * dt) * self.sample.orientation;
            self.sample.linear_velocity = v;
            self.sample.angular_velocity = omega;
        }
        self.sample.time = goal.time;
        self.sample
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(position: Vector3<f64>) -> DeviceSample {
        DeviceSample {
            time: 0.0,
            position,
            orientation: UnitQuaternion::identity(),
            linear_velocity: Vector3::zeros(),
            angular_velocity: Vector3::zeros(),
            buttons: 0,
        }
    }

    #[test]
    fn a_pushed_hand_gives_way_by_force_over_stiffness() {
        let parameters = HandParameters { mass: 0.1, damping: 5.0, stiffness: 100.0 };
        let goal = at(Vector3::zeros());
        let mut hand = Hand::new(parameters, &goal).unwrap();
        let command =
            DeviceCommand { force: Vector3::new(0.0, 0.0, 2.0), torque: Vector3::new(0.01, 0.0, 0.0) };
        for _ in 0..5000 {
            hand.advance(&goal, &command, 1e-3);
        }
        assert!((hand.sample().position.z - 0.02).abs() < 1e-9);
        let angle = 0.01 / (100.0 * RADIUS * RADIUS);
        assert!((hand.sample().orientation.scaled_axis().x - angle).abs() < 1e-6);
    }

    #[test]
    fn a_force_that_is_not_finite_does_not_move_the_hand() {
        let parameters = HandParameters { mass: 0.1, damping: 5.0, stiffness: 100.0 };
        let goal = at(Vector3::x());
        let mut hand = Hand::new(parameters, &goal).unwrap();
        let command = DeviceCommand { force: Vector3::new(f64::NAN, 0.0, 0.0), torque: Vector3::zeros() };
        assert_eq!(hand.advance(&goal, &command, 1e-3).position, Vector3::x());
    }

    #[test]
    fn impedance_must_be_physical() {
        let goal = at(Vector3::zeros());
        let good = HandParameters { mass: 0.1, damping: 5.0, stiffness: 100.0 };
        for bad in [
            HandParameters { mass: 0.0, ..good },
            HandParameters { damping: -1.0, ..good },
            HandParameters { stiffness: f64::NAN, ..good },
        ] {
            assert!(Hand::new(bad, &goal).is_err());
        }
    }
}
