//! The hand that the window is: a device without motors whose handle follows the pointer or a motion.
//!
//! The window says sixty times a second where the handle should go, through a wait-free exchange of the newest value; the device moves it
//! there a thousand times a second. A hand of mass, damping and stiffness holds the handle: so it moves without steps of position or
//! velocity, whatever the window does, and, when it is told to yield, gives way to the force. A window that stands still is a hand that
//! stands still.

mod mover;

use hapteron::device::{
    Applied, Capabilities, Device, DeviceCommand, DeviceFault, DeviceSample, HandParameters, Pacing,
};
use hapteron::trajectory::Trajectory;
use mover::Mover;
use nalgebra::{Isometry3, Vector3};
use std::time::Instant;
use triple_buffer::{Input, Output, triple_buffer};

/// A pinch that follows the pointer within a twentieth of a second, close to critical damping.
const FOLLOWING: HandParameters = HandParameters { mass: 0.05, damping: 4.0, stiffness: 100.0 };
/// How the hand holds the handle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
pub enum Hold {
    /// It goes where it is told, whatever the force.
    #[default]
    Exact,
    /// A pinch of two fingers that gives way.
    Light,
    /// A grip of the fist that gives way little.
    Firm,
}

impl Hold {
    /// All, with what people call them.
    pub const ALL: [(Self, &'static str); 3] =
        [(Self::Exact, "Exact"), (Self::Firm, "Firm"), (Self::Light, "Light")];

    /// What a mouse that rests on it is told.
    #[must_use]
    pub fn hint(self) -> &'static str {
        match self {
            Self::Exact => "The handle goes where it is told, whatever the force",
            Self::Firm => "A grip of 700 N/m: it gives way by 1.4 mm for each newton",
            Self::Light => "A pinch of 100 N/m: it gives way by 10 mm for each newton",
        }
    }

    /// A light pinch and a firm grip.
    fn parameters(self) -> HandParameters {
        match self {
            Self::Exact | Self::Light => FOLLOWING,
            Self::Firm => HandParameters { mass: 0.15, damping: 20.0, stiffness: 700.0 },
        }
    }
}

/// What moves the handle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// The pointer and the keys.
    #[default]
    Pointer,
    /// The motion that the device was given.
    Motion,
}

/// What the window wants of the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// Where the handle should go, device scale.
    pub pose: Isometry3<f64>,
    /// What moves it.
    pub source: Source,
    /// How it is held.
    pub hold: Hold,
    /// Counts up to start the motion anew.
    pub start: u32,
    /// At its end the motion begins again.
    pub repeat: bool,
}

/// The window's end of the exchange.
pub struct HandControl {
    to_device: Input<Wish>,
}

impl HandControl {
    /// Tells the device; it sees it at its next sample. Never waits.
    pub fn tell(&mut self, wish: Wish) {
        self.to_device.write(wish);
    }
}

/// The device.
pub struct WindowHand {
    capabilities: Capabilities,
    wishes: Output<Wish>,
    motion: Option<Trajectory>,
    mover: Mover,
    started: Instant,
    last: Option<f64>,
    command: DeviceCommand,
    forces: bool,
    /// The next sample is the first since the forces were switched on.
    fresh: bool,
}

impl WindowHand {
    /// A hand at a place, with a motion that it can make (device scale).
    #[must_use]
    pub fn new(wish: Wish, motion: Option<Trajectory>) -> (HandControl, Self) {
        let (to_device, wishes) = triple_buffer(&wish);
        let device = Self {
            capabilities: capabilities(),
            wishes,
            motion,
            mover: Mover::new(&wish),
            started: Instant::now(),
            last: None,
            command: DeviceCommand::zero(),
            forces: false,
            fresh: false,
        };
        (HandControl { to_device }, device)
    }
}

/// What the window's hand is to a guard.
#[must_use]
pub fn capabilities() -> Capabilities {
    Capabilities {
        name: "mouse and keyboard".to_owned(),
        senses_rotation: true,
        drives_force: true,
        drives_torque: true,
        // As of a strong desktop device: what the arrows show is what such a one would do.
        peak_force: 40.0,
        continuous_force: 40.0,
        peak_torque: 2.0,
        continuous_torque: 2.0,
        max_stiffness: f64::INFINITY,
        max_angular_stiffness: f64::INFINITY,
        max_damping: f64::INFINITY,
        workspace: [Vector3::zeros(); 2],
        rate: 1000.0,
        buttons: 0,
        force_persists: false,
        hardware_watchdog: true,
        pacing: Pacing::Polled,
    }
}

impl Device for WindowHand {
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
        self.forces = enabled;
        self.fresh = enabled;
        Ok(())
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        let now = self.started.elapsed().as_secs_f64();
        let step = self.last.map_or(0.0, |last| now - last);
        self.last = Some(now);
        let wish = *self.wishes.read();
        if std::mem::take(&mut self.fresh) {
            // A motion begins with the session, not with the device.
            self.mover.since = now;
        }
        Ok(self.mover.advance(&wish, self.motion.as_ref(), &self.command, now, step))
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        let finite = command.force.iter().chain(command.torque.iter()).all(|c| c.is_finite());
        self.command = if finite && self.forces { *command } else { DeviceCommand::zero() };
        match (finite, self.forces) {
            (false, _) => Err(DeviceFault::Malformed),
            (true, true) => Ok(Applied::Fully),
            (true, false) => Ok(Applied::Disabled),
        }
    }

    fn stop(&mut self) {
        self.command = DeviceCommand::zero();
        self.forces = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wish(x: f64) -> Wish {
        Wish {
            pose: Isometry3::translation(x, 0.0, 0.0),
            source: Source::Pointer,
            hold: Hold::Exact,
            start: 0,
            repeat: false,
        }
    }

    /// Would catch a device that keeps pushing after a stop, or takes a force that is not finite.
    #[test]
    fn stopped_it_feels_nothing_and_nan_is_refused() {
        let (mut control, mut device) = WindowHand::new(wish(0.0), None);
        device.set_force_enabled(true).unwrap();
        let push = DeviceCommand { force: Vector3::x(), torque: Vector3::zeros() };
        assert_eq!(device.write(&push), Ok(Applied::Fully));
        let nan = DeviceCommand { force: Vector3::x() * f64::NAN, torque: Vector3::zeros() };
        assert_eq!(device.write(&nan), Err(DeviceFault::Malformed));
        assert_eq!(device.command, DeviceCommand::zero());
        device.write(&push).unwrap();
        device.stop();
        assert_eq!(device.command, DeviceCommand::zero());
        assert_eq!(device.write(&push), Ok(Applied::Disabled));
        control.tell(wish(0.002));
        let first = device.read().unwrap();
        assert!(first.position.x >= 0.0 && first.position.x < 0.002);
    }
}
