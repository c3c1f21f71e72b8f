//! Drivers of real devices: one folder a vendor, where `unsafe` and vendor units stop.
//!
//! Nothing is linked: vendors' libraries are loaded when a device is opened, services are spoken to through sockets. `docs/devices.md` tells
//! which options each kind has, and what was and was not tried on hardware.

mod error;
#[cfg_attr(not(any(unix, windows)), allow(dead_code))]
mod library;
mod motion;
mod options;
mod survey;

mod force_dimension;
pub mod haply;
mod openhaptics;
#[cfg(unix)]
pub mod spacemouse;
#[cfg(not(unix))]
mod spacemouse {
    use super::{Device, DriverOptions, Found, OpenError};

    pub(super) const KIND: &str = "spacemouse";
    const NOT_HERE: OpenError =
        OpenError::NotHere { kind: KIND, reason: "spacenavd runs on Linux and other Unix systems" };

    pub(super) fn open(_: &DriverOptions) -> Result<Box<dyn Device>, OpenError> {
        Err(NOT_HERE)
    }

    pub(super) fn attached() -> Result<Found, OpenError> {
        Err(NOT_HERE)
    }
}

pub mod vrpn;

pub use error::{Looked, OpenError};
pub use options::DriverOptions;
pub use survey::{Attached, DriverSurvey, survey};

use crate::Device;

/// The attached devices, and remarks.
type Found = (Vec<Attached>, Vec<String>);

/// What a driver is to the registry.
struct Driver {
    kind: &'static str,
    devices: &'static str,
    open: fn(&DriverOptions) -> Result<Box<dyn Device>, OpenError>,
    attached: fn() -> Result<Found, OpenError>,
}

/// All drivers, in the order in which they are shown.
const DRIVERS: [Driver; 5] = [
    Driver {
        kind: force_dimension::KIND,
        devices: "Force Dimension delta, omega, sigma, lambda; Novint Falcon",
        open: force_dimension::open,
        attached: force_dimension::attached,
    },
    Driver {
        kind: openhaptics::KIND,
        devices: "3D Systems Touch, Touch X, Phantom (Sensable)",
        open: openhaptics::open,
        attached: openhaptics::attached,
    },
    Driver {
        kind: haply::KIND,
        devices: "Haply Inverse3, with or without VerseGrip",
        open: haply::open,
        attached: haply::attached,
    },
    Driver {
        kind: spacemouse::KIND,
        devices: "3Dconnexion SpaceMouse and relatives (input without force)",
        open: spacemouse::open,
        attached: spacemouse::attached,
    },
    Driver {
        kind: vrpn::KIND,
        devices: "any tracker of a VRPN server, and its force device",
        open: vrpn::open,
        attached: vrpn::attached,
    },
];

/// The kind whose library calls the loop, at the rate that its option `rate` asks for.
pub const CALLED_BY_THE_LIBRARY: &str = openhaptics::KIND;

/// The kinds that [`open`] knows.
pub fn kinds() -> impl Iterator<Item = &'static str> {
    DRIVERS.iter().map(|driver| driver.kind)
}

/// Opens a device; motors off, not homed.
///
/// # Errors
/// Unknown kind or option, library or service missing (with where it was looked for and how to get it), no device.
pub fn open(kind: &str, options: &DriverOptions) -> Result<Box<dyn Device>, OpenError> {
    match DRIVERS.iter().find(|driver| driver.kind == kind) {
        Some(driver) => (driver.open)(options),
        None => {
            let known: Vec<&str> = kinds().collect();
            Err(OpenError::UnknownKind {
                kind: kind.into(),
                hint: options::suggestion(kind, &known),
                known: known.join(", "),
            })
        }
    }
}
