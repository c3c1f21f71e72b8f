//! A VRPN server with a tracker, its buttons and a force device; its own reader and writer of the protocol, big endian through and through.
//!
//! 1 ms of the hand passes with every force that arrives, and with every millisecond in which none does; a pose goes out each time.

use crate::HandAndHandle;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

const TICK: f64 = 1e-3;
/// The server's numbers, unlike the client's.
const SENDERS: [(i32, &str); 3] = [(4, "Other0"), (7, "Phantom0"), (9, "Button0")];
const TYPES: [(i32, &str); 6] = [
    (20, "vrpn_Tracker Pos_Quat"),
    (21, "vrpn_Tracker Velocity"),
    (22, "vrpn_Button Change"),
    (23, "vrpn_ForceDevice Force_Error"),
    (24, "vrpn_Base ping_message"),
    (25, "vrpn_Base pong_message"),
];

/// What a test sees and scripts.
#[derive(Debug, Default)]
pub struct VrpnState {
    /// Hand and handle, in the server's axes.
    pub hand: HandAndHandle,
    /// The force field: origin, force, radius. It stands until the next, or until the connection ends.
    pub field: (Vector3<f64>, Vector3<f64>, f64),
    /// Names that the client told, by its numbers.
    pub client_senders: BTreeMap<i32, String>,
    /// The same for message types.
    pub client_types: BTreeMap<i32, String>,
    /// Pings and pongs of the client.
    pub signs_of_life: (u32, u32),
    /// Forces that arrived.
    pub forces: u32,
    /// Velocities are sent, too.
    pub velocities: bool,
    /// Milliseconds that go by without a pose.
    pub silent: bool,
    /// Bytes that go out once, as they are.
    pub raw: Vec<u8>,
    /// A pose goes out with this much older a time, microseconds, and this x.
    pub overtaken: Option<(i64, f64)>,
    /// Buttons to send.
    pub buttons: Vec<(i32, i32)>,
    /// A force error to send.
    pub error: Option<i32>,
    /// Reads nothing, so that the client's buffers fill.
    pub deaf: bool,
    /// Hang up.
    pub hang_up: bool,
    /// A client is connected.
    pub connected: bool,
}

/// A server in a thread.
pub struct VrpnServer {
    address: String,
    state: Arc<Mutex<VrpnState>>,
    running: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl VrpnServer {
    /// Starts one at any free port, with this cookie.
    ///
    /// # Panics
    /// When there is no free port.
    #[must_use]
    pub fn start(cookie: &'static [u8; 24]) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("a bound address").to_string();
        listener.set_nonblocking(true).expect("a listener that does not block");
        let state = Arc::new(Mutex::new(VrpnState { velocities: true, ..VrpnState::default() }));
        let running = Arc::new(AtomicBool::new(true));
        let (its_state, its_running) = (state.clone(), running.clone());
        let thread = std::thread::spawn(move || {
            while its_running.load(Ordering::SeqCst) {
                match listener.accept() {
                    Ok((stream, _)) => serve(stream, cookie, &its_state, &its_running),
                    Err(_) => std::thread::sleep(Duration::from_millis(1)),
                }
            }
        });
        Self { address, state, running, thread: Some(thread) }
    }

    /// `host:port`.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// To look at and to script.
    pub fn state(&self) -> MutexGuard<'_, VrpnState> {
        lock(&self.state)
    }
}

impl Drop for VrpnServer {
    fn drop(&mut self) {
        self.running.store(false, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn lock(state: &Mutex<VrpnState>) -> MutexGuard<'_, VrpnState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A message as VRPN sends it.
#[must_use]
pub fn vrpn_message(microseconds: i64, sender: i32, kind: i32, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (seconds, rest) = (microseconds / 1_000_000, microseconds % 1_000_000);
    for number in [24 + payload.len() as i32, seconds as i32, rest as i32, sender, kind, 0] {
        bytes.extend(number.to_be_bytes());
    }
    bytes.extend(payload);
    while bytes.len() % 8 != 0 {
        bytes.push(0xAA);
    }
    bytes
}

/// The payload of a pose: sensor, position, orientation x y z w.
#[must_use]
pub fn vrpn_pose(sensor: i32, position: &Vector3<f64>, [x, y, z, w]: [f64; 4]) -> Vec<u8> {
    let mut payload: Vec<u8> = [sensor, 0].iter().flat_map(|n| n.to_be_bytes()).collect();
    let numbers = [position.x, position.y, position.z, x, y, z, w];
    payload.extend(numbers.iter().flat_map(|n| n.to_be_bytes()));
    payload
}

fn description(kind: i32, number: i32, name: &str) -> Vec<u8> {
    let mut payload = (name.len() as i32 + 1).to_be_bytes().to_vec();
    payload.extend(name.as_bytes());
    payload.push(0);
    vrpn_message(0, number, kind, &payload)
}

fn serve(mut stream: TcpStream, cookie: &[u8; 24], state: &Mutex<VrpnState>, running: &AtomicBool) {
    let _ = stream.set_nonblocking(false);
    let _ = stream.set_nodelay(true);
    let _ = stream.write_all(cookie);
    let mut theirs = [0; 24];
    if stream.read_exact(&mut theirs).is_err() || !theirs.starts_with(b"vrpn: ver. 07.") {
        return;
    }
    let names = SENDERS.iter().map(|(number, name)| description(-1, *number, name));
    let types = TYPES.iter().map(|(number, name)| description(-2, *number, name));
    let first: Vec<u8> = names.chain(types).chain([vrpn_message(0, 7, 24, &[])]).flatten().collect();
    let _ = stream.write_all(&first);
    let _ = stream.set_read_timeout(Some(Duration::from_millis(1)));
    lock(state).connected = true;
    let (mut bytes, mut piece, mut time) = (Vec::new(), [0; 4096], 1_000_000_i64);
    while running.load(Ordering::SeqCst) && !lock(state).hang_up {
        if lock(state).deaf {
            std::thread::sleep(Duration::from_millis(1));
        } else {
            match stream.read(&mut piece) {
                Ok(0) => break,
                Ok(count) => bytes.extend(&piece[..count]),
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => break,
            }
        }
        let forces = take(&mut bytes, &mut lock(state));
        let mut out = Vec::new();
        for _ in 0..forces.max(1) {
            time += 1000;
            out.extend(tick(&mut lock(state), time));
        }
        if stream.write_all(&out).is_err() {
            break;
        }
    }
    let mut s = lock(state);
    s.connected = false;
    s.field = (Vector3::zeros(), Vector3::zeros(), 0.0);
}

/// Takes the client's messages; how many forces there were.
fn take(bytes: &mut Vec<u8>, s: &mut VrpnState) -> u32 {
    let mut forces = 0;
    loop {
        let int = |at: usize| bytes.get(at..at + 4).map(|b| i32::from_be_bytes([b[0], b[1], b[2], b[3]]));
        let (Some(length), Some(sender), Some(kind)) = (int(0), int(12), int(16)) else { return forces };
        let length = length as usize;
        let padded = length.div_ceil(8) * 8;
        if bytes.len() < padded {
            return forces;
        }
        let payload = bytes[24..length].to_vec();
        bytes.drain(..padded);
        let name = || String::from_utf8_lossy(&payload[4..payload.len() - 1]).into_owned();
        match kind {
            -1 => drop(s.client_senders.insert(sender, name())),
            -2 => drop(s.client_types.insert(sender, name())),
            _ => match s.client_types.get(&kind).map(String::as_str) {
                Some("vrpn_Base ping_message") => s.signs_of_life.0 += 1,
                Some("vrpn_Base pong_message") => s.signs_of_life.1 += 1,
                Some("vrpn_ForceDevice Force_Field")
                    if s.client_senders.get(&sender).is_some_and(|n| n == "Phantom0") =>
                {
                    let n: Vec<f64> = payload
                        .chunks_exact(4)
                        .map(|b| f64::from(f32::from_be_bytes([b[0], b[1], b[2], b[3]])))
                        .collect();
                    s.field = (Vector3::new(n[0], n[1], n[2]), Vector3::new(n[3], n[4], n[5]), n[15]);
                    assert!(n.len() == 16 && n[6..15].iter().all(|j| *j == 0.0), "a constant field: {n:?}");
                    s.forces += 1;
                    forces += 1;
                }
                _ => {}
            },
        }
    }
}

/// 1 ms of the hand, and what is told of it.
fn tick(s: &mut VrpnState, time: i64) -> Vec<u8> {
    let (origin, force, radius) = s.field;
    let near = (s.hand.position - origin).norm() <= radius;
    s.hand.step(if near { force } else { Vector3::zeros() }, Vector3::zeros(), TICK);
    let mut out = std::mem::take(&mut s.raw);
    if s.silent {
        return out;
    }
    let q = s.hand.orientation();
    let turn = [q.i, q.j, q.k, q.w];
    if s.velocities {
        let v = s.hand.velocity;
        let dt = 0.01;
        let w = nalgebra::UnitQuaternion::from_scaled_axis(s.hand.angular_velocity * dt);
        let mut payload = vrpn_pose(0, &v, [w.i, w.j, w.k, w.w]);
        payload.extend(f64::to_be_bytes(dt));
        out.extend(vrpn_message(time, 7, 21, &payload));
    }
    out.extend(vrpn_message(time, 7, 20, &vrpn_pose(0, &s.hand.position, turn)));
    // Another sensor, another tracker.
    out.extend(vrpn_message(time, 7, 20, &vrpn_pose(1, &Vector3::repeat(9.0), [0.0, 0.0, 0.0, 1.0])));
    out.extend(vrpn_message(time, 4, 20, &vrpn_pose(0, &Vector3::repeat(8.0), [0.0, 0.0, 0.0, 1.0])));
    if let Some((older, x)) = s.overtaken {
        out.extend(vrpn_message(time - older, 7, 20, &vrpn_pose(0, &Vector3::new(x, 0.0, 0.0), turn)));
    }
    for (button, down) in s.buttons.drain(..) {
        let payload: Vec<u8> = [button, down].iter().flat_map(|n| n.to_be_bytes()).collect();
        out.extend(vrpn_message(time, 9, 22, &payload));
    }
    if let Some(error) = s.error.take() {
        out.extend(vrpn_message(time, 7, 23, &error.to_be_bytes()));
    }
    out
}
