//! What a haptic device is to the rest: it gives samples of its handle and takes commands.
//!
//! Here live the sample and the command, the scaling between the device's workspace and the virtual world, the guard of the
//! output, simulated devices with the hand that stands in for a person, and the drivers of real ones. What never lives here: meshes, the dynamics of the body, files. SI units, world axes.

mod device;
pub mod drivers;
pub mod guard;
mod hand;
mod scaling;
pub mod simulated;
mod undeliverable;

pub use device::{Applied, Capabilities, Control, Device, DeviceFault, Pacing};
pub use hand::{GRIP_RADIUS, Grip, HandError, HandParameters, Tremor};
pub use scaling::{Scaling, ScalingError};
pub use undeliverable::undeliverable;

use nalgebra::{UnitQuaternion, Vector3};

/// Where the handle is and how it moves, at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceSample {
    /// When it was taken, seconds.
    pub time: f64,
    /// Metres.
    pub position: Vector3<f64>,
    /// Handle axes to world axes.
    pub orientation: UnitQuaternion<f64>,
    /// m/s.
    pub linear_velocity: Vector3<f64>,
    /// rad/s, world axes.
    pub angular_velocity: Vector3<f64>,
    /// Bit i is set while button i is down.
    pub buttons: u32,
}

/// What the handle is to push the hand with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceCommand {
    /// On the hand, N.
    pub force: Vector3<f64>,
    /// On the hand about the handle's position, N m.
    pub torque: Vector3<f64>,
}

impl DeviceCommand {
    /// Nothing.
    #[must_use]
    pub fn zero() -> Self {
        Self { force: Vector3::zeros(), torque: Vector3::zeros() }
    }
}
