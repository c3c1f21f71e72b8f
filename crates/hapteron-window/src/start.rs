//! The start page: built-in scenes, recent files, a place to drop files on.

use crate::opening::{Assembly, Part, Source};
use crate::recent::Recent;
use crate::widgets::Widgets;
use eframe::egui;
use egui::{Button, Frame, RichText, Sense, vec2};
use std::path::PathBuf;

/// A built-in scene as it is offered.
struct Card {
    name: &'static str,
    title: &'static str,
    text: &'static str,
}

const CARDS: [Card; 3] = [
    Card {
        name: "jaws",
        title: "Upper jaw on lower jaw",
        text: "47,340 on 40,180 triangles. Press the teeth together, slide them, feel the cusps catch.",
    },
    Card {
        name: "spoon_in_cup",
        title: "Spoon in a cup",
        text: "1,344 on 4,000 triangles. The spoon's handle stands in the handle of the cup.",
    },
    Card {
        name: "spoon_in_free_space",
        title: "Spoon in free space",
        text: "No contact. Shake it, then choose Runge-Kutta and a light mass: it flies apart.",
    },
];

/// The page.
#[derive(Default)]
pub struct StartPage {
    path: String,
    /// Meshes that were dropped.
    assembly: Option<Assembly>,
    /// What was wrong with the last one.
    problem: Option<String>,
}

impl StartPage {
    /// Tells why a scene could not be opened.
    pub fn complain(&mut self, problem: String) {
        self.problem = Some(problem);
    }

    /// Meshes that wait to become a scene.
    #[cfg(test)]
    pub fn parts(&self) -> usize {
        self.assembly.as_ref().map_or(0, |a| a.parts.len())
    }

    /// What was wrong with the last one.
    #[cfg(test)]
    pub fn problem(&self) -> Option<&str> {
        self.problem.as_deref()
    }

    /// A mesh was dropped.
    pub fn add_mesh(&mut self, path: &std::path::Path) {
        match Part::read(path) {
            Ok(part) => match &mut self.assembly {
                Some(assembly) => assembly.parts.push(part),
                None => self.assembly = Some(Assembly::new(part)),
            },
            Err(problem) => self.problem = Some(problem),
        }
    }

    /// Shows it; tells what is to be opened.
    pub fn ui(
        &mut self,
        ui: &mut egui::Ui,
        recent: &Recent,
        busy: Option<&Source>,
        widgets: &mut Widgets,
    ) -> Option<Source> {
        let mut chosen = None;
        egui::CentralPanel::default().show(ui, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                let width = 860.0_f32.min(ui.available_width());
                let side = ((ui.available_width() - width) / 2.0).max(0.0);
                ui.horizontal(|ui| {
                    ui.add_space(side);
                    ui.vertical(|ui| {
                        ui.set_width(width);
                        chosen = self.content(ui, width, recent, busy, widgets);
                    });
                });
            });
        });
        chosen
    }

    fn content(
        &mut self,
        ui: &mut egui::Ui,
        width: f32,
        recent: &Recent,
        busy: Option<&Source>,
        widgets: &mut Widgets,
    ) -> Option<Source> {
        let mut chosen = None;
        ui.horizontal(|ui| {
            ui.add_space((ui.available_width() - 100.0).max(0.0));
            crate::theme::switch(ui, widgets);
        });
        ui.add_space(14.0);
        ui.label(RichText::new("hapteron").size(38.0).strong());
        ui.label(
            RichText::new("Hold a rigid object and feel it touch a scene, a thousand times a second.")
                .size(16.0),
        );
        ui.add_space(22.0);
        if let Some(source) = busy {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label(format!("Opening {} …", source.name()));
            });
        }
        if let Some(problem) = &self.problem {
            Frame::group(ui.style()).fill(ui.visuals().error_fg_color.gamma_multiply(0.12)).show(ui, |ui| {
                ui.colored_label(ui.visuals().error_fg_color, problem);
            });
            ui.add_space(8.0);
        }
        if let Some(assembly) = &mut self.assembly {
            match assembly_ui(ui, assembly, widgets) {
                Some(true) => chosen = Some(Source::Meshes(Box::new(assembly.scene()))),
                Some(false) => self.assembly = None,
                None => {}
            }
            ui.add_space(14.0);
        }
        ui.label(RichText::new("Built-in scenes").size(16.0).strong());
        ui.add_space(4.0);
        ui.horizontal(|ui| {
            let width = (width - 2.0 * ui.spacing().item_spacing.x) / 3.0;
            for card in &CARDS {
                if card_ui(ui, card, width, widgets) {
                    chosen = Some(Source::Builtin(card.name.to_owned()));
                }
            }
        });
        ui.add_space(20.0);
        ui.label(RichText::new("Your scenes and meshes").size(16.0).strong());
        ui.add_space(4.0);
        ui.label("Drop a scene (.toml) or meshes (.obj .stl .ply .off) on this window, or write a path:");
        ui.horizontal(|ui| {
            let edit = egui::TextEdit::singleline(&mut self.path)
                .desired_width(520.0)
                .hint_text("path/to/scene.toml");
            let edit = widgets.add(ui, "path", edit);
            let entered = edit.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
            if (widgets.add(ui, "open", Button::new("Open")).clicked() || entered)
                && !self.path.trim().is_empty()
            {
                chosen = Some(Source::File(PathBuf::from(self.path.trim())));
            }
        });
        if !recent.scenes.is_empty() {
            ui.add_space(12.0);
            ui.label(RichText::new("Opened lately").strong());
            for scene in &recent.scenes {
                let text = scene.display().to_string();
                if ui.add(Button::new(text).frame(false)).clicked() {
                    chosen = Some(Source::File(scene.clone()));
                }
            }
        }
        ui.add_space(22.0);
        ui.weak(
            "Without a haptic device the pointer is the hand: drag the body to move it, turn the wheel while dragging to bring it nearer or \
             farther, hold Ctrl to turn it. Forces are shown as arrows and plots. Esc stops everything.",
        );
        if chosen.is_some() {
            self.problem = None;
        }
        if busy.is_some() { None } else { chosen }
    }
}

/// A scene to click on.
fn card_ui(ui: &mut egui::Ui, card: &Card, width: f32, widgets: &mut Widgets) -> bool {
    let response = ui.scope_builder(egui::UiBuilder::new().id_salt(card.name).sense(Sense::click()), |ui| {
        let hovered = ui.response().hovered();
        let visuals = ui.visuals();
        let (fill, stroke) = if hovered {
            (visuals.widgets.hovered.weak_bg_fill, visuals.widgets.hovered.bg_stroke)
        } else {
            (visuals.faint_bg_color, visuals.widgets.noninteractive.bg_stroke)
        };
        Frame::new().fill(fill).stroke(stroke).corner_radius(8.0).inner_margin(14.0).show(ui, |ui| {
            ui.set_width(width - 30.0);
            ui.set_min_height(84.0);
            ui.vertical(|ui| {
                ui.style_mut().interaction.selectable_labels = false;
                ui.label(RichText::new(card.title).size(17.0).strong());
                ui.add_space(4.0);
                ui.label(card.text);
            });
        });
    });
    widgets.note(card.name, response.response.rect);
    response.response.clicked()
}

/// Dropped meshes: which is held, their unit, the mass. `true`: open it; `false`: forget it.
fn assembly_ui(ui: &mut egui::Ui, assembly: &mut Assembly, widgets: &mut Widgets) -> Option<bool> {
    let mut answer = None;
    Frame::group(ui.style()).inner_margin(12.0).show(ui, |ui| {
        ui.set_width(ui.available_width());
        ui.label(RichText::new("A scene of your meshes").size(16.0).strong());
        ui.label("Choose which one you hold; the others stay. Drop more to add them.");
        for (index, part) in assembly.parts.iter().enumerate() {
            ui.horizontal(|ui| {
                ui.radio_value(&mut assembly.body, index, "held");
                let name =
                    part.path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
                ui.label(RichText::new(name).strong());
                ui.label(format!("{} triangles, {:.3} m long", part.triangles, part.size * assembly.scale));
                if !part.closed {
                    ui.colored_label(ui.visuals().warn_fg_color, "not closed: it cannot be held");
                }
            });
        }
        ui.horizontal(|ui| {
            ui.label("The files are in");
            for (scale, name) in [(1e-3, "mm"), (1e-2, "cm"), (0.0254, "inches"), (1.0, "m")] {
                ui.radio_value(&mut assembly.scale, scale, name);
            }
            ui.add_space(16.0);
            ui.label("Mass of the held one");
            let mut grams = assembly.mass * 1e3;
            if ui.add(egui::DragValue::new(&mut grams).range(0.1..=10_000.0).suffix(" g")).changed() {
                assembly.mass = grams * 1e-3;
            }
        });
        ui.horizontal(|ui| {
            let open = Button::new(RichText::new("Open").strong()).min_size(vec2(80.0, 24.0));
            if widgets.add(ui, "open meshes", open).clicked() {
                answer = Some(true);
            }
            if ui.button("Forget").clicked() {
                answer = Some(false);
            }
        });
    });
    answer
}
