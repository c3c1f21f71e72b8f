//! A simulated device: sensors, motors and delay around a handle.

use super::handle::HeldHandle;
use super::{DeviceModel, Random};
use crate::hand::{HandError, HandParameters, Tremor};
use crate::{Applied, Capabilities, Device, DeviceCommand, DeviceFault, DeviceSample};
use nalgebra::{UnitQuaternion, Vector3};

/// Most samples of delay.
pub const MOST_DELAY: usize = 2;
/// Time constant of the motors' temperature, seconds.
const THERMAL_TIME: f64 = 10.0;
/// From this share of the greatest temperature on the motors are held back.
const HOT: f64 = 0.9;

/// What a simulated device is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedSettings {
    /// The device.
    pub model: DeviceModel,
    /// Who holds it.
    pub hand: HandParameters,
    /// Of the hand's tremor, metres.
    pub tremor: f64,
    /// A command acts this many samples after the one it was made from, 0 to [`MOST_DELAY`]: with 0 from that sample on.
    pub delay: usize,
    /// The share of a new velocity difference in the velocity estimate, above 0 to 1; 1: the difference itself.
    pub velocity_filter: f64,
    /// Samples are taken up to this much too early or too late, seconds.
    pub jitter: f64,
    /// Of tremor and jitter.
    pub seed: u64,
}

impl SimulatedSettings {
    /// The usual: one sample of delay, a velocity filter of 0.3 (57 Hz at 1 kHz), no jitter, no tremor.
    #[must_use]
    pub fn new(model: DeviceModel, hand: HandParameters) -> Self {
        Self { model, hand, tremor: 0.0, delay: 1, velocity_filter: 0.3, jitter: 0.0, seed: 0 }
    }
}

/// Why a simulated device cannot be: a name and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SimulatedError {
    /// Of the hand.
    Hand(HandError),
    /// Of the device.
    Device(&'static str, f64),
}

impl std::fmt::Display for SimulatedError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Hand(e) => e.fmt(f),
            Self::Device("delay", v) => write!(f, "device.delay is {v}; it must be 0, 1 or 2 samples"),
            Self::Device("velocity_filter", v) => {
                write!(f, "device.velocity_filter is {v}; it must be above 0 and not above 1")
            }
            Self::Device(name, v) => {
                write!(f, "{name} is {v}; it must be finite and not negative, a mass or inertia positive")
            }
        }
    }
}

impl std::error::Error for SimulatedError {}

/// A device that is computed. Its time goes on only by [`SimulatedDevice::advance`].
#[derive(Clone, Debug)]
pub struct SimulatedDevice {
    settings: SimulatedSettings,
    capabilities: Capabilities,
    handle: HeldHandle,
    random: Random,
    goal: DeviceSample,
    /// When the next sample is due, and when the handle is (jitter apart), seconds.
    time: f64,
    handle_time: f64,
    sample: DeviceSample,
    /// Orientations are quantised as turns from here.
    reference: UnitQuaternion<f64>,
    /// What the motors do now, and what they will.
    queue: [DeviceCommand; MOST_DELAY + 1],
    /// Temperature of the motors, 1: as hot as the continuous limits make them.
    heat: [f64; 2],
    enabled: bool,
}

impl SimulatedDevice {
    /// A device whose handle starts on the hand's goal, with its motors off.
    ///
    /// # Errors
    /// A setting out of its range.
    pub fn new(settings: SimulatedSettings, goal: &DeviceSample) -> Result<Self, SimulatedError> {
        check(&settings)?;
        let tremor = Tremor::new(settings.tremor, settings.seed);
        let mut sample = *goal;
        if !settings.model.senses_rotation {
            sample.orientation = UnitQuaternion::identity();
            sample.angular_velocity = Vector3::zeros();
        }
        Ok(Self {
            settings,
            capabilities: settings.model.capabilities(),
            handle: HeldHandle::new(&settings.model, &settings.hand, tremor, goal),
            random: Random::new(settings.seed ^ 0x5eed),
            goal: *goal,
            time: goal.time,
            handle_time: goal.time,
            sample,
            reference: goal.orientation,
            queue: [DeviceCommand::zero(); MOST_DELAY + 1],
            heat: [0.0; 2],
            enabled: false,
        })
    }

    /// Where the hand wants to be at the goal's time; it goes on from there with the goal's velocity, and its buttons are pressed.
    pub fn set_goal(&mut self, goal: &DeviceSample) {
        self.goal = *goal;
    }

    /// Another hand takes the handle, or lets it go.
    ///
    /// # Errors
    /// An impedance that no hand has.
    pub fn set_hand(&mut self, hand: HandParameters) -> Result<(), HandError> {
        hand.check()?;
        self.settings.hand = hand;
        self.handle.hold(&self.settings.model, &hand);
        Ok(())
    }

    /// Lets `dt` seconds pass, and takes a sample. Real time: work in proportion to `dt`, no allocation.
    pub fn advance(&mut self, dt: f64) {
        if !(dt > 0.0 && dt.is_finite()) {
            return;
        }
        self.time += dt;
        let jitter = self.settings.jitter * (2.0 * self.random.unit() - 1.0);
        let until = (self.time + jitter).max(self.handle_time);
        self.warm(dt);
        self.handle.advance(self.handle_time, until, &self.goal, &self.queue[0]);
        self.handle_time = until;
        self.sense(dt);
    }

    /// What the motors push with now.
    #[must_use]
    pub fn acting(&self) -> DeviceCommand {
        self.queue[0]
    }

    /// Where the handle really is.
    #[must_use]
    pub fn position(&self) -> Vector3<f64> {
        self.handle.position
    }

    /// Takes a sample as the encoders see it, with a velocity from differences.
    fn sense(&mut self, dt: f64) {
        let model = &self.settings.model;
        let position = quantised(&self.handle.position, model.resolution);
        let orientation = if !model.senses_rotation {
            UnitQuaternion::identity()
        } else if model.angular_resolution > 0.0 {
            let turn = (self.handle.orientation * self.reference.inverse()).scaled_axis();
            UnitQuaternion::from_scaled_axis(quantised(&turn, model.angular_resolution)) * self.reference
        } else {
            self.handle.orientation
        };
        let before = &self.sample;
        let turn = (orientation * before.orientation.inverse()).scaled_axis();
        let a = self.settings.velocity_filter;
        self.sample = DeviceSample {
            time: self.time,
            position,
            orientation,
            linear_velocity: before.linear_velocity * (1.0 - a) + (position - before.position) * (a / dt),
            angular_velocity: before.angular_velocity * (1.0 - a) + turn * (a / dt),
            buttons: self.goal.buttons,
        };
    }

    fn warm(&mut self, dt: f64) {
        let model = &self.settings.model;
        let now = &self.queue[0];
        let loads = [(now.force, model.continuous_force), (now.torque, model.continuous_torque)];
        for (heat, (wrench, continuous)) in self.heat.iter_mut().zip(loads) {
            let load = if continuous > 0.0 { wrench.norm_squared() / (continuous * continuous) } else { 0.0 };
            *heat += (load - *heat) * (dt / THERMAL_TIME).min(1.0);
        }
    }

    /// The greatest force and torque at the motors' temperature.
    fn limits(&self) -> [f64; 2] {
        let m = &self.settings.model;
        let limit = |heat: f64, peak: f64, continuous: f64| {
            continuous + (peak - continuous) * ((1.0 - heat) / (1.0 - HOT)).clamp(0.0, 1.0)
        };
        [
            limit(self.heat[0], m.peak_force, m.continuous_force),
            limit(self.heat[1], m.peak_torque, m.continuous_torque),
        ]
    }
}

impl Device for SimulatedDevice {
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
        if !enabled {
            self.queue = [DeviceCommand::zero(); MOST_DELAY + 1];
        }
        Ok(())
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        Ok(self.sample)
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        self.queue.rotate_left(1);
        let last = self.settings.delay;
        let finite = command.force.norm_squared().is_finite() && command.torque.norm_squared().is_finite();
        if !finite || !self.enabled {
            self.queue[last] = DeviceCommand::zero();
            return if finite { Ok(Applied::Disabled) } else { Err(DeviceFault::Malformed) };
        }
        let [force, torque] = self.limits();
        let torque_told = if self.capabilities.drives_torque { command.torque } else { Vector3::zeros() };
        let share = |v: &Vector3<f64>, most: f64| {
            let length = v.norm_squared().sqrt();
            if length > most { most / length } else { 1.0 }
        };
        let share = share(&command.force, force).min(share(&torque_told, torque));
        self.queue[last] = DeviceCommand { force: command.force * share, torque: torque_told * share };
        Ok(if share < 1.0 { Applied::Scaled(share) } else { Applied::Fully })
    }

    fn stop(&mut self) {
        self.queue = [DeviceCommand::zero(); MOST_DELAY + 1];
        self.enabled = false;
    }
}

impl Drop for SimulatedDevice {
    fn drop(&mut self) {
        self.stop();
    }
}

/// The nearest value that encoders of this resolution know.
fn quantised(v: &Vector3<f64>, resolution: f64) -> Vector3<f64> {
    if resolution > 0.0 { v.map(|c| libm::round(c / resolution) * resolution) } else { *v }
}

fn check(settings: &SimulatedSettings) -> Result<(), SimulatedError> {
    settings.hand.check().map_err(SimulatedError::Hand)?;
    let m = &settings.model;
    if settings.delay > MOST_DELAY {
        return Err(SimulatedError::Device("delay", settings.delay as f64));
    }
    let filter = settings.velocity_filter;
    if !(filter > 0.0 && filter <= 1.0) {
        return Err(SimulatedError::Device("velocity_filter", filter));
    }
    let positive = [("device.mass", m.mass), ("device inertia", m.inertia)];
    if let Some((name, v)) = positive.into_iter().find(|(_, v)| !(*v > 0.0 && v.is_finite())) {
        return Err(SimulatedError::Device(name, v));
    }
    let not_negative = [
        ("device.damping", m.damping),
        ("device.friction", m.friction),
        ("device angular damping", m.angular_damping),
        ("device angular friction", m.angular_friction),
        ("device.resolution", m.resolution),
        ("device angular resolution", m.angular_resolution),
        ("device.jitter", settings.jitter),
        ("hand.tremor", settings.tremor),
    ];
    match not_negative.into_iter().find(|(_, v)| !(*v >= 0.0 && v.is_finite())) {
        Some((name, v)) => Err(SimulatedError::Device(name, v)),
        None => Ok(()),
    }
}
