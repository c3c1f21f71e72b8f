//! A handle with mass, held by a hand with a spring and damper; the same behind every emulator.

use nalgebra::{UnitQuaternion, Vector3};

/// Kilograms of hand and handle.
const MASS: f64 = 0.15;
/// N/m of the hand.
pub const HAND_STIFFNESS: f64 = 200.0;
/// N s/m of the hand: about critical.
const HAND_DAMPING: f64 = 10.0;
/// kg m^2.
const INERTIA: f64 = 5e-5;
/// N m/rad of the hand.
pub const HAND_ANGULAR_STIFFNESS: f64 = 0.2;
/// N m s/rad of the hand.
const HAND_ANGULAR_DAMPING: f64 = 6e-3;

/// A handle in a hand that pulls it to a target. Axes are those of the device that it is part of.
#[derive(Clone, Debug)]
pub struct HandAndHandle {
    /// Where the hand wants the handle, metres.
    pub target: Vector3<f64>,
    /// How the hand wants to hold it: rotation vector, radians.
    pub target_rotation: Vector3<f64>,
    /// Metres.
    pub position: Vector3<f64>,
    /// m/s.
    pub velocity: Vector3<f64>,
    /// Rotation vector (exact for turns about one axis), radians.
    pub rotation: Vector3<f64>,
    /// rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Force of the motors in the last step, N.
    pub force: Vector3<f64>,
    /// Torque of the motors in the last step, N m.
    pub torque: Vector3<f64>,
    /// Seconds since the start.
    pub time: f64,
}

impl Default for HandAndHandle {
    fn default() -> Self {
        let zero = Vector3::zeros();
        Self {
            target: zero,
            target_rotation: zero,
            position: zero,
            velocity: zero,
            rotation: zero,
            angular_velocity: zero,
            force: zero,
            torque: zero,
            time: 0.0,
        }
    }
}

impl HandAndHandle {
    /// One step under the motors' push; spring and damper are implicit, so that it is stable at any step.
    pub fn step(&mut self, force: Vector3<f64>, torque: Vector3<f64>, dt: f64) {
        let pull = HAND_STIFFNESS * (self.target - self.position) + force;
        let inverse = 1.0 / (1.0 + dt * HAND_DAMPING / MASS + dt * dt * HAND_STIFFNESS / MASS);
        self.velocity = (self.velocity + pull * (dt / MASS)) * inverse;
        self.position += self.velocity * dt;
        let turn = HAND_ANGULAR_STIFFNESS * (self.target_rotation - self.rotation) + torque;
        let (damping, stiffness) = (HAND_ANGULAR_DAMPING / INERTIA, HAND_ANGULAR_STIFFNESS / INERTIA);
        let inverse = 1.0 / (1.0 + dt * damping + dt * dt * stiffness);
        self.angular_velocity = (self.angular_velocity + turn * (dt / INERTIA)) * inverse;
        self.rotation += self.angular_velocity * dt;
        (self.force, self.torque) = (force, torque);
        self.time += dt;
    }

    /// The rotation vector as a quaternion.
    #[must_use]
    pub fn orientation(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.rotation)
    }

    /// The value of a name as in `position_x`, for scripts.
    pub fn part(&mut self, name: &str) -> Option<&mut f64> {
        let (vector, axis) = name.rsplit_once('_')?;
        let vector = match vector {
            "target" => &mut self.target,
            "target_rotation" => &mut self.target_rotation,
            "position" => &mut self.position,
            "velocity" => &mut self.velocity,
            "rotation" => &mut self.rotation,
            "angular_velocity" => &mut self.angular_velocity,
            "force" => &mut self.force,
            "torque" => &mut self.torque,
            _ => return None,
        };
        match axis {
            "x" => Some(&mut vector.x),
            "y" => Some(&mut vector.y),
            "z" => Some(&mut vector.z),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards the model: under a steady push it comes to rest at force / stiffness from its target, and turns likewise.
    #[test]
    fn rests_where_spring_and_push_balance() {
        let mut hand = HandAndHandle { target: Vector3::new(0.01, 0.0, 0.0), ..Default::default() };
        for _ in 0..3000 {
            hand.step(Vector3::new(0.0, 2.0, 0.0), Vector3::new(0.0, 0.0, 0.02), 1e-3);
        }
        assert!((hand.position - Vector3::new(0.01, 0.01, 0.0)).norm() < 1e-9, "{hand:?}");
        assert!((hand.rotation - Vector3::new(0.0, 0.0, 0.1)).norm() < 1e-9, "{hand:?}");
    }
}
