//! Force Dimension's devices (delta, omega, sigma, lambda; the Novint Falcon too), through the vendor's library `libdrd` or `libdhd`.
//!
//! The library's base has x toward the user, y to the right, z up. A force stands until the next one, so the device's own watchdog is
//! switched on where it has one, and its velocity threshold stays as the vendor set it.

mod find;
mod functions;
mod models;

use super::motion::{Axes, Velocities, command_is_finite, rotation, sample_is_finite};
use super::options::Reader;
use super::{Attached, DriverOptions, Found, OpenError};
use crate::{Applied, Capabilities, Device, DeviceCommand, DeviceFault, DeviceSample};
use find::{load, open_index, open_serial};
use functions::{Code, Functions, Id, Set, Status};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::time::{Duration, Instant};

/// The name of this driver in scenes.
pub(super) const KIND: &str = "force-dimension";
const OPTIONS: [&str; 7] =
    ["library", "serial", "index", "homing", "homing_timeout", "watchdog", "gravity_compensation"];
/// Our axes in the vendor's: x = its y, y = its z, z = its x.
const AXES: Axes = Axes(Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0));
/// One step of the device's watchdog.
const WATCHDOG_STEP: f64 = 125e-6;

/// How the handle's position is found after power-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Homing {
    /// The device moves by itself, where it can.
    Automatic,
    /// The user brings it to the end stops.
    ByHand,
}

/// One open device.
struct ForceDimension {
    functions: Functions,
    id: Id,
    capabilities: Capabilities,
    homing: Homing,
    homing_timeout: Duration,
    opened: Instant,
    velocities: Velocities,
    enabled: bool,
    /// Latched until homing or [`Device::set_force_enabled`].
    fault: Option<DeviceFault>,
}

/// Opens a device.
pub(super) fn open(options: &DriverOptions) -> Result<Box<dyn Device>, OpenError> {
    let options = options.of(KIND, &OPTIONS)?;
    let functions = load(&options)?.0;
    let serial = options.count("serial")?;
    let id = match serial {
        None => open_index(&functions, options.count("index")?.unwrap_or(0))?,
        Some(serial) => open_serial(&functions, serial)?,
    };
    let device = match ForceDimension::new(functions, id, &options) {
        Ok(device) => device,
        Err(error) => {
            functions.close(id);
            return Err(error);
        }
    };
    device.release();
    Ok(Box::new(device))
}

/// The attached devices, each opened for a moment.
pub(super) fn attached() -> Result<Found, OpenError> {
    let options = DriverOptions::new();
    let options = options.of(KIND, &OPTIONS)?;
    let (functions, mut notes) = load(&options)?;
    let mut attached = Vec::new();
    for index in 0..functions.device_count().clamp(0, 16) {
        let address = format!("index = {index}");
        match open_index(&functions, index as u32) {
            Err(error) => notes.push(format!("{address}: {error}")),
            Ok(id) => {
                let serial = functions.serial(id).map(|s| format!(", serial = {s}")).unwrap_or_default();
                match ForceDimension::new(functions, id, &options) {
                    Ok(device) => attached.push(Attached {
                        address: address + &serial,
                        capabilities: device.capabilities.clone(),
                    }),
                    Err(error) => notes.push(format!("{address}: {error}")),
                }
            }
        }
    }
    Ok((attached, notes))
}

impl ForceDimension {
    fn new(functions: Functions, id: Id, options: &Reader<'_>) -> Result<Self, OpenError> {
        let homing = match options.choice("homing", &["automatic", "by-hand"])? {
            "by-hand" => Homing::ByHand,
            _ => Homing::Automatic,
        };
        let homing_timeout = options.seconds("homing_timeout", 60.0, 1.0..=600.0)?;
        let steps = options.number("watchdog", 0.02, 0.002..=0.0318)? / WATCHDOG_STEP;
        functions.set_gravity_compensation(options.switch("gravity_compensation", true)?, id);
        let watchdog = functions.set_watchdog(steps as u8, id);
        let capabilities = models::capabilities(models::Described {
            system_type: functions.system_type(id),
            name: functions.system_name(id),
            left_handed: functions.flag(functions.dhdIsLeftHanded, id),
            senses_rotation: functions.flag(functions.dhdHasWrist, id),
            active_wrist: functions.flag(functions.dhdHasActiveWrist, id),
            limits: functions.limits(id),
            watchdog,
        });
        let opened = Instant::now();
        let velocities = Velocities::new();
        Ok(Self {
            functions,
            id,
            capabilities,
            homing,
            homing_timeout,
            opened,
            velocities,
            enabled: false,
            fault: None,
        })
    }

    fn status(&self) -> Result<Status, DeviceFault> {
        let status = self.functions.status(self.id).map_err(fault_of)?;
        if !status.power || !status.connected {
            return Err(DeviceFault::Disconnected);
        }
        Ok(status)
    }

    /// Zero force, motors off, the handle free to move.
    fn release(&self) {
        let zero = Vector3::zeros();
        for _ in 0..2 {
            if self.functions.set_force(&zero, &zero, self.id).is_ok() {
                break;
            }
        }
        let _ = self.functions.enable_force(false, self.id);
    }

    /// Stops and remembers why.
    fn latch(&mut self, fault: DeviceFault) -> DeviceFault {
        self.stop();
        self.fault = Some(fault);
        fault
    }

    /// A force that is refused twice running ends with a stop: the last one that was taken would stand.
    fn send(&mut self, command: &DeviceCommand) -> Result<Set, DeviceFault> {
        let force = AXES.to_vendor(&command.force);
        let torque = match self.capabilities.drives_torque {
            true => AXES.to_vendor(&command.torque),
            false => Vector3::zeros(),
        };
        let mut outcome = self.functions.set_force(&force, &torque, self.id);
        if outcome.is_err() {
            outcome = self.functions.set_force(&force, &torque, self.id);
        }
        outcome.map_err(|code| self.latch(fault_of(code)))
    }

    /// By what factor saturated motors took the command.
    fn factor(&self, command: &DeviceCommand) -> f64 {
        let Some((force, torque)) = self.functions.force(self.id) else { return 1.0 };
        let (force, torque) = (AXES.vector(&force), AXES.vector(&torque));
        let told = command.force.norm_squared();
        let factor = match told > 0.0 {
            true => force.dot(&command.force) / told,
            false => torque.dot(&command.torque) / command.torque.norm_squared(),
        };
        if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 }
    }

    /// What it means that the motors are off although they were switched on.
    fn off(&mut self, cause: i32) -> Result<Applied, DeviceFault> {
        match cause {
            2 | 6 => Err(self.latch(DeviceFault::SafetyStop)),
            3 => Err(self.latch(DeviceFault::Watchdog)),
            5 => Err(self.latch(DeviceFault::Disconnected)),
            _ => Ok(Applied::Disabled),
        }
    }
}

impl Device for ForceDimension {
    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn home(&mut self) -> Result<(), DeviceFault> {
        self.fault = None;
        let f = self.functions;
        let robotic = self.homing == Homing::Automatic && f.flag(f.drdIsSupported, self.id);
        // A wrist may be lost although the arm is not; only the robotic part knows.
        let lost = robotic && f.drdIsInitialized.is_some() && !f.flag(f.drdIsInitialized, self.id);
        if !self.status()?.reset && !lost {
            return Ok(());
        }
        let automatic = if robotic { f.auto_init(self.id) } else { None };
        let homed = match automatic {
            Some(outcome) => {
                f.end_regulation(self.id);
                outcome
            }
            None => f.wait_for_reset(self.homing_timeout.as_millis() as i32, self.id).unwrap_or(Ok(())),
        };
        self.release();
        match homed {
            Ok(()) if !self.status()?.reset => Ok(()),
            Ok(()) | Err(Code::TIMEOUT) => Err(DeviceFault::NotHomed),
            Err(code) => Err(fault_of(code)),
        }
    }

    fn set_force_enabled(&mut self, enabled: bool) -> Result<(), DeviceFault> {
        self.fault = None;
        self.enabled = false;
        self.send(&DeviceCommand::zero())?;
        if enabled && self.status()?.reset {
            return Err(DeviceFault::NotHomed);
        }
        self.functions.enable_force(enabled, self.id).map_err(fault_of)?;
        self.enabled = enabled;
        Ok(())
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        let lost = |this: &mut Self, fault| match fault {
            DeviceFault::Disconnected => this.latch(fault),
            other => other,
        };
        let status = self.status().map_err(|fault| lost(self, fault))?;
        if status.reset {
            return Err(DeviceFault::NotHomed);
        }
        let pose = self.functions.position_and_frame(self.id);
        let (position, frame) = pose.map_err(|code| lost(self, fault_of(code)))?;
        let time = self.opened.elapsed().as_secs_f64();
        let position = AXES.vector(&position);
        let orientation = match self.capabilities.senses_rotation {
            true => AXES.orientation(&rotation(&frame).ok_or(DeviceFault::Malformed)?),
            false => UnitQuaternion::identity(),
        };
        if !position.iter().all(|c| c.is_finite()) {
            return Err(DeviceFault::Malformed);
        }
        self.velocities.push(time, &position, &orientation);
        // Without two fresh positions the library knows no velocity; then the past poses give it.
        let linear_velocity = match self.functions.linear_velocity(self.id) {
            Ok(v) => AXES.vector(&v),
            Err(_) => self.velocities.linear(),
        };
        let angular_velocity = match self.functions.angular_velocity(self.id) {
            _ if !self.capabilities.senses_rotation => Vector3::zeros(),
            Some(Ok(w)) => AXES.vector(&w),
            Some(Err(_)) | None => self.velocities.angular(),
        };
        let buttons = self.functions.buttons(self.id);
        let sample = DeviceSample { time, position, orientation, linear_velocity, angular_velocity, buttons };
        if sample_is_finite(&sample) { Ok(sample) } else { Err(DeviceFault::Malformed) }
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        if !command_is_finite(command) {
            self.send(&DeviceCommand::zero())?;
            return Err(DeviceFault::Malformed);
        }
        if !self.enabled {
            // The button on the front panel can switch the motors on: nothing may wait there.
            self.send(&DeviceCommand::zero())?;
            return Ok(Applied::Disabled);
        }
        let set = self.send(command)?;
        let status = self.status().map_err(|fault| self.latch(fault))?;
        if !status.force {
            return self.off(status.force_off_cause);
        }
        Ok(match set {
            Set::AsTold => Applied::Fully,
            Set::Saturated => Applied::Scaled(self.factor(command)),
        })
    }

    fn stop(&mut self) {
        self.enabled = false;
        self.release();
        self.functions.stop(self.id);
    }
}

impl Drop for ForceDimension {
    fn drop(&mut self) {
        self.stop();
        self.functions.close(self.id);
    }
}

fn fault_of(code: Code) -> DeviceFault {
    match code {
        Code::COMMUNICATION | Code::NO_DEVICE => DeviceFault::Disconnected,
        Code::TIMEOUT => DeviceFault::Late,
        Code::GEOMETRY => DeviceFault::Malformed,
        Code(code) => DeviceFault::Refused(code),
    }
}
