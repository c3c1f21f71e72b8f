//! 3D Systems' Touch, Touch X and Phantom through OpenHaptics' device library (HDAPI).
//!
//! Axes are ours; lengths are millimetres, torques millinewton metres. The library calls us: everything happens inside its scheduler's tick.

mod functions;
mod scheduler;
mod service;

use super::library::{Loaded, Search};
use super::options::Reader;
use super::{Attached, DriverOptions, Found, OpenError};
use crate::{Applied, Capabilities, Control, Device, DeviceCommand, DeviceFault, DeviceSample, Pacing};
use functions::{
    Calibration, Functions, INPUT_DOF, MODEL_TYPE, NOMINAL_MAX_CONTINUOUS_FORCE,
    NOMINAL_MAX_CONTINUOUS_TORQUE, NOMINAL_MAX_DAMPING, NOMINAL_MAX_FORCE, NOMINAL_MAX_STIFFNESS,
    NOMINAL_MAX_TORQUE, NOMINAL_MAX_TORQUE_STIFFNESS, OUTPUT_DOF, SERIAL_NUMBER, USABLE_WORKSPACE,
};
use nalgebra::Vector3;
use service::{Gate, Outcome, Target};
use std::ffi::{CString, c_uint};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// The name of this driver in scenes.
pub(super) const KIND: &str = "openhaptics";
const OPTIONS: [&str; 5] = ["library", "name", "homing_timeout", "patience", "rate"];
/// Of the library's scheduler, Hz, as long as it takes no other.
const USUAL_RATE: f64 = 1000.0;
const CURE: &str = "Install OpenHaptics and the device driver from 3D Systems (https://support.3dsystems.com, 'OpenHaptics' and 'Haptic Device \
     Driver'); on Linux libHD.so needs libPHANToMIO.so beside it. Or set HAPTERON_HD_LIBRARY (or the option library) to the file";
const NO_DEVICE_CURE: &str = "Check power and cable, run the vendor's Touch_Setup or diagnostic, and give the device's name there as the \
     option name (default: the vendor's default device)";

fn search() -> Search {
    #[cfg(windows)]
    const NAMES: &[&str] = &["HD.dll", "hd.dll"];
    #[cfg(target_os = "macos")]
    const NAMES: &[&str] = &["libHD.dylib", "HD.framework/HD"];
    #[cfg(not(any(windows, target_os = "macos")))]
    const NAMES: &[&str] = &["libHD.so"];
    let mut folders = Vec::new();
    if let Some(root) = std::env::var_os("OH_SDK_BASE").map(PathBuf::from) {
        folders.extend(["lib", "bin", "utilities/lib"].map(|f| root.join(f)));
    }
    if cfg!(target_os = "macos") {
        folders.push("/Library/Frameworks".into());
    }
    if cfg!(unix) {
        let places =
            ["/usr/local/lib", "/usr/lib", "/usr/lib64", "/usr/lib/x86_64-linux-gnu", "/opt/OpenHaptics/lib"];
        folders.extend(places.map(PathBuf::from));
    }
    Search {
        what: "OpenHaptics' device library",
        variable: "HAPTERON_HD_LIBRARY",
        names: NAMES,
        folders,
        cure: CURE,
    }
}

/// One open device.
struct OpenHaptics {
    functions: Functions,
    device: c_uint,
    capabilities: Capabilities,
    homing_timeout: Duration,
    patience: Duration,
    gate: &'static Gate,
    /// Latched until homing or [`Device::set_force_enabled`].
    fault: Option<DeviceFault>,
}

fn load(options: &Reader<'_>) -> Result<(Loaded, Functions), OpenError> {
    let library = search().load(options.text("library"))?;
    let functions = Functions::resolve(&library)?;
    Ok((library, functions))
}

/// Opens a device.
pub(super) fn open(options: &DriverOptions) -> Result<Box<dyn Device>, OpenError> {
    let options = options.of(KIND, &OPTIONS)?;
    let homing_timeout = options.seconds("homing_timeout", 60.0, 0.0..=600.0)?;
    let patience = options.seconds("patience", 0.1, 0.005..=10.0)?;
    let rate = options.number("rate", USUAL_RATE, 100.0..=8000.0)?;
    let (_, functions) = load(&options)?;
    let name = options.text("name").map(str::to_owned);
    let device = init(&functions, name.as_deref())?;
    functions.make_current(device);
    functions.enable_force(false);
    let rate = if functions.set_rate(rate.round() as u32) { rate.round() } else { USUAL_RATE };
    let capabilities = capabilities(&functions, rate);
    let gate = Box::leak(Box::new(Gate::new(Target {
        functions,
        device,
        senses_rotation: capabilities.senses_rotation,
        drives_torque: capabilities.drives_torque,
        peak_force: capabilities.peak_force,
        peak_torque: capabilities.peak_torque,
        opened: Instant::now(),
    })));
    Ok(Box::new(OpenHaptics { functions, device, capabilities, homing_timeout, patience, gate, fault: None }))
}

/// The default device, opened for a moment.
pub(super) fn attached() -> Result<Found, OpenError> {
    let options = DriverOptions::new();
    let (library, functions) = load(&options.of(KIND, &OPTIONS)?)?;
    let mut notes = vec![format!("library {}", library.path.display())];
    let missing = functions.missing();
    if !missing.is_empty() {
        notes.push(format!(
            "this version of the library lacks {}; the driver does without",
            missing.join(", ")
        ));
    }
    let device = init(&functions, None)?;
    functions.make_current(device);
    let serial = functions.string(SERIAL_NUMBER).map(|s| format!(" (serial number {s})")).unwrap_or_default();
    let capabilities = capabilities(&functions, USUAL_RATE);
    functions.disable_device(device);
    notes.push("other devices of this library are opened by the option name".into());
    Ok((vec![Attached { address: format!("the default device{serial}"), capabilities }], notes))
}

fn init(functions: &Functions, name: Option<&str>) -> Result<c_uint, OpenError> {
    let c_name = name.and_then(|n| CString::new(n).ok());
    functions.init(c_name.as_deref()).map_err(|code| OpenError::NoDevice {
        detail: format!(
            "OpenHaptics could not open {} ({})",
            name.map_or("its default device".into(), |n| format!("'{n}'")),
            functions.error_text(code)
        ),
        cure: NO_DEVICE_CURE,
    })
}

/// Limits as the library tells them; what it answers with zero is not known.
fn capabilities(f: &Functions, rate: f64) -> Capabilities {
    let limit = |parameter, unit: f64| {
        let [value] = f.doubles::<1>(parameter);
        if value.is_finite() && value > 0.0 { value * unit } else { f64::INFINITY }
    };
    let drives_torque = f.integer(OUTPUT_DOF) >= 6;
    let torque = |parameter| if drives_torque { limit(parameter, 1e-3) } else { 0.0 };
    let w = f.doubles::<6>(USABLE_WORKSPACE).map(|mm| if mm.is_finite() { mm * 1e-3 } else { 0.0 });
    let (force, angular) = (limit(NOMINAL_MAX_FORCE, 1.0), torque(NOMINAL_MAX_TORQUE));
    let found = Capabilities {
        name: format!("OpenHaptics {}", f.string(MODEL_TYPE).unwrap_or_else(|| "device".into())),
        senses_rotation: f.integer(INPUT_DOF) >= 6,
        drives_force: true,
        drives_torque,
        peak_force: force,
        continuous_force: limit(NOMINAL_MAX_CONTINUOUS_FORCE, 1.0).min(force),
        peak_torque: angular,
        continuous_torque: torque(NOMINAL_MAX_CONTINUOUS_TORQUE).min(angular),
        max_stiffness: limit(NOMINAL_MAX_STIFFNESS, 1e3),
        max_angular_stiffness: torque(NOMINAL_MAX_TORQUE_STIFFNESS),
        max_damping: limit(NOMINAL_MAX_DAMPING, 1e3),
        workspace: [Vector3::new(w[0], w[1], w[2]), Vector3::new(w[3], w[4], w[5])],
        rate,
        buttons: 4,
        force_persists: false,
        hardware_watchdog: false,
        pacing: Pacing::Callback,
    };
    let _ = f.drain();
    found
}

impl Device for OpenHaptics {
    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    /// With the scheduler running and no force, as the library's encoders are read by it.
    fn home(&mut self) -> Result<(), DeviceFault> {
        self.fault = None;
        let f = &self.functions;
        f.make_current(self.device);
        let deadline = Instant::now() + self.homing_timeout;
        scheduler::start(f);
        let homed = loop {
            match f.calibration() {
                Calibration::Known => break Ok(()),
                Calibration::Update => f.update_calibration(),
                Calibration::ByHand => {}
            }
            if let Err(fault) = f.drain() {
                break Err(fault);
            }
            if Instant::now() > deadline {
                break Err(DeviceFault::NotHomed);
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        scheduler::stop(f);
        homed
    }

    fn set_force_enabled(&mut self, enabled: bool) -> Result<(), DeviceFault> {
        self.fault = None;
        let f = &self.functions;
        f.make_current(self.device);
        if enabled && f.calibration() != Calibration::Known {
            return Err(DeviceFault::NotHomed);
        }
        f.enable_force(enabled);
        f.drain()
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        Err(DeviceFault::WrongPacing)
    }

    fn write(&mut self, _: &DeviceCommand) -> Result<Applied, DeviceFault> {
        Err(DeviceFault::WrongPacing)
    }

    fn serve(&mut self, control: Control<'_>) -> Result<(), DeviceFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        self.functions.make_current(self.device);
        self.functions.drain()?;
        if self.functions.calibration() != Calibration::Known {
            return Err(DeviceFault::NotHomed);
        }
        match self.gate.serve(control, self.patience) {
            Outcome::Finished => Ok(()),
            Outcome::Fault(fault) => {
                self.stop();
                self.fault = Some(fault);
                Err(fault)
            }
            Outcome::Panic(panic) => {
                self.stop();
                std::panic::resume_unwind(panic)
            }
        }
    }

    /// Outside [`Device::serve`] no frame is open and no force commanded; the motors are switched off.
    fn stop(&mut self) {
        self.functions.make_current(self.device);
        self.functions.enable_force(false);
        let _ = self.functions.drain();
    }
}

impl Drop for OpenHaptics {
    fn drop(&mut self) {
        self.stop();
        self.functions.disable_device(self.device);
    }
}
