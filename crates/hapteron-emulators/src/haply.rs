//! Haply's Inverse Service: a WebSocket server of both generations with an Inverse3 and a wireless VerseGrip. Axes are x right, y forward, z up.
//!
//! One state frame for each message, and 1 ms of the hand with each; a force holds for one message.

use crate::HandAndHandle;
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;
use tungstenite::{Message, WebSocket};

const TICK: f64 = 1e-3;

/// Which service it speaks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Generation {
    /// 3.0 and 3.1: `values`, `probe_cursor_position`.
    V31,
    /// 3.5: `vector`, `probe_position`, more fields.
    V35,
}

/// What a test sees and scripts.
#[derive(Debug)]
pub struct HaplyState {
    /// Hand and handle.
    pub hand: HandAndHandle,
    /// The force that holds now, service axes.
    pub force: Vector3<f64>,
    /// Messages so far.
    pub messages: u32,
    /// Commands that the generation does not know.
    pub unknown: Vec<String>,
    /// The settings that were sent, as texts.
    pub configured: Vec<String>,
    /// `status.calibrated`.
    pub calibrated: bool,
    /// `status.power_supply`.
    pub powered: bool,
    /// An Inverse3 is there.
    pub present: bool,
    /// A grip is there.
    pub grip: bool,
    /// Keys and devices in another order, more devices, more keys.
    pub reordered: bool,
    /// Button b of the grip.
    pub button: bool,
    /// Instead of the next frame, this text.
    pub instead: Option<String>,
    /// Messages that are not answered.
    pub swallow: u32,
    /// Before each answer.
    pub delay: Duration,
    /// Hang up.
    pub hang_up: bool,
    /// A client is connected.
    pub connected: bool,
}

/// A service in a thread, at an address of its own.
pub struct HaplyService {
    address: String,
    state: Arc<Mutex<HaplyState>>,
    running: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl HaplyService {
    /// Starts one at any free port.
    ///
    /// # Panics
    /// When there is no free port.
    #[must_use]
    pub fn start(generation: Generation) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("a bound address").to_string();
        listener.set_nonblocking(true).expect("a listener that does not block");
        let state = Arc::new(Mutex::new(HaplyState {
            hand: HandAndHandle::default(),
            force: Vector3::zeros(),
            messages: 0,
            unknown: Vec::new(),
            configured: Vec::new(),
            calibrated: true,
            powered: true,
            present: true,
            grip: true,
            reordered: false,
            button: false,
            instead: None,
            swallow: 0,
            delay: Duration::ZERO,
            hang_up: false,
            connected: false,
        }));
        let running = Arc::new(AtomicBool::new(true));
        let (its_state, its_running) = (state.clone(), running.clone());
        let thread = std::thread::spawn(move || {
            while its_running.load(Ordering::SeqCst) {
                match listener.accept() {
                    Ok((stream, _)) => serve(stream, generation, &its_state, &its_running),
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
    pub fn state(&self) -> MutexGuard<'_, HaplyState> {
        lock(&self.state)
    }
}

impl Drop for HaplyService {
    fn drop(&mut self) {
        self.running.store(false, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn lock(state: &Mutex<HaplyState>) -> MutexGuard<'_, HaplyState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

fn serve(stream: TcpStream, generation: Generation, state: &Mutex<HaplyState>, running: &AtomicBool) {
    let _ = stream.set_nonblocking(false);
    let _ = stream.set_nodelay(true);
    let _ = stream.set_read_timeout(Some(Duration::from_millis(20)));
    let Ok(mut socket) = tungstenite::accept(stream) else { return };
    lock(state).connected = true;
    let first = {
        let mut s = lock(state);
        s.instead.take().unwrap_or_else(|| full_frame(&s, generation).to_string())
    };
    let _ = socket.send(Message::text(first));
    while running.load(Ordering::SeqCst) {
        if lock(state).hang_up {
            break;
        }
        match socket.read() {
            Ok(Message::Text(text)) => answer(&mut socket, &text, generation, state),
            Ok(Message::Close(_)) => break,
            Ok(_) => {}
            Err(tungstenite::Error::Io(e))
                if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) =>
            {
                // Nobody commands: the device idles.
                lock(state).force = Vector3::zeros();
            }
            Err(_) => break,
        }
    }
    let mut s = lock(state);
    (s.connected, s.force) = (false, Vector3::zeros());
}

fn answer(socket: &mut WebSocket<TcpStream>, text: &str, generation: Generation, state: &Mutex<HaplyState>) {
    let (frame, delay) = {
        let mut s = lock(state);
        s.messages += 1;
        s.force = Vector3::zeros();
        take(&mut s, text, generation);
        let force = if s.powered && s.calibrated { s.force } else { Vector3::zeros() };
        s.hand.step(force, Vector3::zeros(), TICK);
        if s.swallow > 0 {
            s.swallow -= 1;
            return;
        }
        (s.instead.take().unwrap_or_else(|| full_frame(&s, generation).to_string()), s.delay)
    };
    std::thread::sleep(delay);
    let _ = socket.send(Message::text(frame));
}

/// Carries out a message.
fn take(s: &mut HaplyState, text: &str, generation: Generation) {
    let Ok(message) = serde_json::from_str::<Value>(text) else {
        s.unknown.push(format!("no JSON: {text}"));
        return;
    };
    for device in message["inverse3"].as_array().into_iter().flatten() {
        if device["device_id"] != "04C3" {
            s.unknown.push(format!("device {}", device["device_id"]));
            continue;
        }
        if !device["configure"].is_null() {
            s.configured.push(device["configure"].to_string());
        }
        for (name, command) in device["commands"].as_object().into_iter().flatten() {
            match (name.as_str(), generation) {
                ("set_cursor_force", _) => {
                    let key = if generation == Generation::V35 { "vector" } else { "values" };
                    let part = |axis: &str| command[key][axis].as_f64();
                    match (part("x"), part("y"), part("z")) {
                        (Some(x), Some(y), Some(z)) => s.force = Vector3::new(x, y, z),
                        _ => s.unknown.push(format!("{name} {command}")),
                    }
                }
                ("probe_position", Generation::V35) | ("probe_cursor_position", Generation::V31) => {}
                _ => s.unknown.push(name.clone()),
            }
        }
    }
}

fn xyz(v: &Vector3<f64>) -> Value {
    json!({ "x": v.x, "y": v.y, "z": v.z })
}

fn full_frame(s: &HaplyState, generation: Generation) -> Value {
    let q = s.hand.orientation();
    let orientation = json!({ "x": q.i, "y": q.j, "z": q.k, "w": q.w });
    let mut state = json!({
        "cursor_position": xyz(&s.hand.position), "cursor_velocity": xyz(&s.hand.velocity),
        "angular_position": {"a0": -89.7, "a1": 222.8, "a2": -22.8}, "mode": "idle",
        "body_orientation": {"x": 0.03, "y": 0.71, "z": 0.0, "w": 0.70},
    });
    if generation == Generation::V35 {
        state["control_domain"] = "cartesian".into();
        state["control_mode"] = "force".into();
        state["current_cursor_force"] = xyz(&s.force);
        state["transform"] = json!({});
    }
    let status = json!({
        "calibrated": s.calibrated, "in_use": true, "power_supply": s.powered, "ready": true, "started": true
    });
    let config = json!({"type": "inverse3", "handedness": "right", "port": "COM15", "cursor_offset": null});
    let inverse = json!({"device_id": "04C3", "config": config, "state": state, "status": status});
    let grip = json!({
        "device_id": "1102",
        "state": {"battery_level": 0.16, "hall": 16, "orientation": orientation,
                  "buttons": {"a": false, "b": s.button, "c": false}},
        "status": {"connected": true, "awake": true, "ready": true},
    });
    let mut inverses = if s.present { vec![inverse] } else { Vec::new() };
    let mut grips = if s.grip { vec![grip] } else { Vec::new() };
    if s.reordered {
        let state = json!({"cursor_position": {"x": 9, "y": 9, "z": 9}, "new_key": [[], {}]});
        inverses.insert(0, json!({"zzz": null, "status": {}, "state": state, "device_id": "FFFF"}));
        let state = json!({"orientation": {"w": 0, "z": 0, "y": 1, "x": 0}});
        grips.insert(0, json!({"status": {}, "state": state, "device_id": "0000"}));
        return json!({"wireless_verse_grip": grips, "zzz": 1e300, "inverse3": inverses, "session_id": 3});
    }
    json!({"session_id": 3, "inverse3": inverses, "verse_grip": [], "wireless_verse_grip": grips})
}
