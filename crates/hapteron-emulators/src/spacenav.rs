//! spacenavd: a UNIX socket that one client connects to, protocol 0 or 1.

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// A daemon that waits for one client, then is scripted.
pub struct Spacenavd {
    path: PathBuf,
    greeting: Option<JoinHandle<UnixStream>>,
    client: Option<UnixStream>,
}

impl Spacenavd {
    /// Listens at a path of its own.
    ///
    /// # Panics
    /// When the path cannot be listened at.
    #[must_use]
    pub fn start(protocol: u8) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("hapteron-{}-{number}.spnav", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let listener = UnixListener::bind(&path).expect("a path to listen at");
        let greeting = std::thread::spawn(move || greet(&listener, protocol));
        Self { path, greeting: Some(greeting), client: None }
    }

    /// Where it listens.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn client(&mut self) -> &mut UnixStream {
        if let Some(greeting) = self.greeting.take() {
            self.client = Some(greeting.join().expect("a client"));
        }
        self.client.as_mut().expect("a client that is not hung up on")
    }

    /// What the client says next, so many bytes.
    ///
    /// # Panics
    /// When it says less.
    pub fn hear(&mut self, count: usize) -> Vec<u8> {
        let mut said = vec![0; count];
        let client = self.client();
        let _ = client.set_read_timeout(Some(Duration::from_secs(10)));
        client.read_exact(&mut said).expect("a client that speaks");
        said
    }

    /// Sends anything.
    pub fn raw(&mut self, bytes: &[u8]) {
        let _ = self.client().write_all(bytes);
    }

    /// Sends a record.
    pub fn event(&mut self, numbers: [i32; 8]) {
        let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_ne_bytes()).collect();
        self.raw(&bytes);
    }

    /// The cap is held: counts x, y, z, rx, ry, rz.
    pub fn motion(&mut self, [x, y, z, rx, ry, rz]: [i32; 6], period: i32) {
        self.event([0, x, y, z, rx, ry, rz, period]);
    }

    /// A button goes down or up.
    pub fn button(&mut self, button: i32, down: bool) {
        self.event([if down { 1 } else { 2 }, button, 0, 0, 0, 0, 0, 0]);
    }

    /// A device comes or goes.
    pub fn device(&mut self, present: bool) {
        self.event([3, i32::from(!present), 0, 0, 0x256F, 0xC635, 0, 0]);
    }

    /// Ends the connection.
    pub fn hang_up(&mut self) {
        let _ = self.client();
        self.client = None;
    }
}

impl Drop for Spacenavd {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The first words with a client.
fn greet(listener: &UnixListener, protocol: u8) -> UnixStream {
    let (mut client, _) = listener.accept().expect("a client");
    let mut first = [0; 4];
    client.read_exact(&mut first).expect("a greeting");
    let wants = u32::from_ne_bytes(first);
    assert_eq!(wants & 0xFFFF_FF00, 0x7FAA_5500, "the client's greeting");
    if protocol > 0 {
        let agreed = (wants & 0xFFFF_FF00) | (wants & 0xFF).min(u32::from(protocol));
        client.write_all(&agreed.to_ne_bytes()).expect("a client that listens");
    }
    client
}
