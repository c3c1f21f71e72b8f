//! The window of hapteron: a scene, the forces in it and their plots while it runs.
//!
//! [`open`] shows it and returns when it is closed. Here live the 3D view, the plots, the panel of parameters, and the hand that the pointer
//! is. What never lives here: anything that the haptic thread waits for. The window reads what the threads tell of themselves
//! ([`hapteron::session::real_time`]) through wait-free exchanges and sends commands through a bounded ring; it may stand still, be resized or
//! be closed, and no tick is later for it.

mod app;
mod display;
mod live;
mod opening;
mod picture;
mod plots;
mod recent;
mod start;
mod theme;
pub mod trial;
mod view;
mod widgets;

pub use opening::Source;

use eframe::egui;
use std::path::PathBuf;

/// How the window opens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// What is opened at once, instead of the start page.
    pub open: Option<Source>,
    /// Bright surroundings, or dark ones; none: as the system.
    pub light: Option<bool>,
    /// Saves a picture (PNG) and closes.
    pub screenshot: Option<PathBuf>,
    /// When, seconds; without a picture: closes then.
    pub after: Option<f64>,
    /// Writes where buttons and values are (`name,left,top,right,bottom`, pixels) for scripts that drive the window.
    pub widgets: Option<PathBuf>,
    /// Width and height, points.
    pub size: Option<[f32; 2]>,
}

/// Why there is no window. In words, with what to do.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct WindowError(String);

/// Opens the window and returns when it is closed.
///
/// # Errors
/// [`WindowError`] when there is no display, or none that can show OpenGL.
pub fn open(options: Options) -> Result<(), WindowError> {
    let size = options.size.unwrap_or([1280.0, 800.0]);
    run(size, Box::new(|creation| Ok(Box::new(app::Window::new(&creation.egui_ctx, options)))))
}

/// Shows something in a window until it is closed.
fn run(size: [f32; 2], create: eframe::AppCreator<'_>) -> Result<(), WindowError> {
    display::check(|name| std::env::var_os(name)).map_err(WindowError)?;
    let native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("hapteron")
            .with_inner_size(size)
            .with_min_inner_size([820.0, 560.0])
            .with_drag_and_drop(true),
        // The scene is drawn into buffers of its own; egui smooths its edges itself.
        multisampling: 0,
        renderer: eframe::Renderer::Glow,
        ..eframe::NativeOptions::default()
    };
    eframe::run_native("hapteron", native, create).map_err(|error| {
        let why = match error {
            eframe::Error::WinitEventLoop(_) => "the display does not answer".to_owned(),
            eframe::Error::NoGlutinConfigs(..) => {
                "the display has no OpenGL (Debian: libgl1-mesa-dri)".to_owned()
            }
            other => other.to_string(),
        };
        WindowError(format!("the window cannot be opened: {why}. {}", display::CURE))
    })
}
