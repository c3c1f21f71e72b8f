//! Whether there is a display to open a window on.

use std::ffi::OsString;

/// What to do where there is none.
pub const CURE: &str = "`hapteron run SCENE.toml` and `hapteron demo` need no display; or start this from a desktop, or under Xvfb: \
                        xvfb-run -s '-screen 0 1280x800x24' hapteron live";

/// Tells why no window can be opened, when the environment names no display.
///
/// # Errors
/// In words, with what to do.
pub fn check(variable: impl Fn(&str) -> Option<OsString>) -> Result<(), String> {
    // Elsewhere windows need no name of a display.
    if cfg!(not(all(unix, not(target_os = "macos")))) {
        return Ok(());
    }
    let given = |name: &str| variable(name).is_some_and(|value| !value.is_empty());
    if ["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY"].into_iter().any(given) {
        return Ok(());
    }
    Err(format!("there is no display: none of DISPLAY, WAYLAND_DISPLAY and WAYLAND_SOCKET is set. {CURE}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_display_is_found_by_its_variables() {
        let none = |_: &str| None;
        assert!(check(none).unwrap_err().contains("hapteron demo"));
        let empty = |_: &str| Some(OsString::new());
        assert!(check(empty).is_err());
        for name in ["DISPLAY", "WAYLAND_DISPLAY"] {
            assert!(check(|asked: &str| (asked == name).then(|| OsString::from(":1"))).is_ok());
        }
    }
}
