//! Progress bars, messages and Ctrl-C.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A message on stderr, as `eprintln!`, but where nobody reads any more - a terminal that was closed, a pipe that has ended - it is lost without a panic: a
/// session ends as it should and its files are completed.
macro_rules! say {
    ($($text:tt)*) => {
        $crate::progress::tell(format_args!($($text)*))
    };
}
pub(crate) use say;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static HANDLER: OnceLock<()> = OnceLock::new();
static FIRST: OnceLock<Instant> = OnceLock::new();

/// For so long after the first Ctrl-C a second one kills nothing: keys repeat, and a device is to be stopped before the program ends.
const GRACE: Duration = Duration::from_secs(1);

/// From now on Ctrl-C (and SIGTERM, and the end of the terminal) does not kill the program but makes [`interrupted`] true; one more, later than
/// [`GRACE`], kills it.
pub fn catch_interrupt() {
    HANDLER.get_or_init(|| {
        let installed = ctrlc::set_handler(|| {
            let first = FIRST.get_or_init(Instant::now);
            if !INTERRUPTED.swap(true, Ordering::SeqCst) {
                say!("\nstopping; once more to kill");
            } else if first.elapsed() > GRACE {
                std::process::exit(130);
            }
        });
        if let Err(error) = installed {
            say!("warning: Ctrl-C will not end the run cleanly: {error}");
        }
    });
}

/// Whether Ctrl-C was pressed.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// Writes a message to stderr; see [`say!`].
pub fn tell(message: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stderr().lock(), "{message}");
}

/// A bar of `steps` on stderr; nothing when stderr is not a terminal.
pub fn bar(steps: u64, what: &str) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %  {eta} left") {
        bar.set_style(style);
    }
    bar.set_message(what.to_owned());
    bar
}
