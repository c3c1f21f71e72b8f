//! The 3D view with what the pointer and the keys do in it.

use super::hand::Source;
use super::session::scale_of;
use super::steering::{Drag, Keys};
use super::{Live, Wanted};
use crate::theme::{Palette, screen};
use crate::view::{self, Colour, Preset, Shown, Sight, View};
use crate::widgets::Widgets;
use eframe::egui;
use egui::{Align2, Color32, FontId, Key, PointerButton, Rect, Sense, pos2, vec2};
use nalgebra::{Point2, Vector2, Vector3};

/// Points of scrolling that are one notch of the wheel.
const NOTCH: f32 = 50.0;

impl Live {
    /// Shows the scene.
    pub(super) fn stage(&mut self, ui: &mut egui::Ui, view: &View, shown: &Shown, widgets: &mut Widgets) {
        let size = ui.available_size().max(vec2(1.0, 1.0));
        let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
        widgets.note("view", rect);
        self.point(ui, rect, &response);
        let Some(row) = self.shown_row() else { return };
        let live = self.plots.cursor().is_none();
        let spots =
            if live { self.session.spots().to_vec() } else { self.past.spots(&self.scene, &row).to_vec() };
        self.session.watch_levels(shown.levels && self.has_levels());
        let sight = Sight {
            scene: &self.scene,
            body: row.body,
            handle: row.handle,
            grasp: self.session.grasp(),
            held: !row.flags.contains(hapteron::session::Flags::RELEASED),
            feedback: row.feedback,
            spots: &spots,
            levels: self.session.levels().filter(|_| live),
        };
        view.paint(ui, rect, &sight, &self.shapes, shown, &self.camera);
        if let Some(levels) = sight.levels {
            let text = format!("Contact levels in use    {}", view::level_words(&sight, levels));
            badge(
                &ui.painter_at(rect),
                rect.left_top() + vec2(12.0, 40.0),
                text,
                Color32::from_rgb(58, 66, 78),
            );
        }
        self.note_places(rect, widgets, &row);
        self.badges(ui, rect, row.time);
        legend(ui, rect, shown, scale_of(&self.scene));
    }

    /// For scripts: where the body's grip is in the window, and what cannot be seen in a picture without reading it.
    fn note_places(&self, rect: Rect, widgets: &mut Widgets, row: &hapteron::recording::Row) {
        let size = Vector2::new(f64::from(rect.width()), f64::from(rect.height()));
        if self.steering.is_held() {
            widgets.note("held", rect);
        }
        if self.replays && self.source == Source::Motion {
            widgets.note("replaying", rect);
        }
        let center = row.body * self.shapes.shapes[0].center;
        if let Some(place) = self.camera.project(&center, size) {
            let at = rect.min + vec2(place.x as f32, place.y as f32);
            widgets.note("body", Rect::from_center_size(pos2(at.x.round(), at.y.round()), vec2(2.0, 2.0)));
        }
    }

    /// What the pointer does: holds the body, or turns, moves and zooms the camera.
    fn point(&mut self, ui: &egui::Ui, rect: Rect, response: &egui::Response) {
        let size = Vector2::new(f64::from(rect.width()), f64::from(rect.height()));
        let place = |p: egui::Pos2| Point2::new(f64::from(p.x - rect.left()), f64::from(p.y - rect.top()));
        let (modifiers, scroll) = ui.input(|i| (i.modifiers, i.smooth_scroll_delta().y));
        let pressed = response.is_pointer_button_down_on() && ui.input(|i| i.pointer.primary_pressed());
        let live = self.plots.cursor().is_none() && self.ended().is_none();
        if pressed
            && live
            && !modifiers.shift
            && let Some(at) = response.interact_pointer_pos()
            && let Some(point) = self.pick(place(at), size)
        {
            if self.source == Source::Motion {
                self.source = Source::Pointer;
                self.replays = false;
            }
            self.steering.grab(point);
        }
        if !ui.input(|i| i.pointer.primary_down()) {
            self.steering.release();
        }
        let by = response.drag_delta();
        let by = Vector2::new(f64::from(by.x), f64::from(by.y));
        if self.steering.is_held() {
            if let Some(at) = response.interact_pointer_pos() {
                let kind = match (modifiers.command, modifiers.alt) {
                    (true, _) => Drag::Turn,
                    (_, true) => Drag::Roll,
                    _ => Drag::Move,
                };
                self.steering.drag(&self.camera, kind, place(at), by, size);
            }
            let radius = self.radius();
            self.steering.wheel(&self.camera, f64::from(scroll / NOTCH), radius);
        } else {
            let pans = modifiers.shift
                || response.dragged_by(PointerButton::Secondary)
                || response.dragged_by(PointerButton::Middle);
            if response.dragged() && pans {
                self.camera.pan(by, size.y);
            } else if response.dragged_by(PointerButton::Primary) {
                self.camera.orbit(by);
            }
            if response.hovered() && scroll != 0.0 {
                self.camera.zoom((1.0 + 0.15 * f64::from(scroll / NOTCH)).clamp(0.5, 2.0));
            }
        }
        self.cursor(ui, response, &place, size);
    }

    /// The pointer's look tells what it would do.
    fn cursor(
        &mut self,
        ui: &egui::Ui,
        response: &egui::Response,
        place: &dyn Fn(egui::Pos2) -> Point2<f64>,
        size: Vector2<f64>,
    ) {
        if ui.input(|i| i.pointer.delta() != egui::Vec2::ZERO) {
            self.hovered = response.hover_pos().is_some_and(|at| self.pick(place(at), size).is_some());
        }
        if self.steering.is_held() {
            ui.set_cursor_icon(egui::CursorIcon::Grabbing);
        } else if self.hovered && response.hovered() {
            ui.set_cursor_icon(egui::CursorIcon::Grab);
        }
    }

    /// What is shown, and what can be done, in words over the picture.
    fn badges(&self, ui: &egui::Ui, rect: Rect, time: f64) {
        let painter = ui.painter_at(rect);
        let mut at = rect.left_top() + vec2(12.0, 10.0);
        let mut badge = |text: String, colour: Color32| at.x += badge(&painter, at, text, colour) + 6.0;
        if self.plots.cursor().is_some() {
            badge(format!("HISTORY  t = {time:.3} s"), Color32::from_rgb(150, 96, 0));
        } else if let Some(end) = self.ended() {
            badge(format!("STOPPED: {end}"), Color32::from_rgb(176, 32, 32));
        } else if self.paused {
            badge("SCENE PAUSED".to_owned(), Color32::from_rgb(150, 96, 0));
        } else {
            badge(format!("LIVE  t = {time:.1} s"), Color32::from_rgb(22, 120, 68));
        }
        if let Some(recorder) = &self.recorder {
            badge(format!("RECORDING  {:.1} s", recorder.duration()), Color32::from_rgb(196, 30, 50));
        }
        if self.replays && self.source == Source::Motion {
            badge(format!("REPLAY of {:.1} s", self.session.motion()), Color32::from_rgb(52, 92, 168));
        }
        if !self.session.is_held() {
            badge("BODY LET GO  (G grasps)".to_owned(), Color32::from_rgb(96, 82, 140));
        }
        let hint = if self.steering.is_held() {
            "wheel: nearer, farther    Ctrl: turn    Alt: roll"
        } else if self.hovered {
            "drag: hold and move the body    Ctrl + drag: turn it    wheel: zoom"
        } else {
            "drag the body to move it    drag beside it: orbit    right drag: pan    wheel: zoom    F: fit"
        };
        over(ui, rect.right_bottom() + vec2(-14.0, -14.0), Align2::RIGHT_BOTTOM, hint);
    }

    /// Keys of the page, unless something is being typed.
    pub(super) fn keys(&mut self, ui: &egui::Ui, typing: bool, wanted: &mut Option<Wanted>) {
        // The stop works whatever has the keyboard.
        if ui.input(|i| i.key_pressed(Key::Escape)) {
            self.stop();
        }
        if typing || ui.egui_wants_keyboard_input() {
            return;
        }
        let pressed = |key: Key| ui.input(|i| i.key_pressed(key) && !i.modifiers.command);
        if pressed(Key::F) {
            self.fit();
        }
        if pressed(Key::R) {
            self.toggle_recording();
        }
        if pressed(Key::T) {
            self.replay();
        }
        if pressed(Key::P) {
            self.plots.toggle_pause(&self.history);
        }
        if pressed(Key::G) {
            self.toggle_grasp();
        }
        if pressed(Key::F12) {
            *wanted = Some(Wanted::Picture);
        }
        for (key, (preset, _)) in [Key::Num1, Key::Num2, Key::Num3, Key::Num4].into_iter().zip(Preset::ALL) {
            if pressed(key) {
                self.camera.look_from(preset);
            }
        }
        self.push(ui);
    }

    /// Keys that move the handle while they are down.
    fn push(&mut self, ui: &egui::Ui) {
        let (keys, dt) = ui.input(|i| {
            let down = |a: Key, b: Key| f64::from(u8::from(i.key_down(a) || i.key_down(b)));
            let push = Vector3::new(
                down(Key::D, Key::ArrowRight) - down(Key::A, Key::ArrowLeft),
                down(Key::W, Key::ArrowUp) - down(Key::S, Key::ArrowDown),
                down(Key::E, Key::PageDown) - down(Key::Q, Key::PageUp),
            );
            (Keys { push, turn: i.modifiers.command, slow: i.modifiers.shift }, i.stable_dt)
        });
        if keys.push != Vector3::zeros() && self.plots.cursor().is_none() && self.ended().is_none() {
            self.source = Source::Pointer;
            let radius = self.radius();
            self.steering.keys(&self.camera, &keys, radius, f64::from(dt.min(0.1)));
        }
    }
}

/// Words on a ground of their own; tells how wide that is.
fn badge(painter: &egui::Painter, at: egui::Pos2, text: String, colour: Color32) -> f32 {
    let galley = painter.layout_no_wrap(text, FontId::proportional(13.0), Color32::WHITE);
    let size = galley.size() + vec2(16.0, 7.0);
    painter.rect_filled(Rect::from_min_size(at, size), 5.0, colour);
    painter.galley(at + vec2(8.0, 3.5), galley, Color32::WHITE);
    size.x
}

/// Small words over the picture.
fn over(ui: &egui::Ui, place: egui::Pos2, align: Align2, text: &str) {
    let [r, g, b, _] = Palette::of(ui).text;
    ui.painter().text(place, align, text, FontId::proportional(12.5), screen([r, g, b, 200]));
}

/// What of the scene's forces the hand feels: with a scaled device it is not the same.
fn felt(what: &str, times: f64) -> String {
    if (times - 1.0).abs() < 1e-6 {
        return format!("{what} on the hand");
    }
    let number = format!("{times:.2}");
    let number = number.trim_end_matches('0').trim_end_matches('.');
    format!("{what} on the hand, {number} times the coupling's")
}

/// What the colours in the picture are, in its upper right corner.
fn legend(ui: &egui::Ui, rect: Rect, shown: &Shown, scale: f64) {
    let palette = Palette::of(ui);
    let entries: [(bool, Colour, String); 5] = [
        (shown.ghost, palette.ghost, "device (where the hand is)".to_owned()),
        (shown.coupling, palette.coupling, "coupling".to_owned()),
        (shown.forces, palette.force, felt("force", 1.0 / scale)),
        (shown.forces, palette.torque, felt("torque", 1.0 / (scale * scale))),
        (shown.contacts, palette.touching, "contacts".to_owned()),
    ];
    let painter = ui.painter_at(rect);
    let mut at = rect.right_top() + vec2(-14.0, 18.0);
    for (_, colour, name) in entries.into_iter().filter(|e| e.0) {
        let [r, g, b, _] = colour;
        let [tr, tg, tb, _] = palette.text;
        let font = FontId::proportional(12.0);
        painter.text(at - vec2(14.0, 0.0), Align2::RIGHT_CENTER, name, font, screen([tr, tg, tb, 200]));
        painter.circle_filled(at - vec2(3.0, 0.0), 4.0, screen([r, g, b, 255]));
        at.y += 17.0;
    }
}

#[cfg(test)]
mod tests {
    use super::felt;

    #[test]
    fn a_scaled_device_is_told_of() {
        assert_eq!(felt("force", 1.0), "force on the hand");
        assert_eq!(felt("force", 1.0 / 0.4), "force on the hand, 2.5 times the coupling's");
        assert_eq!(felt("torque", 6.25), "torque on the hand, 6.25 times the coupling's");
    }
}
