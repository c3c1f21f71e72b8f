//! Where the library is, and which device of those that it sees.

use super::functions::{Functions, Id};
use crate::drivers::OpenError;
use crate::drivers::library::Search;
use crate::drivers::options::Reader;
use std::path::PathBuf;

const CURE: &str = "Install the Force Dimension SDK (https://www.forcedimension.com/software/sdk), then set FDSDK to its folder, or \
     HAPTERON_DRD_LIBRARY (or the option library) to the file libdrd. On Linux it needs libusb-1.0 and a udev rule for vendor 1451";
const NO_DEVICE_CURE: &str = "Check power and USB cable; on Linux also the udev rule for vendor 1451 (Falcon: 0403:cb48), so that you may \
     open it without being root";

fn search() -> Search {
    #[cfg(windows)]
    const NAMES: &[&str] = &["drd64.dll", "dhd64.dll", "drd.dll", "dhd.dll"];
    #[cfg(target_os = "macos")]
    const NAMES: &[&str] = &["libdrd.dylib", "libdhd.dylib"];
    #[cfg(not(any(windows, target_os = "macos")))]
    const NAMES: &[&str] = &["libdrd.so", "libdhd.so"];
    let mut folders = Vec::new();
    for variable in ["FDSDK", "FORCEDIM_SDK"] {
        let Some(root) = std::env::var_os(variable).map(PathBuf::from) else { continue };
        let os = if cfg!(target_os = "macos") { "mac" } else { "lin" };
        for compiler in ["gcc", "clang"] {
            folders.push(root.join(format!("lib/release/{os}-{}-{compiler}", std::env::consts::ARCH)));
        }
        folders.extend([root.join("lib"), root.join("bin")]);
    }
    if cfg!(windows) {
        let installed = std::fs::read_dir("C:\\Program Files\\Force Dimension").into_iter().flatten();
        folders.extend(installed.flatten().map(|sdk| sdk.path().join("bin")));
    } else {
        if let Some(home) = std::env::var_os("HOME") {
            folders.push(PathBuf::from(home).join(".local/lib"));
        }
        folders.push("/usr/local/lib".into());
    }
    Search {
        what: "Force Dimension's library",
        variable: "HAPTERON_DRD_LIBRARY",
        names: NAMES,
        folders,
        cure: CURE,
    }
}

/// The library's functions, and what there is to be said about them.
pub(super) fn load(options: &Reader<'_>) -> Result<(Functions, Vec<String>), OpenError> {
    let library = search().load(options.text("library"))?;
    let functions = Functions::resolve(&library)?;
    let version =
        functions.version().map(|[a, b, c, d]| format!(", version {a}.{b}.{c}.{d}")).unwrap_or_default();
    let mut notes = vec![format!("library {}{version}", library.path.display())];
    let missing = functions.missing();
    if !missing.is_empty() {
        notes.push(format!(
            "this version of the library lacks {}; the driver does without",
            missing.join(", ")
        ));
    }
    Ok((functions, notes))
}

/// Opens the device of an index.
pub(super) fn open_index(functions: &Functions, index: u32) -> Result<Id, OpenError> {
    let no_device = |detail| OpenError::NoDevice { detail, cure: NO_DEVICE_CURE };
    let count = functions.device_count();
    let index = u8::try_from(index).ok().filter(|i| i32::from(*i) < count).ok_or_else(|| {
        no_device(format!("Force Dimension's library sees {count} devices; index {index} is none of them"))
    })?;
    functions.open(index).map_err(|code| {
        no_device(format!(
            "Force Dimension's library could not open device {index} ({})",
            functions.error_text(code)
        ))
    })
}

/// Opens the device of a serial number.
pub(super) fn open_serial(functions: &Functions, serial: u32) -> Result<Id, OpenError> {
    let mut seen = Vec::new();
    for index in 0..functions.device_count().clamp(0, 16) {
        let Ok(id) = open_index(functions, index as u32) else { continue };
        let found = functions.serial(id);
        if found.map(u32::from) == Some(serial) {
            return Ok(id);
        }
        seen.extend(found.map(|s| s.to_string()));
        functions.close(id);
    }
    let detail = format!("none has the serial number {serial}; attached: [{}]", seen.join(", "));
    Err(OpenError::NoDevice { detail, cure: NO_DEVICE_CURE })
}
