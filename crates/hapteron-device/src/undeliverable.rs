//! The part of a command that a device cannot deliver.

use crate::{Capabilities, DeviceCommand};
use nalgebra::Vector3;

/// What of a command a device leaves out for want of motors: the torque of one that senses six axes and drives three, everything for one that only
/// senses. [`crate::Applied`] judges the rest, so a session reports both.
#[must_use]
pub fn undeliverable(capabilities: &Capabilities, command: &DeviceCommand) -> DeviceCommand {
    let left = |driven: bool, wanted: &Vector3<f64>| if driven { Vector3::zeros() } else { *wanted };
    DeviceCommand {
        force: left(capabilities.drives_force, &command.force),
        torque: left(capabilities.drives_torque, &command.torque),
    }
}
