//! 3Dconnexion's SpaceMouse (and relatives) through the spacenavd daemon's UNIX socket, protocols 0 and 1: an input of six axes without force.
//!
//! Its cap tells how fast to go, so that the pose is an integral; silence means rest. spacenavd's axes are x right, y up, z away from the user.

pub mod events;

use super::{Attached, DriverOptions, Found, OpenError};
use crate::{Applied, Capabilities, Device, DeviceCommand, DeviceFault, DeviceSample, Pacing};
use events::{Event, Events};
use nalgebra::{UnitQuaternion, Vector3};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

/// The name of this driver in scenes.
pub(super) const KIND: &str = "spacemouse";
const OPTIONS: [&str; 4] = ["socket", "speed", "turn_rate", "reach"];
const CURE: &str = "Install and start spacenavd (https://spacenav.sourceforge.net; Debian, Ubuntu: apt install spacenavd), or give the option \
     socket = \"PATH\" (environment variable SPNAV_SOCKET)";
/// Counts that are no wish to move.
const DEAD_ZONE: f64 = 10.0;
/// Counts at the cap's stop.
const FULL: f64 = 350.0;
/// How long the daemon may take to tell its protocol.
const ANSWER: Duration = Duration::from_millis(300);
/// Requests of protocol 1: open with protocol 1; which events.
const OPEN: i32 = 0x7FAA_5501;
const SET_EVENT_MASK: i32 = 0x7FAA_1003;
/// Motions, buttons, devices.
const EVENT_MASK: i32 = 1 | 2 | 4;
/// Longest stretch of time that is integrated at once, s.
const LONGEST_STEP: f64 = 0.05;
/// Reads of the socket for one sample, at most.
const MOST_READS: usize = 16;

/// One open device.
struct SpaceMouse {
    stream: UnixStream,
    events: Events,
    capabilities: Capabilities,
    /// m/s and rad/s at the cap's stop; metres to either side.
    speed: f64,
    turn_rate: f64,
    reach: f64,
    opened: Instant,
    sample: DeviceSample,
    /// Linear and angular velocity that the cap asks for, and until when.
    wish: (Vector3<f64>, Vector3<f64>),
    wish_ends: f64,
    present: bool,
    /// Latched until homing.
    fault: Option<DeviceFault>,
}

/// Where the socket may be, in order.
fn places(named: Option<&str>) -> Vec<String> {
    if let Some(named) = named {
        return vec![named.into()];
    }
    let mut places = Vec::new();
    places.extend(std::env::var("SPNAV_SOCKET").ok().filter(|s| !s.is_empty()));
    if let Ok(text) = std::fs::read_to_string("/etc/spnavrc") {
        let value =
            |line: &str| line.trim().strip_prefix("socket")?.trim().strip_prefix('=').map(str::to_owned);
        places.extend(text.lines().filter_map(value).map(|p| p.trim().to_owned()));
    }
    places.push("/var/run/spnav.sock".into());
    places
}

/// Opens the daemon's socket.
pub(super) fn open(options: &DriverOptions) -> Result<Box<dyn Device>, OpenError> {
    SpaceMouse::open(options).map(|(device, _)| Box::new(device) as Box<dyn Device>)
}

/// The daemon, if it runs; which devices it has, it does not tell before they move.
pub(super) fn attached() -> Result<Found, OpenError> {
    let (device, protocol) = SpaceMouse::open(&DriverOptions::new())?;
    let notes = vec![
        format!("spacenavd runs, protocol {protocol}"),
        "whether a SpaceMouse is plugged in shows when it moves".into(),
    ];
    let address = "through spacenavd".into();
    Ok((vec![Attached { address, capabilities: device.capabilities.clone() }], notes))
}

impl SpaceMouse {
    fn open(options: &DriverOptions) -> Result<(Self, u8), OpenError> {
        let options = options.of(KIND, &OPTIONS)?;
        let speed = options.number("speed", 0.1, 0.001..=10.0)?;
        let turn_rate = options.number("turn_rate", 1.0, 0.01..=20.0)?;
        let reach = options.number("reach", 0.1, 0.001..=10.0)?;
        let places = places(options.text("socket"));
        let unreachable = |reasons: Vec<String>| OpenError::Unreachable {
            address: "spacenavd".into(),
            reason: reasons.join("; "),
            cure: CURE,
        };
        let mut reasons = Vec::new();
        let found = places.iter().find_map(|place| {
            UnixStream::connect(place).map_err(|e| reasons.push(format!("{place}: {e}"))).ok()
        });
        let mut stream = found.ok_or_else(|| unreachable(reasons))?;
        let mut events = Events::default();
        let protocol = greet(&mut stream, &mut events).map_err(|e| unreachable(vec![e.to_string()]))?;
        let zero = Vector3::zeros();
        let device = Self {
            stream,
            events,
            capabilities: capabilities(reach),
            speed,
            turn_rate,
            reach,
            opened: Instant::now(),
            sample: DeviceSample {
                time: 0.0,
                position: zero,
                orientation: UnitQuaternion::identity(),
                linear_velocity: zero,
                angular_velocity: zero,
                buttons: 0,
            },
            wish: (zero, zero),
            wish_ends: 0.0,
            present: true,
            fault: None,
        };
        Ok((device, protocol))
    }

    /// Takes what has come since the last call.
    fn listen(&mut self, now: f64) -> Result<(), DeviceFault> {
        let mut bytes = [0; 1024];
        for _ in 0..MOST_READS {
            match self.stream.read(&mut bytes) {
                Ok(0) => return Err(DeviceFault::Disconnected),
                Ok(count) => {
                    let mut events = self.events;
                    events.push(&bytes[..count], |event| self.take(event, now));
                    self.events = events;
                }
                Err(e) if e.kind() == ErrorKind::WouldBlock => break,
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(DeviceFault::Disconnected),
            }
        }
        Ok(())
    }

    fn take(&mut self, event: Event, now: f64) {
        match event {
            Event::Motion([x, y, z, rx, ry, rz], period) => {
                // The daemon's z points away from the user: positions and axes of rotation alike.
                let linear = Vector3::new(wish(x), wish(y), -wish(z)) * self.speed;
                let angular = Vector3::new(wish(rx), wish(ry), -wish(rz)) * self.turn_rate;
                self.wish = (linear, angular);
                // Devices send every 8 or 16 ms while the cap is held.
                self.wish_ends = now + 2e-3 * f64::from(period.clamp(16, 50));
            }
            Event::Button(button, true) => self.sample.buttons |= 1 << button,
            Event::Button(button, false) => self.sample.buttons &= !(1 << button),
            Event::Device(present) => {
                self.present = present;
                self.wish = (Vector3::zeros(), Vector3::zeros());
            }
            Event::Other => {}
        }
    }

    /// Goes as the cap asks, within reach.
    fn go(&mut self, now: f64) {
        let s = &mut self.sample;
        let dt = (now - s.time).clamp(0.0, LONGEST_STEP);
        if now > self.wish_ends {
            self.wish = (Vector3::zeros(), Vector3::zeros());
        }
        let (mut linear, angular) = self.wish;
        for axis in 0..3 {
            let next = s.position[axis] + linear[axis] * dt;
            if next.abs() > self.reach {
                linear[axis] = 0.0;
            }
            s.position[axis] = next.clamp(-self.reach, self.reach);
        }
        let turned = UnitQuaternion::from_scaled_axis(angular * dt) * s.orientation;
        s.orientation = UnitQuaternion::new_normalize(turned.into_inner());
        (s.linear_velocity, s.angular_velocity) = (linear, angular);
        s.time = now;
    }
}

/// Counts as a share of the way to the stop, without the dead zone.
fn wish(counts: i32) -> f64 {
    let counts = f64::from(counts);
    let beyond = (counts.abs() - DEAD_ZONE).clamp(0.0, FULL - DEAD_ZONE);
    beyond.copysign(counts) / (FULL - DEAD_ZONE)
}

/// Asks for protocol 1; a daemon that does not answer speaks protocol 0.
fn greet(stream: &mut UnixStream, events: &mut Events) -> std::io::Result<u8> {
    stream.write_all(&OPEN.to_ne_bytes())?;
    stream.set_read_timeout(Some(ANSWER))?;
    let (mut answer, mut filled) = ([0; 4], 0);
    while filled < 4 {
        match stream.read(&mut answer[filled..]) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => filled += count,
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => break,
            Err(e) => return Err(e),
        }
    }
    let number = i32::from_ne_bytes(answer);
    let newer = filled == 4 && number & !0xFF == OPEN & !0xFF && number & 0xFF > 0;
    if newer {
        let mut request = [0; events::RECORD];
        request[..4].copy_from_slice(&SET_EVENT_MASK.to_ne_bytes());
        request[4..8].copy_from_slice(&EVENT_MASK.to_ne_bytes());
        stream.write_all(&request)?;
    } else {
        // Protocol 0: our first message was no number to it; the sensitivity is what it waits for. What came is the start of an event.
        stream.write_all(&1.0f32.to_ne_bytes())?;
        events.push(&answer[..filled], |_| {});
    }
    stream.set_nonblocking(true)?;
    Ok(u8::from(newer))
}

fn capabilities(reach: f64) -> Capabilities {
    Capabilities {
        name: "3Dconnexion SpaceMouse".into(),
        senses_rotation: true,
        drives_force: false,
        drives_torque: false,
        peak_force: 0.0,
        continuous_force: 0.0,
        peak_torque: 0.0,
        continuous_torque: 0.0,
        max_stiffness: 0.0,
        max_angular_stiffness: 0.0,
        max_damping: 0.0,
        workspace: [Vector3::repeat(-reach), Vector3::repeat(reach)],
        rate: 1000.0,
        buttons: 32,
        force_persists: false,
        hardware_watchdog: false,
        pacing: Pacing::Polled,
    }
}

impl Device for SpaceMouse {
    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    /// The pose starts again from the middle.
    fn home(&mut self) -> Result<(), DeviceFault> {
        self.fault = None;
        self.stop();
        self.sample.position = Vector3::zeros();
        self.sample.orientation = UnitQuaternion::identity();
        Ok(())
    }

    fn set_force_enabled(&mut self, _: bool) -> Result<(), DeviceFault> {
        Ok(())
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        let now = self.opened.elapsed().as_secs_f64();
        if let Err(fault) = self.listen(now) {
            self.stop();
            self.fault = Some(fault);
            return Err(fault);
        }
        self.go(now);
        if self.present { Ok(self.sample) } else { Err(DeviceFault::Disconnected) }
    }

    fn write(&mut self, command: &DeviceCommand) -> Result<Applied, DeviceFault> {
        match (self.fault, super::motion::command_is_finite(command)) {
            (Some(fault), _) => Err(fault),
            (None, false) => Err(DeviceFault::Malformed),
            (None, true) => Ok(Applied::Disabled),
        }
    }

    fn stop(&mut self) {
        self.wish = (Vector3::zeros(), Vector3::zeros());
    }
}
