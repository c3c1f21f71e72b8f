//! The TCP connection to a VRPN server: cookies, tables of names, and messages without waiting.

use super::message::{
    COOKIE, DISCONNECT, Incoming, Message, Outgoing, SENDER_DESCRIPTION, TYPE_DESCRIPTION, cookie_is_known,
};
use crate::DeviceFault;
use nalgebra::Vector3;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Reads of the socket for one sample, at most.
const MOST_READS: usize = 16;
/// Our own tables: one sender for each device, these message types.
const TYPES: [&str; 3] = ["vrpn_ForceDevice Force_Field", "vrpn_Base ping_message", "vrpn_Base pong_message"];
const FORCE_FIELD: i32 = 0;
const PING: i32 = 1;
const PONG: i32 = 2;
/// Our senders: the tracker and the force device.
const TRACKER: i32 = 0;
const FORCE_DEVICE: i32 = 1;

/// What the server means by its numbers; none until it has told.
#[derive(Clone, Copy, Debug, Default)]
struct Numbers {
    tracker: Option<i32>,
    buttons: Option<i32>,
    force_device: Option<i32>,
    pose: Option<i32>,
    velocity: Option<i32>,
    button: Option<i32>,
    error: Option<i32>,
    ping: Option<i32>,
}

/// What a message means to this driver.
#[derive(Clone, Copy, Debug)]
pub(super) enum Event<'a> {
    Pose(Message<'a>),
    Velocity(Message<'a>),
    Button(Message<'a>),
    ForceError(Message<'a>),
}

/// The names of the server's devices.
#[derive(Clone, Debug)]
pub(super) struct Devices {
    pub tracker: String,
    pub buttons: String,
    pub force_device: Option<String>,
}

/// An open connection.
pub(super) struct Connection {
    stream: TcpStream,
    incoming: Incoming,
    outgoing: Outgoing,
    devices: Devices,
    numbers: Numbers,
}

/// Why there is no connection.
pub(super) enum NoConnection {
    Unreachable(String),
    OtherProtocol(String),
}

impl From<io::Error> for NoConnection {
    fn from(error: io::Error) -> Self {
        Self::Unreachable(error.to_string())
    }
}

impl Connection {
    /// Connects to `host:port`, exchanges cookies, tells our names and waits for the tracker's.
    pub fn open(address: &str, devices: Devices, patience: Duration) -> Result<Self, NoConnection> {
        let deadline = Instant::now() + patience;
        let mut last = io::Error::new(ErrorKind::NotFound, "the name leads to no address");
        let found = address
            .to_socket_addrs()?
            .find_map(|address| TcpStream::connect_timeout(&address, patience).map_err(|e| last = e).ok());
        let mut stream = found.ok_or(last)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(patience))?;
        stream.write_all(COOKIE)?;
        let (mut cookie, mut filled) = ([0; 24], 0);
        while filled < cookie.len() {
            let left = deadline.saturating_duration_since(Instant::now());
            stream.set_read_timeout(Some(left.max(Duration::from_millis(1))))?;
            match stream.read(&mut cookie[filled..]) {
                Ok(0) => return Err(NoConnection::OtherProtocol("it hangs up".into())),
                Ok(count) => filled += count,
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    return Err(NoConnection::OtherProtocol("it says nothing".into()));
                }
                Err(e) => return Err(e.into()),
            }
        }
        if !cookie_is_known(&cookie) {
            let said = String::from_utf8_lossy(&cookie).trim_end_matches('\0').to_owned();
            return Err(NoConnection::OtherProtocol(format!("it greets with {said:?}")));
        }
        stream.set_nonblocking(true)?;
        let (incoming, outgoing) = (Incoming::default(), Outgoing::default());
        let mut connection = Self { stream, incoming, outgoing, devices, numbers: Numbers::default() };
        connection.introduce();
        Ok(connection)
    }

    /// Our senders and types, and a first sign of life.
    fn introduce(&mut self) {
        let now = now();
        self.outgoing.description(now, SENDER_DESCRIPTION, TRACKER, &self.devices.tracker);
        if let Some(name) = &self.devices.force_device {
            self.outgoing.description(now, SENDER_DESCRIPTION, FORCE_DEVICE, name);
        }
        for (number, name) in TYPES.iter().enumerate() {
            self.outgoing.description(now, TYPE_DESCRIPTION, number as i32, name);
        }
        self.outgoing.message(now, TRACKER, PING, &[]);
        let _ = self.flush();
    }

    /// Whether the server has told of our tracker.
    pub fn knows_tracker(&self) -> bool {
        self.numbers.tracker.is_some() && self.numbers.pose.is_some()
    }

    /// Takes what has come; never waits.
    pub fn listen(&mut self, mut tell: impl FnMut(Event<'_>)) -> Result<(), DeviceFault> {
        for _ in 0..MOST_READS {
            match self.stream.read(self.incoming.room()) {
                Ok(0) => return Err(DeviceFault::Disconnected),
                Ok(count) => self.incoming.filled(count),
                Err(e) if e.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(DeviceFault::Disconnected),
            }
            let mut pinged = false;
            while let Some(message) = self.incoming.next_message().map_err(|_| DeviceFault::Malformed)? {
                let n = &mut self.numbers;
                let (sender, kind) = (Some(message.sender), Some(message.kind));
                match message.kind {
                    DISCONNECT => return Err(DeviceFault::Disconnected),
                    SENDER_DESCRIPTION => n.learn_sender(&self.devices, &message),
                    TYPE_DESCRIPTION => n.learn_type(&message),
                    _ if kind == n.ping => pinged = true,
                    _ if kind == n.pose && sender == n.tracker => tell(Event::Pose(message)),
                    _ if kind == n.velocity && sender == n.tracker => tell(Event::Velocity(message)),
                    _ if kind == n.button && sender == n.buttons => tell(Event::Button(message)),
                    _ if kind == n.error && sender == n.force_device => tell(Event::ForceError(message)),
                    _ => {}
                }
            }
            if pinged {
                self.outgoing.message(now(), TRACKER, PONG, &[]);
                let _ = self.flush();
            }
        }
        Ok(())
    }

    /// Sends a force that holds until the next one; in the server's axes.
    pub fn force(
        &mut self,
        origin: &Vector3<f64>,
        force: &Vector3<f64>,
        radius: f32,
    ) -> Result<(), DeviceFault> {
        // What could not be sent before goes first; a newer force does not queue up behind it.
        self.flush()?;
        self.outgoing.force(now(), FORCE_DEVICE, FORCE_FIELD, origin, force, radius);
        self.flush()
    }

    /// Sends what waits, as far as the system takes it at once.
    fn flush(&mut self) -> Result<(), DeviceFault> {
        while !self.outgoing.bytes().is_empty() {
            match self.stream.write(self.outgoing.bytes()) {
                Ok(0) => return Err(DeviceFault::Disconnected),
                Ok(count) => self.outgoing.sent(count),
                Err(e) if e.kind() == ErrorKind::WouldBlock => return Err(DeviceFault::Late),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(DeviceFault::Disconnected),
            }
        }
        Ok(())
    }
}

impl Numbers {
    fn learn_sender(&mut self, devices: &Devices, message: &Message<'_>) {
        let Some(name) = message.name() else { return };
        let number = Some(message.sender);
        if name == devices.tracker {
            self.tracker = number;
        }
        if name == devices.buttons {
            self.buttons = number;
        }
        if Some(name) == devices.force_device.as_deref() {
            self.force_device = number;
        }
    }

    fn learn_type(&mut self, message: &Message<'_>) {
        let Some(name) = message.name() else { return };
        let place = match name {
            "vrpn_Tracker Pos_Quat" => &mut self.pose,
            "vrpn_Tracker Velocity" => &mut self.velocity,
            "vrpn_Button Change" => &mut self.button,
            "vrpn_ForceDevice Force_Error" => &mut self.error,
            "vrpn_Base ping_message" => &mut self.ping,
            _ => return,
        };
        *place = Some(message.sender);
    }
}

/// Microseconds since 1970, as VRPN's messages carry them.
fn now() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_micros() as i64)
}
