//! Pictures of the window as PNG.

use eframe::egui::{self, ColorImage};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Writes a picture.
///
/// # Errors
/// Those of the file, in words.
pub fn write(image: &ColorImage, path: &Path) -> Result<(), String> {
    let text = |e: &dyn std::fmt::Display| format!("cannot write {}: {e}", path.display());
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|e| text(&e))?;
    }
    let file = std::fs::File::create(path).map_err(|e| text(&e))?;
    let [width, height] = image.size.map(|s| u32::try_from(s).unwrap_or(u32::MAX));
    let mut encoder = png::Encoder::new(std::io::BufWriter::new(file), width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let bytes: Vec<u8> = image.pixels.iter().flat_map(|p| [p.r(), p.g(), p.b()]).collect();
    let mut writer = encoder.write_header().map_err(|e| text(&e))?;
    writer.write_image_data(&bytes).map_err(|e| text(&e))?;
    writer.finish().map_err(|e| text(&e))
}

/// Asks for a picture of the next frame; `done` is called with it.
pub fn ask(ctx: &egui::Context, done: impl FnOnce(Arc<ColorImage>) + Send + 'static) {
    ctx.send_viewport_cmd(egui::ViewportCommand::Screenshot(egui::ScreenshotCallback::new(done)));
    ctx.request_repaint();
}

/// `runs/live.png`, or numbered when it exists.
#[must_use]
pub fn free_name() -> PathBuf {
    let first = Path::new("runs").join("live.png");
    let numbered = (2..).map(|n| Path::new("runs").join(format!("live-{n}.png")));
    std::iter::once(first.clone()).chain(numbered).find(|p| !p.exists()).unwrap_or(first)
}
