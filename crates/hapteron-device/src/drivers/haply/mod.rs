//! Haply's Inverse3, with a VerseGrip for the orientation, through the vendor's service (WebSocket, JSON), generations 3.0/3.1 and 3.5.
//!
//! One message to the service gives one state frame; a command holds for one of its ticks, so a host that falls silent leaves no force. It drives no torque.
//! Axes of the service: x right, y forward, z up; metres and newtons.
//!
//! Allocation: frames are read and commands written without any; the WebSocket library makes one buffer for each message in either direction.

pub mod frame;
pub mod json;
mod socket;

use super::motion::{Axes, Velocities, command_is_finite, limited, sample_is_finite};
use super::{Attached, DriverOptions, Found, OpenError};
use crate::{Applied, Capabilities, Device, DeviceCommand, DeviceFault, DeviceSample, Pacing};
use frame::Frame;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use socket::{NoSocket, Socket};
use std::fmt::Write;
use std::time::{Duration, Instant};

/// The name of this driver in scenes.
pub(super) const KIND: &str = "haply";
const OPTIONS: [&str; 8] =
    ["address", "device", "grip", "protocol", "preset", "patience", "homing_timeout", "max_force"];
const ADDRESS: &str = "localhost:10001";
const CURE: &str = "Install and start Haply's Inverse Service (https://docs.haply.co; on Linux: systemctl start haply-inverse-service), or give the \
     option address = \"HOST:PORT\"";
const NO_DEVICE_CURE: &str =
    "Connect the Inverse3 by USB and to its power supply; Haply Hub shows what the service sees";
/// Our axes in the service's: x = its x, y = its z, z = minus its y.
const AXES: Axes = Axes(Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0));
/// Messages that may wait for their answers before no more are sent.
const MOST_OUTSTANDING: u32 = 8;
/// Reads after a late one that look whether more has arrived.
const SUSPICIOUS: u32 = 1000;
/// How long a message may take to leave.
const SEND: Duration = Duration::from_millis(2);

/// The spelling of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Generation {
    /// 3.0 and 3.1.
    Older,
    /// 3.5.
    Newer,
}

/// One open device.
struct Haply {
    socket: Socket,
    id: String,
    grip: Option<String>,
    generation: Generation,
    capabilities: Capabilities,
    patience: Duration,
    homing_timeout: Duration,
    opened: Instant,
    velocities: Velocities,
    orientation: UnitQuaternion<f64>,
    /// The text of the next message; kept for its memory.
    message: String,
    /// Messages since the last answer.
    outstanding: u32,
    /// Reads for which answers of earlier ticks may still arrive.
    suspicious: u32,
    refusals: u32,
    powered: bool,
    enabled: bool,
    /// Latched until [`Device::set_force_enabled`] or homing.
    fault: Option<DeviceFault>,
}

/// Opens a device.
pub(super) fn open(options: &DriverOptions) -> Result<Box<dyn Device>, OpenError> {
    Haply::open(options, Duration::from_secs(3)).map(|device| Box::new(device) as Box<dyn Device>)
}

/// What the service at the usual address has.
pub(super) fn attached() -> Result<Found, OpenError> {
    let device = Haply::open(&DriverOptions::new(), Duration::from_millis(500))?;
    let notes = vec![format!("service at {ADDRESS}, commands of generation {:?}", device.generation)];
    let address = format!("device = \"{}\"", device.id);
    Ok((vec![Attached { address, capabilities: device.capabilities.clone() }], notes))
}

impl Haply {
    fn open(options: &DriverOptions, patience: Duration) -> Result<Self, OpenError> {
        let options = options.of(KIND, &OPTIONS)?;
        let address = options.text("address").unwrap_or(ADDRESS);
        let address = address.trim_start_matches("ws://").trim_end_matches('/');
        let wanted = options.text("device");
        let wanted_grip = options.text("grip").filter(|g| *g != "none");
        let protocol = options.choice("protocol", &["auto", "3.1", "3.5"])?;
        let tick = options.seconds("patience", 0.01, 0.001..=1.0)?;
        let homing_timeout = options.seconds("homing_timeout", 60.0, 0.0..=600.0)?;
        let force = options.number("max_force", 10.0, 0.0..=50.0)?;
        let mut socket = Socket::connect(address, patience).map_err(|error| match error {
            NoSocket::Unreachable(reason) => {
                OpenError::Unreachable { address: address.into(), reason, cure: CURE }
            }
            NoSocket::OtherProtocol(detail) => {
                OpenError::Protocol { address: address.into(), protocol: "WebSocket", detail }
            }
        })?;
        let silent = |detail: &str| OpenError::Protocol {
            address: address.into(),
            protocol: "the Inverse Service's protocol",
            detail: detail.into(),
        };
        let text = socket.receive(patience)?.ok_or_else(|| silent("no state came after connecting"))?;
        let frame = Frame::read(&text, wanted, wanted_grip)
            .map_err(|_| silent("the first message is no state frame"))?;
        let Some(inverse) = frame.inverse else {
            let detail = match wanted {
                Some(id) => format!("the service at {address} sees no Inverse3 '{id}'"),
                None => format!("the service at {address} sees no Inverse3"),
            };
            return Err(OpenError::NoDevice { detail, cure: NO_DEVICE_CURE });
        };
        let grip = frame.grip.filter(|_| options.text("grip") != Some("none"));
        if let (Some(id), None) = (wanted_grip, grip) {
            let detail = format!("the service at {address} sees no grip '{id}'");
            return Err(OpenError::NoDevice { detail, cure: NO_DEVICE_CURE });
        }
        let generation = match protocol {
            "3.1" => Generation::Older,
            "3.5" => Generation::Newer,
            _ if inverse.newer => Generation::Newer,
            _ => Generation::Older,
        };
        let mut device = Self {
            id: inverse.id.into(),
            grip: grip.map(|g| g.id.into()),
            generation,
            capabilities: capabilities(inverse.left_handed, grip.is_some(), force),
            patience: tick,
            homing_timeout,
            opened: Instant::now(),
            velocities: Velocities::new(),
            orientation: UnitQuaternion::identity(),
            message: String::with_capacity(512),
            outstanding: 0,
            suspicious: 0,
            refusals: 0,
            powered: true,
            enabled: false,
            fault: None,
            socket,
        };
        device.configure(options.text("preset"))?;
        Ok(device)
    }

    /// The first message: settings of this session go here.
    fn configure(&mut self, preset: Option<&str>) -> Result<(), DeviceFault> {
        let Some(preset) = preset else { return self.probe() };
        // An identifier: anything else would not be JSON any more.
        let preset: String =
            preset.chars().filter(|c| c.is_ascii_alphanumeric() || "_-".contains(*c)).collect();
        self.message.clear();
        let _ = write!(
            self.message,
            r#"{{"inverse3":[{{"device_id":"{}","configure":{{"preset":{{"preset":"{preset}"}}}}}}]}}"#,
            self.id
        );
        self.send()
    }

    /// Asks for a state without commanding anything: no force.
    fn probe(&mut self) -> Result<(), DeviceFault> {
        let probe = match self.generation {
            Generation::Older => "probe_cursor_position",
            Generation::Newer => "probe_position",
        };
        self.message.clear();
        let _ = write!(
            self.message,
            r#"{{"inverse3":[{{"device_id":"{}","commands":{{"{probe}":{{}}}}}}]}}"#,
            self.id
        );
        self.send()
    }

    fn push(&mut self, force: &Vector3<f64>) -> Result<(), DeviceFault> {
        let f = AXES.to_vendor(force);
        let vector = match self.generation {
            Generation::Older => "values",
            Generation::Newer => "vector",
        };
        self.message.clear();
        let _ = write!(
            self.message,
            r#"{{"inverse3":[{{"device_id":"{}","commands":{{"set_cursor_force":{{"{vector}":{{"x":{},"y":{},"z":{}}}}}}}}}]}}"#,
            self.id, f.x, f.y, f.z
        );
        self.send()
    }

    fn send(&mut self) -> Result<(), DeviceFault> {
        self.socket.send(&self.message, SEND)?;
        self.outstanding += 1;
        Ok(())
    }

    /// A command that cannot be sent twice running ends with a fault.
    fn refused(&mut self, fault: DeviceFault) -> DeviceFault {
        self.refusals += 1;
        if self.refusals >= 2 || fault != DeviceFault::Late {
            return self.latch(fault);
        }
        fault
    }

    fn latch(&mut self, fault: DeviceFault) -> DeviceFault {
        self.stop();
        self.fault = Some(fault);
        fault
    }

    /// The newest frame as a sample.
    fn sample(&mut self, text: &str) -> Result<DeviceSample, DeviceFault> {
        let frame = Frame::read(text, Some(&self.id), self.grip.as_deref());
        let frame = frame.map_err(|_| DeviceFault::Malformed)?;
        let Some(inverse) = frame.inverse else { return Err(self.latch(DeviceFault::Disconnected)) };
        if inverse.calibrated == Some(false) {
            return Err(DeviceFault::NotHomed);
        }
        self.powered = inverse.powered != Some(false) && inverse.ready != Some(false);
        let position = AXES.vector(&inverse.position.ok_or(DeviceFault::Malformed)?);
        let mut buttons = 0;
        if let (Some(_), Some(grip)) = (&self.grip, frame.grip) {
            buttons = grip.buttons;
            // A wireless grip may sleep: then its last orientation stands.
            if let Some(q) = grip.orientation {
                self.orientation = AXES.orientation(&q);
            }
        }
        let time = self.opened.elapsed().as_secs_f64();
        self.velocities.push(time, &position, &self.orientation);
        let sample = DeviceSample {
            time,
            position,
            orientation: self.orientation,
            linear_velocity: match inverse.velocity {
                Some(v) => AXES.vector(&v),
                None => self.velocities.linear(),
            },
            angular_velocity: self.velocities.angular(),
            buttons,
        };
        if sample_is_finite(&sample) { Ok(sample) } else { Err(DeviceFault::Malformed) }
    }
}

/// Force limits are the vendor's published figures, not read from the device.
fn capabilities(left_handed: bool, senses_rotation: bool, force: f64) -> Capabilities {
    let hand = if left_handed { ", left-handed" } else { "" };
    let grip = if senses_rotation { " with VerseGrip" } else { "" };
    Capabilities {
        name: format!("Haply Inverse3{grip}{hand}"),
        senses_rotation,
        drives_force: force > 0.0,
        drives_torque: false,
        peak_force: force,
        continuous_force: force.min(3.0),
        peak_torque: 0.0,
        continuous_torque: 0.0,
        max_stiffness: f64::INFINITY,
        max_angular_stiffness: 0.0,
        max_damping: f64::INFINITY,
        workspace: [Vector3::zeros(); 2],
        rate: 1000.0,
        buttons: 10,
        force_persists: false,
        hardware_watchdog: true,
        pacing: Pacing::Exchange,
    }
}

impl Device for Haply {
    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn home(&mut self) -> Result<(), DeviceFault> {
        self.fault = None;
        let deadline = Instant::now() + self.homing_timeout;
        loop {
            match self.read() {
                Ok(_) => return Ok(()),
                Err(DeviceFault::NotHomed | DeviceFault::Late) if Instant::now() < deadline => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(fault) => return Err(fault),
            }
        }
    }

    fn set_force_enabled(&mut self, enabled: bool) -> Result<(), DeviceFault> {
        (self.fault, self.refusals) = (None, 0);
        self.enabled = false;
        // Two messages in flight are one too many: the answer to the last one first.
        self.read()?;
        self.probe()?;
        self.enabled = enabled;
        Ok(())
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        if self.outstanding == 0 {
            self.probe().map_err(|fault| self.refused(fault))?;
        }
        let received = self.socket.receive(self.patience).map_err(|fault| self.latch(fault))?;
        let Some(mut text) = received else {
            self.suspicious = SUSPICIOUS;
            return Err(DeviceFault::Late);
        };
        if self.suspicious > 0 {
            self.suspicious -= 1;
            // After a late one there may be more than one on the way: the newest counts.
            for _ in 0..MOST_OUTSTANDING {
                let Some(newer) = self.socket.ready().map_err(|fault| self.latch(fault))? else { break };
                text = newer;
            }
        }
        self.outstanding = 0;
        self.sample(&text)
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        if self.outstanding >= MOST_OUTSTANDING {
            // Nobody answers: more messages would only wait. Without them the device idles.
            return Err(self.refused(DeviceFault::Late));
        }
        let finite = command_is_finite(command);
        let (force, factor) = limited(&command.force, self.capabilities.peak_force);
        let sent = if finite && self.enabled { self.push(&force) } else { self.probe() };
        sent.map_err(|fault| self.refused(fault))?;
        self.refusals = 0;
        match (finite, self.enabled && self.powered) {
            (false, _) => Err(DeviceFault::Malformed),
            (true, false) => Ok(Applied::Disabled),
            (true, true) if factor < 1.0 => Ok(Applied::Scaled(factor)),
            (true, true) => Ok(Applied::Fully),
        }
    }

    /// A zero force; then silence, by which the device idles.
    fn stop(&mut self) {
        if std::mem::replace(&mut self.enabled, false) {
            let _ = self.push(&Vector3::zeros());
        }
        let _ = self.probe();
    }
}

impl Drop for Haply {
    fn drop(&mut self) {
        self.stop();
        self.socket.close();
    }
}
