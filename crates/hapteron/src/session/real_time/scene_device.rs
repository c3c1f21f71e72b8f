//! The device of a scene that names none: a handle on the scene's motion, with or without a hand that feels the force, moved by the clock.

use super::clock;
use crate::scene::{Scene, SceneError};
use crate::session::virtual_time::simulated_device;
use hapteron_device::simulated::SimulatedDevice;
use hapteron_device::{Applied, Capabilities, Device, DeviceCommand, DeviceFault, DeviceSample, Pacing};
use nalgebra::Vector3;
use std::sync::Arc;

/// Steps that a device makes at once when a tick is late, so that the tick after a long stop is not late for its sake.
const MOST_STEPS: u64 = 50;

/// A simulated device on the scene's motion.
///
/// In real time it has gone on by as many time steps as have passed on the clock, under the force that was written last, like a real one.
pub struct SceneDevice {
    scene: Arc<Scene>,
    capabilities: Capabilities,
    /// Where a hand feels the force.
    simulated: Option<SimulatedDevice>,
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
    /// A device that cannot be (a scene that was read has been checked already).
    pub fn new(scene: Arc<Scene>, repeat: bool) -> Result<Self, SceneError> {
        let first = scene.scaling.from_world(&scene.trajectory.sample(0.0, scene.time_step));
        let simulated = simulated_device(&scene, &first)?;
        let capabilities = match &simulated {
            Some(device) => Capabilities { pacing: Pacing::Polled, ..device.capabilities().clone() },
            None => unfelt(1.0 / scene.time_step),
        };
        Ok(Self { scene, capabilities, simulated, enabled: false, repeat, epoch_ns: None, steps: 0 })
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

    /// Makes the steps that have passed on the clock.
    fn go_on(&mut self) {
        let now = clock::now_ns();
        let dt = self.scene.time_step;
        let step_ns = dt * 1e9;
        // The first sample is that of the end of the first step.
        let epoch = *self.epoch_ns.get_or_insert(now - step_ns as u64);
        let wanted = ((now - epoch) as f64 / step_ns).round() as u64;
        let skipped = wanted.saturating_sub(MOST_STEPS);
        if self.steps < skipped {
            // As if the clock had stood still meanwhile.
            self.epoch_ns = Some(epoch + ((skipped - self.steps) as f64 * step_ns) as u64);
        }
        let wanted = wanted.min(self.steps + MOST_STEPS);
        while self.steps < wanted {
            self.steps += 1;
            let goal = self.goal(self.steps);
            if let Some(device) = &mut self.simulated {
                device.set_goal(&goal);
                device.advance(dt);
            }
        }
    }
}

impl Device for SceneDevice {
    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn is_simulated(&self) -> bool {
        true
    }

    fn home(&mut self) -> Result<(), DeviceFault> {
        Ok(())
    }

    fn set_force_enabled(&mut self, enabled: bool) -> Result<(), DeviceFault> {
        self.enabled = enabled;
        // The motion begins with the next sample.
        (self.epoch_ns, self.steps) = (None, 0);
        self.simulated.as_mut().map_or(Ok(()), |device| device.set_force_enabled(enabled))
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        if self.enabled {
            self.go_on();
        }
        match &mut self.simulated {
            Some(device) => device.read(),
            None => Ok(self.goal(self.steps)),
        }
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        match &mut self.simulated {
            Some(device) => device.write(command),
            None if command.force.iter().chain(&command.torque).all(|c| c.is_finite()) => Ok(Applied::Fully),
            None => Err(DeviceFault::Malformed),
        }
    }

    fn stop(&mut self) {
        if let Some(device) = &mut self.simulated {
            device.stop();
        }
        self.enabled = false;
    }
}

/// A motion that nobody feels anything of.
fn unfelt(rate: f64) -> Capabilities {
    Capabilities {
        name: "recorded motion".to_owned(),
        senses_rotation: true,
        drives_force: false,
        drives_torque: false,
        peak_force: 0.0,
        continuous_force: 0.0,
        peak_torque: 0.0,
        continuous_torque: 0.0,
        max_stiffness: f64::INFINITY,
        max_angular_stiffness: f64::INFINITY,
        max_damping: f64::INFINITY,
        workspace: [Vector3::zeros(); 2],
        rate,
        buttons: 0,
        force_persists: false,
        hardware_watchdog: true,
        pacing: Pacing::Polled,
    }
}

impl Drop for SceneDevice {
    fn drop(&mut self) {
        self.stop();
    }
}
