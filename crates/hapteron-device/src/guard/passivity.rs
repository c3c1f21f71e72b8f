//! Time-domain passivity observer and controller (Hannaford and Ryu 2002; method.md G.1).

use crate::DeviceCommand;
use nalgebra::Vector3;

/// Radius by which the controller's damping becomes that of rotation, metres.
const RADIUS: f64 = 0.02;
/// Slower than this there is nothing to damp, m/s.
const LEAST_SPEED: f64 = 1e-4;
/// Energy that the virtual side may have taken in and give back, J: more would be a licence to feed an oscillation.
const MOST_CREDIT: f64 = 0.25;
/// While there is no force, what was observed is forgotten with this time constant, seconds.
const FORGET: f64 = 1.0;

/// What went through the device's port.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PassivityObserver {
    /// Energy that the virtual side took in, J; below zero it made energy.
    energy: f64,
}

impl PassivityObserver {
    pub fn new() -> Self {
        Self { energy: 0.0 }
    }

    pub fn energy(&self) -> f64 {
        self.energy
    }

    /// Takes the energy that went to the hand since the last pass, J.
    pub fn take(&mut self, to_hand: f64, idle: bool, dt: f64) {
        self.energy = (self.energy - to_hand).min(MOST_CREDIT);
        if idle {
            self.energy *= 1.0 - (dt / FORGET).min(1.0);
        }
    }

    /// The command with the damping that brings the observed energy back to zero, within `most` (N s/m); whether any was needed. `moved` is how far
    /// the handle went and turned since the last pass: a filtered velocity would come too late to damp.
    pub fn control(
        &self,
        command: &DeviceCommand,
        moved: &[Vector3<f64>; 2],
        most: f64,
        dt: f64,
    ) -> (DeviceCommand, bool) {
        let (v, omega) = (moved[0] / dt, moved[1] / dt);
        let speed2 = v.norm_squared() + omega.norm_squared() * (RADIUS * RADIUS);
        if !(self.energy < 0.0 && speed2 > LEAST_SPEED * LEAST_SPEED) {
            return (*command, false);
        }
        let damping = (-self.energy / (dt * speed2)).min(most);
        let damped = DeviceCommand {
            force: command.force - v * damping,
            torque: command.torque - omega * (damping * RADIUS * RADIUS),
        };
        (damped, true)
    }
}
