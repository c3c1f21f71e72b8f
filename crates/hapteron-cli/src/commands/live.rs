//! `hapteron live`: a scene in a window.

use crate::arguments::Live;
use anyhow::Result;
use std::process::ExitCode;

/// Runs the command.
#[cfg(feature = "window")]
pub fn live(arguments: &Live) -> Result<ExitCode> {
    use hapteron_window::{Options, Source};
    hapteron::session::real_time::system::ignore_suspend();
    let open = match (&arguments.file, &arguments.scene) {
        (Some(path), _) => Some(Source::File(path.clone())),
        (None, Some(name)) => Some(Source::Builtin(name.clone())),
        (None, None) => None,
    };
    hapteron_window::open(Options {
        open,
        light: (arguments.light || arguments.dark).then_some(arguments.light),
        screenshot: arguments.screenshot.clone(),
        after: arguments.after,
        widgets: arguments.widgets.clone(),
        size: arguments.size,
    })?;
    Ok(ExitCode::SUCCESS)
}

/// Why there is no window in this build.
#[cfg(not(feature = "window"))]
pub const NO_WINDOW: &str = "this hapteron was built without its window (--no-default-features). Build it with the feature `window`; \
                             `hapteron run` and `hapteron demo` need none";

/// Runs the command.
#[cfg(not(feature = "window"))]
pub fn live(_: &Live) -> Result<ExitCode> {
    anyhow::bail!("{NO_WINDOW}")
}
