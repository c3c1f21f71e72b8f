//! Who feels the force: `[device]`, `[hand]` and `[guard]`.

use super::file::{self, SceneFile};
use super::resolve::{Resolved, Resolver};
use hapteron_device::guard::{Guard, GuardSettings};
use hapteron_device::simulated::{
    self, CATALOGUE, DEFAULT_MODEL, SimulatedDevice, SimulatedError, SimulatedSettings,
};
use hapteron_device::{Capabilities, DeviceSample, Grip, HandParameters};
use nalgebra::{UnitQuaternion, Vector3};

/// The kind of device that is no driver.
pub(super) const SIMULATED: &str = "simulated";

/// What the three tables come to.
pub(super) struct ClosedLoop {
    pub hand: Option<HandParameters>,
    pub simulated: SimulatedSettings,
    pub guard: Option<GuardSettings>,
}

impl ClosedLoop {
    /// The handle as the device would sense it, where a simulated hand holds it.
    pub fn sensed(&self, handle: DeviceSample) -> DeviceSample {
        if self.hand.is_none() || self.simulated.model.senses_rotation {
            return handle;
        }
        DeviceSample { orientation: UnitQuaternion::identity(), angular_velocity: Vector3::zeros(), ..handle }
    }
}

impl Resolver<'_> {
    pub(super) fn closed_loop(&self, file: &mut SceneFile, time_step: f64) -> Resolved<ClosedLoop> {
        let seed = file.scene.seed.unwrap_or(0);
        let hand = self.hand(&mut file.hand)?;
        let simulated = self.simulated(&mut file.device, &mut file.hand, hand, seed)?;
        let kind = file.device.kind.get_or_insert_with(|| SIMULATED.to_owned());
        let real = kind != SIMULATED;
        let guard = self.guard(&mut file.guard, real, hand.is_some(), &simulated, time_step)?;
        Ok(ClosedLoop { hand, simulated, guard })
    }

    fn hand(&self, hand: &mut file::Hand) -> Resolved<Option<HandParameters>> {
        let numbers = (hand.mass, hand.damping, hand.stiffness);
        let parameters = match (hand.grip.take(), numbers) {
            (None, (None, None, None)) => return Ok(None),
            (Some(grip), (None, None, None)) => match grip {
                file::Grip::Released => Grip::Released,
                file::Grip::Light => Grip::Light,
                file::Grip::Medium => Grip::Medium,
                file::Grip::Firm => Grip::Firm,
            }
            .parameters(),
            (Some(_), _) => {
                let text = "stands beside mass, damping or stiffness; give the grip or these three";
                return Err(self.source.fault("hand.grip", text));
            }
            (None, (Some(mass), Some(damping), Some(stiffness))) => {
                HandParameters { mass, damping, stiffness }
            }
            _ => {
                let text = "a simulated hand needs a grip, or mass, damping and stiffness together; leave all out for a handle that follows the motion exactly";
                return Err(self.source.fault("hand.mass", text));
            }
        };
        let HandParameters { mass, damping, stiffness } = parameters;
        (hand.mass, hand.damping, hand.stiffness) = (Some(mass), Some(damping), Some(stiffness));
        Ok(Some(parameters))
    }

    fn simulated(
        &self,
        device: &mut file::Device,
        hand: &mut file::Hand,
        parameters: Option<HandParameters>,
        seed: u32,
    ) -> Resolved<SimulatedSettings> {
        let name = device.model.get_or_insert_with(|| DEFAULT_MODEL.to_owned());
        let Some(mut model) = simulated::model(name) else {
            let known: Vec<&str> = CATALOGUE.iter().map(|m| m.id).collect();
            let text = format!("`{name}` is not in the catalogue; there are {}", known.join(", "));
            return Err(self.source.fault("device.model", text));
        };
        model.mass = self.positive("device.mass", &mut device.mass, model.mass)?;
        model.damping = self.not_negative("device.damping", &mut device.damping, model.damping)?;
        model.friction = self.not_negative("device.friction", &mut device.friction, model.friction)?;
        model.resolution =
            self.not_negative("device.resolution", &mut device.resolution, model.resolution)?;
        let usual = SimulatedSettings::new(model, parameters.unwrap_or_default());
        let tremor = match parameters {
            Some(_) => self.not_negative("hand.tremor", &mut hand.tremor, 0.0)?,
            None if hand.tremor.is_some() => {
                let text = "only a simulated hand trembles; give it a grip";
                return Err(self.source.fault("hand.tremor", text));
            }
            None => 0.0,
        };
        let settings = SimulatedSettings {
            tremor,
            delay: *device.delay.get_or_insert(usual.delay),
            velocity_filter: *device.velocity_filter.get_or_insert(usual.velocity_filter),
            jitter: self.not_negative("device.jitter", &mut device.jitter, usual.jitter)?,
            seed: u64::from(seed),
            ..usual
        };
        let at_rest = DeviceSample {
            time: 0.0,
            position: Vector3::zeros(),
            orientation: UnitQuaternion::identity(),
            linear_velocity: Vector3::zeros(),
            angular_velocity: Vector3::zeros(),
            buttons: 0,
        };
        match SimulatedDevice::new(settings, &at_rest) {
            Ok(_) => Ok(settings),
            Err(e) => {
                let key = match &e {
                    SimulatedError::Hand(e) => format!("hand.{}", e.0),
                    SimulatedError::Device(name, _) => {
                        format!("device.{}", name.trim_start_matches("device."))
                    }
                };
                Err(self.source.fault(&key, e.to_string()))
            }
        }
    }

    fn guard(
        &self,
        keys: &mut file::Guard,
        real: bool,
        hand: bool,
        simulated: &SimulatedSettings,
        time_step: f64,
    ) -> Resolved<Option<GuardSettings>> {
        let enabled = *keys.enabled.get_or_insert(real || hand);
        let settings =
            guard_settings(keys, &simulated.model.capabilities(), !real, simulated.delay, time_step);
        Guard::new(settings).map_err(|e| self.source.fault(&format!("guard.{}", e.0), e.to_string()))?;
        if !real {
            // Of a real device only the device itself knows the limits.
            write_out(keys, &settings);
        }
        Ok(as_wanted(settings, enabled, real))
    }
}

/// A guard that is switched off is gone where the motors are simulated; of a real device its limits stay.
pub(super) fn as_wanted(settings: GuardSettings, enabled: bool, real: bool) -> Option<GuardSettings> {
    match (enabled, real) {
        (true, _) => Some(settings),
        (false, true) => Some(settings.limits_only()),
        (false, false) => None,
    }
}

/// Writes the limits into the scene's keys.
pub(super) fn write_out(keys: &mut file::Guard, settings: &GuardSettings) {
    keys.max_force = Some(settings.max_force);
    keys.max_torque = Some(settings.max_torque);
    keys.max_slew = Some(settings.max_slew);
    keys.max_power = Some(settings.max_power);
    keys.ramp_time = Some(settings.ramp_time);
    keys.stale_after = Some(settings.stale_after);
    keys.max_speed = Some(settings.max_speed);
    keys.passivity = Some(settings.passivity);
    keys.max_damping = Some(settings.max_damping);
}

/// The limits for a device: the scene's where it has them, else the device's; of force and torque no more than the device's, where it
/// is there (`known`) and tells. So a scene that was made for a strong device does no harm on a weak one.
pub(super) fn guard_settings(
    keys: &file::Guard,
    device: &Capabilities,
    known: bool,
    delay: usize,
    time_step: f64,
) -> GuardSettings {
    let of_device = GuardSettings::for_device(device, time_step);
    let least = |key: Option<f64>, drives: bool, peak: f64, usual: f64| match key {
        None => usual,
        Some(limit) if known && !drives => limit.min(0.0),
        Some(limit) if known && peak.is_finite() => limit.min(peak),
        Some(limit) => limit,
    };
    let max_force = least(keys.max_force, device.drives_force, device.peak_force, of_device.max_force);
    let max_torque = least(keys.max_torque, device.drives_torque, device.peak_torque, of_device.max_torque);
    let max_damping = match keys.max_damping {
        None => of_device.max_damping,
        Some(most) if known => most.min(of_device.max_damping),
        Some(most) => most,
    };
    let usual = GuardSettings { max_damping, ..GuardSettings::within(max_force, max_torque, time_step) };
    let max_slew = keys.max_slew.unwrap_or(usual.max_slew);
    GuardSettings {
        delay,
        max_slew,
        max_torque_slew: usual.max_torque_slew * (max_slew / usual.max_slew),
        max_power: keys.max_power.unwrap_or(usual.max_power),
        ramp_time: keys.ramp_time.unwrap_or(usual.ramp_time),
        stale_after: keys.stale_after.unwrap_or(usual.stale_after),
        max_speed: keys.max_speed.unwrap_or(usual.max_speed),
        passivity: keys.passivity.unwrap_or(usual.passivity),
        ..usual
    }
}
