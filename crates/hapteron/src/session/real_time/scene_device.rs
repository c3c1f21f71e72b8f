//! The device of a scene that names none: a handle on the scene's motion, with or without a hand that feels the force, moved by the clock.

use super::clock;
use crate::scene::Scene;
use hapteron_device::{
    Applied, Capabilities, Device, DeviceCommand, DeviceFault, DeviceSample, Hand, Pacing,
};
use nalgebra::Vector3;
use std::sync::Arc;

/// Steps that a hand makes at once when a tick is late, so that the tick after a long stop is not late for its sake.
const MOST_STEPS: u64 = 50;

/// A simulated device on the scene's motion.
///
/// In real time it has gone on by as many time steps as have passed on the clock, under the force that was written last, like a real one.
pub struct SceneDevice {
    scene: Arc<Scene>,
    capabilities: Capabilities,
    hand: Option<Hand>,
    command: DeviceCommand,
    enabled: bool,
    /// The motion begins anew when it is over, if its end is where it began.
    repeat: bool,
    /// Clock of the first sample of the motion, and steps made since.
    epoch_ns: Option<u64>,
    steps: u64,
}

impl SceneDevice {
    /// A device at the start of the scene's motion, which begins anew at its end with `repeat`.
    ///
    /// # Errors
    /// Parameters of the hand that no hand has (a scene that was read has been checked already).
    pub fn new(scene: Arc<Scene>, repeat: bool) -> Result<Self, hapteron_device::HandError> {
        let first = scene.scaling.from_world(&scene.trajectory.sample(0.0, scene.time_step));
        let hand = scene.hand.map(|p| Hand::new(p, &first)).transpose()?;
        let felt = hand.is_some();
        let infinite = if felt { f64::INFINITY } else { 0.0 };
        let capabilities = Capabilities {
            name: (if felt { "simulated hand" } else { "recorded motion" }).to_owned(),
            senses_rotation: true,
            drives_force: felt,
            drives_torque: felt,
            peak_force: infinite,
            continuous_force: infinite,
            peak_torque: infinite,
            continuous_torque: infinite,
            max_stiffness: f64::INFINITY,
            max_angular_stiffness: f64::INFINITY,
            max_damping: f64::INFINITY,
            workspace: [Vector3::zeros(); 2],
            rate: 1.0 / scene.time_step,
            buttons: 0,
            force_persists: true,
            hardware_watchdog: false,
            pacing: Pacing::Polled,
        };
        Ok(Self {
            scene,
            capabilities,
            hand,
            command: DeviceCommand::zero(),
            enabled: false,
            repeat,
            epoch_ns: None,
            steps: 0,
        })
    }

    /// What the hand wants at a step, in the device's scale.
    fn goal(&self, step: u64) -> DeviceSample {
        let dt = self.scene.time_step;
        let time = step as f64 * dt;
        let duration = self.scene.trajectory.duration();
        let within = if self.repeat && duration > dt { time % duration } else { time };
        let sample = self.scene.trajectory.sample(within, dt);
        DeviceSample { time, ..self.scene.scaling.from_world(&sample) }
    }
}

impl Device for SceneDevice {
    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn home(&mut self) -> Result<(), DeviceFault> {
        Ok(())
    }

    fn set_force_enabled(&mut self, enabled: bool) -> Result<(), DeviceFault> {
        self.enabled = enabled;
        self.command = DeviceCommand::zero();
        // The motion begins with the next sample.
        (self.epoch_ns, self.steps) = (None, 0);
        Ok(())
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        if !self.enabled {
            return Ok(self.hand.map_or_else(|| self.goal(0), |hand| hand.sample()));
        }
        let now = clock::now_ns();
        let step_ns = self.scene.time_step * 1e9;
        // The first sample is that of the end of the first step.
        let epoch = *self.epoch_ns.get_or_insert(now - step_ns as u64);
        let wanted = ((now - epoch) as f64 / step_ns).round() as u64;
        self.steps = self.steps.max(wanted.saturating_sub(MOST_STEPS));
        while self.steps < wanted {
            self.steps += 1;
            let goal = self.goal(self.steps);
            if let Some(hand) = &mut self.hand {
                hand.advance(&goal, &self.command, self.scene.time_step);
            }
        }
        Ok(self.hand.map_or_else(|| self.goal(self.steps), |hand| hand.sample()))
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        let finite = command.force.iter().chain(&command.torque).all(|c| c.is_finite());
        let on = self.enabled && finite;
        self.command = if on { *command } else { DeviceCommand::zero() };
        match (finite, self.enabled) {
            (false, _) => Err(DeviceFault::Malformed),
            (true, false) => Ok(Applied::Disabled),
            (true, true) => Ok(Applied::Fully),
        }
    }

    fn stop(&mut self) {
        self.command = DeviceCommand::zero();
        self.enabled = false;
    }
}

impl Drop for SceneDevice {
    fn drop(&mut self) {
        self.stop();
    }
}
