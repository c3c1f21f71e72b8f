//! VRPN: any tracker of a VRPN server as input, and its force device, if it has one, as output.
//!
//! One TCP connection, no UDP. The force goes out as a force field that is constant around the handle and stands until the next, so that the server's own
//! loop holds it: a host that dies is noticed by the server when the connection breaks. VRPN has no torque.

mod connection;
pub mod message;

use super::motion::{Axes, Velocities, command_is_finite, limited, sample_is_finite, single_is_finite};
use super::{Attached, DriverOptions, Found, OpenError};
use crate::{Applied, Capabilities, Device, DeviceCommand, DeviceFault, DeviceSample, Pacing};
use connection::{Connection, Devices, Event, NoConnection};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::time::{Duration, Instant};

/// The name of this driver in scenes.
pub(super) const KIND: &str = "vrpn";
const OPTIONS: [&str; 9] = [
    "address",
    "tracker",
    "sensor",
    "buttons",
    "force_device",
    "axes",
    "patience",
    "max_force",
    "connect_timeout",
];
const ADDRESS: &str = "localhost:3883";
const CURE: &str = "Start a VRPN server there (https://github.com/vrpn/vrpn: vrpn_server), or give the option address = \"HOST[:PORT]\"";
/// The force holds within this distance of the handle, m: everywhere.
const RADIUS: f32 = 10.0;

/// The newest state of the tracker, in our axes.
struct Tracked {
    sample: DeviceSample,
    /// Server time of the newest pose, microseconds; none before the first.
    stamp: Option<i64>,
    /// In the server's axes.
    server_position: Vector3<f64>,
    /// When a velocity last came with the poses.
    velocity_known: f64,
    velocities: Velocities,
    /// A pose that could not be understood came since the last read.
    malformed: bool,
    /// The force device's trouble, as it last told.
    trouble: Option<i32>,
}

/// One open device.
struct Vrpn {
    connection: Connection,
    capabilities: Capabilities,
    axes: Axes,
    sensor: i32,
    patience: f64,
    opened: Instant,
    tracked: Tracked,
    refusals: u32,
    enabled: bool,
    /// Latched until [`Device::set_force_enabled`] or homing.
    fault: Option<DeviceFault>,
}

/// Opens a tracker and its force device.
pub(super) fn open(options: &DriverOptions) -> Result<Box<dyn Device>, OpenError> {
    Vrpn::open(options).map(|device| Box::new(device) as Box<dyn Device>)
}

/// A server on this machine.
pub(super) fn attached() -> Result<Found, OpenError> {
    let options = DriverOptions::new().with("connect_timeout", 0.5);
    let device = Vrpn::open(&options)?;
    let notes = vec![format!("server at {ADDRESS}; other trackers by the option tracker")];
    Ok((
        vec![Attached {
            address: "tracker = \"Tracker0\"".into(),
            capabilities: device.capabilities.clone(),
        }],
        notes,
    ))
}

impl Vrpn {
    fn open(options: &DriverOptions) -> Result<Self, OpenError> {
        let options = options.of(KIND, &OPTIONS)?;
        let address = options.text("address").unwrap_or(ADDRESS).trim_start_matches("tcp://");
        let address = if address.contains(':') { address.into() } else { format!("{address}:3883") };
        let tracker = options.text("tracker").unwrap_or("Tracker0").to_owned();
        let force_device = options.text("force_device").map(str::to_owned);
        let sensor = options.count("sensor")?.unwrap_or(0) as i32;
        let patience = options.number("patience", 0.1, 0.001..=10.0)?;
        let connect = options.seconds("connect_timeout", 5.0, 0.01..=60.0)?;
        let force = options.number("max_force", f64::INFINITY, 0.0..=f64::INFINITY)?;
        let axes_text = options.text("axes").unwrap_or("x y z");
        let axes = axes(axes_text).ok_or_else(|| OpenError::BadOption {
            kind: KIND,
            key: "axes",
            value: axes_text.into(),
            expected: "three signed axes of the server that lie along ours (right, up, toward the user), right-handed, as \"x z -y\"".into(),
        })?;
        let devices = Devices {
            buttons: options.text("buttons").unwrap_or(&tracker).to_owned(),
            tracker: tracker.clone(),
            force_device: force_device.clone(),
        };
        let connection = Connection::open(&address, devices, connect).map_err(|error| match error {
            NoConnection::Unreachable(reason) => {
                OpenError::Unreachable { address: address.clone(), reason, cure: CURE }
            }
            NoConnection::OtherProtocol(detail) => {
                OpenError::Protocol { address: address.clone(), protocol: "VRPN version 7", detail }
            }
        })?;
        let mut device = Self {
            connection,
            capabilities: capabilities(&tracker, force_device.is_some(), force),
            axes,
            sensor,
            patience,
            opened: Instant::now(),
            tracked: Tracked::new(),
            refusals: 0,
            enabled: false,
            fault: None,
        };
        device.wait_for_tracker(connect).map_err(|fault| match fault {
            DeviceFault::Late => OpenError::NoDevice {
                detail: format!("the VRPN server at {address} tells of no tracker '{tracker}' that sends poses of sensor {sensor}"),
                cure: "The tracker's name is the second word of its line in vrpn.cfg; give it as the option tracker",
            },
            fault => OpenError::Fault(fault),
        })?;
        Ok(device)
    }

    fn wait_for_tracker(&mut self, patience: Duration) -> Result<(), DeviceFault> {
        let deadline = Instant::now() + patience;
        while !self.connection.knows_tracker() || self.tracked.stamp.is_none() {
            self.listen()?;
            if Instant::now() > deadline {
                return Err(DeviceFault::Late);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }

    fn listen(&mut self) -> Result<(), DeviceFault> {
        let now = self.opened.elapsed().as_secs_f64();
        let Self { connection, tracked, axes, sensor, .. } = self;
        connection.listen(|event| tracked.take(event, now, axes, *sensor))
    }

    fn latch(&mut self, fault: DeviceFault) -> DeviceFault {
        self.stop();
        self.fault = Some(fault);
        fault
    }

    /// A force that cannot be sent twice running ends with a fault: the last one stands at the server.
    fn send(&mut self, force: &Vector3<f64>) -> Result<(), DeviceFault> {
        let force = self.axes.to_vendor(force);
        match self.connection.force(&self.tracked.server_position, &force, RADIUS) {
            Ok(()) => {
                self.refusals = 0;
                Ok(())
            }
            Err(fault) => {
                self.refusals += 1;
                if self.refusals >= 2 || fault != DeviceFault::Late {
                    return Err(self.latch(fault));
                }
                Err(fault)
            }
        }
    }
}

impl Tracked {
    fn new() -> Self {
        let zero = Vector3::zeros();
        Self {
            sample: DeviceSample {
                time: 0.0,
                position: zero,
                orientation: UnitQuaternion::identity(),
                linear_velocity: zero,
                angular_velocity: zero,
                buttons: 0,
            },
            stamp: None,
            server_position: zero,
            velocity_known: f64::NEG_INFINITY,
            velocities: Velocities::new(),
            malformed: false,
            trouble: None,
        }
    }

    fn take(&mut self, event: Event<'_>, now: f64, axes: &Axes, sensor: i32) {
        let s = &mut self.sample;
        match event {
            Event::Pose(message) => {
                let Some((its_sensor, position, orientation)) = message.pose() else {
                    self.malformed = true;
                    return;
                };
                // One that is older than what is known has overtaken nothing: it is left out.
                if its_sensor != sensor || self.stamp.is_some_and(|stamp| message.time < stamp) {
                    return;
                }
                self.stamp = Some(message.time);
                self.server_position = position;
                (s.position, s.orientation, s.time) =
                    (axes.vector(&position), axes.orientation(&orientation), now);
                // Spaced as the server took them: several may come in one read.
                self.velocities.push(message.time as f64 * 1e-6, &s.position, &s.orientation);
                if now - self.velocity_known > 0.1 {
                    (s.linear_velocity, s.angular_velocity) =
                        (self.velocities.linear(), self.velocities.angular());
                }
            }
            Event::Velocity(message) => {
                if let Some((its_sensor, linear, angular)) = message.velocity()
                    && its_sensor == sensor
                {
                    self.velocity_known = now;
                    (s.linear_velocity, s.angular_velocity) = (axes.vector(&linear), axes.vector(&angular));
                }
            }
            Event::Button(message) => {
                if let Some((button @ 0..32, down)) = message.button() {
                    s.buttons = s.buttons & !(1 << button) | u32::from(down) << button;
                }
            }
            Event::ForceError(message) => self.trouble = message.error(),
        }
    }
}

/// `x z -y`: which of the server's axes lies along each of ours; `None` for what is no rotation.
fn axes(text: &str) -> Option<Axes> {
    let mut rows = [[0.0; 3]; 3];
    let mut words = text.split_whitespace();
    for row in &mut rows {
        let word = words.next()?;
        let (sign, name) = match word.strip_prefix('-') {
            Some(name) => (-1.0, name),
            None => (1.0, word.trim_start_matches('+')),
        };
        row["xyz".find(name).filter(|_| name.len() == 1)?] = sign;
    }
    let matrix = Matrix3::from_fn(|r, c| rows[r][c]);
    (words.next().is_none() && matrix.determinant() > 0.5).then_some(Axes(matrix))
}

fn capabilities(tracker: &str, drives_force: bool, force: f64) -> Capabilities {
    let force = if drives_force { force } else { 0.0 };
    let unknown = if force > 0.0 { f64::INFINITY } else { 0.0 };
    Capabilities {
        name: format!("VRPN {tracker}{}", if drives_force { " with force device" } else { "" }),
        senses_rotation: true,
        drives_force: force > 0.0,
        drives_torque: false,
        peak_force: force,
        continuous_force: force,
        peak_torque: 0.0,
        continuous_torque: 0.0,
        max_stiffness: unknown,
        max_angular_stiffness: 0.0,
        max_damping: unknown,
        workspace: [Vector3::zeros(); 2],
        rate: 1000.0,
        buttons: 32,
        force_persists: true,
        hardware_watchdog: false,
        pacing: Pacing::Polled,
    }
}

impl Device for Vrpn {
    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn home(&mut self) -> Result<(), DeviceFault> {
        self.fault = None;
        self.wait_for_tracker(Duration::from_secs(1))
    }

    fn set_force_enabled(&mut self, enabled: bool) -> Result<(), DeviceFault> {
        (self.fault, self.refusals, self.tracked.trouble) = (None, 0, None);
        self.enabled = false;
        if self.capabilities.drives_force {
            self.send(&Vector3::zeros())?;
            self.enabled = enabled;
        }
        Ok(())
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        self.listen().map_err(|fault| self.latch(fault))?;
        match self.tracked.trouble {
            // A parameter of a surface, which this driver never sets; or all is well again.
            None | Some(0 | 4) => {}
            Some(1 | 2) => return Err(self.latch(DeviceFault::SafetyStop)),
            Some(code) => return Err(self.latch(DeviceFault::Refused(code))),
        }
        if std::mem::take(&mut self.tracked.malformed) {
            return Err(DeviceFault::Malformed);
        }
        let sample = self.tracked.sample;
        if self.opened.elapsed().as_secs_f64() - sample.time > self.patience {
            return Err(DeviceFault::Late);
        }
        if sample_is_finite(&sample) { Ok(sample) } else { Err(DeviceFault::Malformed) }
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        let (force, factor) = limited(&command.force, self.capabilities.peak_force);
        if !(command_is_finite(command) && single_is_finite(&force)) {
            if self.enabled {
                self.send(&Vector3::zeros())?;
            }
            return Err(DeviceFault::Malformed);
        }
        if !self.enabled {
            return Ok(Applied::Disabled);
        }
        self.send(&force)?;
        Ok(if factor < 1.0 { Applied::Scaled(factor) } else { Applied::Fully })
    }

    /// A field of no force and no extent.
    fn stop(&mut self) {
        self.enabled = false;
        if !self.capabilities.drives_force {
            return;
        }
        // What waits in the system's buffer is not lost: a few moments for it to go.
        for _ in 0..20 {
            match self.connection.force(&Vector3::zeros(), &Vector3::zeros(), 0.0) {
                Err(DeviceFault::Late) => std::thread::sleep(Duration::from_micros(500)),
                _ => break,
            }
        }
    }
}

impl Drop for Vrpn {
    fn drop(&mut self) {
        self.stop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards the reading of axes: rotations only.
    #[test]
    fn axes_are_rotations() {
        assert_eq!(axes("x y z").unwrap().0, Matrix3::identity());
        assert_eq!(
            axes(" x  z -y ").unwrap().vector(&Vector3::new(1.0, 2.0, 3.0)),
            Vector3::new(1.0, 3.0, -2.0)
        );
        for text in ["", "x y", "x y z x", "x y -z", "x x z", "x y w", "xy z x", "--x y z", "x y "] {
            assert!(axes(text).is_none(), "{text}");
        }
    }
}
