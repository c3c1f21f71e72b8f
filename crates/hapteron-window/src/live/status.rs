//! Whether forces are on, why not, and how to get them back.

use super::Live;
use crate::widgets::Widgets;
use eframe::egui;
use egui::{Button, Color32, RichText, vec2};
use hapteron::dynamics::Status;
use hapteron::recording::GREATEST_DEVIATION;
use hapteron::session::{Command, Flags};

const GREEN: Color32 = Color32::from_rgb(36, 142, 84);
const AMBER: Color32 = Color32::from_rgb(184, 120, 8);
const RED: Color32 = Color32::from_rgb(196, 40, 44);

/// Bits that are as the user wanted, or as the machine allows: no warning.
const ORDINARY: [Flags; 5] =
    [Flags::RELEASED, Flags::CLUTCHED, Flags::PAUSED, Flags::SAMPLE_REPEATED, Flags::DEADLINE_MISSED];

/// A button across the panel that cannot be missed.
fn wide(text: RichText, fill: Color32, width: f32) -> impl egui::Widget {
    move |ui: &mut egui::Ui| {
        let layout = egui::Layout::centered_and_justified(egui::Direction::LeftToRight);
        ui.allocate_ui_with_layout(vec2(width, 38.0), layout, |ui| ui.add(Button::new(text).fill(fill))).inner
    }
}

impl Live {
    /// The stop button and the state of the forces.
    pub(super) fn status(&mut self, ui: &mut egui::Ui, widgets: &mut Widgets) {
        let over = self.ended().is_some();
        let width = ui.available_width();
        if over {
            let text = RichText::new("Start again").size(17.0).color(Color32::WHITE);
            let button = wide(text, GREEN, width);
            let hint = "The scene from its start, with the parameters as they are now";
            if widgets.add(ui, "start again", button).on_hover_text(hint).clicked() {
                self.start_again();
            }
        } else {
            let text = RichText::new("STOP   (Esc)").size(17.0).strong().color(Color32::WHITE);
            let button = wide(text, RED, width);
            if widgets
                .add(ui, "stop", button)
                .on_hover_text("Zero force, at once, and the end of the session")
                .clicked()
            {
                self.stop();
            }
        }
        let (colour, words) = self.state();
        egui::Frame::new()
            .fill(colour.gamma_multiply(if ui.visuals().dark_mode { 0.28 } else { 0.18 }))
            .corner_radius(5.0)
            .inner_margin(6.0)
            .show(ui, |ui| {
                ui.set_width(ui.available_width());
                for (index, line) in words.iter().enumerate() {
                    let text = RichText::new(line);
                    ui.label(if index == 0 { text.strong() } else { text.small() });
                }
                let faulty = self.session.latest().is_some_and(|r| {
                    r.result.after.fault.is_some()
                        || r.result.after.guard.is_some_and(|g| g.fault().is_some())
                });
                if faulty && !over {
                    let hint = "Forces on again, from where the body stands; first put right what caused it";
                    if widgets.add(ui, "re-arm", Button::new("Re-arm")).on_hover_text(hint).clicked() {
                        self.send(Command::Rearm);
                    }
                }
            });
    }

    /// A colour, what the state is, and its reasons.
    fn state(&self) -> (Color32, Vec<String>) {
        if let Some(end) = self.ended() {
            return (RED, vec!["No force: session ended".to_owned(), format!("{end}")]);
        }
        let Some(record) = self.session.latest() else {
            return (AMBER, vec!["Starting".to_owned()]);
        };
        if let Some(fault) = record.result.after.fault {
            let mut words = vec!["No force: a fault has latched".to_owned()];
            words.extend(fault.names().map(str::to_owned));
            if fault.contains(Flags::from_status(Status::NON_FINITE)) {
                words.push(
                    "It was unstable: choose Backward Euler or more mass; then Esc and start again."
                        .to_owned(),
                );
            }
            return (RED, words);
        }
        if let Some(fault) = record.result.after.guard.and_then(|g| g.fault()) {
            return (RED, vec!["No force: the guard took it away".to_owned(), fault.to_string()]);
        }
        let flags = record.result.flags;
        let warnings: Vec<String> = flags
            .names()
            .filter(|name| !ORDINARY.iter().any(|f| f.names().any(|n| n == *name)))
            .map(str::to_owned)
            .collect();
        let deviation = record.result.step.deviation;
        if deviation > GREATEST_DEVIATION {
            let words = vec![
                "Unstable".to_owned(),
                format!(
                    "The handle is {:.0} mm away from the body. Try Backward Euler, more mass, less stiffness.",
                    deviation * 1e3
                ),
            ];
            return (RED, words);
        }
        if flags.contains(Flags::PAUSED) {
            return (AMBER, vec!["No force: scene paused".to_owned()]);
        }
        if warnings.is_empty() {
            (GREEN, vec!["Forces on, no limit reached".to_owned()])
        } else {
            let mut words = vec!["Forces on".to_owned()];
            words.extend(warnings);
            (AMBER, words)
        }
    }
}
