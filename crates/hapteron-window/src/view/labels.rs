//! Words, axes and the scale bar over the 3D view.

use super::camera::Camera;
use super::compose::{Label, Shown};
use super::marks::nice_below;
use crate::theme::{Palette, screen};
use eframe::egui;
use egui::{Align2, Color32, FontId, Pos2, Rect, Stroke, pos2, vec2};
use nalgebra::Vector2;

/// Length of the scale bar on the screen, points, at most.
const LONGEST_BAR: f64 = 130.0;
/// Length of the axes in the corner, points.
const AXIS: f32 = 30.0;

/// Paints all of them.
pub fn paint(ui: &egui::Ui, rect: Rect, camera: &Camera, labels: &[Label], shown: &Shown, palette: &Palette) {
    let painter = ui.painter_at(rect);
    let size = Vector2::new(f64::from(rect.width()), f64::from(rect.height()));
    let mut taken: Vec<Rect> = Vec::new();
    for label in labels {
        if let Some(place) = camera.project(&label.at, size) {
            let mut at = rect.min + vec2(place.x as f32, place.y as f32);
            at = at.clamp(rect.min + vec2(40.0, 14.0), rect.max - vec2(40.0, 14.0));
            // Two words at one place would be none.
            while taken.iter().any(|t| t.contains(at)) {
                at.y += 16.0;
            }
            taken.push(outlined(&painter, at, &label.text, screen(label.colour), palette).expand(6.0));
        }
    }
    if shown.axes {
        axes(&painter, rect, camera, palette);
        scale_bar(&painter, rect, camera, palette);
    }
}

/// Words that can be read over anything.
fn outlined(painter: &egui::Painter, at: Pos2, text: &str, colour: Color32, palette: &Palette) -> Rect {
    let font = FontId::proportional(14.0);
    let galley = painter.layout_no_wrap(text.to_owned(), font, colour);
    let rect = Align2::CENTER_CENTER.anchor_size(at, galley.size());
    let [r, g, b, _] = palette.background[1];
    painter.rect_filled(rect.expand2(vec2(4.0, 1.0)), 4.0, Color32::from_rgba_unmultiplied(r, g, b, 190));
    painter.galley(rect.min, galley, colour);
    rect
}

/// The world's directions.
fn axes(painter: &egui::Painter, rect: Rect, camera: &Camera, palette: &Palette) {
    let origin = rect.left_bottom() + vec2(46.0, -46.0);
    let [right, up, back] = camera.axes();
    let colours =
        [Color32::from_rgb(232, 84, 84), Color32::from_rgb(92, 184, 92), Color32::from_rgb(84, 140, 240)];
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| back[a].total_cmp(&back[b]));
    for axis in order {
        let tip = origin + vec2(right[axis] as f32, -up[axis] as f32) * AXIS;
        painter.line_segment([origin, tip], Stroke::new(2.0, colours[axis]));
        let place = origin + vec2(right[axis] as f32, -up[axis] as f32) * (AXIS + 10.0);
        let letter = ["x", "y", "z"][axis];
        painter.text(place, Align2::CENTER_CENTER, letter, FontId::proportional(13.0), screen(palette.text));
    }
}

/// A length to compare with, true at the point the camera turns around.
fn scale_bar(painter: &egui::Painter, rect: Rect, camera: &Camera, palette: &Palette) {
    let point = camera.metres_per_point(f64::from(rect.height()));
    let metres = nice_below(LONGEST_BAR * point);
    let length = (metres / point) as f32;
    let left = pos2(rect.left() + 100.0, rect.bottom() - 22.0);
    let right = left + vec2(length, 0.0);
    let stroke = Stroke::new(1.5, screen(palette.text));
    painter.line_segment([left, right], stroke);
    for end in [left, right] {
        painter.line_segment([end - vec2(0.0, 4.0), end + vec2(0.0, 4.0)], stroke);
    }
    let middle = left + vec2(length / 2.0, -10.0);
    let font = FontId::proportional(12.5);
    painter.text(middle, Align2::CENTER_CENTER, length_text(metres), font, screen(palette.text));
}

/// A length with the unit that reads best.
fn length_text(metres: f64) -> String {
    if metres >= 1.0 {
        format!("{metres} m")
    } else if metres >= 0.999e-3 {
        format!("{:.0} mm", metres * 1e3)
    } else if metres >= 0.999e-6 {
        format!("{:.0} µm", metres * 1e6)
    } else {
        format!("{metres:.0e} m")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_the_unit_that_reads_best() {
        let texts = [2.0, 0.5, 0.02, 0.001, 5e-5].map(length_text);
        assert_eq!(texts, ["2 m", "500 mm", "20 mm", "1 mm", "50 µm"]);
    }
}
