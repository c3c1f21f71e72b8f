//! A display of its own with the window on it, and a hand on the mouse and the keys.

use super::picture::Picture;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Everything that is waited for comes within this, on a machine that does other things too.
const PATIENCE: Duration = Duration::from_secs(60);
const STEP: Duration = Duration::from_millis(100);

/// Closes everything when it is dropped.
pub struct Desk {
    server: Child,
    display: String,
    window: Child,
    folder: PathBuf,
    widgets: PathBuf,
}

fn has(program: &str) -> bool {
    let tried = Command::new(program).arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    tried.is_ok()
}

impl Desk {
    /// None, and a message, where the programs are missing.
    pub fn open() -> Option<Self> {
        for program in ["Xvfb", "xdotool"] {
            if !has(program) {
                eprintln!(
                    "skipped: {program} is not installed (Debian: apt-get install xvfb xdotool libgl1-mesa-dri)"
                );
                return None;
            }
        }
        let folder = std::env::temp_dir().join(format!(
            "hapteron-live-{}-{:?}",
            std::process::id(),
            std::thread::current().id()
        ));
        std::fs::create_dir_all(&folder).unwrap();
        let chosen = folder.join("display");
        // The server finds a free display and tells which.
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-fbdir"])
            .arg(&folder)
            .stdout(std::fs::File::create(&chosen).unwrap())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begun = Instant::now();
        let number = loop {
            let text = std::fs::read_to_string(&chosen).unwrap();
            if text.ends_with('\n') {
                break text.trim().to_owned();
            }
            if begun.elapsed() > PATIENCE {
                let _ = server.kill();
                panic!("Xvfb does not start");
            }
            std::thread::sleep(STEP);
        };
        let display = format!(":{number}");
        let widgets = folder.join("widgets.csv");
        let window = Command::new(env!("CARGO_BIN_EXE_hapteron"))
            .args(["live", "--dark", "--widgets"])
            .arg(&widgets)
            .current_dir(&folder)
            .env("DISPLAY", &display)
            .env("XDG_CONFIG_HOME", folder.join("config"))
            .env("LIBGL_ALWAYS_SOFTWARE", "1")
            .env_remove("WAYLAND_DISPLAY")
            .spawn()
            .unwrap();
        let mut desk = Self { server, display, window, folder, widgets };
        desk.wait_for("jaws");
        // Without a window manager the keys go where they are told to.
        let found = desk.xdotool(&["search", "--sync", "--onlyvisible", "--name", "hapteron"]);
        let window = found.lines().next().unwrap().to_owned();
        desk.xdotool(&["windowfocus", "--sync", &window]);
        Some(desk)
    }

    /// Where the window runs and saves.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.display).output().unwrap();
        assert!(
            output.status.success(),
            "xdotool {arguments:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Left, top, right, bottom of a widget, pixels, when it is shown.
    fn find(&self, name: &str) -> Option<[i32; 4]> {
        let text = std::fs::read_to_string(&self.widgets).ok()?;
        let line = text.lines().find_map(|l| l.strip_prefix(name)?.strip_prefix(','))?;
        let numbers: Vec<i32> = line.split(',').map(|n| n.parse().unwrap()).collect();
        numbers.try_into().ok()
    }

    /// Of a widget that is shown.
    pub fn area(&self, name: &str) -> [i32; 4] {
        self.find(name).unwrap_or_else(|| panic!("'{name}' is not shown"))
    }

    /// The middle of a widget.
    pub fn place(&self, name: &str) -> (i32, i32) {
        let [left, top, right, bottom] = self.area(name);
        ((left + right) / 2, (top + bottom) / 2)
    }

    /// Waits until a widget is shown.
    pub fn wait_for(&mut self, name: &str) {
        let begun = Instant::now();
        while self.find(name).is_none() {
            if let Some(status) = self.window.try_wait().unwrap() {
                panic!("the window has ended while '{name}' was waited for: {status}");
            }
            if begun.elapsed() > PATIENCE {
                panic!("'{name}' does not appear; see {}", self.keep_picture().display());
            }
            std::thread::sleep(STEP);
        }
    }

    /// Waits until something is over that is told of like a widget.
    pub fn wait_for_end(&self, name: &str) {
        let begun = Instant::now();
        while self.find(name).is_some() {
            assert!(
                begun.elapsed() < PATIENCE,
                "'{name}' does not end; see {}",
                self.keep_picture().display()
            );
            std::thread::sleep(STEP);
        }
    }

    /// Waits until the window has written a file.
    pub fn wait_for_file(&self, name: &str) {
        let begun = Instant::now();
        let path = self.folder.join(name);
        let mut before = 0;
        // Until it is there and grows no more.
        loop {
            let size = std::fs::metadata(&path).map_or(0, |m| m.len());
            if size > 0 && size == before {
                return;
            }
            if begun.elapsed() > PATIENCE {
                panic!("{name} is not written; see {}", self.keep_picture().display());
            }
            before = size;
            std::thread::sleep(5 * STEP);
        }
    }

    /// Lets the window go on.
    pub fn pause(&self, seconds: f64) {
        std::thread::sleep(Duration::from_secs_f64(seconds));
    }

    /// Lets the window draw a few pictures, in which it takes note of what was done, however long that takes it.
    pub fn settle(&self) {
        let pictures = || self.find("picture").map_or(0, |p| p[0]);
        let (begun, enough) = (Instant::now(), pictures() + 4);
        while pictures() < enough {
            assert!(
                begun.elapsed() < PATIENCE,
                "the window draws nothing; see {}",
                self.keep_picture().display()
            );
            std::thread::sleep(STEP / 10);
        }
    }

    fn move_to(&self, (x, y): (i32, i32)) {
        self.xdotool(&["mousemove", &x.to_string(), &y.to_string()]);
        self.settle();
    }

    /// Clicks on a widget.
    pub fn click(&mut self, name: &str) {
        self.wait_for(name);
        self.move_to(self.place(name));
        // Not longer: what lasts four fifths of a second is no click.
        self.xdotool(&["mousedown", "1"]);
        self.pause(0.1);
        self.xdotool(&["mouseup", "1"]);
        self.settle();
    }

    /// Takes hold of the body and moves it slowly; it stays held.
    pub fn drag_body(&mut self, right: i32, down: i32) {
        self.wait_for("body");
        let (x, y) = self.place("body");
        self.move_to((x, y));
        self.xdotool(&["mousedown", "1"]);
        self.wait_for("held");
        let steps = right.abs().max(down.abs());
        for step in 1..=steps {
            let (x, y) = (x + right * step / steps, y + down * step / steps);
            self.xdotool(&["mousemove", &x.to_string(), &y.to_string()]);
            self.pause(0.03);
        }
        self.settle();
    }

    /// Lets go of the mouse button.
    pub fn let_go(&self) {
        self.xdotool(&["mouseup", "1"]);
        self.settle();
    }

    /// Replaces what a number or a line of text says; a slider's number is at its right end.
    pub fn type_into(&mut self, name: &str, text: &str) {
        self.wait_for(name);
        let [_, top, right, bottom] = self.area(name);
        self.move_to((right - 14, (top + bottom) / 2));
        self.xdotool(&["click", "1"]);
        self.settle();
        self.xdotool(&["key", "ctrl+a"]);
        self.settle();
        self.xdotool(&["type", "--delay", "60", text]);
        self.settle();
        self.key("Return");
    }

    /// Presses a key.
    pub fn key(&self, key: &str) {
        self.xdotool(&["key", key]);
        self.settle();
    }

    /// Waits until the display shows what a stored picture does: pictures of a busy machine come late.
    pub fn must_resemble(&self, reference: &Path) -> Picture {
        let begun = Instant::now();
        loop {
            let picture = self.picture();
            if begun.elapsed() > PATIENCE || Picture::are_stored() || picture.resembles_file(reference) {
                picture.must_resemble(reference);
                return picture;
            }
            std::thread::sleep(2 * STEP);
        }
    }

    /// What the display shows: Xvfb keeps it in a file.
    pub fn picture(&self) -> Picture {
        Picture::from_xwd(&std::fs::read(self.folder.join("Xvfb_screen0")).unwrap())
    }

    /// The display as it is, for whoever looks for what went wrong.
    fn keep_picture(&self) -> PathBuf {
        let path = std::env::temp_dir().join("hapteron-live-failed.png");
        self.picture().write_png(&path);
        path
    }

    /// Closes the window, and sees that it ends well.
    pub fn close(mut self) {
        self.xdotool(&["key", "ctrl+q"]);
        let begun = Instant::now();
        let status = loop {
            if let Some(status) = self.window.try_wait().unwrap() {
                break status;
            }
            assert!(begun.elapsed() < PATIENCE, "the window does not close");
            std::thread::sleep(STEP);
        };
        assert!(status.success(), "{status}");
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        for child in [&mut self.window, &mut self.server] {
            let _ = child.kill();
            let _ = child.wait();
        }
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}
