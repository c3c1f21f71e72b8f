//! What could be driven from this machine, and what is missing for the rest.

use super::{DRIVERS, OpenError};
use crate::Capabilities;

/// A device that could be opened now.
#[derive(Clone, Debug, PartialEq)]
pub struct Attached {
    /// The options that lead to it, as in `serial = 1234`.
    pub address: String,
    /// What it can do.
    pub capabilities: Capabilities,
}

/// One driver's view of this machine.
#[derive(Debug)]
pub struct DriverSurvey {
    /// The name for scenes.
    pub kind: &'static str,
    /// The devices that it drives.
    pub devices: &'static str,
    /// Those that are attached.
    pub attached: Vec<Attached>,
    /// Remarks, as on the version of a library.
    pub notes: Vec<String>,
    /// What is missing, where it was looked for and how to get it; `None` where a device is attached.
    pub missing: Option<OpenError>,
}

/// Asks every driver. Opens each attached device for a moment, without force; takes up to a few seconds.
#[must_use]
pub fn survey() -> Vec<DriverSurvey> {
    let one = |driver: &super::Driver| {
        let (attached, notes, missing) = match (driver.attached)() {
            Ok((attached, notes)) => (attached, notes, None),
            Err(error) => (Vec::new(), Vec::new(), Some(error)),
        };
        DriverSurvey { kind: driver.kind, devices: driver.devices, attached, notes, missing }
    };
    DRIVERS.iter().map(one).collect()
}
