//! The WebSocket to the service, bounded in time.

use crate::DeviceFault;
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};
use tungstenite::handshake::HandshakeError;
use tungstenite::{Message, Utf8Bytes, WebSocket, error::Error, protocol::WebSocketConfig};

/// A frame larger than this is no state frame.
const LARGEST: usize = 1 << 20;

/// A TCP stream that gives up at a deadline, whatever trickles in.
struct Bounded {
    stream: TcpStream,
    deadline: Instant,
}

impl Bounded {
    fn left(&self) -> io::Result<Duration> {
        let left = self.deadline.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(io::ErrorKind::WouldBlock.into()) } else { Ok(left) }
    }
}

impl Read for Bounded {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.left()?;
        self.stream.set_read_timeout(Some(left))?;
        self.stream.read(buffer)
    }
}

impl Write for Bounded {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        let left = self.left()?;
        self.stream.set_write_timeout(Some(left))?;
        self.stream.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// An open connection.
pub(super) struct Socket {
    socket: WebSocket<Bounded>,
}

/// Why there is no connection.
pub(super) enum NoSocket {
    Unreachable(String),
    OtherProtocol(String),
}

impl Socket {
    /// Connects to `host:port` within a time.
    pub fn connect(address: &str, patience: Duration) -> Result<Self, NoSocket> {
        let deadline = Instant::now() + patience;
        let unreachable = |e: &io::Error| NoSocket::Unreachable(e.to_string());
        let mut last = NoSocket::Unreachable("the name leads to no address".into());
        for address in address.to_socket_addrs().map_err(|e| unreachable(&e))? {
            match TcpStream::connect_timeout(&address, patience) {
                Err(error) => last = unreachable(&error),
                Ok(stream) => {
                    stream.set_nodelay(true).map_err(|e| unreachable(&e))?;
                    let config = WebSocketConfig::default()
                        .max_message_size(Some(LARGEST))
                        .max_frame_size(Some(LARGEST));
                    let url = format!("ws://{address}/");
                    let bounded = Bounded { stream, deadline };
                    return tungstenite::client::client_with_config(url, bounded, Some(config))
                        .map(|(socket, _)| Self { socket })
                        .map_err(|error| match error {
                            HandshakeError::Interrupted(_) => {
                                NoSocket::Unreachable("it takes the connection and says nothing".into())
                            }
                            HandshakeError::Failure(e) => NoSocket::OtherProtocol(e.to_string()),
                        });
                }
            }
        }
        Err(last)
    }

    /// The next text within a time; `None` when none comes.
    pub fn receive(&mut self, patience: Duration) -> Result<Option<Utf8Bytes>, DeviceFault> {
        self.socket.get_mut().deadline = Instant::now() + patience;
        self.next()
    }

    /// A text that is already there.
    pub fn ready(&mut self) -> Result<Option<Utf8Bytes>, DeviceFault> {
        let lost = |_| DeviceFault::Disconnected;
        self.socket.get_ref().stream.set_nonblocking(true).map_err(lost)?;
        // Nothing waits now: the deadline only has to lie ahead.
        self.socket.get_mut().deadline = Instant::now() + Duration::from_secs(1);
        let next = self.next();
        self.socket.get_ref().stream.set_nonblocking(false).map_err(lost)?;
        next
    }

    fn next(&mut self) -> Result<Option<Utf8Bytes>, DeviceFault> {
        // A few pings and the like may come before a text; not without end.
        for _ in 0..32 {
            match self.socket.read() {
                Ok(Message::Text(text)) => return Ok(Some(text)),
                Ok(Message::Binary(_)) => return Err(DeviceFault::Malformed),
                Ok(Message::Close(_)) => return Err(DeviceFault::Disconnected),
                Ok(_) => {}
                Err(Error::Io(e)) if e.kind() == io::ErrorKind::WouldBlock => return Ok(None),
                Err(Error::Io(e)) if e.kind() == io::ErrorKind::TimedOut => return Ok(None),
                Err(error) => return Err(fault_of(&error)),
            }
        }
        Ok(None)
    }

    /// Sends a text within a time.
    pub fn send(&mut self, text: &str, patience: Duration) -> Result<(), DeviceFault> {
        self.socket.get_mut().deadline = Instant::now() + patience;
        match self.socket.send(Message::text(text)) {
            Ok(()) => Ok(()),
            Err(Error::Io(e)) if e.kind() == io::ErrorKind::WouldBlock => Err(DeviceFault::Late),
            Err(Error::Io(e)) if e.kind() == io::ErrorKind::TimedOut => Err(DeviceFault::Late),
            Err(Error::WriteBufferFull(_)) => Err(DeviceFault::Late),
            Err(error) => Err(fault_of(&error)),
        }
    }

    /// Says good-bye; errors no longer matter.
    pub fn close(&mut self) {
        self.socket.get_mut().deadline = Instant::now() + Duration::from_millis(20);
        let _ = self.socket.close(None);
        let _ = self.socket.flush();
        let _ = self.socket.get_ref().stream.shutdown(std::net::Shutdown::Both);
    }
}

fn fault_of(error: &Error) -> DeviceFault {
    match error {
        Error::Io(_) | Error::ConnectionClosed | Error::AlreadyClosed => DeviceFault::Disconnected,
        Error::Protocol(tungstenite::error::ProtocolError::ResetWithoutClosingHandshake) => {
            DeviceFault::Disconnected
        }
        _ => DeviceFault::Malformed,
    }
}
