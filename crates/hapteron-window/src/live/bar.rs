//! The row of buttons above everything.

use super::values::Values;
use super::{Live, Wanted};
use crate::view::Preset;
use crate::widgets::Widgets;
use eframe::egui;
use egui::{Button, Color32, RichText};

impl Live {
    /// Shows it; tells what is wanted of the window.
    pub(super) fn bar(&mut self, ui: &mut egui::Ui, widgets: &mut Widgets) -> Option<Wanted> {
        let mut wanted = None;
        egui::Panel::top("bar").show(ui, |ui| {
            ui.add_space(4.0);
            ui.horizontal(|ui| {
                if widgets
                    .add(ui, "scenes", Button::new("Scenes"))
                    .on_hover_text("Back to the start page")
                    .clicked()
                {
                    wanted = Some(Wanted::Scenes);
                }
                ui.label(RichText::new(self.scene.name()).strong());
                ui.separator();
                self.recording(ui, widgets);
                ui.separator();
                for (key, (preset, name)) in Preset::ALL.into_iter().enumerate() {
                    let hint = format!("Look from here ({})", key + 1);
                    if widgets.add(ui, name, Button::new(name)).on_hover_text(hint).clicked() {
                        self.camera.look_from(preset);
                    }
                }
                if widgets
                    .add(ui, "fit", Button::new("Fit"))
                    .on_hover_text("Show the whole scene (F)")
                    .clicked()
                {
                    self.fit();
                }
                ui.separator();
                let hint = "Save a picture of this window as PNG (F12)";
                if widgets.add(ui, "picture", Button::new("Picture")).on_hover_text(hint).clicked() {
                    wanted = Some(Wanted::Picture);
                }
                let hint = "Save what the plots hold as run.csv, up to the last two minutes";
                if widgets.add(ui, "csv", Button::new("CSV")).on_hover_text(hint).clicked() {
                    self.save_csv();
                }
                ui.separator();
                let opened = Values::of(&self.scene);
                let button = Button::new("Reset values");
                let reset =
                    ui.add_enabled_ui(self.values != opened, |ui| widgets.add(ui, "reset", button)).inner;
                let hint = "All parameters as in the scene";
                if reset.on_hover_text(hint).on_disabled_hover_text("They are as in the scene").clicked() {
                    self.values = opened;
                }
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    crate::theme::switch(ui, widgets);
                    let rate = ui.input(|i| 1.0 / f64::from(i.stable_dt.max(1e-3)));
                    ui.label(RichText::new(format!("{rate:.0} fps")).weak());
                });
            });
            ui.add_space(3.0);
        });
        wanted
    }

    fn recording(&mut self, ui: &mut egui::Ui, widgets: &mut Widgets) {
        let red = Color32::from_rgb(224, 60, 70);
        let (text, hint) = if self.recorder.is_some() {
            (RichText::new("Stop recording").color(red), "End and save the recording (R)")
        } else {
            (RichText::new("Record"), "Record hand, body and forces, every tick (R)")
        };
        let can = self.recorder.is_some() || self.ended().is_none();
        let button = ui.add_enabled_ui(can, |ui| widgets.add(ui, "record", Button::new(text))).inner;
        if button.on_hover_text(hint).clicked() {
            self.toggle_recording();
        }
        let can = self.recorder.is_some() || self.recorded.is_some();
        let button = ui.add_enabled_ui(can, |ui| widgets.add(ui, "replay", Button::new("Replay"))).inner;
        let hint = "The recorded hand again, from the same start, with the parameters as they are now (T)";
        if button.on_hover_text(hint).on_disabled_hover_text("Record something first").clicked() {
            self.replay();
        }
    }
}
