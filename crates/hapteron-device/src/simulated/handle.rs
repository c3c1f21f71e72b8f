//! How the handle moves between two samples: mass, friction, the hand's pull and the motors' push.

use super::DeviceModel;
use crate::hand::{GRIP_RADIUS, HandParameters, Tremor};
use crate::{DeviceCommand, DeviceSample};
use nalgebra::{UnitQuaternion, Vector3};

/// Longest inner step, seconds.
const LONGEST_STEP: f64 = 1e-4;

/// One kind of motion, translation or rotation, by one set of numbers.
#[derive(Clone, Copy, Debug)]
struct Axis {
    mass: f64,
    damping: f64,
    /// Coulomb friction, a force.
    friction: f64,
    /// Of the hand.
    stiffness: f64,
    pull_damping: f64,
}

impl Axis {
    /// The velocity after `h` seconds: the midpoint rule for mass, springs and dampers (no damping of its own, second order),
    /// with the friction as an impulse that can stop the motion but not turn it round.
    fn velocity(
        &self,
        v: Vector3<f64>,
        away: Vector3<f64>,
        goal_v: Vector3<f64>,
        push: Vector3<f64>,
        h: f64,
    ) -> Vector3<f64> {
        let Self { mass, damping, friction, stiffness, pull_damping } = *self;
        let half = 0.5 * h * (damping + pull_damping) + 0.25 * h * h * stiffness;
        // `away` is from the handle to the goal at the middle of the step, as if the handle stood still.
        let p = v * (mass - half) + (away * stiffness + goal_v * pull_damping + push) * h;
        let length = p.norm_squared().sqrt();
        let stopped = friction * h;
        if length > stopped { p * ((1.0 - stopped / length) / (mass + half)) } else { Vector3::zeros() }
    }
}

/// The handle in a hand.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldHandle {
    linear: Axis,
    angular: Axis,
    tremor: Tremor,
    pub position: Vector3<f64>,
    pub orientation: UnitQuaternion<f64>,
    linear_velocity: Vector3<f64>,
    angular_velocity: Vector3<f64>,
}

impl HeldHandle {
    pub fn new(model: &DeviceModel, hand: &HandParameters, tremor: Tremor, start: &DeviceSample) -> Self {
        let r2 = GRIP_RADIUS * GRIP_RADIUS;
        Self {
            linear: Axis {
                mass: model.mass + hand.mass,
                damping: model.damping,
                friction: model.friction,
                stiffness: hand.stiffness,
                pull_damping: hand.damping,
            },
            angular: Axis {
                mass: model.inertia + hand.mass * r2,
                damping: model.angular_damping,
                friction: model.angular_friction,
                stiffness: hand.stiffness * r2,
                pull_damping: hand.damping * r2,
            },
            tremor,
            position: start.position,
            orientation: start.orientation,
            linear_velocity: start.linear_velocity,
            angular_velocity: start.angular_velocity,
        }
    }

    /// Another hand takes the handle, where it is and as fast as it is.
    pub fn hold(&mut self, model: &DeviceModel, hand: &HandParameters) {
        let now = DeviceSample {
            time: 0.0,
            position: self.position,
            orientation: self.orientation,
            linear_velocity: self.linear_velocity,
            angular_velocity: self.angular_velocity,
            buttons: 0,
        };
        *self = Self::new(model, hand, self.tremor, &now);
    }

    /// Moves on from `from` to `to` (seconds) under a held force, towards a goal that moves evenly through where it is at its own time.
    pub fn advance(&mut self, from: f64, to: f64, goal: &DeviceSample, command: &DeviceCommand) {
        let steps = ((to - from) / LONGEST_STEP).ceil().max(1.0);
        let h = (to - from) / steps;
        for i in 0..steps as u32 {
            self.step(from + (f64::from(i) + 0.5) * h, h, goal, command);
        }
    }

    fn step(&mut self, middle: f64, h: f64, goal: &DeviceSample, command: &DeviceCommand) {
        let ahead = middle - goal.time;
        let [shift, turn] = self.tremor.at(middle);
        let wanted = goal.position + goal.linear_velocity * ahead + shift;
        let v = self.linear.velocity(
            self.linear_velocity,
            wanted - self.position,
            goal.linear_velocity,
            command.force,
            h,
        );
        let away = if self.angular.stiffness > 0.0 {
            let wanted =
                UnitQuaternion::from_scaled_axis(goal.angular_velocity * ahead + turn) * goal.orientation;
            (wanted * self.orientation.inverse()).scaled_axis()
        } else {
            Vector3::zeros()
        };
        let omega =
            self.angular.velocity(self.angular_velocity, away, goal.angular_velocity, command.torque, h);
        self.position += (self.linear_velocity + v) * (0.5 * h);
        let turned = UnitQuaternion::from_scaled_axis((self.angular_velocity + omega) * (0.5 * h));
        self.orientation = UnitQuaternion::new_normalize((turned * self.orientation).into_inner());
        self.linear_velocity = v;
        self.angular_velocity = omega;
    }
}
