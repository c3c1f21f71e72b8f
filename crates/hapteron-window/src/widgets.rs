//! Where the buttons and values are: told to scripts that drive the window, by name.

use eframe::egui;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Adds widgets and notes their places.
#[derive(Default)]
pub struct Widgets {
    file: Option<PathBuf>,
    places: Vec<(String, egui::Rect)>,
    written: String,
}

impl Widgets {
    /// One that writes the places into a file, when there is one, whenever they change.
    #[must_use]
    pub fn new(file: Option<&Path>) -> Self {
        Self { file: file.map(Path::to_owned), ..Self::default() }
    }

    /// Adds a widget under a name.
    pub fn add(&mut self, ui: &mut egui::Ui, name: &str, widget: impl egui::Widget) -> egui::Response {
        let response = ui.add(widget);
        self.note(name, response.rect);
        response
    }

    /// Notes where something is.
    pub fn note(&mut self, name: &str, rect: egui::Rect) {
        if self.file.is_some() {
            self.places.push((name.to_owned(), rect));
        }
    }

    /// The end of a picture: writes `name,left,top,right,bottom` in pixels, a line each, when anything has moved.
    pub fn finish(&mut self, pixels_per_point: f32) {
        let Some(file) = &self.file else { return };
        let mut text = String::new();
        for (name, rect) in self.places.drain(..) {
            let [l, t, r, b] = [rect.left(), rect.top(), rect.right(), rect.bottom()]
                .map(|v| (v * pixels_per_point).round());
            let _ = writeln!(text, "{name},{l},{t},{r},{b}");
        }
        if text != self.written {
            // Through another name, so that no one reads half of it.
            let part = file.with_extension("part");
            let done = std::fs::write(&part, &text).and_then(|()| std::fs::rename(&part, file));
            match done {
                Ok(()) => self.written = text,
                Err(error) => {
                    eprintln!("warning: cannot write {}: {error}", file.display());
                    self.file = None;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a file that scripts cannot read.
    #[test]
    fn places_are_written_in_pixels() {
        let file = std::env::temp_dir().join(format!("hapteron-widgets-{}", std::process::id()));
        let mut widgets = Widgets::new(Some(&file));
        widgets.note("stop", egui::Rect::from_min_max(egui::pos2(1.0, 2.0), egui::pos2(11.0, 22.0)));
        widgets.finish(2.0);
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "stop,2,4,22,44\n");
        std::fs::remove_file(&file).unwrap();
    }
}
