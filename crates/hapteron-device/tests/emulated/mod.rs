//! What the tests of the drivers share.
#![allow(dead_code, reason = "each test uses its part")]
#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(unsafe_code, reason = "scripts an emulated library through its C symbols")]

use hapteron_device::{Capabilities, Device, DeviceCommand, DeviceSample};
use nalgebra::Vector3;
use std::ffi::{CString, c_char};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

/// The stiffness of the virtual wall, N/m.
pub const WALL: f64 = 800.0;

/// An emulated vendor library of its own: a copy of the file, so that its state is nobody else's.
pub struct EmulatedLibrary {
    library: libloading::Library,
    pub path: PathBuf,
    prefix: &'static str,
}

impl EmulatedLibrary {
    /// `prefix`: `dhd` or `hd`.
    pub fn new(prefix: &'static str) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let tests = std::env::current_exe().unwrap();
        let name =
            format!("{}hapteron_emulators{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
        let original = tests.ancestors().skip(1).map(|f| f.join(&name)).find(|f| f.exists());
        let original = original
            .unwrap_or_else(|| panic!("{name} is built with the tests; not found near {}", tests.display()));
        let file = format!("hapteron-{}-{number}-{name}", std::process::id());
        let path = std::env::temp_dir().join(file);
        std::fs::copy(&original, &path).unwrap();
        // SAFETY: our own library; it has no initialisers.
        let library = unsafe { libloading::Library::new(&path) }.unwrap();
        Self { library, path, prefix }
    }

    pub fn set(&self, name: &str, value: f64) -> &Self {
        let full = CString::new(format!("{}.{name}", self.prefix)).unwrap();
        // SAFETY: the symbol's signature in `hapteron_emulators::control`.
        let known = unsafe {
            let set: libloading::Symbol<'_, unsafe extern "C" fn(*const c_char, f64) -> i32> =
                self.library.get(b"emulator_set").unwrap();
            set(full.as_ptr(), value)
        };
        assert_eq!(known, 1, "the emulator does not know {name}");
        self
    }

    pub fn get(&self, name: &str) -> f64 {
        let full = CString::new(format!("{}.{name}", self.prefix)).unwrap();
        // SAFETY: the symbol's signature in `hapteron_emulators::control`.
        let value = unsafe {
            let get: libloading::Symbol<'_, unsafe extern "C" fn(*const c_char) -> f64> =
                self.library.get(b"emulator_get").unwrap();
            get(full.as_ptr())
        };
        assert!(!value.is_nan(), "the emulator does not know {name}");
        value
    }

    pub fn vector(&self, name: &str) -> Vector3<f64> {
        Vector3::new(
            self.get(&format!("{name}_x")),
            self.get(&format!("{name}_y")),
            self.get(&format!("{name}_z")),
        )
    }

    pub fn set_vector(&self, name: &str, value: Vector3<f64>) {
        self.set(&format!("{name}_x"), value.x);
        self.set(&format!("{name}_y"), value.y);
        self.set(&format!("{name}_z"), value.z);
    }
}

impl Drop for EmulatedLibrary {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The force of a wall that takes up the half space behind the origin along `inward`.
pub fn wall_force(sample: &DeviceSample, inward: &Vector3<f64>) -> DeviceCommand {
    let depth = sample.position.dot(inward).max(0.0);
    DeviceCommand { force: -WALL * depth * inward, torque: Vector3::zeros() }
}

/// Depth at which the emulators' hand rests when it wants to be `wanted` behind the wall: two springs in series.
pub fn resting_depth(wanted: f64) -> f64 {
    wanted * 200.0 / (200.0 + WALL)
}

/// A loop of a polled or exchange-paced device, `ticks` long; the last sample.
pub fn run(
    device: &mut dyn Device,
    ticks: u32,
    mut control: impl FnMut(&DeviceSample) -> DeviceCommand,
) -> DeviceSample {
    let mut last = None;
    for _ in 0..ticks {
        let sample = device.read().unwrap();
        let parts = [sample.position, sample.linear_velocity, sample.angular_velocity];
        assert!(parts.iter().all(|v| v.iter().all(|c| c.is_finite())), "{sample:?}");
        device.write(&control(&sample)).unwrap();
        last = Some(sample);
    }
    last.unwrap()
}

/// Sanity of any device's capabilities.
pub fn check_capabilities(c: &Capabilities) {
    assert!(!c.name.is_empty());
    assert!(c.rate > 0.0);
    assert!(c.peak_force >= c.continuous_force, "{c:?}");
    assert!(c.peak_torque >= c.continuous_torque, "{c:?}");
    assert_eq!(c.drives_force, c.peak_force > 0.0);
    assert_eq!(c.drives_torque, c.peak_torque > 0.0);
    assert_eq!(c.drives_force, c.max_stiffness > 0.0 && c.max_damping > 0.0);
}
