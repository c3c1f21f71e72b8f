//! What a haptic device is to the loop that drives it.
//!
//! All devices speak one frame: right-handed, metres, newtons, radians; x to the right, y up, z toward the user; the pose of the
//! handle in the device's base, the wrench on the hand at the handle's position in base axes. A driver converts at its edge.

use crate::{DeviceCommand, DeviceSample};
use nalgebra::Vector3;

/// Who decides when a tick happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pacing {
    /// The loop's own clock: read and write whenever called.
    Polled,
    /// The device's library calls the loop: [`Device::serve`].
    Callback,
    /// Each write is answered by one sample: [`Device::read`] waits for it, for a bounded time.
    Exchange,
}

/// What a device can sense and drive, and its limits.
///
/// A limit that is not known is infinite; a device without motors has zeros.
#[derive(Clone, Debug, PartialEq)]
pub struct Capabilities {
    /// As people know it.
    pub name: String,
    /// Whether the orientation is sensed (else it is always the identity).
    pub senses_rotation: bool,
    /// Whether it pushes.
    pub drives_force: bool,
    /// Whether it turns the hand. Where it does not, the session reports the torque that it cannot deliver.
    pub drives_torque: bool,
    /// Greatest force for a short time, N.
    pub peak_force: f64,
    /// Greatest force for ever, N.
    pub continuous_force: f64,
    /// Greatest torque for a short time, N m.
    pub peak_torque: f64,
    /// Greatest torque for ever, N m.
    pub continuous_torque: f64,
    /// Greatest coupling stiffness that it displays well, N/m.
    pub max_stiffness: f64,
    /// Greatest coupling stiffness in rotation, N m/rad.
    pub max_angular_stiffness: f64,
    /// Greatest coupling damping, N s/m.
    pub max_damping: f64,
    /// Two opposite corners of the workspace, metres; no workspace is known when they are equal.
    pub workspace: [Vector3<f64>; 2],
    /// Ticks a second that it is made for, Hz.
    pub rate: f64,
    /// Number of buttons.
    pub buttons: u32,
    /// The last force stands until another is written: a loop that dies must be replaced by a zero.
    pub force_persists: bool,
    /// The device itself drops the force when writes stop.
    pub hardware_watchdog: bool,
    /// Who decides when a tick happens.
    pub pacing: Pacing,
}

/// What became of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Applied {
    /// The hand is pushed as told.
    Fully,
    /// The motors were at their limit: as told, times this factor (direction kept).
    Scaled(f64),
    /// The motors are off, on the device's own decision or until [`Device::set_force_enabled`].
    Disabled,
}

/// Why a device cannot go on, as one small value, so that the loop can handle it without allocating.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DeviceFault {
    /// No sample came in time.
    Late,
    /// It is gone: unplugged, switched off, or its service ended.
    Disconnected,
    /// It does not know where it is: [`Device::home`] first.
    NotHomed,
    /// Its own watchdog took the force away.
    Watchdog,
    /// Its own safety took the force away: too fast, too hot, dead-man switch, emergency stop.
    SafetyStop,
    /// What it sent cannot be understood, or is not finite.
    Malformed,
    /// The method is not for a device of this pacing.
    WrongPacing,
    /// Its library refused with a code of its own.
    Refused(i32),
}

impl std::fmt::Display for DeviceFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = match self {
            Self::Late => "no sample came in time",
            Self::Disconnected => "the device is gone",
            Self::NotHomed => "the device does not know where it is; bring it to its reset position",
            Self::Watchdog => "the device's watchdog took the force away",
            Self::SafetyStop => {
                "the device's own safety took the force away (too fast, too hot, dead-man or stop switch)"
            }
            Self::Malformed => "what the device sent cannot be understood",
            Self::WrongPacing => "this device is not paced this way",
            Self::Refused(code) => return write!(f, "the device's library refused with code {code}"),
        };
        f.write_str(text)
    }
}

impl std::error::Error for DeviceFault {}

/// One round of control: from a sample to the command for it; `None` ends the service with a zero force.
pub type Control<'a> = &'a mut (dyn FnMut(&DeviceSample) -> Option<DeviceCommand> + Send);

/// A haptic device that is open.
///
/// Dropping one leaves it at zero force with its motors off, whatever happened before.
pub trait Device: Send {
    /// What it can do. The same for its whole life.
    fn capabilities(&self) -> &Capabilities;

    /// Whether nobody's hand is in it: it is computed. Only such a device can be driven without a guard.
    fn is_simulated(&self) -> bool {
        false
    }

    /// Finds out where the handle is, if that takes a motion or the user's help. Set-up: may take seconds.
    ///
    /// # Errors
    /// The device's fault; [`DeviceFault::NotHomed`] when the user did not do their part in time.
    fn home(&mut self) -> Result<(), DeviceFault>;

    /// Switches the motors on or off; off is where a device starts. Set-up.
    ///
    /// # Errors
    /// The device's fault.
    fn set_force_enabled(&mut self, enabled: bool) -> Result<(), DeviceFault>;

    /// The newest sample, finite. Real time: bounded, no allocation in this crate's code.
    ///
    /// # Errors
    /// The device's fault.
    fn read(&mut self) -> Result<DeviceSample, DeviceFault>;

    /// Pushes the hand. A command that is not finite is written as zero and answered with [`DeviceFault::Malformed`]. Real time: bounded,
    /// no allocation in this crate's code.
    ///
    /// # Errors
    /// The device's fault.
    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault>;

    /// For [`Pacing::Callback`]: lets the device's library call `control` on its own real-time thread until that answers `None`.
    ///
    /// # Errors
    /// The device's fault; [`DeviceFault::WrongPacing`] for other devices.
    fn serve(&mut self, control: Control<'_>) -> Result<(), DeviceFault> {
        let _ = control;
        Err(DeviceFault::WrongPacing)
    }

    /// Zero force, then motors off. May be called again and again, and after any fault.
    fn stop(&mut self);
}
