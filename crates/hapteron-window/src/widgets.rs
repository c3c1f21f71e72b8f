//! Where the buttons and values are: told to scripts that drive the window, by name.

use eframe::egui;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Adds widgets and notes their places.
#[derive(Default)]
pub struct Widgets {
    file: Option<PathBuf>,
    places: Vec<(String, egui::Rect)>,
    pictures: u64,
}

impl Widgets {
    /// One that writes the places into a file, when there is one.
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

    /// The end of a picture: writes `name,left,top,right,bottom` in pixels, a line each, and as `picture` which one it is, so that scripts
    /// need not guess how long the window takes for what they ask.
    pub fn finish(&mut self, pixels_per_point: f32) {
        let Some(file) = &self.file else { return };
        self.pictures += 1;
        let mut text = format!("picture,{},0,0,0\n", self.pictures);
        for (name, rect) in self.places.drain(..) {
            let [l, t, r, b] = [rect.left(), rect.top(), rect.right(), rect.bottom()]
                .map(|v| (v * pixels_per_point).round());
            let _ = writeln!(text, "{name},{l},{t},{r},{b}");
        }
        // Through another name, so that no one reads half of it.
        let part = file.with_extension("part");
        let done = std::fs::write(&part, &text).and_then(|()| std::fs::rename(&part, file));
        if let Err(error) = done {
            eprintln!("warning: cannot write {}: {error}", file.display());
            self.file = None;
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
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "picture,1,0,0,0\nstop,2,4,22,44\n");
        std::fs::remove_file(&file).unwrap();
    }
}
