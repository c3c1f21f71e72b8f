//! The parameters that may change while the scene runs.

use super::hand::{Hold, Source};
use super::values::{METHODS, MODELS, Values};
use super::{Live, recorder};
use crate::view::Shown;
use crate::widgets::Widgets;
use eframe::egui;
use egui::{Button, CollapsingHeader, ComboBox, Grid, RichText, Slider};
use hapteron::session::Command;
use std::ops::RangeInclusive;

/// The device that is none.
const POINTER: &str = "mouse and keyboard";

/// A number with its unit.
struct Number {
    name: &'static str,
    hint: &'static str,
    unit: &'static str,
    /// Shown number for one of the parameter: 1000 shows kg in g.
    factor: f64,
    /// As shown.
    range: RangeInclusive<f64>,
    logarithmic: bool,
}

const MASS: Number = Number {
    name: "Mass",
    hint: "Of the body; its inertia changes with it. Light bodies are felt less and are harder to integrate.",
    unit: " g",
    factor: 1e3,
    range: 0.5..=1000.0,
    logarithmic: true,
};
const STIFFNESS: Number = Number {
    name: "Stiffness",
    hint: "Of the spring between handle and body: force for each metre of stretch.",
    unit: " N/m",
    factor: 1.0,
    range: 20.0..=5000.0,
    logarithmic: true,
};
const DAMPING: Number = Number {
    name: "Damping",
    hint: "Of the damper between handle and body.",
    unit: " N s/m",
    factor: 1.0,
    range: 0.0..=30.0,
    logarithmic: false,
};
const TURN_STIFFNESS: Number = Number {
    name: "Turn stiffness",
    hint: "Torque for each radian between handle and body.",
    unit: " N m/rad",
    factor: 1.0,
    range: 0.01..=20.0,
    logarithmic: true,
};
const TURN_DAMPING: Number = Number {
    name: "Turn damping",
    hint: "Of the turn between handle and body.",
    unit: " mN m s",
    factor: 1e3,
    range: 0.0..=100.0,
    logarithmic: false,
};
const MOST_FORCE: Number = Number {
    name: "Force limit",
    hint: "The coupling bends over to this force and pulls no harder.",
    unit: " N",
    factor: 1.0,
    range: 0.5..=30.0,
    logarithmic: false,
};
const MOST_TORQUE: Number = Number {
    name: "Torque limit",
    hint: "The coupling bends over to this torque and turns no harder.",
    unit: " mN m",
    factor: 1e3,
    range: 5.0..=1000.0,
    logarithmic: true,
};
const WALL: Number = Number {
    name: "Stiffness",
    hint: "Of each contact plane: force for each metre that the surfaces sink into each other.",
    unit: " N/m",
    factor: 1.0,
    range: 100.0..=20_000.0,
    logarithmic: true,
};
const WALL_DAMPING: Number = Number {
    name: "Damping",
    hint: "Of each contact plane.",
    unit: " N s/m",
    factor: 1.0,
    range: 0.0..=50.0,
    logarithmic: false,
};

impl Live {
    /// Shows all of them.
    pub(super) fn panel(&mut self, ui: &mut egui::Ui, shown: &mut Shown, widgets: &mut Widgets) {
        ui.add_space(6.0);
        self.status(ui, widgets);
        ui.add_space(2.0);
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            // All headings fit into a window of the usual height.
            ui.spacing_mut().item_spacing.y = 2.5;
            section("Hand", true).show(ui, |ui| self.hand(ui, widgets));
            section("Body and coupling", true).show(ui, |ui| body(ui, &mut self.values, widgets));
            section("Contact", true).show(ui, |ui| contact(ui, &mut self.values, widgets));
            section("Integrator and gravity", true).show(ui, |ui| physics(ui, &mut self.values, widgets));
            let has_levels = self.has_levels();
            let list = section("View", false).show(ui, |ui| view(ui, shown, has_levels, widgets));
            widgets.note("view settings", list.header_response.rect);
            section("Real time", true).show(ui, |ui| self.real_time(ui));
            ui.add_space(8.0);
        });
    }

    fn hand(&mut self, ui: &mut egui::Ui, widgets: &mut Widgets) {
        ui.horizontal(|ui| {
            let held = self.session.is_held();
            let (text, hint) = if held {
                ("Let go", "The body moves on its own; the handle is free (G)")
            } else {
                ("Grasp", "Holds the body where handle and body are now (G)")
            };
            if widgets.add(ui, "grasp", Button::new(text)).on_hover_text(hint).clicked() {
                self.toggle_grasp();
            }
            let (text, hint) = if self.paused {
                ("Go on", "The scene goes on from where it stands")
            } else {
                ("Pause scene", "The body stands still and nothing is felt")
            };
            if widgets.add(ui, "pause scene", Button::new(text)).on_hover_text(hint).clicked() {
                self.send(Command::Pause(!self.paused));
            }
        });
        ui.horizontal(|ui| {
            ui.label("Device");
            let shown = self.session.driver().or(self.device).unwrap_or(POINTER).to_owned();
            let mut chosen = None;
            ComboBox::from_id_salt("device").width(190.0).selected_text(shown).show_ui(ui, |ui| {
                if ui.selectable_label(self.device.is_none(), POINTER).clicked() {
                    chosen = Some(None);
                }
                for kind in hapteron::device::drivers::kinds() {
                    if ui.selectable_label(self.device == Some(kind), kind).clicked() {
                        chosen = Some(Some(kind));
                    }
                }
            });
            if let Some(kind) = chosen.filter(|kind| *kind != self.device) {
                self.switch_device(kind);
            }
        });
        if self.session.driver().is_some() {
            return;
        }
        ui.horizontal(|ui| {
            ui.label("Moved by");
            let pointer = Button::selectable(self.source == Source::Pointer, "pointer");
            let hint = "Drag the body, or W A S D Q E and the arrow keys; with Ctrl they turn";
            if widgets.add(ui, "pointer", pointer).on_hover_text(hint).clicked() {
                self.source = Source::Pointer;
            }
            let motion = Button::selectable(self.source == Source::Motion && !self.replays, "scene's motion");
            let hint = "The motion that the scene gives, over and over";
            let still = self.session.motion() < 2.0 * self.scene.time_step || recorder::is_still(&self.scene);
            let motion = ui.add_enabled_ui(!still, |ui| widgets.add(ui, "motion", motion)).inner;
            if motion.on_hover_text(hint).on_disabled_hover_text("The scene has no motion").clicked() {
                if self.replays {
                    // The session has the recording's motion: the scene's comes with another one.
                    self.start_again();
                }
                self.source = Source::Motion;
                self.session.restart_motion();
            }
        });
        ui.horizontal(|ui| {
            ui.label("Held")
                .on_hover_text("Whether the hand that the pointer stands for gives way to the force");
            for (hold, name) in Hold::ALL {
                let button = Button::selectable(self.hold == hold, name);
                if widgets.add(ui, name, button).on_hover_text(hold.hint()).clicked() {
                    self.hold = hold;
                }
            }
        });
    }

    /// How well the threads keep their time.
    fn real_time(&self, ui: &mut egui::Ui) {
        let timing = self.session.timing();
        let micro = |ns: u64| format!("{:.0} µs", ns as f64 * 1e-3);
        let rate = if timing.period.mean_ns() > 0.0 { 1e9 / timing.period.mean_ns() } else { 0.0 };
        let missed = 100.0 * timing.missed as f64 / (timing.ticks + timing.missed).max(1) as f64;
        let grants = self.session.grants();
        let rows = [
            ("Haptic rate", format!("{rate:.1} Hz")),
            ("Ticks late, p50 / p99", {
                let late = &timing.lateness;
                format!("{} / {}", micro(late.quantile_ns(0.5)), micro(late.quantile_ns(0.99)))
            }),
            ("Deadlines missed", format!("{} ({missed:.2} %)", timing.missed)),
            ("Work in a tick, p99", micro(timing.compute.quantile_ns(0.99))),
            ("Contact pass, p50 / p99", {
                let pass = &timing.pass;
                format!("{} / {}", micro(pass.quantile_ns(0.5)), micro(pass.quantile_ns(0.99)))
            }),
            ("Priority", grants.priority.to_string()),
            ("Memory", grants.memory.to_string()),
        ];
        Grid::new("real time").num_columns(2).spacing([10.0, 2.0]).show(ui, |ui| {
            for (name, value) in rows {
                ui.label(RichText::new(name).small());
                ui.add(egui::Label::new(RichText::new(&value).small()).truncate()).on_hover_text(value);
                ui.end_row();
            }
        });
    }
}

fn section(name: &str, open: bool) -> CollapsingHeader {
    CollapsingHeader::new(RichText::new(name).strong()).default_open(open)
}

/// A slider with name and unit. `id` is its name for scripts.
fn number(ui: &mut egui::Ui, widgets: &mut Widgets, id: &str, what: &Number, value: &mut f64) {
    let mut shown = *value * what.factor;
    let slider = Slider::new(&mut shown, what.range.clone())
        .logarithmic(what.logarithmic)
        .clamping(egui::SliderClamping::Edits)
        .max_decimals(3)
        .suffix(what.unit);
    ui.label(what.name).on_hover_text(what.hint);
    if widgets.add(ui, id, slider).changed() {
        *value = shown / what.factor;
    }
    ui.end_row();
}

/// A number that may be none.
fn limit(
    ui: &mut egui::Ui,
    widgets: &mut Widgets,
    id: &str,
    what: &Number,
    value: &mut Option<f64>,
    usual: f64,
) {
    ui.label(what.name).on_hover_text(what.hint);
    ui.horizontal(|ui| {
        let mut on = value.is_some();
        if widgets.add(ui, id, egui::Checkbox::without_text(&mut on)).changed() {
            *value = on.then_some(usual);
        }
        match value {
            Some(limit) => {
                let mut shown = *limit * what.factor;
                ui.spacing_mut().slider_width = 68.0;
                let slider = Slider::new(&mut shown, what.range.clone())
                    .logarithmic(what.logarithmic)
                    .max_decimals(2)
                    .suffix(what.unit);
                if ui.add(slider).changed() {
                    *limit = shown / what.factor;
                }
            }
            None => {
                ui.weak("none");
            }
        }
    });
    ui.end_row();
}

fn rows(ui: &mut egui::Ui, name: &str, add: impl FnOnce(&mut egui::Ui)) {
    Grid::new(name).num_columns(2).spacing([8.0, 3.0]).show(ui, add);
}

fn body(ui: &mut egui::Ui, values: &mut Values, widgets: &mut Widgets) {
    let gains = &mut values.gains;
    rows(ui, "body", |ui| {
        number(ui, widgets, "mass", &MASS, &mut values.mass);
        number(ui, widgets, "stiffness", &STIFFNESS, &mut gains.linear_stiffness);
        number(ui, widgets, "damping", &DAMPING, &mut gains.linear_damping);
        number(ui, widgets, "turn stiffness", &TURN_STIFFNESS, &mut gains.angular_stiffness);
        number(ui, widgets, "turn damping", &TURN_DAMPING, &mut gains.angular_damping);
        limit(ui, widgets, "force limit", &MOST_FORCE, &mut gains.max_force, 10.0);
        limit(ui, widgets, "torque limit", &MOST_TORQUE, &mut gains.max_torque, 0.2);
    });
}

fn contact(ui: &mut egui::Ui, values: &mut Values, widgets: &mut Widgets) {
    rows(ui, "contact", |ui| {
        number(ui, widgets, "contact stiffness", &WALL, &mut values.contact_stiffness);
        number(ui, widgets, "contact damping", &WALL_DAMPING, &mut values.contact_damping);
        ui.label("Model")
            .on_hover_text("What the haptic thread makes of contacts between two contact passes");
        let name = MODELS.iter().find(|m| m.0 == values.contact_model).map_or("", |m| m.1);
        let list = ComboBox::from_id_salt("model").width(170.0).selected_text(name).show_ui(ui, |ui| {
            for (model, name, hint) in MODELS {
                let choice = Button::selectable(values.contact_model == model, name);
                if widgets.add(ui, name, choice).on_hover_text(hint).clicked() {
                    values.contact_model = model;
                }
            }
        });
        widgets.note("contact model", list.response.rect);
        ui.end_row();
    });
}

fn physics(ui: &mut egui::Ui, values: &mut Values, widgets: &mut Widgets) {
    rows(ui, "physics", |ui| {
        ui.label("Method").on_hover_text("How the body's motion is integrated");
        let name = METHODS.iter().find(|m| m.0 == values.method).map_or("", |m| m.1);
        let list = ComboBox::from_id_salt("method").width(170.0).selected_text(name).show_ui(ui, |ui| {
            for (method, name, hint) in METHODS {
                let choice = Button::selectable(values.method == method, name);
                if widgets.add(ui, name, choice).on_hover_text(hint).clicked() {
                    values.method = method;
                }
            }
        });
        widgets.note("method", list.response.rect);
        ui.end_row();
        ui.label("Gravity").on_hover_text("Acceleration of gravity, world axes");
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 3.0;
            ui.spacing_mut().interact_size.x = 34.0;
            for component in &mut values.gravity {
                ui.add(egui::DragValue::new(component).speed(0.1).range(-30.0..=30.0).max_decimals(2));
            }
            ui.label("m/s²");
            for (name, gravity, hint) in
                [("0", [0.0; 3], "None"), ("g", [0.0, 0.0, -9.81], "As on the ground: 9.81 m/s² down")]
            {
                let id = if name == "g" { "earth" } else { "weightless" };
                if widgets.add(ui, id, Button::new(name)).on_hover_text(hint).clicked() {
                    values.gravity = gravity;
                }
            }
        });
        ui.end_row();
    });
}

fn view(ui: &mut egui::Ui, shown: &mut Shown, has_levels: bool, widgets: &mut Widgets) {
    Grid::new("view").num_columns(2).spacing([18.0, 3.0]).show(ui, |ui| {
        let mut pairs = [
            (&mut shown.ghost, "Ghost of the device"),
            (&mut shown.coupling, "Coupling"),
            (&mut shown.contacts, "Contact points"),
            (&mut shown.normals, "Normals"),
            (&mut shown.planes, "Planes"),
            (&mut shown.forces, "Force and torque"),
            (&mut shown.grid, "Floor"),
            (&mut shown.axes, "Axes and scale"),
            (&mut shown.see_through, "Body of glass"),
        ];
        for pair in pairs.chunks_mut(2) {
            for (on, name) in pair {
                widgets.add(ui, name, egui::Checkbox::new(on, *name));
            }
            ui.end_row();
        }
    });
    let levels = egui::Checkbox::new(&mut shown.levels, "Contact levels in use");
    let levels = ui.add_enabled_ui(has_levels, |ui| widgets.add(ui, "levels", levels)).inner;
    levels
        .on_hover_text("Where contacts are looked for: each patch of the level that is used there in a colour of its own")
        .on_disabled_hover_text("The scene is exact. Give it contact.error_threshold = 0.02 to have levels of detail");
    ui.horizontal(|ui| {
        ui.label("Arrow of 1 N");
        ui.add(Slider::new(&mut shown.newton, 0.05..=3.0).logarithmic(true).suffix(" radii").max_decimals(2));
    });
}
